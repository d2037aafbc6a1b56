# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The driveline beside a stiff solver where that takes long, and over many random drives."""

from driveline.scenarios import SCENARIOS
from drivelines import distances, GAPS, random_given, random_state, System, until
import numpy as np
import pytest

from dm_ros import Driveline


@pytest.mark.parametrize('name, end', [('hill_axle_ice', 1.5), ('stop_hold', 3.5)])
def test_every_tick_is_near_to_a_stiff_solver(name, end):
    assert (distances(until(SCENARIOS[name], end)) < [2e-4, 5e-2, 1e-1]).all()


def test_many_random_states_balance_their_powers():
    rng = np.random.default_rng(0)
    for planar in (False, True):
        system = System('awd', planar, GAPS)
        for _ in range(5000):
            system.given = random_given(rng, planar=planar)
            x = random_state(rng, system.layout, scale=10.0 ** rng.uniform(-2, 0.5))
            x[system.layout.pads] = rng.uniform(-1, 1, 4)
            assert system.books(x)[2].min() >= 0.0
            assert np.isfinite(system.jacobian(x)).all()


def test_wild_drives_stay_finite_and_never_make_energy():
    for seed in range(20):
        rng = np.random.default_rng(seed)
        car = Driveline('awd', planar=True, parameters=GAPS)
        car.reset(rng.uniform(-20, 40))
        for _ in range(100):
            inputs = {'torque': rng.normal(0, 500), 'steer': rng.normal(0, 0.2),
                      'brakes': tuple(rng.uniform(0, 3000, 4) * rng.integers(0, 2, 4)),
                      'grip': tuple(rng.uniform(0.05, 1.2, 4)), 'grade': rng.normal(0, 0.2),
                      'contact': tuple(rng.uniform(0, 1.5, 4) * rng.integers(0, 2, 4)),
                      'clutch_forces': {'centre_rear': rng.uniform(0, 3000)},
                      'wind': rng.normal(0, 10)}
            for _ in range(20):
                car.step(**inputs)
        energy = car.energy
        assert min(car.losses.values()) >= 0.0
        assert abs(energy.numerical) < 2e-3 * (abs(energy.work) + energy.lost), seed
