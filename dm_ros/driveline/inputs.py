# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What comes into a driveline in a tick: by name, in which unit and range."""

from collections.abc import Mapping
from math import atan, inf, isfinite
from operator import le

from dm_ros.driveline.assembly import INPUT
from dm_ros.driveline.road import Given
from dm_ros.mechanism.ports import force, Port, torque

STEEPEST = 10.0        # tangent of a slope
STEER_LIMIT = 1.0      # rad
TURNING_POINT = 0.9    # of the way from a steered wheel to the centre of its circle, at least left
LEAST_GRIP = 1e-6
OF_A_ROAD = {'array': 'position', 'lasts': True}


class Inputs:
    """
    The inputs of a driveline.

    :param p: ``VehicleParameters``; wheels: their names; differentials: of ``Differential``;
        planar: whether it can steer.
    """

    def __init__(self, p, wheels, differentials, planar):
        self._planar = planar
        self._wheels = wheels
        self.clutches = tuple([c for d in differentials for c in d.clutches])
        steer = min(STEER_LIMIT, atan(2.0 * TURNING_POINT * p.L / p.track)) if planar else inf
        groups = {
            'torque': (torque(INPUT)._replace(topic=f'torque/{INPUT}'),),
            'brakes': [Port(f'{wheel}_brake', 'capacity', 'N m', 0.0, lasts=True,
                            topic=f'brake/{wheel}') for wheel in wheels],
            'clutch_forces': [force(f'{clutch}_clutch')._replace(topic=f'clutch/{clutch}')
                              for clutch in self.clutches],
            'steer': (Port('steer', 'angle', 'rad', -steer, steer, topic='steer', **OF_A_ROAD),),
            'grade': (Port('grade', 'tangent', '1', -STEEPEST, STEEPEST, topic='grade',
                           **OF_A_ROAD),),
            'grip': [Port(f'{wheel}_grip', 'share', '1', LEAST_GRIP, idle=1.0,
                          topic=f'grip/{wheel}', **OF_A_ROAD) for wheel in wheels],
            'contact': [Port(f'{wheel}_contact', 'share', '1', 0.0, idle=1.0,
                             topic=f'contact/{wheel}', **OF_A_ROAD) for wheel in wheels],
            'wind': (Port('wind', 'head wind', 'm/s', -inf),)}
        self.ports = tuple([port for group in groups.values() for port in group])
        self._arguments = [name for name, group in groups.items() for _ in group]
        self._low, self._high = zip(*[(port.low, port.high) for port in self.ports])
        self._zeros, self._ones = (0.0,) * len(wheels), (1.0,) * len(wheels)
        self._open = (0.0,) * len(self.clutches)

    def idle(self, grade):
        """Return what holds before anything comes in, but a grade."""
        return Given(0.0, self._zeros, 0.0, grade, self._ones, self._ones, 0.0)

    def checked(self, torque, brakes, clutch_forces, steer, grade, grip, contact, wind):
        """
        Return the ``Given`` and the forces on all clutches, N.

        :raises ValueError: names what is wrong, its value and what is allowed.
        """
        brakes = self._for_wheels('brakes', brakes, self._zeros)
        grip = self._for_wheels('grip', grip, self._ones)
        contact = self._for_wheels('contact', contact, self._ones)
        forces = self._forces(clutch_forces) if clutch_forces else self._open
        torque, steer = self._number('torque', torque), self._number('steer', steer)
        grade, wind = self._number('grade', grade), self._number('wind', wind)
        values = (torque, *brakes, *forces, steer, grade, *grip, *contact, wind)
        if not (isfinite(sum(values)) and all(map(le, self._low, values))
                and all(map(le, values, self._high))):   # as nearly never
            self._refuse(values)
        if steer and not self._planar:
            raise ValueError(f'steer: {steer!r} is not allowed, it must be 0: the body cannot '
                             'turn unless it is planar')
        return Given(torque, brakes, steer, grade, grip, contact, wind), forces

    def _for_wheels(self, what, values, default):
        if values is None or values is default:
            return default
        try:
            numbers = tuple(map(float, values))
            if len(numbers) == len(default):
                return numbers
        except (TypeError, ValueError, OverflowError):
            pass
        raise ValueError(f'{what}: {values!r} must be {len(default)} numbers, '
                         f'for {", ".join(self._wheels)}')

    def _forces(self, given):
        if not isinstance(given, Mapping):
            raise ValueError(f'clutch_forces: {given!r} must be {{clutch: N}}')
        for name in given:
            if name not in self.clutches:
                among = ', '.join(self.clutches)
                raise ValueError(f'clutch_forces: {name!r} is not one of {among}' if among else
                                 f'clutch_forces: {name!r} is not allowed, there is no clutch')
        return tuple([self._number(f'clutch_forces: {name}', given.get(name, 0.0))
                      for name in self.clutches])

    @staticmethod
    def _number(what, value):
        if type(value) is float:
            return value
        try:
            if not isinstance(value, (bool, str)):
                return float(value)
        except (TypeError, ValueError, OverflowError):
            pass
        raise ValueError(f'{what}: {value!r} is not allowed, it must be a number')

    def _refuse(self, values):
        for argument, port, value in zip(self._arguments, self.ports, values):
            if refusal := port.refusal(value):
                raise ValueError(f'{argument}: {refusal}')
