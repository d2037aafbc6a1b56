# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
A differential in time: ``Simulation`` steps one of the five variants at a fixed rate.

Nothing here depends on measured time: equal inputs give equal bits.
"""

import math
from operator import add
from typing import NamedTuple

from dm_ros.mechanism.power_flow import DIRECT, power_flow
from dm_ros.motion.models import MODELS, VARIANTS


class Snapshot(NamedTuple):
    """What a differential reports at the end of a tick, in plain floats."""

    time: float        # s, the number of ticks times their length
    velocity: tuple    # rad/s, in the order of ``Simulation.shafts``
    position: tuple    # rad, the integral of velocity
    torque: tuple      # N m, held in the tick, in the order of ``Simulation.inputs``
    moment: tuple      # N m, in the order of ``Simulation.moments``
    power_flow: int    # +1 direct, -1 reverse, as it was in force


class Simulation:
    """
    One differential in simulated time.

    At each tick the torques are held, the power-flow index is decided at the start of each
    solver step, and the speeds advance by the tick length.

    :param variant: one of ``VARIANTS``.
    :param dt: length of a tick, s.
    :param parameters: ``SymmetricParameters`` or ``SelfLockingParameters``, or a mapping from
        parameter names to values that differ from the defaults.
    :param substeps: solver steps in a tick.
    :param power_flow_deadband: W, see ``dm_ros.mechanism.power_flow``.
    :param initial_velocity: speeds of the two output shafts at the start, rad/s.
    :raises ValueError: names what is wrong, its value and what is allowed.
    """

    def __init__(self, variant, dt=0.001, parameters=None, *, substeps=1,
                 power_flow_deadband=0.0, initial_velocity=(0.0, 0.0)):
        if variant not in MODELS:
            raise ValueError(f'variant: {variant!r} is not one of {", ".join(VARIANTS)}')
        self.variant = variant
        self.dt = checked('dt', dt, lambda v: v > 0.0, 'a positive number of seconds')
        self.power_flow_deadband = power_flow_deadband
        self.initial_velocity = initial_velocity
        self._substeps = None
        self._model = None
        self.adopt(self.prepare({} if parameters is None else parameters, substeps))
        self.reset()

    @property
    def shafts(self):
        """Names of all shafts."""
        return self._model.shafts

    @property
    def inputs(self):
        """Names of the shafts that take a torque."""
        return self._model.inputs

    @property
    def outputs(self):
        """Names of the two output shafts."""
        return self._model.outputs

    @property
    def moments(self):
        """Names of the internal moments."""
        return self._model.moments

    @property
    def time(self):
        """Simulated time, s."""
        return self._ticks * self.dt

    @property
    def ticks(self):
        """Ticks since the start."""
        return self._ticks

    @property
    def coarse_steps(self):
        """Solver steps since the start that reached the bound of work, see ``ClutchStep``."""
        return self._coarse_steps

    @property
    def power_flow_deadband(self):
        """Difference of power within which the index stays what it is, W."""
        return self._deadband

    @power_flow_deadband.setter
    def power_flow_deadband(self, value):
        self._deadband = checked('power_flow_deadband', value, lambda v: v >= 0.0,
                                 'a number of watts that is not negative')

    @property
    def initial_velocity(self):
        """Speeds of the two output shafts at the start and after a reset, rad/s."""
        return self._initial_velocity

    @initial_velocity.setter
    def initial_velocity(self, velocities):
        names = MODELS[self.variant][0].outputs
        try:
            pair = dict(zip(names, velocities, strict=True))
        except (TypeError, ValueError):
            raise ValueError(f'initial_velocity: {velocities!r} must be two numbers, '
                             f'for {", ".join(names)}') from None
        self._initial_velocity = tuple(
            checked(f'initial_velocity.{name}', value, lambda v: abs(v) <= 1e6,
                    'a number of rad/s in [-1e+06, 1e+06]') for name, value in pair.items())

    @property
    def substeps(self):
        """Solver steps in a tick."""
        return self._substeps

    @substeps.setter
    def substeps(self, value):
        self.adopt(self.prepare({}, value))

    @property
    def parameters(self):
        """
        The parameters in force.

        They may be set between two ticks, also by a mapping of those that change; the speeds
        of the output shafts and all angles go on from where they are.
        """
        return self._model.parameters

    @parameters.setter
    def parameters(self, parameters):
        self.adopt(self.prepare(parameters))

    def prepare(self, parameters, substeps=None):
        """
        Return what ``adopt`` takes, without touching this simulation.

        It may be called from another thread: making the matrices takes some hundred
        microseconds, adopting them next to nothing.

        :param parameters: as for the simulation itself; a mapping changes those in force.
        :param substeps: solver steps in a tick, None for those in force.
        :raises ValueError: names what is wrong, its value and what is allowed.
        """
        model_type, formulation = MODELS[self.variant]
        parameters_type = model_type.parameters_type
        if not isinstance(parameters, parameters_type):
            now = self._model.parameters if self._model else parameters_type()
            try:
                parameters = now.changed(dict(parameters))
            except TypeError:
                raise ValueError(f'parameters: {type(parameters).__name__} is not '
                                 f'{parameters_type.__name__} or a mapping') from None
        substeps = checked('substeps', self._substeps if substeps is None else substeps,
                           lambda v: v >= 1 and v == int(v), 'a positive integer')
        return model_type(formulation, parameters, self.dt / substeps), int(substeps)

    def adopt(self, prepared):
        """Take what ``prepare`` made; the speeds of the output shafts and all angles go on."""
        old = self._model
        self._model, self._substeps = prepared
        if old is not None:
            self._origin = self._positions(old)
            self._integral = (0.0, 0.0)
            velocity = dict(zip(old.shafts, old.all_shafts(self._x)))
            self._x, _ = self._model.independent(*(velocity[s] for s in old.outputs))

    def reset(self):
        """Go back to the start: time, angles and torques zero, initial speeds, index +1."""
        self._ticks = 0
        self._coarse_steps = 0
        self._direction = DIRECT
        self._torque = (0.0, 0.0, 0.0)
        self._x, self._memory = self._model.independent(*self._initial_velocity)
        self._integral = (0.0, 0.0)
        self._origin = (0.0,) * len(self.shafts)

    def step(self, torques):
        """Advance one tick under the torques, as ``advance``, and return its ``Snapshot``."""
        self.advance(torques)
        return self.snapshot()

    def advance(self, torques):
        """
        Advance one tick.

        :param torques: N m, in the order of ``inputs``, held in the tick.
        :raises ValueError: for torques that are not three finite numbers, or that lead out of
            the range of floating point numbers; the state stays what it was.
        """
        torque = self._checked_torques(torques)
        model, deadband = self._model, self._deadband
        x, memory, direction = self._x, self._memory, self._direction
        integral_1, integral_2 = self._integral
        coarse_steps = 0
        try:
            for _ in range(self._substeps):
                input_power, output_power = model.powers(x, torque)
                direction = power_flow(input_power, output_power, deadband, direction)
                x, (i_1, i_2), memory, coarse = model.step(x, memory, torque, direction)
                integral_1 += i_1
                integral_2 += i_2
                coarse_steps += coarse
            in_range = math.isfinite(x[0] + x[1] + integral_1 + integral_2)
        except ArithmeticError:
            in_range = False
        if not in_range:
            raise ValueError(f'torques: {torque} lead out of the range of floating point numbers')
        self._x, self._memory, self._direction = x, memory, direction
        self._integral = (integral_1, integral_2)
        self._torque = torque
        self._coarse_steps += coarse_steps
        self._ticks += 1

    def snapshot(self):
        """Return the ``Snapshot`` of the last tick, or of the start at zero torque."""
        model, x = self._model, self._x
        return Snapshot(
            self._ticks * self.dt, model.all_shafts(x), self._positions(model), self._torque,
            model.internal_moments(x, self._memory, self._torque, self._direction),
            self._direction)

    def _positions(self, model):
        return tuple(map(add, self._origin, model.all_shafts(self._integral)))

    def _checked_torques(self, torques):
        try:
            T_a, T_b, T_c = torques
            torque = (float(T_a), float(T_b), float(T_c))
        except (TypeError, ValueError, OverflowError):
            raise ValueError(f'torques: {torques!r} must be three numbers, '
                             f'for {", ".join(self.inputs)}') from None
        if math.isfinite(torque[0] + torque[1] + torque[2]):   # as nearly always
            return torque
        for name, value in zip(self.inputs, torque):
            if not math.isfinite(value):
                raise ValueError(f'torques: {value!r} for {name} is not a finite number')
        return torque


def checked(name, value, fits, allowed):
    """Return the value as a finite float that fits; raise ValueError that names it."""
    try:
        number = float(value)
        good = not isinstance(value, (bool, str)) and math.isfinite(number) and fits(number)
    except (TypeError, ValueError, OverflowError):
        good = False
    if not good:
        raise ValueError(f'{name}: {value!r} is not allowed, it must be {allowed}')
    return number
