# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
The yardstick of the bench: the exact solution under torques that are held within a tick.

The power-flow index is decided at the start of each tick, from the yardstick's own speeds.
"""

from math import tanh
from typing import NamedTuple
import warnings

import numpy as np
from scipy.integrate import odeint, ODEintWarning

from dm_ros import self_locking
from dm_ros.parameters import SelfLockingParameters
from dm_ros.power_flow import DIRECT, power_flow, REVERSE
from dm_ros.self_locking import SelfLockingOde
from dm_ros.symmetric import SymmetricOde


class Trajectory(NamedTuple):
    """Speeds, angles and index at the end of each tick."""

    speeds: np.ndarray   # (ticks, 3), rad/s: the carrier and the two output shafts
    angles: np.ndarray   # (ticks, 3), rad; None for the self-locking yardstick
    index: np.ndarray    # (ticks,), +1 or -1


class ClutchMotion:
    """The equations of variant 2 in plain floats: the right-hand side of yardstick and peers."""

    def __init__(self, p):
        self._rows = {}
        for direction in (DIRECT, REVERSE):
            r = SelfLockingOde(p).response(direction)
            fixed = np.vstack([np.hstack([r.A, r.C]), np.hstack([r.P, r.W])])
            self._rows[direction] = fixed.ravel().tolist(), np.vstack([r.B, r.Q]).tolist()
        self._steepness = self_locking.slip_steepness(p)
        self.full_friction = self_locking.full_friction(p)

    def slope(self, T, direction, friction=None):
        """
        Return the function ``(omega_0, slip) -> (e_0, dslip/dt, F_1, F_2, M_1, M_2)``.

        :param friction: in place of ``full_friction``.
        """
        (A11, A12, C11, C12, A21, A22, C21, C22,
         P11, P12, W11, W12, P21, P22, W21, W22), torque_rows = self._rows[direction]
        b1, b2, m1, m2 = (a * T[0] + b * T[1] + c * T[2] for a, b, c in torque_rows)
        a1, a2 = self._steepness
        (g1, g2), (n1, n2) = friction or self.full_friction

        def slope(w, s):
            t1, t2 = tanh(a1 * s), tanh(a2 * s)
            x1, x2, F1, F2 = g1 * t1, g2 * t2, n1 * t1, n2 * t2
            z1 = m1 + P11 * w + P12 * s - W11 * F1 - W12 * F2
            z2 = m2 + P21 * w + P22 * s - W21 * F1 - W22 * F2
            # (I + W diag(x sign M)) M = z, tried first with the signs of z
            y1, y2 = x1 if z1 >= 0.0 else -x1, x2 if z2 >= 0.0 else -x2
            a, b, c, d = 1 + W11 * y1, W12 * y2, W21 * y1, 1 + W22 * y2
            det = a * d - b * c
            M1, M2 = (d * z1 - b * z2) / det, (a * z2 - c * z1) / det
            if M1 * z1 < 0.0 or M2 * z2 < 0.0:
                M1, M2 = self_locking.solve_moments(
                    (z1, z2), ((W11, W12), (W21, W22)), (x1, x2))
            F1 += x1 * abs(M1)
            F2 += x2 * abs(M2)
            return (b1 + A11 * w + A12 * s - C11 * F1 - C12 * F2,
                    b2 + A21 * w + A22 * s - C21 * F1 - C22 * F2, F1, F2, M1, M2)
        return slope


def slip_shares(p):
    """Return (a_1, a_2): omega_1 = omega_0 + a_1 slip, omega_2 = omega_0 - a_2 slip."""
    g_12 = p.g_12 if isinstance(p, SelfLockingParameters) else 1.0
    return g_12 / (1 + g_12), 1 / (1 + g_12)


def three_shafts(p, w, s):
    """Return carrier and outputs, (n, 3), from the carrier and the slip omega_1 - omega_2."""
    a_1, a_2 = slip_shares(p)
    return np.column_stack([w, w + a_1 * s, w - a_2 * s])


def clutch_trajectory(p, load, dt, lagged=False):
    """
    Return the ``Trajectory`` of a self-locking differential by LSODA to 1e-11, tick by tick.

    :param lagged: the friction knows |M| of the preceding tick alone, as in variant 1.
    """
    motion = ClutchMotion(p)
    phi, preload = friction = motion.full_friction
    a_1, a_2 = slip_shares(p)
    w = s = M_1 = M_2 = 0.0
    direction = DIRECT
    states, index = [], []
    with warnings.catch_warnings():
        warnings.simplefilter('error', ODEintWarning)
        for T in load:
            direction = power_flow(
                T[0] * w, T[1] * (w + a_1 * s) + T[2] * (w - a_2 * s), 0.0, direction)
            if lagged:
                friction = (0.0, 0.0), (phi[0] * abs(M_1) + preload[0],
                                        phi[1] * abs(M_2) + preload[1])
            slope = motion.slope(T, direction, friction)

            def f(t, y, slope=slope):
                return slope(float(y[0]), float(y[1]))[:2]

            w, s = odeint(f, (w, s), (0.0, dt), tfirst=True, rtol=1e-11, atol=1e-11,
                          mxstep=100_000)[-1].tolist()
            *_, M_1, M_2 = slope(w, s)
            states.append((w, s))
            index.append(direction)
    return Trajectory(three_shafts(p, *np.array(states).T), None, np.array(index))


def exponential(Z):
    """Return e^Z in extended precision: Taylor's series, scaled and squared."""
    Z = np.asarray(Z, np.longdouble)
    squarings = max(0, int(np.ceil(np.log2(float(np.abs(Z).sum(axis=1).max()) + 1e-300))) + 2)
    Z = Z / 2**squarings
    term = total = np.eye(len(Z), dtype=np.longdouble)
    for k in range(1, 30):
        term = term @ Z / k
        total = total + term
    for _ in range(squarings):
        total = total @ total
    return total


