# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The exact steps of a symmetric differential under the passive law, one for each pattern of signs.

Beyond ``SATURATED`` times the sign speed every sigma is 1 or -1. While that holds for carrier and
outputs, and no power through a mesh or a bearing turns round, the equations are linear and the
step is exact. A ``Pattern`` is the set of these signs with its step; it is made when it is first
met and kept. Along a step each quantity whose sign counts is f = a + b e^(l t) + c e^(m t). Where
it has its sign at both ends, it had it all the way if its slope, which has one zero at most, has
one sign at both ends too, or if it is so small that f cannot have come down to zero in between.
"""

import math
from typing import NamedTuple

import numpy as np

from dm_ros.mechanism import passive, symmetric
from dm_ros.mechanism.losses import symmetric_drag, SymmetricLosses
from dm_ros.mechanism.symmetric import TO_SLIP
from dm_ros.motion import held_torque
from dm_ros.motion.quadrature import second_moment_of_the_way

MARGIN = 1e-9   # N m from turning round, within which no pattern is taken


class Pattern(NamedTuple):
    """What is linear while the signs are these; x is (w, s), T is (T_3, T_1, T_2)."""

    step: held_torque.HeldTorqueStep
    slope: tuple                        # rows (w, s, T_3, T_1, T_2) of dw/dt and ds/dt
    moments: symmetric.Moments          # in one sign for all flows
    kept: tuple                         # rows (w, s, T_3, T_1, T_2, least) of what must stay above
    input_sign: float                   # of T_3
    reach: tuple                        # s, times the slopes at both ends: how far f can come down
    losses: SymmetricLosses
    second: tuple                       # of ``second_moment_of_the_way``


class Patterns:
    """The patterns of one formulation with one set of parameters and one step length."""

    def __init__(self, equations, p, k, h):
        self._equations, self._p, self._k, self._h = equations, p, k, h
        self._kept = {}
        self._fast = passive.SATURATED * k.sign_speed

    def has_one_at(self, x):
        """Return whether the carrier and the outputs are so fast that every sigma is 1 or -1."""
        w, s = x
        k_1s, k_2s, fast = self._k.k_1 * s, self._k.k_2 * s, self._fast
        return ((w > fast or w < -fast) and (w + k_1s > fast or w + k_1s < -fast)
                and (w - k_2s > fast or w - k_2s < -fast))

    def of(self, u, point):
        """Return the ``Pattern`` at a point where all is fast, None where there is none."""
        _, _, _, _, _, _, _, signs, (_, _, *sigmas, _, _), _ = point
        key = (*sigmas, *signs, u[0] >= 0.0)
        if key not in self._kept:
            self._kept[key] = self._pattern(point, 1.0 if u[0] >= 0.0 else -1.0)
        return self._kept[key]

    def _pattern(self, point, input_sign):
        k, p = self._k, self._p
        _, _, _, _, _, _, _, (s_1, s_2, s_F, h_N, b), state, _ = point
        _, _, sigma_0, sigma_1, sigma_2, _, _ = state
        eta = passive.efficiencies(k, input_sign, point)
        with np.errstate(all='ignore'):
            try:
                A, B, _, P, Q, _ = self._equations.response(eta)
                A = TO_SLIP @ A @ np.linalg.inv(TO_SLIP)
                step = held_torque.held_torque_step_by_floats(A, TO_SLIP @ B, self._h)
            except (ArithmeticError, np.linalg.LinAlgError, ValueError):
                return None
        rows = np.hstack([A, TO_SLIP @ B])
        # the moments N within, then M and what follows from them
        within = np.hstack([P @ np.linalg.inv(TO_SLIP), Q])
        n = np.array([k.mean_F + k.half_F * sigma_0 * s_F, k.mean_1 + k.half_1 * sigma_1 * s_1,
                      k.mean_2 + k.half_2 * sigma_2 * s_2])
        M_F, M_1, M_2 = moments = within / n[:, None]
        N, c_F = within[1] + within[2], k.mean_F - k.half_F * sigma_0 * s_F
        brakes, drives = float(sigma_0 * s_F < 0.0), float(sigma_0 * s_F > 0.0)
        input_brakes = float(sigma_0 * p.g_F * input_sign < 0.0)
        drag = np.array([k.l_0, -k.l_1 * k.k_1 + k.l_2 * k.k_2, 0.0, 0.0, 0.0])
        bracket = sigma_0 * (drag + h_N * N - brakes * c_F * M_F)
        speeds = np.array([[1.0, 0.0], [1.0, k.k_1], [1.0, -k.k_2]])
        kept = [(*(sigma * row), 0.0, 0.0, 0.0, self._fast)
                for sigma, row in zip((sigma_0, sigma_1, sigma_2), speeds)]
        kept += [(*row, MARGIN) for row in (
            s_F * M_F, s_1 * M_1, s_2 * M_2, (2 * h_N - 1) * sigma_0 * N, (2 * b - 1) * bracket)]
        reach = reach_of_slopes(A, self._h)
        if not (np.isfinite(kept).all() and np.isfinite(rows).all() and reach):
            return None
        bearing_3, bearing_0 = k.bearing_3, k.bearing_0 * b
        n_F, n_1, n_2 = n.tolist()
        losses = SymmetricLosses(
            *symmetric_drag(p), 2 * k.half_F * s_F * sigma_0, 2 * k.half_1 * s_1 * sigma_1,
            2 * k.half_2 * s_2 * sigma_2,
            bearing_3 * drives * n_F, -bearing_3 * input_brakes, bearing_3,
            bearing_0 * h_N * n_1, bearing_0 * h_N * n_2, -bearing_0 * brakes * c_F, bearing_0)
        return Pattern(step, tuple(map(tuple, rows.tolist())),
                       symmetric.Moments(*moments.ravel().tolist()),
                       tuple(tuple(map(float, row)) for row in kept), input_sign,
                       reach, losses, second_moment_of_the_way(A, self._h))


def reach_of_slopes(A, h):
    """
    Return by what the slopes at the ends of a step bound the way down between them, a pair, s.

    A slope is g(0) p(t) + g(h) q(t), where p and q are those sums of both modes that are 1 at
    one end and 0 at the other. No time is farther than h/2 from an end.

    :return: h/2 times the largest p and q; None where the modes of A swing.
    """
    mean, half = (A[0, 0] + A[1, 1]) / 2, (A[0, 0] - A[1, 1]) / 2
    square = half**2 + A[0, 1] * A[1, 0]
    if not square > 0.0:
        return None
    high, low = mean + math.sqrt(square), mean - math.sqrt(square)
    return h / 2 * largest_share(-high, -low, h), h / 2 * largest_share(high, low, h)


def largest_share(high, low, h):
    """Return the largest (e^(high t) - e^(low t))/(e^(high h) - e^(low h)) for t in [0, h]."""
    def share(t):
        # over e^(high h), as the other may overflow
        return (math.exp(high * (t - h)) * math.expm1((low - high) * t)
                / math.expm1((low - high) * h))
    top = math.log(low / high) / (high - low) if low * high > 0.0 else h
    try:
        return max(1.0, share(top)) if 0.0 < top < h else 1.0
    except OverflowError:
        return math.inf


def exact_step(pattern, x, T):
    """Return x and its integral after a step, None where a sign may not hold all the way."""
    w, s = x
    T_3, T_1, T_2 = T
    if T_3 * pattern.input_sign < 0.0:
        return None
    (w_end, s_end), integral = held_torque.step(pattern.step, x, T)
    (A_ww, A_ws, B_w3, B_w1, B_w2), (A_sw, A_ss, B_s3, B_s1, B_s2) = pattern.slope
    b_w = B_w3 * T_3 + B_w1 * T_1 + B_w2 * T_2
    b_s = B_s3 * T_3 + B_s1 * T_1 + B_s2 * T_2
    v_w, v_s = A_ww * w + A_ws * s + b_w, A_sw * w + A_ss * s + b_s
    v_w_end = A_ww * w_end + A_ws * s_end + b_w
    v_s_end = A_sw * w_end + A_ss * s_end + b_s
    reach, reach_end = pattern.reach
    for c_w, c_s, c_3, c_1, c_2, least in pattern.kept:
        held = c_3 * T_3 + c_1 * T_1 + c_2 * T_2 - least
        f, f_end = c_w * w + c_s * s + held, c_w * w_end + c_s * s_end + held
        if f <= 0.0 or f_end <= 0.0:
            return None
        slope, slope_end = c_w * v_w + c_s * v_s, c_w * v_w_end + c_s * v_s_end
        if slope * slope_end < 0.0 and (
                (f if f < f_end else f_end) <= reach * abs(slope) + reach_end * abs(slope_end)):
            return None
    return (w_end, s_end), integral
