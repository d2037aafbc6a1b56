# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The commands, one a file."""
