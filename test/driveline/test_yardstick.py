# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The yardstick itself: the numbers of the specification, its books, symmetry and rest."""

import math
import random

from driveline import yardstick
from driveline.scenarios import DEFAULT_INPUTS, DIFFERENTIALS, sign_speeds, WHEELS
from driveline.second_differential import AXLE, CENTRE, Differential
import numpy as np
import pytest

LAYOUTS = tuple(DIFFERENTIALS)
OTHER_SIDE = (1, 0, 3, 2)


def approx(values, relative):
    """Compare each number by itself: none is excused by a larger one beside it."""
    return pytest.approx(values, rel=relative, abs=0.0)


# ---- one differential ---------------------------------------------------------------------

# axle or centre, omega_1, omega_2, torques (input, outputs), e_0, e_1, e_2, internal moments
DIFFERENTIAL_CASES = {
    'symmetric: pinion drives': (
        True, 100.0, 90.0, (30.0, -50.0, -45.0),
        (41.99041014593, -7419.002497655, 7502.983317947),
        (103.7267475935, 49.16119146507, 46.81367373458)),
    'symmetric: outputs drive': (
        True, 60.0, 75.0, (-28.0, 52.0, 48.0),
        (-41.26047559631, 5923.922847881, -6006.443799074),
        (-102.2875490292, -50.94119388738, -49.07365988383)),
    'symmetric: all torques brake': (
        True, 50.0, 45.0, (-10.0, -20.0, -18.0),
        (-741.1431193787, -3732.8688877, 2250.582648943),
        (-35.3919085832, 19.52584202042, 18.58848977456)),
    'symmetric: left drives right': (
        True, 40.0, 30.0, (2.0, 6.0, -12.0),
        (1.076155675079, 26487.44959606, -26485.29728471),
        (6.563838708032, -1.227259072709, 7.300653018941)),
    'symmetric: turning round': (
        True, 0.07, -0.15, (12.0, -20.0, -22.0),
        (8.270201138451, 2477.559496931, -2461.019094654),
        (43.01103001762, 20.61141213681, 21.56713496504)),
    'symmetric: all torques drive': (
        True, 50.0, 45.0, (10.0, 20.0, 18.0),
        (693.8167519215, 3584.192269367, -2196.558765524),
        (33.0745076409, -19.35234539151, -18.39788057779)),
    'lsd: carrier drives': (
        False, 100.0, 90.0, (300.0, -120.0, -150.0),
        (683.9274468814, -483.1091230345, 1461.951826825),
        (128.3798407221, 85.10783079964, 9.4089661054, -74.21856810394)),
    'lsd: outputs drive': (
        False, -64.0, -60.0, (200.0, -90.0, -140.0),
        (-645.3420058951, 1321.12009624, -1956.316740652),
        (89.07583371868, 316.636258995, -7.263142743272, 187.9812960907)),
    'lsd: all torques brake': (
        False, 50.0, 50.3, (-60.0, -30.0, -50.0),
        (-3580.944922462, -3196.292687193, -3837.379745974),
        (12.87221243145, 54.75510384954, -1.914124794334, 26.46423533769)),
    'lsd: front drives rear': (
        False, 120.0, -40.0, (20.0, 80.0, -70.0),
        (709.2746988452, 1995.314333224, -148.0850574072),
        (-64.40999315582, 24.59306350297, 5.916498044701, -44.48404316407)),
    'lsd: turning round': (
        False, 0.06, -0.05, (100.0, -42.0, -59.0),
        (-20.82830255832, -178.5111286333, 84.29358149165),
        (42.69201227175, 49.7222495456, 1.220700994311, -9.900332951715)),
    'lsd: clutches drive the carrier': (
        False, 99.0, 100.0, (5.0, -10.0, 20.0),
        (356.4474939544, 439.101481158, 301.3448358186),
        (9.338150536399, 21.61540126529, -2.862318078523, 39.65104720489)),
}


