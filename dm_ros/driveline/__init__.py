# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A whole driveline on its wheels: one system of equations and one solver; no files and no ROS."""
