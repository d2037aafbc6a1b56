# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
What a solver step did with energy, read from its path: one meter for each mechanism.

``book(step, T)`` takes what a model's ``step`` returned and the torques, and returns the energies
of the step as one tuple, J: the work on each port, what was stored, what each element lost in the
order of ``losses``, and what the error of the step took. ``stored_energy(x)`` is the kinetic one.

All losses are linear in products of two of speed, moment and torque, and the moments in turn are
linear in speeds and torques but for the friction of clutches. So what a meter must know of a path
is its integral, its second moment, the integral of x x', and what friction does on it.
"""

from operator import add

import numpy as np

from dm_ros.mechanism import losses, self_locking, symmetric
from dm_ros.mechanism.clutched import evaluate
from dm_ros.mechanism.variants import SELF_LOCKING, SYMMETRIC
from dm_ros.motion.exponentials import held_propagator, way


def kinetic_form(inertias, shafts):
    """Return (m_11, m_12, m_22): kinetic energy is (m_11 x_1^2 + m_22 x_2^2)/2 + m_12 x_1 x_2."""
    m = shafts.T @ (np.array(inertias)[:, None] * shafts)
    return float(m[0, 0]), float(m[0, 1]), float(m[1, 1])


def kinetic_energy(m, x):
    """Return the kinetic energy at the speeds x, J."""
    m_11, m_12, m_22 = m
    x_1, x_2 = x
    return (m_11 * x_1 * x_1 + m_22 * x_2 * x_2) / 2 + m_12 * x_1 * x_2


def energy_gained(m, start, end):
    """Return the difference of the kinetic energies, J, exact also where it is small."""
    m_11, m_12, m_22 = m
    (x_1, x_2), (y_1, y_2) = start, end
    s_1, s_2 = y_1 + x_1, y_2 + x_2
    return ((y_1 - x_1) * (m_11 * s_1 + m_12 * s_2)
            + (y_2 - x_2) * (m_12 * s_1 + m_22 * s_2)) / 2


def pairs_of(n):
    """
    Return the matrices between the n^2 entries of z z' and the n (n + 1)/2 that differ.

    :return: ``spread`` (n^2, n (n + 1)/2), from those that differ to all, and ``pick``, back.
    """
    entries = [(i, j) for i in range(n) for j in range(n)]
    different = [(i, j) for i, j in entries if i <= j]
    spread = np.array([[tuple(sorted(entry)) == pair for pair in different] for entry in entries])
    pick = np.array([[entry == pair for entry in entries] for pair in different])
    return spread.astype(float), pick.astype(float)


def second_moment_of_the_way(A, h):
    """
    Return the matrix (3, 3) that gives the integral of q q' from d d', both as (11, 12, 22).

    q is the way from the start of a step of x' = A x + b, and d the whole of it: q' = A q + g with
    a constant g. So z = (q, g) and z z' obey linear equations.
    """
    spread, pick = pairs_of(4)
    K = np.zeros((4, 4))
    K[:2, :2], K[:2, 2:] = A, np.eye(2)
    both = pick @ (np.kron(K, np.eye(4)) + np.kron(np.eye(4), K)) @ spread
    _, _, integral, _ = held_propagator(both, np.zeros((10, 0)), h)
    _, reach, _, _ = held_propagator(A, np.eye(2), h)
    (a, b), (c, d) = np.linalg.inv(reach)   # g from d
    from_d = np.array([[a * a, 2 * a * b, b * b], [a * c, a * d + b * c, b * d],
                       [c * c, 2 * c * d, d * d]])
    return integral[np.ix_([0, 1, 4], [7, 8, 9])] @ from_d


class SymmetricMeter:
    """The books of a symmetric differential, exact: its path is that of a linear equation."""

    def __init__(self, model):
        p, self._h = model.parameters, model.h
        self._m = kinetic_form((p.I_0, p.I_1, p.I_2, p.I_3, p.n_s * p.I_s),
                               symmetric.kinematics(p))
        self._g_F, self._moments = p.g_F, model.moments
        self._losses = {d: losses.symmetric_losses(p, d) for d in model.responses}
        self._second = {d: tuple(second_moment_of_the_way(r.A, model.h).ravel().tolist())
                        for d, r in model.responses.items()}

    def stored_energy(self, x):
        """Return the kinetic energy at the speeds x, J."""
        return kinetic_energy(self._m, x)

    def book(self, step, T):
        """Return the energies of a step, see the module."""
        x, direction, end, (a_1, a_2), _, _, _ = step
        (x_1, x_2), (y_1, y_2), (T_3, T_1, T_2), h = x, end, T, self._h
        k_11, k_12, k_13, k_21, k_22, k_23, k_31, k_32, k_33 = self._second[direction]
        # the integral of x x'
        d_1, d_2 = y_1 - x_1, y_2 - x_2
        d_11, d_12, d_22 = d_1 * d_1, d_1 * d_2, d_2 * d_2
        b_1, b_2 = a_1 - h * x_1, a_2 - h * x_2
        X_11 = x_1 * (a_1 + b_1) + k_11 * d_11 + k_12 * d_12 + k_13 * d_22
        X_12 = x_1 * a_2 + x_2 * b_1 + k_21 * d_11 + k_22 * d_12 + k_23 * d_22
        X_22 = x_2 * (a_2 + b_2) + k_31 * d_11 + k_32 * d_12 + k_33 * d_22
        X_01, X_02, a_0 = (X_11 + X_12) / 2, (X_12 + X_22) / 2, (a_1 + a_2) / 2
        # of moments and speeds: M = P x + Q T, in one sign for both directions
        k = self._moments[direction]
        M_F = k.Q_F3 * T_3 + k.Q_F1 * T_1 + k.Q_F2 * T_2
        M_1 = k.Q_13 * T_3 + k.Q_11 * T_1 + k.Q_12 * T_2
        M_2 = k.Q_23 * T_3 + k.Q_21 * T_1 + k.Q_22 * T_2
        T_3_w3 = T_3 * self._g_F * a_0
        lost = losses.symmetric(
            self._losses[direction], (X_01 + X_02) / 2, (X_11 - X_22) / 2, X_11 + X_22 - 2 * X_12,
            direction * (k.P_F1 * X_01 + k.P_F2 * X_02 + M_F * a_0),
            direction * (k.P_11 * X_11 + k.P_12 * X_12 + M_1 * a_1),
            direction * (k.P_21 * X_12 + k.P_22 * X_22 + M_2 * a_2),
            direction * (k.P_11 * X_01 + k.P_12 * X_02 + M_1 * a_0),
            direction * (k.P_21 * X_01 + k.P_22 * X_02 + M_2 * a_0), T_3_w3)
        return T_3_w3, T_1 * a_1, T_2 * a_2, energy_gained(self._m, x, end), *lost, 0.0


def lobatto(pieces):
    """
    Return Lobatto's rule of five points on [0, 1] in pieces, each as long as all before it.

    What vanishes at 0 is integrated exactly to degree 7 in each piece.

    :return: ``(r, r^2, r^3, weight)`` of each node r in (0, 1), 1/2 first, and the weight at 1.
    """
    inner = (3 / 7)**0.5 / 2
    rule = ((0.0, 1 / 20), (0.5 - inner, 49 / 180), (0.5, 16 / 45), (0.5 + inner, 49 / 180),
            (1.0, 1 / 20))
    edges = [0.0] + [2.0**(n + 1 - pieces) for n in range(pieces)]
    weights = {0.5: 0.0}
    for begin, end in zip(edges, edges[1:]):
        for node, weight in rule:
            at = begin + (end - begin) * node
            weights[at] = weights.get(at, 0.0) + (end - begin) * weight
    del weights[0.0]
    last = weights.pop(1.0)
    return tuple((r, r**2, r**3, weight) for r, weight in weights.items()), last


class SelfLockingMeter:
    """
    The books of a self-locking differential, along the path of ``clutch.step``.

    In a part of that path the friction is its tangent at the start and a remainder, which is as
    small as what the step calls its error: Simpson's rule will do for it. The rest is linear, and
    known from the integral of the path, which is the angle that the simulation reports, and from
    its second moment. The path misses the equations by y' - f(y), which is another view on the
    remainder and on c; the work of it is what the error of the step takes.
    """

    RULES = (None, *(lobatto(pieces) for pieces in range(1, 41)))
    STIFF = 1.5   # time constants of the path that a piece may take
    CALM = 4e-6   # rad/s of c: with less, the remainder is some hundredth of the step's tolerance

    def __init__(self, model):
        p = model.parameters
        self._m = kinetic_form(
            (p.I_0, p.I_1, p.I_2, p.n_s * p.I_s),
            self_locking.kinematics(p) @ np.linalg.inv(self_locking.slip_coordinates(p)))
        self._coefficients = model.coefficients
        self._losses = {d: losses.self_locking_losses(p, d) for d in model.responses}

    def stored_energy(self, x):
        """Return the kinetic energy at the speeds x, J."""
        return kinetic_energy(self._m, x)

    def book(self, step, T):
        """Return the energies of a step, see the module."""
        x, direction, end, (a_w, a_s), _, _, (u, parts) = step
        T_0, T_1, T_2 = T
        k, q = self._coefficients[direction], self._losses[direction]
        first, *others = parts
        lost, numerical = self._part(k, q, u, T_0, first)
        for part in others:
            more, taken = self._part(k, q, u, T_0, part)
            lost = tuple(map(add, lost, more))
            numerical += taken
        return (T_0 * a_w, T_1 * (a_w + q.k_1 * a_s), T_2 * (a_w - q.k_2 * a_s),
                energy_gained(self._m, x, end), *lost, numerical)

    def _part(self, k, q, u, T_0, part):
        """Return what the elements lost in a part of the path, and what its error took."""
        (w, s), f, J, h, (d_w, d_s), (c_w, c_s), (a_w, a_s), straight, here, there = part
        J_ww, J_ws, J_sw, J_ss, F_1w, F_1s, F_2w, F_2s = J
        v_w, v_s, F_1, F_2, _, _, _, _, _, _ = here
        m_ww, m_ws, m_ss = self._m
        J_path = (0.0, 0.0, 0.0, 0.0) if straight else (J_ww, J_ws, J_sw, J_ss)
        stiff = h * (abs(J_path[0]) + abs(J_path[3]))
        pieces = 1
        while stiff > self.STIFF:
            stiff /= 2.0
            pieces += 1
        inner, end = self.RULES[min(pieces, len(self.RULES) - 1)]
        ways = way(J_path, f, h, inner)

        # moments over the path of the way y(t) - y: of two of it, and of it and powers of t/h
        w_r, s_r = d_w + c_w, d_s + c_s
        w_2, s_2 = end * w_r, end * s_r
        w_3, s_3, R_ww, R_ws, R_ss = w_2, s_2, w_2 * w_r, w_2 * s_r, s_2 * s_r
        for (_, r_2, r_3, weight), (w_q, s_q) in zip(inner, ways):
            w_q += c_w * r_3
            s_q += c_s * r_3
            a, b = weight * w_q, weight * s_q
            R_ww += a * w_q
            R_ws += a * s_q
            R_ss += b * s_q
            w_2 += a * r_2
            s_2 += b * r_2
            w_3 += a * r_3
            s_3 += b * r_3

        # y' - f(y) but for the remainder, with the momentum at the start and that of the way
        if straight:   # e + g t/h
            f_w, f_s = f
            e_w, e_s = f_w - v_w, f_s - v_s
            g_w, g_s = -h * (J_ww * f_w + J_ws * f_s), -h * (J_sw * f_w + J_ss * f_s)
            taken = ((m_ww * w + m_ws * s) * (e_w + g_w / 2)
                     + (m_ws * w + m_ss * s) * (e_s + g_s / 2)
                     + (m_ww * d_w + m_ws * d_s) * (e_w / 2 + g_w / 3)
                     + (m_ws * d_w + m_ss * d_s) * (e_s / 2 + g_s / 3))
        else:          # b (t/h)^2 - J c (t/h)^3
            b_w, b_s = 3 * c_w / h, 3 * c_s / h
            g_w, g_s = J_ww * c_w + J_ws * c_s, J_sw * c_w + J_ss * c_s
            w_2, s_2 = w_2 + w / 3, s_2 + s / 3
            w_3, s_3 = w_3 + w / 4, s_3 + s / 4
            taken = ((m_ww * w_2 + m_ws * s_2) * b_w + (m_ws * w_2 + m_ss * s_2) * b_s
                     - (m_ww * w_3 + m_ws * s_3) * g_w - (m_ws * w_3 + m_ss * s_3) * g_s)
        r_w, r_s = a_w - h * w, a_s - h * s
        V_ww, V_ws = r_w * w + h * R_ww, r_w * s + h * R_ws   # the integral of (y(t) - y) y(t)'
        V_sw, V_ss = r_s * w + h * R_ws, r_s * s + h * R_ss
        X_ww, X_ws, X_ss = w * a_w + V_ww, w * a_s + V_ws, s * a_s + V_ss

        # what friction has beside its tangent
        _, _, F_1r, F_2r, _, _, _, _, _, _ = there
        F_1r -= F_1 + F_1w * w_r + F_1s * s_r
        F_2r -= F_2 + F_2w * w_r + F_2s * s_r
        w_r += w
        s_r += s
        if abs(c_w) + abs(c_s) < self.CALM and not straight:   # it grows with (t/h)^2
            F_1r *= h / 3
            F_2r *= h / 3
            f_1w, f_1s, f_2w, f_2s = F_1r * w_r, F_1r * s_r, F_2r * w_r, F_2r * s_r
        else:   # by Simpson's rule
            (w_m, s_m), e, m = ways[0], h / 6, h * 2 / 3
            w_m, s_m = w_m + c_w / 8, s_m + c_s / 8
            _, _, F_1m, F_2m, _, _, _, _, _, _ = evaluate(k, u, w + w_m, s + s_m)
            F_1m, F_1r = m * (F_1m - F_1 - F_1w * w_m - F_1s * s_m), e * F_1r
            F_2m, F_2r = m * (F_2m - F_2 - F_2w * w_m - F_2s * s_m), e * F_2r
            w_m += w
            s_m += s
            f_1w, f_1s = F_1m * w_m + F_1r * w_r, F_1m * s_m + F_1r * s_r
            f_2w, f_2s = F_2m * w_m + F_2r * w_r, F_2m * s_m + F_2r * s_r
        taken = h * taken + (
            m_ww * (k.C_w1 * f_1w + k.C_w2 * f_2w) + m_ss * (k.C_s1 * f_1s + k.C_s2 * f_2s)
            + m_ws * (k.C_w1 * f_1s + k.C_w2 * f_2s + k.C_s1 * f_1w + k.C_s2 * f_2w))

        F_1_w = F_1 * a_w + F_1w * V_ww + F_1s * V_sw + f_1w
        F_1_s = F_1 * a_s + F_1w * V_ws + F_1s * V_ss + f_1s
        F_2_w = F_2 * a_w + F_2w * V_ww + F_2s * V_sw + f_2w
        F_2_s = F_2 * a_s + F_2w * V_ws + F_2s * V_ss + f_2s
        _, _, m_1, m_2, _, _ = u
        return losses.self_locking(
            q, X_ww, X_ws, X_ss, F_1_w, F_1_s, F_2_w, F_2_s,
            m_1 * a_w + k.P_1w * X_ww + k.P_1s * X_ws - k.W_11 * F_1_w - k.W_12 * F_2_w,
            m_1 * a_s + k.P_1w * X_ws + k.P_1s * X_ss - k.W_11 * F_1_s - k.W_12 * F_2_s,
            m_2 * a_w + k.P_2w * X_ww + k.P_2s * X_ws - k.W_21 * F_1_w - k.W_22 * F_2_w,
            m_2 * a_s + k.P_2w * X_ws + k.P_2s * X_ss - k.W_21 * F_1_s - k.W_22 * F_2_s,
            T_0 * a_w), -taken


METERS = {SYMMETRIC.name: SymmetricMeter, SELF_LOCKING.name: SelfLockingMeter}


def meter_of(mechanism, model):
    """Return the meter that reads what a model of a mechanism did."""
    return METERS[mechanism.name](model)