@pytest.mark.parametrize('case', DIFFERENTIAL_CASES)
def test_the_law_of_losses_gives_the_numbers_of_its_specification(case):
    is_axle, omega_1, omega_2, torques, accelerations, moments = DIFFERENTIAL_CASES[case]
    # without joints and flange, which the table does not have
    values = {**(AXLE if is_axle else CENTRE), 'mesh_sign_speed': 0.1}
    if is_axle:
        values |= {'inertia.left': 1.8e-4, 'inertia.right': 1.8e-4, 'inertia.pinion': 1.56e-4}
    shafts = ('left', 'right') if is_axle else ('front', 'rear')
    differential = Differential(values, shafts, is_axle)
    omega_0 = (omega_1 + differential.g_12 * omega_2) / (1.0 + differential.g_12)
    solution = differential.solve(omega_0, omega_1 - omega_2, torques[0], torques[1:], (0.0, 0.0))
    e_1, e_2 = differential.outputs(solution.e_0, solution.ds)
    assert (solution.e_0, e_1, e_2) == approx(accelerations, 1e-11)
    assert solution.moments[:len(moments)] == approx(moments, 1e-11)


# ---- one state ----------------------------------------------------------------------------

def state_of(car, **values):
    """Return a state from lists by kind, zero where nothing is said."""
    state = dict.fromkeys(car.names, 0.0)
    for kind, numbers in values.items():
        names = {'twists': [f'{shaft}.twist' for shaft in car.shafts],
                 'differentials': [f'{name}.{part}' for name in car.differentials
                                   for part in ('omega_0', 's')],
                 'body': ['v_x', 'v_y', 'r'], 'A': ['A_x', 'A_y'], 'omega_in': ['input']}.get(
                     kind, [f'{wheel}.{kind}' for wheel in WHEELS])
        assert len(names) == len(numbers) and set(names) <= set(state)
        state |= dict(zip(names, map(float, numbers)))
    return state


def test_the_equations_give_the_numbers_of_the_specification():
    car = yardstick.Car('awd', True, sign_speeds('awd'))
    state = state_of(
        car, omega_in=[60], differentials=[58, -2, 16, 0.5, 17, -0.8],
        omega=[16.2, 15.7, 16.4, 17.5], body=[5, 0.2, 0.1],
        twists=[0.012, 0.006, 0.011, 0.012, 0.010, 0.017, 0.016], pad=[1, 0.9, 0.95, 0.5],
        kappa=[0.01, 0.02, 0.03, -0.01], alpha=[0.01, 0.015, -0.02, 0.005], A=[1.5, 0.8])
    inputs = {**DEFAULT_INPUTS, 'torque': 350.0, 'brakes': (20.0, 0.0, 0.0, 150.0),
              'clutch_forces': {'centre_rear': 500.0}, 'steer': 0.05, 'grade': 0.08,
              'grip': (0.3, 1.0, 0.8, 0.9)}
    derivatives, look = car.evaluate(state, inputs)

    def of(*names):
        return [derivatives[name] for name in names]

    assert len(car.names) == 35
    assert of('centre.omega_0', 'centre.s') == approx([2817.41998794, 4345.75146952], 1e-9)
    assert of('front.omega_0', 'front.s') == approx([1234.48432531, -4610.56610732], 1e-9)
    assert of('rear.omega_0', 'rear.s') == approx([1024.40761502, -4032.83053660], 1e-9)
    assert look['solutions']['centre'].moments == approx(
        (145.089245615, 457.918109682, -10.3198270151, 296.914236064), 1e-9)
    assert look['solutions']['rear'].moments[0] == approx(460.273363480, 1e-9)
    assert of(*(f'{wheel}.omega' for wheel in WHEELS)) == approx(
        [-108.040332874, -410.176134443, -433.208190190, 333.193678234], 1e-9)
    assert of('v_x', 'v_y', 'r') == approx(
        [1.20134277079, -0.0797505547337, 0.323990820816], 1e-9)
    assert [look['tyres'][wheel]['F_x'] for wheel in WHEELS] == approx(
        [610.423738994, 1553.4131172, 1858.00765713, -813.832919532], 1e-9)
    assert look['loads'] == approx(
        [3634.04593644, 4133.65883966, 3734.76682113, 4143.54101468], 1e-9)
    assert car.energy(state, inputs) == approx(23973.1050863, 1e-9)


