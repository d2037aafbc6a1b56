# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What the tool ``sweep`` is made of: samples, metrics, chunks, and where they are computed."""
