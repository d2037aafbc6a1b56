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

from dm_ros.mechanism import passive
from dm_ros.mechanism.losses import SymmetricLosses
from dm_ros.mechanism.symmetric import Moments
from dm_ros.motion import held_torque
from dm_ros.motion.adaptive import FASTEST
from dm_ros.motion.held_torque import Exact, held_torque_step_by_floats
from dm_ros.motion.quadrature import second_moment_of_the_way

MARGIN = 1e-9   # N m from turning round, within which no pattern is taken


class Pattern(NamedTuple):
    """What is linear while the signs are these; x is (w, s), T is (T_3, T_1, T_2)."""

    exact: Exact
    slope: tuple        # rows (w, s, T_3, T_1, T_2) of dw/dt and ds/dt
    kept: tuple         # rows (w, s, T_3, T_1, T_2, least) of what must stay above 0
    input_sign: float   # of T_3
    reach: tuple        # s, times the slopes at both ends: how far f can come down


class Patterns:
    """The patterns of one set of parameters and one step length, under the passive law."""

    def __init__(self, k, h):
        self._k, self._h = k, h
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
        input_sign = 1.0 if u[0] >= 0.0 else -1.0
        key = (*sigmas, *signs, input_sign)
        if key not in self._kept:
            try:
                self._kept[key] = pattern(self._k, self._h, point, input_sign)
            except (ArithmeticError, ValueError):
                self._kept[key] = None
        return self._kept[key]


def pattern(k, h, point, input_sign):
    """
    Return the ``Pattern`` of the signs at a point, None where its step is not exact.

    :raises ArithmeticError, ValueError: where its numbers leave the range of floating point.
    """
    _, _, _, _, _, _, _, (s_1, s_2, s_F, h_N, b), state, solved = point
    _, _, sigma_0, sigma_1, sigma_2, _, _ = state
    n_1, n_2, p_1, p_2, m_1, m_2, *_ = solved
    u = input_sign, 0.0, 0.0, 0.0, 0.0
    (J_ww, J_ws, J_sw, J_ss), _ = passive.jacobian(k, u, point)
    A = J_ww + 0.0, J_ws + 0.0, J_sw + 0.0, J_ss + 0.0   # no -0.0
    B_w, B_s = passive.torque_slopes(k, u, point)
    e_w, e_s = (A[0], A[1], *B_w), (A[2], A[3], *B_s)
    # the moments, as in ``passive.solve``
    n_F, c_F = k.mean_F + k.half_F * sigma_0 * s_F, k.mean_F - k.half_F * sigma_0 * s_F
    drives, brakes = float(sigma_0 * s_F > 0.0), float(sigma_0 * s_F < 0.0)
    input_brakes = float(sigma_0 * k.g_F * input_sign < 0.0)
    per_torque = k.g_F / ((1 + k.bearing_3 * drives) * n_F)
    q_1, q_2 = k.l_1 * k.k_1 / p_1, -k.l_2 * k.k_2 / p_2
    M_1 = row(m_1, e_w, m_1 * k.k_1, e_s, (0.0, q_1, 0.0, -1 / p_1, 0.0))
    M_2 = row(m_2, e_w, -m_2 * k.k_2, e_s, (0.0, q_2, 0.0, 0.0, -1 / p_2))
    M_F = row(-per_torque * k.I_3 * k.g_F, e_w, 0.0, e_s,
              (-per_torque * (1 + k.bearing_3) * k.l_3 * k.g_F, 0.0,
               per_torque * (1 + k.bearing_3 * input_brakes), 0.0, 0.0))
    N = row(n_1, M_1, n_2, M_2, (0.0,) * 5)
    drag = k.l_0, -k.l_1 * k.k_1 + k.l_2 * k.k_2, 0.0, 0.0, 0.0
    bracket = row(h_N, N, -brakes * c_F, M_F, drag)
    kept = [(sigma_0, 0.0), (sigma_1, sigma_1 * k.k_1), (sigma_2, -sigma_2 * k.k_2)]
    fast = passive.SATURATED * k.sign_speed
    kept = [(*speed, 0.0, 0.0, 0.0, fast) for speed in kept]
    for sign, moment in ((s_F, M_F), (s_1, M_1), (s_2, M_2), ((2 * h_N - 1) * sigma_0, N),
                         ((2 * b - 1) * sigma_0, bracket)):
        kept.append((*[sign * entry for entry in moment], MARGIN))
    reach = reach_of_slopes(A, h)
    numbers = [entry for entries in (*kept, e_w, e_s) for entry in entries]
    if not (all(map(math.isfinite, numbers)) and reach):
        return None
    bearing_3, bearing_0, g_3 = k.bearing_3, k.bearing_0 * b, k.l_3 * k.g_F * k.g_F
    losses = SymmetricLosses(
        k.l_0 + g_3, k.l_1 * k.k_1 * k.k_1 + k.l_2 * k.k_2 * k.k_2 + k.l_s * k.k_2, g_3, k.l_0,
        k.l_1 * k.k_1 - k.l_2 * k.k_2,
        2 * k.half_F * s_F * sigma_0, 2 * k.half_1 * s_1 * sigma_1, 2 * k.half_2 * s_2 * sigma_2,
        bearing_3 * drives * n_F, -bearing_3 * input_brakes, bearing_3,
        bearing_0 * h_N * n_1, bearing_0 * h_N * n_2, -bearing_0 * brakes * c_F, bearing_0)
    exact = Exact(held_torque_step_by_floats(A, (B_w, B_s), h), Moments(*M_F, *M_1, *M_2), losses,
                  second_moment_of_the_way(A, h))
    return Pattern(exact, (e_w, e_s), tuple(kept), input_sign, reach)


