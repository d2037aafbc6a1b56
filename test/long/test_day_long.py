# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A day of simulated time at 100 Hz: nothing drifts."""

from properties import DT, endure, PERIOD
import pytest

from dm_ros import VARIANTS

TICKS = 24 * 3600 * 100


@pytest.mark.parametrize('variant', VARIANTS)
@pytest.mark.parametrize('kind', ['rest', 'constant', 'periodic'])
def test_nothing_drifts_in_a_day(kind, variant):
    # the slowest motion takes some 10 s: after an hour it has settled
    end = endure(variant, kind, settle=360, periods=TICKS // PERIOD)
    print(f'\n{variant}, {kind}: {end}')
    assert end.ticks == TICKS == 8_640_000
    assert end.time == TICKS * DT == 86_400.0
    assert end.residual < 1e-14
    if kind == 'rest':
        assert (end.speed, end.turned) == (0.0, 0.0)
    else:
        assert 10.0 < end.speed < 1e4
        assert end.turned > 1e6
        assert end.angle_error < 1e-5
    assert end.coarse_steps == 0
