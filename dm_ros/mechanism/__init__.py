# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The paper and the losses: parameters, equations, names; no time and no files."""
