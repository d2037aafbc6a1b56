# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The reference runs by a Modelica compiler, and the yardstick beside it where wheels differ.

``driveline.mo`` has the parts, each with its own law, and how they are connected. rumoca
chooses states, differentiates constraints, solves the loops of the differentials and integrates
with a BDF method: no equation of motion of a whole differential or car is written anywhere, and
no code is shared with the package or with the yardstick.
"""

import os
from pathlib import Path

from driveline import yardstick
from driveline.scenarios import DEFAULT_INPUTS, SCENARIOS, split_grip_start, WHEELS
import numpy as np
import pytest

if os.environ.get('CI'):   # there it must not be skipped
    import rumoca
else:
    rumoca = pytest.importorskip('rumoca')

PARTS = Path(__file__).with_name('driveline.mo').read_text()
MODELS = {'awd': 'AllWheelDrive', 'fwd': 'FrontWheelDrive', 'rwd': 'RearWheelDrive'}


def held(changes, name, pick=lambda value: value):
    """Return an expression of time for one input, by pieces."""
    expression, value = '', pick(DEFAULT_INPUTS[name])
    for time, values in changes:
        if name in values:
            if time > 0.0:
                expression += f'if time < {time!r} then {value!r} else '
            value = pick(values[name])
    return expression + repr(value)


def simulate(scenario, **parameters):
    """Return what rumoca makes of a scenario, whose parameters go by those of the model."""
    first = {**DEFAULT_INPUTS, **scenario.changes[0][1]}
    parameters |= {'start': scenario.speed, 'grade': first['grade'],
                   'pad_start': float(scenario.speed > 0.0)}
    for name in ('grip', 'contact'):
        parameters[name] = '{' + ', '.join(map(repr, first[name])) + '}'
    given = ', '.join(f'{name} = {value}' for name, value in parameters.items())
    changes = scenario.changes
    source = f"""{PARTS}
model Run
  extends {MODELS[scenario.layout]}({given});
equation
  source.torque = {held(changes, 'torque')};
  steer = {held(changes, 'steer')};
  brake_front = {held(changes, 'brakes', lambda brakes: brakes[0])};
  brake_rear = {held(changes, 'brakes', lambda brakes: brakes[2])};
end Run;
"""
    model = rumoca.Session().loads(source, model='Run')
    return model.simulate((0.0, scenario.duration), dt=0.001,
                          config=rumoca.SimConfig(solver='bdf', rtol=1e-8, atol=1e-10))


def approx(value, relative=1e-6):
    return pytest.approx(value, rel=relative, abs=0.0)


def last(result, *names):
    return [float(result[name][-1]) for name in names]


def test_hill_axle_ice():
    result = simulate(SCENARIOS['hill_axle_ice'])
    assert last(result, 'vx', 'w1.w', 'w2.w', 'w3.w', 'w4.w') == approx(
        [2.51071, 41.2470, 41.2470, 8.00380, 8.00380], 3e-6)
    assert last(result, 's_front.a.tau', 's_rear.a.tau') == approx([110.8, 309.5], 5e-4)


def test_lift_front():
    result = simulate(SCENARIOS['lift_front'])
    assert last(result, 'vx', 'w1.w', 'w2.w', 'w3.w', 'w4.w') == approx(
        [1.698557, 111.36633, 111.36633, 5.36512928, 5.36512928])


def test_stop_hold():
    result = simulate(SCENARIOS['stop_hold'])
    times, speed = np.array(result.time), np.array(result['vx'])
    way = np.array(result['position'])
    turn = int(np.argmax(speed < 0.0))
    share = speed[turn - 1] / (speed[turn - 1] - speed[turn])
    assert times[turn - 1] + share * (times[turn] - times[turn - 1]) == approx(2.71744, 3e-6)
    assert way.max() - way[turn:].min() == approx(0.0173, 3e-3)
    assert abs(speed[-1]) < 1e-12


def test_tip():
    result = simulate(SCENARIOS['tip'], gap=0.02, half_gap=0.035, c=8000.0, d=20.0)
    times, torque = np.array(result.time), np.array(result['left.a.tau'])
    assert torque.max() == approx(1055.25, 5e-6)
    assert times[torque.argmax()] == approx(0.660)
    assert torque[times > 1.7].min() == approx(-465.17, 1e-5)
    assert last(result, 'vx') == approx([9.76355957], 1e-8)


def test_lane():
    result = simulate(SCENARIOS['lane'])
    times, yaw = np.array(result.time), np.array(result['r'])
    assert (yaw.max(), yaw.min()) == approx((0.237863, -0.237590), 3e-6)
    assert times[yaw.argmax()] == approx(0.820)
    assert last(result, 'vx') == approx([22.309583], 1e-7)


@pytest.mark.parametrize('layout', MODELS)
def test_a_start_on_a_hill_where_each_wheel_has_its_own_grip(layout):
    scenario = split_grip_start(layout)
    run = yardstick.run_of(scenario)
    result = simulate(scenario)
    names = {'v_x': 'vx', 'v_y': 'vy', 'r': 'r', 'A_x': 'Ax', 'A_y': 'Ay', 'input': 'engine.w'}
    for i, wheel in enumerate(WHEELS):
        names |= {f'{wheel}.{kind}': f'w{i + 1}.{there}' for kind, there in (
            ('omega', 'w'), ('pad', 'pad'), ('kappa', 'kappa'), ('alpha', 'alpha'))}
    for name, there in names.items():
        size = float(np.max(np.abs(run.states[name])))
        assert float(result[there][-1]) == pytest.approx(
            run.states[name][-1], rel=0.0, abs=1e-5 * size), name
    spinning = max(run.states[f'{wheel}.kappa'][-1] for wheel in WHEELS)
    assert spinning > 0.2
