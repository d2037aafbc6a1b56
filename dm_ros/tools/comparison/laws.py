# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Both laws of losses on the same loads, with energy books: the runs."""

import math
from typing import Callable, NamedTuple

import numpy as np

from dm_ros.mechanism.variants import SYMMETRIC
from dm_ros.motion.energy import AuditedSimulation
from dm_ros.motion.models import LOSS_LAWS
from dm_ros.settings import make_simulation
from dm_ros.tools.comparison.runs import RATE

LOAD = 'reference load'
WHEEL = 1.0            # kg m^2, on each output of the cases with wheels
P_GAIN, I_GAIN = 40.0, 40.0   # of the speed governor: N m s/rad and N m/rad, at the carrier


class Case(NamedTuple):
    """A load for a differential at any speed."""

    words: str
    seconds: float
    torques: Callable     # (mechanism, its parameters) -> (time, carrier speed) -> torques, N m
    start: float = 0.0    # rad/s, of all shafts
    wheels: bool = False


class Outcome(NamedTuple):
    """What a case came to under one law."""

    law: str
    carrier: np.ndarray     # speed at the end of each tick, rad/s
    power_flow: np.ndarray
    work: np.ndarray        # (ticks, inputs), J
    lost: dict              # by element, (ticks,), J
    returned: np.ndarray    # what gears and bearings gave in each tick, J, not negative

    @property
    def energy_in(self):
        """What torques have brought in, J."""
        return float(np.maximum(self.work, 0.0).sum())

    @property
    def energy_out(self):
        """What torques have taken out, J."""
        return float(np.maximum(-self.work, 0.0).sum())

    @property
    def switches(self):
        """How often the power-flow index has changed."""
        return int(np.count_nonzero(np.diff(self.power_flow)))


def shared(carrier, outputs, shares=None):
    """
    Return a load: a torque at the carrier, by way of the pinion where there is one, and outputs.

    :param carrier, outputs: functions of time and carrier speed, N m; both outputs together.
    :param shares: of the first output, by mechanism; None for that without slip.
    """
    def torques(mechanism, p):
        ratio, first = (p.g_F, 0.5) if mechanism is SYMMETRIC else (1.0, 1 / (1 + p.g_12))
        if shares:
            first = shares[mechanism.name]

        def held(time, speed):
            both = outputs(time, speed)
            return carrier(time, speed) / ratio, first * both, (1.0 - first) * both
        return held
    return torques


def governed(target, outputs):
    """Return a load whose carrier torque comes from a PI governor of the carrier speed."""
    def torques(mechanism, p):
        integral = -outputs(0.0, target(0.0))

        def governor(time, speed):
            nonlocal integral
            error = target(time) - speed
            integral += I_GAIN * error / RATE
            return P_GAIN * error + integral
        return shared(governor, outputs)(mechanism, p)
    return torques


def resistance(time, speed):
    """Return what a road and the air take from both outputs together, N m."""
    return -(60.0 * math.tanh(speed / 0.5) + 0.03 * speed * abs(speed))


def cycle(time):
    """Return a speed that goes from rest to 60 rad/s and back to rest in 20 s."""
    return 60.0 * math.sin(math.pi * time / 20.0)**2


def constant(value):
    return lambda *_: value


def weight(mechanism, p):
    """Return 200 N m at the outputs, and what holds them but for about half of the losses."""
    held = -195.0 if mechanism is SYMMETRIC else -197.6
    return shared(constant(held), constant(200.0))(mechanism, p)


def balanced(mechanism, p):
    """Return 100 N m at the pinion, or 300 N m at the carrier, against the same."""
    torque = 100.0 * p.g_F if mechanism is SYMMETRIC else 300.0
    return shared(constant(torque), constant(-torque))(mechanism, p)


def generator(time, speed):
    """Return the torque of 10 kW, and below 50 rad/s that of a drag."""
    return -1e4 / speed if speed > 50.0 else -4.0 * speed


