# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""All that speaks to ROS 2, but for the tools and the fixtures: the node ``differential``."""
