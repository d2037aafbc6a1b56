# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The energy books of a driveline: what comes in, what is stored, what is lost where.

    work + parametric + jumps = stored + lost + numerical

- work: of the torque on the input, of gravity and of the wind
- stored: the difference of the energies at the ends, of all motion, twist, pads and carcasses
- parametric: what the energy of pads and carcasses grows with where a load changes
- jumps: the same where a brake pressure, a grip, a contact or a grade changes between two ticks
- lost: every loss is the integral of a power that is never negative
- numerical: what is left, the error of the step and of the integrals, which is of second order
"""

from typing import NamedTuple

import numpy as np

from dm_ros.driveline.body import G, slope

NOT_LOST = 4   # powers that stand before the losses


class Energy(NamedTuple):
    """Energies since the start, J."""

    input: float        # work of the torque on the input
    gravity: float      # work
    wind: float         # work
    stored: float       # what is stored more than at the start
    lost: float         # the sum of all losses
    parametric: float   # what changes of load added to what is stored
    jumps: float        # what changes of brakes, grip, contact and grade added to it
    numerical: float    # what the errors took

    @property
    def work(self):
        """The sum of all work."""
        return self.input + self.gravity + self.wind


class Account(NamedTuple):
    """What the books know of one state."""

    train: tuple        # what ``Train.books`` and
    road: tuple         # ``Road.books`` returned
    energy: float       # J, of all
    powers: np.ndarray  # W: input, gravity, wind, parametric, each loss


class Books:
    """
    The books of a run.

    :param equations: ``Equations``; assembly: of which they are.
    """

    def __init__(self, equations, assembly):
        self._equations, self._weight = equations, assembly.vehicle.m * G
        wheels = [wheel.name for wheel in assembly.wheels]
        self.kinds = {
            **{differential.name: differential.losses for differential in assembly.differentials},
            'shafts': tuple([f'{connection.name}_shaft' for connection in assembly.connections]),
            **{kind: tuple([f'{wheel}_{loss}' for loss in losses for wheel in wheels])
               for kind, losses in (('tyres', ('slip', 'tyre_damping')),
                                    ('brakes', ('brake',)), ('rolling', ('rolling',)))},
            'air': ('drag',)}
        self.names = tuple([name for names in self.kinds.values() for name in names])

    def start(self, point, given):
        """Begin at a ``Point``."""
        self._point, self._account = point, self._of(point, given)
        self._initial, self._jumps = self._account.energy, 0.0
        self._integrals = np.zeros(NOT_LOST + len(self.names))

    def follow(self, other, point, given):
        """Go on with the books of another at a ``Point`` whose energy may differ from its own."""
        self._initial, self._integrals = other._initial, other._integrals.copy()
        self._point, self._account = point, self._of(point, given)
        self._jumps = other._jumps + self._account.energy - other._account.energy

    def note(self, first, points, given, h):
        """
        Book a tick.

        :param first: the ``Point`` at its start, under what is held in it; points: those at the
            ends of its parts, each of h, s.
        """
        account, jump, powers = self._account, 0.0, 0.0
        if first is not self._point:
            before, account = account, self._of(
                first, given, account.train if first.train is self._point.train else None,
                account.road if first.road is self._point.road else None)
            jump = account.energy - before.energy
        for point in points:
            before, account = account, self._of(point, given)
            powers = powers + (before.powers + account.powers)
        self._jumps += jump
        self._integrals += (0.5 * h) * powers
        self._point, self._account = points[-1], account

    @property
    def stored(self):
        """The energy now, J."""
        return self._account.energy

    @property
    def losses(self):
        """``{name: J}`` since the start."""
        return dict(zip(self.names, self._integrals[NOT_LOST:].tolist()))

    @property
    def total(self):
        """The ``Energy`` since the start."""
        work_input, gravity, wind, parametric, *lost = self._integrals.tolist()
        stored, lost = self._account.energy - self._initial, sum(lost)
        return Energy(
            work_input, gravity, wind, stored, lost, parametric, self._jumps,
            work_input + gravity + wind + parametric + self._jumps - stored - lost)

    def _of(self, point, given, of_train=None, of_road=None):
        train, road = self._equations.train, self._equations.road
        x = point.x
        turning, lost = of_train = of_train or train.books(x, point.train)
        energy, parametric, lost_on_road = of_road = of_road or road.books(x, point.road, given)
        v_x, _, _ = road.twist(x)
        return Account(of_train, of_road, turning + energy, np.array([
            given.torque * x[0], -self._weight * slope(given.grade)[0] * v_x,
            point.road.drag * given.wind, parametric, *lost, *lost_on_road]))