CASES = {
    'drive cycle': Case(
        'wheels of 1 kg m², a speed governor, to 60 rad/s and back against road and air', 20.0,
        governed(cycle, resistance), wheels=True),
    'cruise': Case(
        'the same wheels held at 20 rad/s against 200 N m', 20.0,
        governed(constant(20.0), constant(-200.0)), start=20.0, wheels=True),
    'weight': Case(
        'the same wheels, from rest: 200 N m pull at the outputs, the input holds nearly as much',
        10.0, weight, wheels=True),
    'rest': Case(
        'from rest: the torques of input and outputs balance exactly', 30.0, balanced),
    'ramp': Case('100 N m against -99 to -101 N m', 10.0,
                 shared(constant(100.0), lambda t, w: -99.0 - t / 5.0), start=100.0),
    'ripple': Case(
        'the same with a ripple of 0.1 N m', 10.0,
        shared(constant(100.0), lambda t, w: -99.0 - t / 5.0 + 0.1 * math.sin(2 * RATE * t)),
        start=100.0),
    'power': Case('100 N m against 10 kW, whatever the speed above 50 rad/s', 10.0,
                  shared(constant(100.0), generator), start=100.0),
    'held': Case('100 N m against -100 N m, so parted that the outputs slip', 10.0,
                 shared(constant(100.0), constant(-100.0), {'symmetric': 0.51, 'lsd': 0.62}),
                 start=20.0),
}


def ticks_of(load, most=math.inf):
    """Return how many ticks ``run`` takes in all."""
    return len(LOSS_LAWS) * sum(
        round(seconds * RATE) for seconds in (
            load.seconds, *(min(case.seconds, most) for case in CASES.values())))


def run(mechanism, load, values, tick, most=math.inf):
    """
    Return ``{case: [Outcome, one for each law]}``.

    :param load: ``Load`` in the place of the reference load.
    :param values: ``{full name: value}``, as ``read_parameter_file`` returns them.
    :param tick: called with a number of ticks done; most: longest time of a case, s.
    """
    p = mechanism.parameters().changed(mechanism.parameters.part_of(values))
    outcomes = {}

    def add(name, case, torques, ticks):
        outcomes[name] = [
            outcome_of(simulation_of(mechanism, p, case, law, values), torques(), ticks)
            for law in LOSS_LAWS]
        tick(len(LOSS_LAWS) * ticks)

    table = load.held(RATE)
    add(LOAD, Case('', load.seconds, None), lambda: lambda time, speed: table[round(time * RATE)],
        len(table))
    for name, case in CASES.items():
        add(name, case, lambda case=case: case.torques(mechanism, p),
            round(min(case.seconds, most) * RATE))
    return outcomes


def simulation_of(mechanism, p, case, law, values):
    """Return the simulation of a case at its start."""
    changes = {'loss_law': law, 'substeps': 1}
    for shaft in mechanism.outputs:
        changes[f'initial_velocity.{shaft}'] = case.start
        if case.wheels:
            inertia = f'{mechanism.name}.inertia.{shaft}'
            changes[inertia] = p.named()[inertia] + WHEEL
    return make_simulation(mechanism.variant, {**values, **changes}, 1 / RATE, AuditedSimulation)


def outcome_of(simulation, torques, ticks):
    """Run a simulation with books and return its ``Outcome``."""
    names = (*simulation.gear_names, *simulation.bearing_names)
    carrier, index, work, losses, rest = [], [], [], [], []
    speed = simulation.snapshot().velocity[0]
    for n in range(ticks):
        snapshot = simulation.step(torques(n / RATE, speed))
        energy = snapshot.energy
        speed = snapshot.velocity[0]
        carrier.append(speed)
        index.append(snapshot.power_flow)
        work.append(energy.work)
        losses.append((*energy.gears, *energy.bearings))
        rest.append((energy.viscous, *energy.clutches))
    losses, rest = np.array(losses), np.array(rest)
    lost = dict(zip((*names, 'drag', *simulation.clutch_names), np.hstack([losses, rest]).T))
    return Outcome(simulation.loss_law, np.array(carrier), np.array(index), np.array(work), lost,
                   np.maximum(-losses, 0.0).sum(axis=1))
