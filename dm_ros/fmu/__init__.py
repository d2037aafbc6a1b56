# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A differential as an FMU: what others simulate with, without Python."""
