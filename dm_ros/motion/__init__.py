# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The mechanism in time: steps, state, energy; no files and no ROS."""
