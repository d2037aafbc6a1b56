# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The yardstick of the comparison: the exact solution under torques that are held within a tick.

The power-flow index is decided at the start of each tick, from the yardstick's own speeds.
"""

from math import tanh
from typing import NamedTuple

import numpy as np
from scipy.integrate import odeint

from dm_ros.mechanism import self_locking
from dm_ros.mechanism.power_flow import DIRECT, power_flow, REVERSE
from dm_ros.mechanism.self_locking import SelfLockingOde
from dm_ros.mechanism.symmetric import SymmetricOde

TOLERANCE = 1e-11   # of LSODA, relative and in rad/s


class Exact(NamedTuple):
    """The exact solution at the end of each tick."""

    speed: np.ndarray    # (ticks, 3), rad/s: the carrier and the two output shafts
    moment: np.ndarray   # (ticks, moments), N m, in the order and sign of ``Simulation.moments``
    index: np.ndarray    # (ticks,), +1 or -1


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


def exact_symmetric(p, torques, dt, start=(0.0, 0.0), deadband=0.0, tick=lambda: None):
    """
    Return the ``Exact`` motion of a symmetric differential, by extended matrix exponentials.

    :param torques: of each tick, (T_3, T_1, T_2), N m; dt: length of a tick, s.
    :param start: speeds of the output shafts, rad/s; deadband: of the index, W.
    :param tick: called after each tick.
    """
    steps, moments = {}, {}
    for direction in (DIRECT, REVERSE):
        response = SymmetricOde(p).response(direction)
        order = [2, 0, 1]   # the paper orders torques (T_1, T_2, T_3)
        Z = np.zeros((5, 5), np.longdouble)   # of (omega_1, omega_2, T_3, T_1, T_2)
        Z[:2, :2], Z[:2, 2:] = response.A, response.B[:, order]
        steps[direction] = exponential(Z * dt)[:2]
        moments[direction] = direction * np.hstack([response.P, response.Q[:, order]])
    state, direction = np.array(start, np.longdouble), DIRECT
    states, index = [], []
    for T in np.asarray(torques, np.longdouble):
        direction = power_flow(T[0] * p.g_F * (state[0] + state[1]) / 2,
                               T[1] * state[0] + T[2] * state[1], deadband, direction)
        state = steps[direction] @ np.concatenate([state, T])
        states.append(state)
        index.append(direction)
        tick()
    pair, index = np.array(states).astype(float), np.array(index)
    both = np.hstack([pair, np.asarray(torques)])
    moment = np.where(index[:, None] > 0, both @ moments[DIRECT].T, both @ moments[REVERSE].T)
    return Exact(np.column_stack([pair.mean(axis=1), pair]), moment, index)


class ClutchMotion:
    """The right-hand side of a self-locking differential, in plain floats."""

    def __init__(self, p):
        self._rows = {}
        for direction in (DIRECT, REVERSE):
            r = SelfLockingOde(p).response(direction)
            fixed = np.vstack([np.hstack([r.A, r.C]), np.hstack([r.P, r.W])])
            self._rows[direction] = fixed.ravel().tolist(), np.vstack([r.B, r.Q]).tolist()
        self._steepness = self_locking.slip_steepness(p)
        self.full_friction = self_locking.full_friction(p)

    def slope(self, T, direction, friction):
        """Return the function ``(omega_0, slip) -> (e_0, dslip/dt, M_1, M_2, F_1, F_2)``."""
        (A11, A12, C11, C12, A21, A22, C21, C22,
         P11, P12, W11, W12, P21, P22, W21, W22), torque_rows = self._rows[direction]
        b1, b2, m1, m2 = (a * T[0] + b * T[1] + c * T[2] for a, b, c in torque_rows)
        a1, a2 = self._steepness
        (g1, g2), (n1, n2) = friction

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
                    b2 + A21 * w + A22 * s - C21 * F1 - C22 * F2, M1, M2, F1, F2)
        return slope


def exact_self_locking(p, torques, dt, start=(0.0, 0.0), deadband=0.0, tick=lambda: None, *,
                       frozen=None):
    """
    Return the ``Exact`` motion of a self-locking differential by LSODA, begun anew in each tick.

    :param frozen: None, or ``(|M_1|, |M_2|)`` at the start, N m: the friction then knows the gear
        moments of the end of the preceding tick alone, as in variant 1.
    :raises ValueError: where LSODA gives up.

    The others are as for ``exact_symmetric``, with (T_0, T_1, T_2).
    """
    motion = ClutchMotion(p)
    phi, preload = friction = motion.full_friction
    a_1, a_2 = p.g_12 / (1 + p.g_12), 1 / (1 + p.g_12)   # omega_1 = w + a_1 s, 2 = w - a_2 s
    w, s = a_2 * start[0] + a_1 * start[1], start[0] - start[1]
    M_1, M_2 = frozen or (0.0, 0.0)
    direction = DIRECT
    states, moments, index = [], [], []
    for T in torques:
        direction = power_flow(
            T[0] * w, T[1] * (w + a_1 * s) + T[2] * (w - a_2 * s), deadband, direction)
        if frozen:
            friction = (0.0, 0.0), (phi[0] * abs(M_1) + preload[0],
                                    phi[1] * abs(M_2) + preload[1])
        slope = motion.slope(T, direction, friction)

        def f(t, y, slope=slope):
            return slope(float(y[0]), float(y[1]))[:2]

        y, info = odeint(f, (w, s), (0.0, dt), tfirst=True, rtol=TOLERANCE, atol=TOLERANCE,
                         mxstep=100_000, full_output=True)
        if info['message'] != 'Integration successful.':
            raise ValueError('lsd: LSODA finds no exact solution to compare with, after '
                             f'{len(index) * dt:g} s')
        w, s = y[-1].tolist()
        _, _, M_1, M_2, F_1, F_2 = slope(w, s)
        states.append((w, w + a_1 * s, w - a_2 * s))
        moments.append((direction * M_1, direction * M_2, F_1, F_2))
        index.append(direction)
        tick()
    return Exact(np.array(states), np.array(moments), np.array(index))
