# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The yardstick of the bench: the exact solution under torques that are held within a tick.

The power-flow index is decided at the start of each tick, from the yardstick's own speeds.
"""

from typing import NamedTuple

import numpy as np
from scipy.integrate import odeint

from dm_ros.mechanism import clutched, passive
from dm_ros.mechanism.parameters import SelfLockingParameters
from dm_ros.mechanism.power_flow import DIRECT, power_flow, REVERSE, who_drives
from dm_ros.mechanism.symmetric import SymmetricOde
from dm_ros.tools.comparison.reference import exact_self_locking, exponential, TOLERANCE


class Trajectory(NamedTuple):
    """Speeds, angles and index at the end of each tick."""

    speeds: np.ndarray   # (ticks, 3), rad/s: the carrier and the two output shafts
    angles: np.ndarray   # (ticks, 3), rad; None for the self-locking yardstick
    index: np.ndarray    # (ticks,), +1 or -1


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
    Return the ``Trajectory`` of a self-locking differential by LSODA, begun anew in each tick.

    :param lagged: the friction knows |M| of the preceding tick alone, as in variant 1.
    """
    exact = exact_self_locking(p, load, dt, frozen=(0.0, 0.0) if lagged else None)
    return Trajectory(exact.speed, None, exact.power_flow)


def symmetric_trajectory(p, load, dt):
    """Return the ``Trajectory`` of a symmetric differential by extended matrix exponentials."""
    steps = {}
    for direction in (DIRECT, REVERSE):
        response = SymmetricOde(p).response(direction)
        Z = np.zeros((7, 7), np.longdouble)   # of (omega_1, omega_2, their angles, torques)
        Z[:2, :2], Z[:2, 4:] = response.A, response.B
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


def passive_trajectory(p, load, dt, lagged=False):
    """
    Return the ``Trajectory`` under the passive law by LSODA, begun anew in each tick.

    :param lagged: as for ``clutch_trajectory``.
    """
    clutches = isinstance(p, SelfLockingParameters)
    k = passive.coefficients(p, clutches, not lagged)
    phi, S = clutched.full_friction(p) if clutches else ((0.0, 0.0), (0.0, 0.0))
    w, s, direction, friction = 0.0, 0.0, DIRECT, S
    rows, index = [], []
    for T in load:
        direction = who_drives(T[0] * (k.g_F or 1.0) * w, abs(w) > k.sign_speed, 0.0, direction)
        u = passive.held(k, T, friction)

        def f(t, y, u=u):
            return passive.evaluate(k, u, float(y[0]), float(y[1]))[:2]

        w, s = odeint(f, (w, s), (0.0, dt), tfirst=True, rtol=TOLERANCE, atol=TOLERANCE,
                      mxstep=100_000)[-1].tolist()
        if lagged:
            _, _, _, _, M_1, M_2, *_ = passive.evaluate(k, u, w, s)
            friction = clutched.held_friction(p, phi, S, clutched.pressing(p, M_1, M_2), ())
        rows.append((w, s))
        index.append(direction)
    return Trajectory(three_shafts(p, *np.array(rows).T), None, np.array(index))


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
