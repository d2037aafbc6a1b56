# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What ``watch`` shows of a running node and how it serves it: no ROS, which is in ``ros``."""
