# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The comparison of all variants on one load: what ``compare_variants`` puts on its page."""