def test_the_mass_that_a_lossless_drive_accelerates():
    car = yardstick.Car('awd', False, {})
    state = car.rolling(10.0, 0.0) | {f'{wheel}.pad': 0.0 for wheel in WHEELS}
    assert 2.0 * car.energy(state, DEFAULT_INPUTS) / 10.0**2 == approx(1864.6369, 1e-7)


@pytest.mark.parametrize('layout, longitudinal, planar',
                         [('fwd', 20, 27), ('rwd', 20, 27), ('awd', 28, 35)])
def test_number_of_states(layout, longitudinal, planar):
    assert len(yardstick.Car(layout, False, {}).names) == longitudinal
    assert len(yardstick.Car(layout, True, {}).names) == planar


# ---- any state ----------------------------------------------------------------------------

def gaps():
    return {f'driveline.shaft.{shaft}.gap': 0.02
            for shaft in ('input', 'front_propeller', 'rear_propeller', 'half')}


def axle_clutches(layout):
    return {f'driveline.{axle}.clutch.{side}.{name}': value
            for axle in DIFFERENTIALS[layout] if axle != 'centre' for side in ('left', 'right')
            for name, value in (('friction_surfaces', 3), ('preload', 50.0),
                                ('coast_factor', 0.4))}


def any_case(seed):
    """Return (car, state, inputs), wild but such that every part is used."""
    rng = random.Random(seed)
    layout = LAYOUTS[seed % 3]
    planar = seed // 3 % 2 == 0
    parameters = sign_speeds(layout)
    if seed // 6 % 2:
        parameters |= gaps() | axle_clutches(layout)
    car = yardstick.Car(layout, planar, parameters)
    speed = rng.choice([0.0, 0.1, 10.0])
    state = {}
    for name in car.names:
        size = {'twist': 0.03, 'pad': 0.5, 'kappa': 0.05, 'alpha': 0.05, 's': 3.0,
                'A_x': 3.0, 'A_y': 3.0}.get(name.rpartition('.')[2], 1.0)
        state[name] = rng.uniform(-size, size)
        if name.endswith('pad'):
            state[name] = rng.choice([-1.0, 1.0]) * rng.uniform(0.0, 1.0)
    for name, value in car.rolling(speed, 0.0).items():
        if name.endswith(('omega', 'omega_0')) or name in ('input', 'v_x'):
            state[name] += value
    clutches = {f'{name}_{shaft}': rng.uniform(0.0, 300.0)
                for name, differential in car.differentials.items()
                for shaft in differential.shafts}
    inputs = {'torque': rng.uniform(-400.0, 400.0),
              'brakes': tuple(rng.choice([0.0, 300.0, 1000.0]) for _ in WHEELS),
              'clutch_forces': clutches, 'steer': rng.uniform(-0.3, 0.3) if planar else 0.0,
              'grade': rng.uniform(-0.3, 0.3),
              'grip': tuple(rng.uniform(0.1, 1.2) for _ in WHEELS),
              'contact': tuple(rng.choice([0.0, 0.5, 1.0, 1.0]) for _ in WHEELS),
              'wind': rng.uniform(-5.0, 5.0)}
    return car, state, inputs


