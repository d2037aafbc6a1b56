# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The right side of a driveline, dx/dt = f(x), and its Jacobian in closed form."""

from typing import NamedTuple

import numpy as np

from dm_ros.driveline.road import Road, RoadPoint
from dm_ros.driveline.state import places, StateLayout
from dm_ros.driveline.train import Train, TrainPoint


class Point(NamedTuple):
    """All that is known at one state."""

    x: list
    array: np.ndarray     # x
    rates: np.ndarray     # dx/dt
    train: TrainPoint
    road: RoadPoint


class Equations:
    """
    The equations of an ``Assembly``.

    :param planar: whether the body moves sideways and yaws too.
    """

    def __init__(self, assembly, planar):
        layout = self.layout = StateLayout(assembly, planar)
        self.train = Train(assembly, layout)
        self.road = Road(assembly, layout, planar)
        n, m = len(layout), len(assembly.connections)
        # J is what the rates grow with per shaft torque, contact, twist and own state, times what
        # these grow with per state
        contacts = 4 * len(assembly.wheels)
        own = [(place + row, place + column) for place in layout.differentials
               for row in range(2) for column in range(2)] + self.road.own_places()
        columns = sorted({column for _, column in own})
        twists, states = m + contacts, 2 * m + contacts
        self._rates_per = np.zeros((n, states + len(columns)))
        self._per_state = np.zeros((states + len(columns), n))
        self._rates_per[:, :m] = self.train.per_torque
        self._per_state[:m] = self.train.per_state
        self._rates_per[layout.twists, twists:states] = np.eye(m)
        self._per_state[twists:states] = self.train.twist_rows
        self._per_state[range(states, states + len(columns)), columns] = 1.0
        entries = self.train.entries() + [(row, states + columns.index(column))
                                          for row, column in own]
        self._entries = tuple(np.array(entries, int).T)
        self._torques, self._contacts = slice(0, m), slice(m, m + contacts)
        self._outer = None   # the rates per contact that are in place

    def at(self, array, friction, given, train=None, road=None):
        """
        Return the ``Point`` at a state.

        :param array: (n,); friction: of each differential; given: ``Given``.
        :param train: its ``TrainPoint``, where it is known; road: its ``RoadPoint``, likewise.
        """
        x = array.tolist()
        if train is None:
            train = self.train.at(x, friction)
        if road is None:
            road = self.road.at(x, train.load[self.train.wheel_flanges], given)
        rates = np.array(self.train.accelerations(given.torque, train) + road.omega + train.rates
                         + road.pads + road.kappa + road.alpha + road.body + road.A)
        return Point(x, array, rates, train, road)

    def jacobian(self, point, given):
        """Return df/dx at a ``Point``, (n, n), at fixed signs and without the columns of A."""
        rates_per, per_state, contacts = self._rates_per, self._per_state, self._contacts
        of_differentials, of_torques = self.train.slopes(point.x, point.train)
        of_road, of_contacts = self.road.slopes(point.x, point.road, given)
        inner, outer = self.road.geometry(given.steer)
        if outer is not self._outer:
            rates_per[:, contacts] = self._outer = outer
        rates_per[self._entries] = of_torques + of_differentials + of_road
        if self.train.has_gaps:
            per_state[self._torques] = self.train.torque_slopes(point.x, point.train)
        np.matmul(np.array(of_contacts).reshape(-1, 4, 5), inner,
                  out=per_state[contacts].reshape(-1, 4, len(rates_per)))
        return rates_per @ per_state

    def rolling(self, v_x, grade):
        """Return the state (n,) of rolling freely with v_x, m/s, on a grade; no twist, no slip."""
        x = np.array(self.road.rolling(v_x, grade))
        # what turns, so that no connection twists
        turning = np.array([*places(self.layout.inertias),
                            *range(self.layout.inertias.stop, self.layout.wheels.start)], int)
        rows = self.train.twist_rows
        x[turning] = np.linalg.lstsq(rows[:, turning], -rows @ x, rcond=None)[0]
        return x
