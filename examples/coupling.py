# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
Measures where the exchange of torques becomes unstable; prints tables of doc/coupling.md.

A differential stands with its output shafts against a load that is a function of their speeds,
as a tyre is, and gets a small push. Torques are exchanged once a tick. The push dies out or it
grows; a bisection finds where the one turns into the other. ``coupling_speed`` does the same where
speeds are exchanged.
"""

import argparse
from dataclasses import replace

from brake_lock import CASES, law_of, parameters_of, PLATES, VARIANT
from car import CarParameters, with_wheels_and_engine
import numpy as np

from dm_ros import Simulation
from dm_ros.mechanism.parameters import SymmetricParameters
from dm_ros.mechanism.variants import variant_named
from dm_ros.testing import DirectDifferential

GEAR = SymmetricParameters()
PUSH = (0.011, -0.009)   # rad/s
TICKS = 800
CAR = CarParameters()
OPEN_CAR = with_wheels_and_engine(VARIANT, CAR)
# the engine drives the carrier by a final drive of its own
LSD_CAR = with_wheels_and_engine(
    'lsd_ode', replace(CAR, engine_inertia=CAR.engine_inertia * GEAR.g_F**2))
SLIPPING = {'lsd.clutch.front.friction_surfaces': 0, 'lsd.clutch.rear.friction_surfaces': 0}
CARS = (   # what, variant, parameters, which wheels have grip
    ('car of the example, both wheels on asphalt', VARIANT, OPEN_CAR, (1.0, 1.0)),
    ('the same, the left wheel without grip', VARIANT, OPEN_CAR, (0.0, 1.0)),
    ('car of the example with plates, both wheels on asphalt', VARIANT,
     {**OPEN_CAR, **dict(PLATES)}, (1.0, 1.0)),
    ('self-locking, clutches taken out', 'lsd_ode', {**LSD_CAR, **SLIPPING}, (1.0, 1.0)),
    ('self-locking, left (front) wheel without grip, clutches taken out', 'lsd_ode',
     {**LSD_CAR, **SLIPPING}, (0.0, 1.0)),
    ('self-locking, both wheels on asphalt, with its clutches', 'lsd_ode', LSD_CAR, (1.0, 1.0)),
)


def slip_inertia(shaft_inertia):
    """
    Return the inertia of each output shaft against slip, kg m^2.

    With opposite speeds of the two shafts the carrier stands and the satellites turn.

    :param shaft_inertia: symmetric.inertia.left and .right with all that is attached, kg m^2.
    """
    return shaft_inertia + GEAR.n_s * GEAR.I_s / (2 * GEAR.g_2s**2)


def mass_matrix(parameters):
    """Return the inertia matrix of the two output shafts, (2, 2), without losses."""
    p = parameters
    symmetric = isinstance(p, SymmetricParameters)
    g_12, I_0 = (1.0, p.I_0 + p.I_3 * p.g_F**2) if symmetric else (p.g_12, p.I_0)
    carrier = np.array([1.0, g_12]) / (1 + g_12)             # its speed from theirs
    satellite = np.array([-1.0, 1.0]) / (p.g_2s * (1 + g_12))
    return (np.diag([p.I_1, p.I_2]) + I_0 * np.outer(carrier, carrier)
            + p.n_s * p.I_s * np.outer(satellite, satellite))


def grows(load, rate, parameters=None, variant='symmetric_ode', substeps=1):
    """Return whether a push grows; load: function of Simulation and speeds to two torques."""
    simulation = Simulation(variant, 1.0 / rate, parameters, substeps=substeps,
                            initial_velocity=PUSH)
    first, second = (simulation.shafts.index(name) for name in simulation.outputs)
    largest = []
    for _ in range(TICKS):
        velocity, position = simulation.snapshot()[1:3]
        torques = load((velocity[first], velocity[second]), (position[first], position[second]))
        if max(map(abs, torques)) > 1e9:
            return True
        simulation.advance((0.0, *torques))
        largest.append(max(map(abs, velocity)))
    return max(largest[-TICKS // 4:]) > max(largest[TICKS // 4:TICKS // 2])


def limit(family, low=1e-12, high=1e12):
    """Return the parameter from which on ``grows(family(parameter))``, by bisection."""
    while high / low > 1.0005:
        middle = (low * high)**0.5
        low, high = (low, middle) if family(middle) else (middle, high)
    return middle


def tyre(slope, shafts=(1.0, 1.0)):
    """Return a load with a slope of torque over speed, N m s/rad."""
    return lambda speeds, _: tuple(-slope * s * speed for s, speed in zip(shafts, speeds))


def late(load, ticks):
    """Return a load whose torques come some ticks late, as over topics in real time."""
    waiting = [(0.0, 0.0)] * ticks

    def late_load(speeds, angles):
        waiting.append(load(speeds, angles))
        return waiting.pop(0)
    return late_load


def linearised(slope, inertia, rate):
    """Return the tyre that looks a tick ahead: its torque at the end of the tick, linearised."""
    return tyre(slope / (1.0 + slope / (rate * inertia)))


def wheel_by_topic(inertia, rate):
    """Return the load of a wheel whose inertia is not in the shaft: minus its acceleration."""
    before = [PUSH]

    def load(speeds, _):
        torques = tuple(-inertia * (now - then) * rate for now, then in zip(speeds, before[0]))
        before[0] = speeds
        return torques
    return load


def half_shaft(stiffness, damping):
    """Return the load of elastic half shafts to wheels that stand, N m/rad and N m s/rad."""
    return lambda speeds, angles: tuple(-stiffness * angle - damping * speed
                                        for angle, speed in zip(angles, speeds))


def attached(inertia):
    """Return the parameters of a differential with more inertia on both output shafts."""
    return {'symmetric.inertia.left': GEAR.I_1 + inertia,
            'symmetric.inertia.right': GEAR.I_2 + inertia}


def slope_limit(rate, parameters, shafts=(1.0, 1.0), **options):
    """Return the measured limit of the slope of the tyres on some shafts, N m s/rad."""
    return limit(lambda k: grows(tyre(k, shafts), rate, parameters, **options))


def slope_formula(rate, parameters, shafts=(1.0, 1.0)):
    """Return the limit of the slope by the formula, N m s/rad."""
    fastest = max(np.linalg.eigvals(np.linalg.solve(mass_matrix(parameters), np.diag(shafts))))
    return 2.0 * rate / float(fastest)


def late_formula(rate, inertia, ticks):
    """Return the limit of the slope of a tyre whose torque comes late, N m s/rad."""
    return (2.0 * np.sin(np.pi / (4 * ticks + 2)) * slip_inertia(GEAR.I_1 + inertia) * rate)


def tables():
    """Yield the lines of the tables of doc/coupling.md."""
    yield from ('| rate, Hz | wheel inertia in the shaft, kg m^2 | 2 I/dt, N m s/rad | measured |',
                '|---|---|---|---|')
    for rate in (200.0, 1000.0, 5000.0):
        for inertia in (0.0, 0.1, 1.0):
            yield (f'| {rate:g} | {inertia:g} '
                   f'| {2 * slip_inertia(GEAR.I_1 + inertia) * rate:.4g} '
                   f'| {slope_limit(rate, attached(inertia)):.4g} |')
    yield from ('', '| at 1000 Hz | formula, N m s/rad | measured |', '|---|---|---|')
    for name, variant, changes, shafts in CARS:
        parameters = variant_named(variant).mechanism.parameters().changed(changes)
        yield (f'| {name} | {slope_formula(1000.0, parameters, shafts):.4g} '
               f'| {slope_limit(1000.0, parameters, shafts, variant=variant):.4g} |')
    yield from ('', '| substeps, at 1000 Hz and 1 kg m^2 | measured limit, N m s/rad |',
                '|---|---|')
    for substeps in (1, 10, 100):
        yield f'| {substeps} | {slope_limit(1000.0, attached(1.0), substeps=substeps):.4g} |'
    yield from ('', '| ticks late, at 1000 Hz and 1 kg m^2 | formula, N m s/rad | measured |',
                '|---|---|---|')
    for ticks in (0, 1, 2):
        measured = limit(lambda k, ticks=ticks: grows(late(tyre(k), ticks), 1000.0,
                                                      attached(1.0)))
        yield f'| {ticks} | {late_formula(1000.0, 1.0, ticks):.4g} | {measured:.4g} |'
    yield from ('', '| rate, Hz | I, kg m^2 | largest wheel inertia by topic, measured |',
                '|---|---|---|')
    for rate in (100.0, 1000.0, 10000.0):
        measured = limit(lambda J, rate=rate: grows(wheel_by_topic(J, rate), rate))
        yield f'| {rate:g} | {slip_inertia(GEAR.I_1):.4g} | {measured:.4g} |'
    yield from ('', '| tyre, at 1000 Hz and 1 kg m^2 | slope, N m s/rad | push |',
                '|---|---|---|')
    for slope in (1e3, 1e4, 1e6):
        for name, load in (('as it is', tyre(slope)),
                           ('linearised', linearised(slope, 1.0, 1000.0))):
            yield (f'| {name} | {slope:g} '
                   f'| {"grows" if grows(load, 1000.0, attached(1.0)) else "dies out"} |')
    parameters = GEAR.changed(OPEN_CAR)
    yield from ('', '| car of the example, rate, Hz | slope at rest over its limit '
                '| ticks at which the torque turns |', '|---|---|---|')
    for rate in (2000.0, 1000.0, 500.0, 300.0, 200.0, 100.0):
        part = car_slope(CAR) / slope_formula(rate, parameters, (0.0, 1.0))
        yield f'| {rate:g} | {part:.2f} | {100 * chatter(rate):.0f} % |'


def car_slope(p):
    """Return the slope of the tyre curve of a car at rest on asphalt, N m s/rad."""
    return (p.wheel_radius**2 * p.wheel_load * max(p.grip) * p.tyre_stiffness * p.tyre_shape
            / p.creep_speed)


def chatter(rate, seconds=1.5):
    """Return the part of ticks at which the torque of the tyre on asphalt turns, brake lock on."""
    case = CASES[1]
    differential = DirectDifferential(VARIANT, rate, parameters=parameters_of(case))
    torque = differential.run(law_of(differential, case, rate)[0], seconds).torque['right']
    steps = np.diff(torque)
    return float((steps[1:] * steps[:-1] < 0.0).mean())


def print_tables(description, tables):
    """Print the lines that a function makes, or the help."""
    argparse.ArgumentParser(
        description=description,
        formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    for line in tables():
        print(line)


if __name__ == '__main__':
    print_tables(__doc__, tables)