def symmetric_trajectory(p, load, dt):
    """Return the ``Trajectory`` of a symmetric differential by extended matrix exponentials."""
    steps = {}
    for direction in (DIRECT, REVERSE):
        response = SymmetricOde(p).response(direction)
        Z = np.zeros((7, 7), np.longdouble)   # of (omega_1, omega_2, their angles, torques)
        Z[:2, :2], Z[:2, 4:] = response.A, response.B[:, [2, 0, 1]]
        Z[2:4, :2] = np.eye(2)
        steps[direction] = exponential(Z * dt)[:4]
    state, direction = np.zeros(4, np.longdouble), DIRECT
    rows, index = [], []
    for T in np.asarray(load, np.longdouble):
        direction = power_flow(T[0] * p.g_F * (state[0] + state[1]) / 2,
                               T[1] * state[0] + T[2] * state[1], 0.0, direction)
        state = steps[direction] @ np.concatenate([state, T])
        rows.append(state)
        index.append(direction)
    speeds, angles = np.array(rows)[:, :2], np.array(rows)[:, 2:]
    return Trajectory(*(np.column_stack([pair.mean(axis=1), pair]) for pair in (speeds, angles)),
                      np.array(index))


def trajectory_of(simulation, load):
    """Return the ``Trajectory`` of a ``Simulation``."""
    snapshots = [simulation.step(T) for T in load]
    return Trajectory(np.array([s.velocity[:3] for s in snapshots]),
                      np.array([s.position[:3] for s in snapshots]),
                      np.array([s.power_flow for s in snapshots]))


def largest_error(speeds, exact):
    """Return the largest error of the three speeds and that of the slip, rad/s."""
    error = np.abs(speeds - exact)
    slip = np.abs((speeds[:, 1] - speeds[:, 2]) - (exact[:, 1] - exact[:, 2]))
    return float(error.max()), float(slip.max())
