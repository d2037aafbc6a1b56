# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What ``identify`` is made of: runs of a drive, the fit, what it is worth, and its report."""
