# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What is read and written: parameters, torques, records, bags, pictures, descriptions."""
