# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The power-flow index says which side drives."""

import pytest

from dm_ros.mechanism.power_flow import DIRECT, power_flow, REVERSE

LAST = pytest.mark.parametrize('last', [DIRECT, REVERSE])


@LAST
@pytest.mark.parametrize('sign_in', [1, -1])
@pytest.mark.parametrize('sign_out', [1, -1])
def test_greater_power_drives_whatever_the_signs_and_the_past(sign_in, sign_out, last):
    assert power_flow(sign_in * 5.0, sign_out * 4.999, 0.0, last) == DIRECT
    assert power_flow(sign_in * 5.0, sign_out * 5.001, 0.0, last) == REVERSE


@LAST
def test_equal_powers_are_reverse_flow(last):
    assert power_flow(5.0, -5.0, 0.0, last) == REVERSE


@LAST
@pytest.mark.parametrize('deadband', [0.0, 2.0])
def test_index_stays_at_rest(deadband, last):
    assert power_flow(0.0, 0.0, deadband, last) == last
    assert power_flow(-0.0, 0.0, deadband, last) == last


@LAST
def test_index_stays_within_the_dead_band_and_only_there(last):
    for input_power, output_power in ((100.0, 98.1), (98.1, 100.0), (-100.0, 98.1), (0.0, 1.9)):
        assert power_flow(input_power, output_power, 2.0, last) == last
    assert power_flow(100.0, 97.9, 2.0, last) == DIRECT
    assert power_flow(97.9, -100.0, 2.0, last) == REVERSE


def test_one_side_alone_drives():
    assert power_flow(1e-300, 0.0, 0.0, REVERSE) == DIRECT
    assert power_flow(0.0, 1e-300, 0.0, DIRECT) == REVERSE
