# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A day of simulated time at 100 Hz: nothing drifts."""

from properties import ANGLE_ERROR, DT, endure, PERIOD
import pytest

from dm_ros import VARIANTS
from dm_ros.motion.models import LOSS_LAWS

TICKS = 24 * 3600 * 100


@pytest.mark.parametrize('variant', VARIANTS)
@pytest.mark.parametrize('kind', ['rest', 'constant', 'periodic'])
@pytest.mark.parametrize('loss_law', LOSS_LAWS)
def test_nothing_drifts_in_a_day(loss_law, kind, variant):
    # the slowest motion takes some 10 s: after an hour it has settled
    end = endure(variant, kind, settle=360, periods=TICKS // PERIOD, loss_law=loss_law)
    print(f'\n{loss_law}, {variant}, {kind}: {end}')
    assert end.ticks == TICKS == 8_640_000
    assert end.time == TICKS * DT == 86_400.0
    assert end.residual < 1e-14
    if kind == 'rest':
        assert (end.speed, end.turned) == (0.0, 0.0)
    else:
        assert 10.0 < end.speed < 1e4
        assert end.turned > 1e6
        assert end.angle_error < ANGLE_ERROR
    assert end.coarse_steps == 0