@pytest.mark.parametrize('seed', range(60))
def test_work_is_the_change_of_energy_and_losses_in_any_state(seed):
    car, state, inputs = any_case(seed)
    derivatives, look = car.evaluate(state, inputs)
    assert all(loss >= 0.0 for loss in look['losses'].values()), look['losses']
    fastest = max(abs(derivatives[name]) / yardstick.scale(name) for name in car.names)
    h = 1e-4 / fastest
    ends = []
    for step in (-2.0, -1.0, 1.0, 2.0):   # with the loads held: what they change is apart
        there = {name: state[name] + step * h * derivatives[name] for name in state}
        ends.append(car.energy(there, inputs, look['loads']))
    change = (8.0 * (ends[2] - ends[1]) - (ends[3] - ends[0])) / (12.0 * h)
    work, losses = sum(look['work'].values()), sum(look['losses'].values())
    rounding = 1e-15 * car.energy(state, inputs) / h
    assert work - change - losses == pytest.approx(
        0.0, abs=1e-8 * (losses + abs(change)) + 10.0 * rounding)


@pytest.mark.parametrize('seed', range(60))
def test_no_tyre_gives_more_than_its_grip(seed):
    car, state, inputs = any_case(seed)
    look = car.evaluate(state, inputs)[1]
    for wheel, load, grip in zip(WHEELS, look['loads'], inputs['grip']):
        tyre = look['tyres'][wheel]
        most = car.friction(load, grip) * load
        assert math.hypot(tyre['F_x'], tyre['F_y']) <= most * (1.0 + 1e-12)


def mirrored(car, state):
    """Return the state of the same car in a mirror along its middle."""
    result = {}
    for name, value in state.items():
        axle_slip = name.endswith('.s') and not name.startswith('centre')
        odd = axle_slip or name.endswith('.alpha') or name in ('v_y', 'r', 'A_y')
        other = name.replace('left', '*').replace('right', 'left').replace('*', 'right')
        result[other] = -value if odd else value
    return result


@pytest.mark.parametrize('seed', range(24))
def test_a_mirrored_car_moves_as_the_mirror_shows(seed):
    car, state, inputs = any_case(seed)
    there = {**inputs, 'steer': -inputs['steer']}
    for name in ('brakes', 'grip', 'contact'):
        there[name] = tuple(inputs[name][i] for i in OTHER_SIDE)
    there['clutch_forces'] = {
        name.replace('left', '*').replace('right', 'left').replace('*', 'right'): force
        for name, force in inputs['clutch_forces'].items()}
    seen = mirrored(car, yardstick.rhs(0.0, state, inputs, car))
    moved = yardstick.rhs(0.0, mirrored(car, state), there, car)
    for name, value in seen.items():
        assert moved[name] == pytest.approx(value, rel=1e-10, abs=1e-9), name


@pytest.mark.parametrize('layout', LAYOUTS)
@pytest.mark.parametrize('planar', [False, True])
def test_a_car_that_is_held_stands_still(layout, planar):
    car = yardstick.Car(layout, planar, {})
    v = car.values
    inputs = {**DEFAULT_INPUTS, 'torque': 60.0, 'brakes': (900.0,) * 4, 'grade': 0.12}
    uphill = yardstick.G * 0.12 / math.sqrt(1.0 + 0.12**2)
    state = dict.fromkeys(car.names, 0.0) | {'A_x': uphill}
    loads = car.loads(state, inputs)
    torque = dict.fromkeys(car.shafts, 0.0) | {'input': 60.0}
    if layout == 'awd':   # nothing turns, so nothing is lost: 40 : 60, and halves
        torque |= {'front_propeller': 24.0, 'rear_propeller': 36.0}
    for wheel in car.driven:
        into = f'{yardstick.AXLE_OF[wheel]}_propeller' if layout == 'awd' else 'input'
        torque[f'{wheel}_half'] = torque[into] * 3.517 / 2.0
    for shaft, value in torque.items():
        state[f'{shaft}.twist'] = value / car.shaft_values(shaft)[0]
    for wheel, load in zip(WHEELS, loads):
        force = v['mass'] * uphill / 4.0
        mu, shape = car.friction(load, 1.0), v['tyre.shape']
        rho = shape * math.tan(math.asin(force / (mu * load)) / shape)
        state[f'{wheel}.kappa'] = rho * mu / v['tyre.stiffness']
        state[f'{wheel}.pad'] = ((torque.get(f'{wheel}_half', 0.0) - v['wheel_radius'] * force)
                                 / car.capacity(wheel, inputs, load))
        assert abs(state[f'{wheel}.pad']) < 1.0
    derivatives = yardstick.rhs(0.0, state, inputs, car)
    assert max(map(abs, derivatives.values())) < 1e-9
    assert all(derivatives[name] == 0.0 for name in derivatives
               if name.endswith(('twist', 'pad', 'kappa', 'alpha')))


