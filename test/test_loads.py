# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The built-in loads do what their descriptions say, with the default parameters."""

from functools import cache

import numpy as np
import pytest

from dm_ros import Simulation, VARIANTS
from dm_ros.mechanism.variants import (
    MECHANISMS,
    SELF_LOCKING,
    SYMMETRIC,
    variant_named,
    variants_of,
)

RATE = 200   # Hz


@cache
def whole_run(variant):
    """Return speeds of all shafts and power-flow indices over a minute of the built-in load."""
    simulation, load = Simulation(variant, 1 / RATE), variant_named(variant).mechanism.load
    snapshots = [simulation.step(load(n / RATE)) for n in range(60 * RATE)]
    return (np.array([snapshot.velocity for snapshot in snapshots]).T,
            np.array([snapshot.power_flow for snapshot in snapshots]))


def run(variant, seconds):
    """Return speeds by shaft and power-flow indices over the beginning of the built-in load."""
    speeds, flow = whole_run(variant)
    ticks = seconds * RATE
    return dict(zip(Simulation(variant).shafts, speeds[:, :ticks], strict=True)), flow[:ticks]


@pytest.mark.parametrize('seconds', [10, 20, 60])
@pytest.mark.parametrize('variant', VARIANTS)
def test_shafts_turn_and_outrun_each_other_in_a_sensible_range(variant, seconds):
    speeds, _ = run(variant, seconds)
    first, second = Simulation(variant).outputs
    for shaft in ('carrier', first, second):
        assert 50.0 < np.abs(speeds[shaft]).max() < 1000.0
    slip = speeds[first] - speeds[second]
    assert slip.max() > 20.0 and slip.min() < -20.0


@pytest.mark.parametrize('seconds', [10, 20, 60])
@pytest.mark.parametrize('variant', VARIANTS)
def test_power_flows_in_both_directions_for_a_fair_share(variant, seconds):
    _, flow = run(variant, seconds)
    assert 0.1 < (flow > 0).mean() < 0.9


@pytest.mark.parametrize('variant', variants_of(SELF_LOCKING))
def test_the_self_locking_one_is_locked_at_times_and_slips_at_others(variant):
    speeds, _ = run(variant, 10)
    locked = np.abs(speeds['front'] - speeds['rear']) < 0.5
    assert 0.1 < locked.mean() < 0.9


def test_the_symmetric_load_is_in_phase_with_the_left_a_little_larger():
    pinion, left, right = np.array([SYMMETRIC.load(n / 100) for n in range(2000)]).T
    assert (left * right >= 0.0).all() and (np.abs(left) >= np.abs(right)).all()
    carrier = 3.517 * pinion
    assert np.corrcoef(carrier, left + right)[0, 1] < -0.95   # opposite, but
    assert np.abs(carrier + left + right).max() > 5.0         # not in balance


def test_the_self_locking_loads_are_a_few_hundred_newton_metres_and_change_sign():
    for torque in np.array([SELF_LOCKING.load(n / 100) for n in range(2000)]).T:
        assert 100.0 < torque.max() < 500.0 and -500.0 < torque.min() < -100.0


def test_profiles_are_pure_functions_of_time():
    for load in [mechanism.load for mechanism in MECHANISMS.values()]:
        assert load(3.7) == load(3.7) and all(type(torque) is float for torque in load(3.7))
