# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
What turns between input and wheels: inertias, elastic shafts and differentials.

Every differential sees known torques, those of the shafts at its flanges, so that its
accelerations are the one solution of the passive law; -T of a shaft acts at its flange a, T at b.
"""

from typing import NamedTuple

import numpy as np

from dm_ros.driveline import shafts
from dm_ros.driveline.state import places


class TrainPoint(NamedTuple):
    """What is known of the train at one state."""

    rates: list      # rad/s, dphi/dt of the connections
    springs: list    # N m, T_c of the connections
    damping: list    # N m, T_d of the connections
    load: list       # N m, of all shafts at each flange
    held: list       # what ``passive.held`` returns, of each differential: torques first
    points: list     # ``passive`` points of the differentials

    @property
    def shaft_torques(self):
        """The torque of each connection, N m."""
        return [spring + damping for spring, damping in zip(self.springs, self.damping)]


class Train:
    """
    The train of an ``Assembly``.

    Its flanges are numbered: inertias, three of each differential, wheels.
    """

    def __init__(self, assembly, layout):
        self.differentials = tuple(assembly.differentials)
        self.inertias = tuple(assembly.inertias.values())
        self.shafts = [(c.p.stiffness, c.p.damping, c.p.gap / 2.0) for c in assembly.connections]
        self.has_gaps = any(beta for _, _, beta in self.shafts)
        self._layout = layout
        self._places = list(zip(self.differentials, layout.differentials))
        self._differentials = [(d.ratio, d.k_1, d.k_2, d.evaluate, n) for d, n in self._places]
        self._first = len(self.inertias)   # flange of a differential
        first = self._first + 3 * len(self.differentials)
        self.wheel_flanges = slice(first, first + len(assembly.wheels))
        names = ([(name, '') for name in assembly.inertias]
                 + [(d.name, port) for d in self.differentials for port in d.ports]
                 + [(wheel.name, '') for wheel in assembly.wheels])
        self._ends = [(names.index(c.a), names.index(c.b)) for c in assembly.connections]
        self._connected = [(*shaft, *ends) for shaft, ends in zip(self.shafts, self._ends)]
        self._lay_out_jacobian(assembly, names)

    def at(self, x, friction):
        """
        Return the ``TrainPoint`` at a state.

        :param friction: of each differential, as ``Differential.friction`` returned it.
        """
        layout = self._layout
        speeds = x[layout.inertias]
        for ratio, k_1, k_2, _, n in self._differentials:
            w, s = x[n], x[n + 1]
            speeds += (ratio * w, w + k_1 * s, w - k_2 * s)
        speeds += x[layout.wheels]
        rates, springs, dampings = shafts.torques(self._connected, x[layout.twists], speeds)
        load = [0.0] * len(speeds)
        for (_, _, _, a, b), spring, damping in zip(self._connected, springs, dampings):
            T = spring + damping
            load[a] -= T
            load[b] += T
        held, points = [], []
        flange = self._first
        for (_, _, _, evaluate, n), (S_1, S_2) in zip(self._differentials, friction):
            T_in, T_1, T_2 = load[flange:flange + 3]
            u = T_in, T_1, T_2, S_1, S_2
            held.append(u)
            points.append(evaluate(u, x[n], x[n + 1]))
            flange += 3
        return TrainPoint(rates, springs, dampings, load, held, points)

    def accelerations(self, torque, point):
        """Return domega/dt of the inertias, the first under the torque, and the differentials."""
        load = point.load
        result = [(load[n] + (0.0 if n else torque)) / inertia
                  for n, inertia in enumerate(self.inertias)]
        for accelerations in point.points:
            result += accelerations[:2]
        return result

    # -- Jacobian: what the state does to the shaft torques, and they to the accelerations --

    def _lay_out_jacobian(self, assembly, names):
        layout = self._layout
        n = len(layout)
        row_of = np.zeros((len(names), n))   # speed of each flange, per state
        per_torque = np.zeros((n, len(names)))   # accelerations, per torque on each flange
        for flange, (place, inertia) in enumerate(zip(places(layout.inertias), self.inertias)):
            row_of[flange, place], per_torque[place, flange] = 1.0, 1.0 / inertia
        flange = len(self.inertias)
        slopes_at = []   # (place, flange) of the slopes of differentials
        for differential, place in self._places:
            row_of[flange:flange + 3, place:place + 2] = differential.port_rows()
            slopes_at += [(place + row, flange + port)
                          for row in range(2) for port in range(3)]
            flange += 3
        for place, wheel in zip(places(layout.wheels), range(flange, len(names))):
            row_of[wheel, place] = 1.0
            per_torque[place, wheel] = 1.0 / assembly.vehicle.I_w
        on = np.zeros((len(names), len(self.shafts)))   # torque on each flange, per shaft
        for shaft, (a, b) in enumerate(self._ends):
            on[a, shaft] -= 1.0
            on[b, shaft] += 1.0
        self.twist_rows = -on.T @ row_of       # dphi/dt, per state
        self.per_torque = per_torque @ on      # accelerations, per shaft torque, but for those
        # of the differentials: of them entry (place, shaft) is slope number ``which``, +-
        self._entries = [(place, shaft, which, on[flange, shaft])
                         for which, (place, flange) in enumerate(slopes_at)
                         for shaft in range(len(self.shafts)) if on[flange, shaft]]
        self._signed = [(which, sign) for _, _, which, sign in self._entries]
        self._twist_places = np.arange(len(self.shafts)), np.array(places(layout.twists), int)
        self.per_state = self._torque_rows([(k, d) for k, d, _ in self.shafts])

    def _torque_rows(self, slopes):
        """Return what the shaft torques grow with per state, (shafts, n)."""
        k, d = np.array(slopes, float).reshape(-1, 2).T
        rows = d[:, None] * self.twist_rows
        rows[self._twist_places] = k
        return rows

    def entries(self):
        """Return (state, shaft) of the second that ``slopes`` returns."""
        return [(place, shaft) for place, shaft, _, _ in self._entries]

    def slopes(self, x, point):
        """
        Return the slopes of the differentials: four each at given torques, and per shaft torque.

        The other accelerations per shaft torque are ``per_torque``, (n, shafts).
        """
        own, slopes = [], []
        for (differential, n), u, at in zip(self._places, point.held, point.points):
            four, w, s = differential.slopes(u, x[n], x[n + 1], at)
            own += four
            slopes += w
            slopes += s
        return own, [slopes[which] * sign for which, sign in self._signed]

    def torque_slopes(self, x, point):
        """Return what the shaft torques grow with per state, (shafts, n)."""
        return self._torque_rows([
            shafts.slopes(k, d, beta, phi, rate) for (k, d, beta), phi, rate
            in zip(self.shafts, x[self._layout.twists], point.rates)])

    def books(self, x, point):
        """
        Return what the books need.

        :return: the energy of rotation and twist, without the wheels, J; what each loss of each
            differential, and each connection, takes, W.
        """
        energy, lost = 0.0, []
        for omega, inertia in zip(x, self.inertias):
            energy += 0.5 * inertia * omega * omega
        for (differential, n), u, at in zip(self._places, point.held, point.points):
            (m_11, m_12, m_22), w, s = differential.form, x[n], x[n + 1]
            energy += 0.5 * (m_11 * w * w + m_22 * s * s) + m_12 * w * s
            lost += differential.lost_powers(u, w, s, at)
        for (k, _, _), spring, damping, rate in zip(
                self.shafts, point.springs, point.damping, point.rates):
            energy += 0.5 * spring * spring / k
            lost.append(damping * rate)
        return energy, lost