# ---- the runs -----------------------------------------------------------------------------

def last(run, *names):
    return [run.states[name][-1] for name in names]


def last_wheels(run):
    return last(run, *(f'{wheel}.omega' for wheel in WHEELS))


def test_hill_axle_ice():
    run = yardstick.run('hill_axle_ice')
    assert last(run, 'v_x') == approx([2.51071], 3e-6)
    assert last_wheels(run) == approx([41.2470, 41.2470, 8.00380, 8.00380], 2e-6)
    torques = run.car.evaluate(run.state(-1), run.inputs[-1])[1]['torques']
    assert torques['front_propeller'] == approx(110.8, 5e-4)
    assert torques['rear_propeller'] == approx(309.5, 5e-4)


def test_the_books_of_hill_axle_ice_close():
    run = yardstick.run('hill_axle_ice')
    work, losses, parametric, change = yardstick.books(run)
    kinds = ('input', 'slope', 'wind')
    total = sum(work[kind] for kind in kinds)
    assert total == pytest.approx(change - parametric + sum(losses.values()),
                                  abs=1e-8 * sum(abs(work[kind]) for kind in kinds))
    assert all(loss >= 0.0 for loss in losses.values())
    assert losses['tyres'] > 0.0 and losses['centre_clutches'] > 0.0


def test_lift_front():
    run = yardstick.run('lift_front')
    assert last(run, 'v_x') == approx([1.698557], 5e-7)
    assert last_wheels(run) == approx([111.36633, 111.36633, 5.36512928, 5.36512928], 1e-7)


def test_stop_hold():
    run = yardstick.run('stop_hold')
    solution = run.pieces[-1][3].sol
    v_x, position = len(run.car.names) - 2, len(run.car.names)
    turn = int(np.argmax(run.states['v_x'] < 0.0))
    before, after = run.times[turn - 1:turn + 1]
    while after - before > 1e-9:   # rest: the first time that the speed is zero
        middle = (before + after) / 2.0
        before, after = (middle, after) if solution(middle)[v_x] > 0.0 else (before, middle)
    assert before == approx(2.71744, 3e-6)
    back = solution(before)[position] - run.states['position'][turn:].min()
    assert back == approx(0.0173, 3e-3)
    later = solution(before + 1.0)
    assert later[v_x] == approx(6e-5, 0.09)
    creep = abs(solution(before + 11.0)[position] - later[position])
    assert creep == approx(2e-6, 0.25)
    assert abs(run.states['v_x'][-1]) < 1e-14


def test_tip():
    run = yardstick.run('tip')
    torque = np.array([look['torques']['rear_left_half'] for look in run.looks()])
    assert torque.max() == approx(1055.25, 5e-6)
    assert run.times[torque.argmax()] == 0.660
    assert torque[run.times > 1.7].min() == approx(-465.17, 1e-5)
    steady = (run.times >= 1.6) & (run.times <= 1.7)
    assert torque[steady].mean() == approx(590.9, 1e-3)
    assert last(run, 'v_x') == approx([9.76355957], 1e-8)


def test_lane():
    run = yardstick.run('lane')
    yaw = run.states['r']
    assert yaw.max() == approx(0.237863, 3e-6)
    assert run.times[yaw.argmax()] == 0.820
    assert yaw.min() == approx(-0.237590, 3e-6)
    assert last(run, 'v_x') == approx([22.309583], 5e-8)
