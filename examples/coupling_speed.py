# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
Measures where the exchange by speed ports becomes unstable; prints tables of doc/coupling.md.

A gear stands with half-shafts on its outputs, and whoever owns the wheels gives them a small push.
Once a tick the wheels give their speeds and get the mean torques of the half-shafts, for the same
tick or one tick late. The push dies out or it grows; a bisection finds where the one turns into
the other.
"""

from coupling import attached, GEAR, half_shaft, late, limit, print_tables, tyre
from coupling import grows as grows_by_torque
import numpy as np
from wheel import Wheel

from dm_ros import Simulation
from dm_ros.energy import AuditedSimulation

PUSH = {'left': 0.011, 'right': 0.003}   # rad/s
TICKS = 400
NOTHING = 1e-9   # N m, of a push that has died out
INERTIA, SLOPE, ENGINE = 1.0, 1400.0, 1.7   # kg m^2, N m s/rad, kg m^2: wheel, tyre, engine
HELD = attached(1e6 - GEAR.I_1)   # a gear that nothing moves
WITH_ENGINE = {'symmetric.inertia.pinion': GEAR.I_3 + ENGINE}
LIMITS = (   # rate, Hz, and half-shaft, N m/rad, of a gear that is held
    (200.0, 1e3), (200.0, 5e3), (200.0, 1e5), (1000.0, 1e4), (1000.0, 1e5))
LIGHT = (   # rate, Hz, and damping of the half-shafts of light gears, N m s/rad
    (5.0, 100.0), (20.0, 100.0), (200.0, 100.0), (200.0, 3.0), (1000.0, 100.0), (1000.0, 15.0),
    (1000.0, 0.5))
STIFFNESSES = 1e3, 3e3, 1e4, 3e4, 1e5   # N m/rad
HEAVY = (   # what turns at the inner ends, parameters, whether the engine is outside
    ('the engine, 1.7 kg m^2, attached to the pinion', WITH_ENGINE, False),
    ('the same engine on a speed port', {}, True),
    ('a gear that is held', HELD, False))


def exchange(simulation, wheels, ticks_late=0, drive=0.0):
    """
    Yield the ``Snapshot`` of each tick, for ever; the wheels have turned with it.

    :param wheels: ``{shaft: Wheel}`` of the speed ports.
    :param ticks_late: how much later the torque comes to the wheels.
    :param drive: N m, on ports that take a torque.
    """
    waiting = [(0.0,) * len(simulation.inputs)] * ticks_late
    while True:
        snapshot = simulation.step([
            wheels[name].speed if name in wheels else drive for name in simulation.inputs])
        waiting.append(snapshot.torque)
        for name, torque in zip(simulation.inputs, waiting.pop(0)):
            if name in wheels:
                wheels[name].turn(-torque, simulation.dt)
        yield snapshot


def grows(port, rate, inner=None, ticks_late=0, slope=0.0, engine=False,
          seconds=0.0):
    """
    Return whether a push of the wheels grows, by the changes of the torques from tick to tick.

    :param port: stiffness and damping of the half-shafts, N m/rad and N m s/rad.
    :param inner: parameters of the differential; slope: of the tyres, N m s/rad.
    :param engine: whether the engine is outside as well, on a speed port like those of the wheels.
    :param seconds: of the run at least; a swing of the slowest motion must fit into its quarter.
    """
    ticks = max(TICKS, round(seconds * rate))
    wheels = {name: Wheel(INERTIA, slope, speed=speed) for name, speed in PUSH.items()}
    if engine:
        wheels['pinion'] = Wheel(ENGINE)
    simulation = Simulation('symmetric_ode', 1.0 / rate, inner, ports=dict.fromkeys(wheels, port))
    torques = []
    for _, snapshot in zip(range(ticks), exchange(simulation, wheels, ticks_late)):
        torques.append(snapshot.torque)
        if max(abs(wheel.speed) for wheel in wheels.values()) > 1e5:
            return True
    changes = np.abs(np.diff(torques, axis=0)).max(axis=1)
    return changes[-ticks // 4:].max() > max(NOTHING, changes[ticks // 4:ticks // 2].max())


def damping_formula(stiffness, rate, ticks_late):
    """Return least and greatest damping beside a gear that is held, N m s/rad, None for none."""
    K = stiffness / (rate**2 * INERTIA)
    root = 4 - K if not ticks_late else 1 - 4 * K
    if root <= 0.0:
        return None
    least, greatest = (K / 2, 2.0) if not ticks_late else (
        (1 + K - root**0.5) / 2, (1 + K + root**0.5) / 2)
    return least * INERTIA * rate, greatest * INERTIA * rate


def damping_limits(stiffness, rate, ticks_late):
    """Return least and greatest damping as measured, N m s/rad, None for none."""
    def unstable(damping):
        return grows((stiffness, damping), rate, HELD, ticks_late)
    formula = damping_formula(stiffness, rate, ticks_late)
    if formula is None:
        some = [unstable(damping) for damping in np.geomspace(0.1, 4.0, 20) * INERTIA * rate]
        assert all(some)
        return None
    middle = (formula[0] * formula[1])**0.5
    return (1.0 / limit(lambda inverse: unstable(1.0 / inverse), 1.0 / middle, 1e3 / middle),
            limit(unstable, middle, 1e4 * middle))


def carried(parameters):
    """Return the inertia at the inner end of each half-shaft if both turn together, kg m^2."""
    p = GEAR.changed(parameters)
    return (p.I_0 + p.g_F**2 * p.I_3) / 2 + p.I_1


def stiffness_formula(damping, rate, inner):
    """Return the limit of the stiffness where the same tick answers, N m/rad."""
    return 2 * damping * rate * (1 + INERTIA / carried(inner))


def stiffness_limit(damping, rate, inner, ticks_late, engine):
    """Return the limit of the stiffness as measured, N m/rad."""
    return limit(lambda c: grows((c, damping), rate, inner, ticks_late, engine=engine),
                 0.1 * damping * rate, 100.0 * damping * rate)


def couplings():
    """Return ``{what: function of rate and ticks late}``: whether a push of tyres grows."""
    def by_torque(load, inertia):
        return lambda rate, ticks: grows_by_torque(late(load, ticks), rate, attached(inertia))

    def by_speed(stiffness, inner, slope):
        seconds = 2.0 * (1e3 / stiffness)**0.5   # stiffer shafts swing faster
        return lambda rate, ticks: grows((stiffness, 100.0), rate, inner, ticks, slope,
                                         seconds=seconds)
    result = {
        'torque port, light gears': by_torque(tyre(SLOPE), 0.0),
        'torque port, the wheel attached to the shaft': by_torque(tyre(SLOPE), INERTIA),
        'torque port, a half-shaft of 1e4 beside the wheel': by_torque(
            half_shaft(1e4, 100.0), 0.0)}
    for what, inner, slope in (('light gears', {}, SLOPE), ('engine attached', WITH_ENGINE, SLOPE),
                               ('engine attached, wheels in the air', WITH_ENGINE, 0.0)):
        for c, name in ((1e3, '1e3'), (1e4, '1e4'), (1e5, '1e5')):
            result[f'speed port, {name}, {what}'] = by_speed(c, inner, slope)
    return result


def books(rate, port=(1e4, 100.0)):
    """Return ``{entry: J}`` of a second in which the engine speeds up wheels in the air."""
    wheels = {name: Wheel(INERTIA) for name in PUSH}
    simulation = AuditedSimulation('symmetric_ode', 1.0 / rate, ports=dict.fromkeys(wheels, port))
    for _ in zip(range(round(rate)), exchange(simulation, wheels, drive=250.0)):
        pass
    total, (engine, *given) = simulation.total, simulation.total.work
    _, _, *twists = simulation.state.x
    twist = sum(port[0] * phi**2 / 2 for phi in twists)
    wheel_energy = sum(INERTIA * wheel.speed**2 / 2 for wheel in wheels.values())
    return {'work of the engine': engine,
            'given to the wheels': -sum(given),
            'stored in speeds': total.stored - twist,
            'stored in twist': twist,
            'lost in the half-shafts': sum(total.half_shafts),
            'lost in the differential': total.lost - sum(total.half_shafts),
            'taken by the error of the step': total.numerical,
            'missing in these books': total.residual,
            'energy of the wheels': wheel_energy,
            'made by the exchange': wheel_energy + sum(given)}


def in_words(limits):
    """Return a pair of limits as it stands in a table."""
    return 'none' if limits is None else f'{limits[0]:.4g} to {limits[1]:.4g}'


def tables():
    """Yield the lines of the tables of doc/coupling.md."""
    yield from ('| half-shaft, N m/rad | rate, Hz | damping, same tick, N m s/rad | measured '
                '| one tick late | measured |', '|---|---|---|---|---|---|')
    for rate, c in LIMITS:
        yield ' | '.join([f'| {c:g} | {rate:g}', *(
            in_words(found(c, rate, ticks)) for ticks in (0, 1)
            for found in (damping_formula, damping_limits))]) + ' |'
    yield from ('', '| at the inner ends, at 1000 Hz and 10 N m s/rad | formula, N m/rad '
                '| same tick, measured | one tick late, measured |', '|---|---|---|---|')
    for name, inner, engine in HEAVY:
        formula = '' if engine else f'{stiffness_formula(10.0, 1000.0, inner):.3g}'
        same, later = (stiffness_limit(10.0, 1000.0, inner, ticks, engine) for ticks in (0, 1))
        yield f'| {name} | {formula} | {same:.3g} | {later:.3g} |'
    yield from ('', '| light gears, rate, Hz | damping, N m s/rad '
                f'| of {len(STIFFNESSES)} half-shafts grow, same tick | one tick late |',
                '|---|---|---|---|')
    for rate, damping in LIGHT:
        same, later = (sum(grows((c, damping), rate, {}, ticks) for c in STIFFNESSES)
                       for ticks in (0, 1))
        yield f'| {rate:g} | {damping:g} | {same} | {later} |'
    yield from ('', '| tyre of 1400 N m s/rad, wheel of 1 kg m^2 | 200 Hz | one tick late '
                '| 1000 Hz | one tick late |', '|---|---|---|---|---|')
    for name, unstable in couplings().items():
        yield ' | '.join([f'| {name}', *(
            'grows' if unstable(rate, ticks) else 'dies out'
            for rate in (200.0, 1000.0) for ticks in (0, 1))]) + ' |'
    yield from ('', '| energy in the first second, J | 200 Hz | 1000 Hz |', '|---|---|---|')
    slow, fast = books(200.0), books(1000.0)
    for name in slow:
        yield f'| {name} | {joules(slow[name])} | {joules(fast[name])} |'


def joules(energy):
    """Return an energy as it stands in a table, without its rounding errors."""
    return f'{energy:.1f}' if abs(energy) > 0.05 else 'below 0.1'


if __name__ == '__main__':
    print_tables(__doc__, tables)