def row(a, x, b, y, z):
    """Return a x + b y + z of rows."""
    return tuple([a * p + b * q + r for p, q, r in zip(x, y, z)])


def reach_of_slopes(A, h):
    """
    Return by what the slopes at the ends of a step bound the way down between them, a pair, s.

    A slope is g(0) p(t) + g(h) q(t), where p and q are those sums of both modes that are 1 at
    one end and 0 at the other. No time is farther than h/2 from an end.

    :param A: (11, 12, 21, 22).
    :return: h/2 times the largest p and q; None where the modes of A swing.
    """
    A_11, A_12, A_21, A_22 = A
    mean, half = (A_11 + A_22) / 2, (A_11 - A_22) / 2
    square = half * half + A_12 * A_21
    if not square > 0.0:
        return None
    root = math.sqrt(square)
    high, low = mean + root, mean - root
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
    (w_end, s_end), integral = held_torque.step(pattern.exact.step, x, T)
    (A_ww, A_ws, B_w3, B_w1, B_w2), (A_sw, A_ss, B_s3, B_s1, B_s2) = pattern.slope
    b_w = B_w3 * T_3 + B_w1 * T_1 + B_w2 * T_2
    b_s = B_s3 * T_3 + B_s1 * T_1 + B_s2 * T_2
    v_w, v_s = A_ww * w + A_ws * s + b_w, A_sw * w + A_ss * s + b_s
    if not abs(v_w) + abs(v_s) < FASTEST:
        return None
    v_w_end = A_ww * w_end + A_ws * s_end + b_w
    v_s_end = A_sw * w_end + A_ss * s_end + b_s
    reach, reach_end = pattern.reach
    for c_w, c_s, c_3, c_1, c_2, least in pattern.kept:
        held = c_3 * T_3 + c_1 * T_1 + c_2 * T_2 - least
        f, f_end = c_w * w + c_s * s + held, c_w * w_end + c_s * s_end + held
        if not (f > 0.0 and f_end > 0.0):   # nor are they numbers, beyond their range
            return None
        slope, slope_end = c_w * v_w + c_s * v_s, c_w * v_w_end + c_s * v_s_end
        if slope * slope_end < 0.0 and (
                (f if f < f_end else f_end) <= reach * abs(slope) + reach_end * abs(slope_end)):
            return None
    return (w_end, s_end), integral
