# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The yardstick of the comparison: the exact solution under torques that are held within a tick.

The power-flow index is decided at the start of each tick, from the yardstick's own speeds; the
law of losses is the paper's.
"""

from typing import NamedTuple

import numpy as np
from scipy.integrate import odeint

from dm_ros.mechanism import clutched
from dm_ros.mechanism.power_flow import DIRECT, power_flow, REVERSE
from dm_ros.mechanism.self_locking import SelfLockingOde
from dm_ros.mechanism.symmetric import SymmetricOde

TOLERANCE = 1e-11   # of LSODA, relative and in rad/s


class Exact(NamedTuple):
    """The exact solution at the end of each tick."""

    speed: np.ndarray    # (ticks, 3), rad/s: the carrier and the two output shafts
    moment: np.ndarray   # (ticks, moments), N m, in the order and sign of ``Simulation.moments``
    power_flow: np.ndarray    # (ticks,), +1 or -1


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
        Z = np.zeros((5, 5), np.longdouble)   # of (omega_1, omega_2, T_3, T_1, T_2)
        Z[:2, :2], Z[:2, 2:] = response.A, response.B
        steps[direction] = exponential(Z * dt)[:2]
        moments[direction] = direction * np.hstack([response.P, response.Q])
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


def exact_self_locking(p, torques, dt, start=(0.0, 0.0), deadband=0.0, tick=lambda: None, *,
                       frozen=None):
    """
    Return the ``Exact`` motion of a self-locking differential by LSODA, begun anew in each tick.

    :param frozen: None, or ``(|M_1|, |M_2|)`` at the start, N m: the friction then knows the gear
        moments of the end of the preceding tick alone, as in variant 1.
    :raises ValueError: where LSODA gives up.

    The others are as for ``exact_symmetric``, with (T_0, T_1, T_2).
    """
    phi, preload = clutched.full_friction(p)
    friction = preload
    coefficients = {d: clutched.coefficients(p, SelfLockingOde(p).response(d), not frozen, d)
                    for d in (DIRECT, REVERSE)}
    a_1, a_2 = p.g_12 / (1 + p.g_12), 1 / (1 + p.g_12)   # omega_1 = w + a_1 s, 2 = w - a_2 s
    w, s = a_2 * start[0] + a_1 * start[1], start[0] - start[1]
    M_1, M_2 = frozen or (0.0, 0.0)
    direction = DIRECT
    states, moments, index = [], [], []
    for T in torques:
        direction = power_flow(
            T[0] * w, T[1] * (w + a_1 * s) + T[2] * (w - a_2 * s), deadband, direction)
        if frozen:
            friction = clutched.held_friction(p, phi, preload, (M_1, M_2), ())
        k = coefficients[direction]
        u = clutched.held(k, T, friction)

        def f(t, y, k=k, u=u):
            return clutched.evaluate(k, u, float(y[0]), float(y[1]))[:2]

        y, info = odeint(f, (w, s), (0.0, dt), tfirst=True, rtol=TOLERANCE, atol=TOLERANCE,
                         mxstep=100_000, full_output=True)
        if info['message'] != 'Integration successful.':
            raise ValueError('lsd: LSODA finds no exact solution to compare with, after '
                             f'{len(index) * dt:g} s')
        w, s = y[-1].tolist()
        _, _, F_1, F_2, *M, _, _, _, _ = clutched.evaluate(k, u, w, s)
        states.append((w, w + a_1 * s, w - a_2 * s))
        moments.append((direction * M[0], direction * M[1], F_1, F_2))
        M_1, M_2 = clutched.pressing(p, direction * M[0], direction * M[1])
        index.append(direction)
        tick()
    return Exact(np.array(states), np.array(moments), np.array(index))
