# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The limits of the torque split, of sixteen mechanisms."""

from mechanisms import BOTH
import pytest
from test_bias import mechanisms, try_the_limits


@pytest.mark.parametrize('direction', BOTH)
def test_the_shafts_stay_together_within_the_limits_and_part_beyond_them(direction):
    try_the_limits(direction, mechanisms(15))
