# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The product beside the yardstick, which shares no line with it: its equations and its runs.

The yardstick itself stands beside a Modelica compiler in ``test_against_modelica``.
"""

from driveline import yardstick
from driveline.scenarios import DEFAULT_INPUTS, sign_speeds, split_grip_start, WHEELS
from drivelines import random_given, random_state, run_of, System
import numpy as np
import pytest

LAYOUTS = [(layout, planar) for layout in ('awd', 'fwd', 'rwd') for planar in (False, True)]
CLUTCHED = {'driveline.rear.clutch.left.friction_surfaces': 6,
            'driveline.rear.clutch.right.friction_surfaces': 4,
            'driveline.rear.clutch.left.preload': 30.0,
            'driveline.rear.clutch.right.coast_factor': 0.5}
GAPS = {'driveline.shaft.half.gap': 0.02, 'driveline.shaft.rear_propeller.gap': 0.015}


def name_there(name):
    """Return the name that a number of the state has in the yardstick."""
    symbol, _, element = name.partition('.')
    if not element:
        return name
    if symbol == 'omega':
        return element if element == 'input' else f'{element}.omega'
    return f'{element}.{ {"phi": "twist", "y": "pad"}.get(symbol, symbol)}'


@pytest.mark.parametrize('parameters', [{}, GAPS, CLUTCHED])
@pytest.mark.parametrize('layout, planar', LAYOUTS)
def test_the_rates_of_all_states_are_those_of_the_yardstick(layout, planar, parameters):
    kept = {name: value for name, value in parameters.items()
            if '.rear' not in name or layout == 'awd' or (
                layout == 'rwd' and 'propeller' not in name)}
    kept |= sign_speeds(layout)
    car, rng = yardstick.Car(layout, planar, kept), np.random.default_rng(8)
    for n in range(25):
        given = random_given(rng, planar=planar)
        forces = {}
        system = System(layout, planar, kept, given)
        for differential in system.assembly.differentials:
            if differential.clutches:
                forces[differential.name] = tuple(rng.uniform(0, 800, 2).tolist())
        system = System(layout, planar, kept, given, forces)
        x = random_state(rng, system.layout, 10.0 ** rng.uniform(-2, 0.5))
        names = [name_there(name) for name in system.layout.names]
        assert set(names) == set(car.names)
        inputs = {**DEFAULT_INPUTS, **given._asdict(), 'clutch_forces': {
            clutch: force for differential in system.assembly.differentials
            for clutch, force in zip(differential.clutches, forces.get(differential.name, ()))}}
        there = yardstick.rhs(0.0, dict(zip(names, np.asarray(x, float).tolist())), inputs, car)
        here = dict(zip(names, system.rates(x).tolist()))
        for name, rate in here.items():
            assert rate == pytest.approx(there[name], rel=1e-8, abs=1e-7), (n, name)


@pytest.mark.parametrize('layout', ['awd', 'fwd', 'rwd'])
def test_a_split_grip_start_on_a_hill_is_that_of_the_yardstick(layout):
    scenario = split_grip_start(layout)
    run, (car, snapshots) = yardstick.run_of(scenario), run_of(scenario)
    assert len(snapshots) == len(run.times)

    def series(of):
        return np.array([of(snapshot) for snapshot in snapshots])
    for name, place in (('v_x', 0), ('v_y', 1), ('r', 2)):
        here = series(lambda snapshot, place=place: snapshot.twist_body[place])
        assert np.abs(here - run.states[name]).max() < 2e-4, name
    shafts = {'input': 'input', **{wheel: f'{wheel}.omega' for wheel in WHEELS}}
    for shaft, name in shafts.items():
        here = series(lambda snapshot, shaft=shaft: snapshot.velocity[car.shafts.index(shaft)])
        assert np.abs(here - run.states[name]).max() < (0.1 if shaft == 'input' else 5e-2), name
    for n, wheel in enumerate(WHEELS):
        here = series(lambda snapshot, n=n: snapshot.slip[n][0])
        assert np.abs(here - run.states[f'{wheel}.kappa']).max() < 5e-3, wheel
    # how the torque is split, at the end
    _, look = run.car.evaluate(run.state(-1), run.inputs[-1])
    torques = dict(zip(car.connections, snapshots[-1].torque))
    for name, torque in look['torques'].items():
        assert torques[name] == pytest.approx(torque, rel=2e-3, abs=0.5), name
    slipping = [abs(kappa) for kappa, _ in snapshots[-1].slip]
    assert max(slipping) > 0.2 > min(slipping)
