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

from operator import add, mul

from dm_ros.mechanism import losses, passive
from dm_ros.mechanism.clutched import evaluate
from dm_ros.mechanism.kinetic import energy_gained, kinetic_energy
from dm_ros.motion.exponentials import way
from dm_ros.motion.held_torque import Exact
from dm_ros.motion.models import (
    ClutchedModel,
    ClutchedSymmetricModel,
    PassiveModel,
    PassiveSymmetricModel,
    SymmetricModel,
)
from dm_ros.motion.quadrature import rule_for


def leads_far(w, s, d_w, d_s):
    """Return whether speeds change by more than a small part of them."""
    return abs(d_w) + abs(d_s) > 0.05 * (abs(w) + abs(s))


def exact_book(exact, m, g_F, h, start, end, integral, T):
    """
    Return the energies of an exact step of a symmetric differential, see the module.

    :param m: the form of the kinetic energy.
    """
    (w, s), (w_end, s_end), (a_w, a_s), (T_3, T_1, T_2) = start, end, integral, T
    _, k, q, (k_11, k_12, k_13, k_21, k_22, k_23, k_31, k_32, k_33) = exact
    # the integral of x x'
    d_w, d_s = w_end - w, s_end - s
    d_ww, d_ws, d_ss = d_w * d_w, d_w * d_s, d_s * d_s
    b_w, b_s = a_w - h * w, a_s - h * s
    X_ww = w * (a_w + b_w) + k_11 * d_ww + k_12 * d_ws + k_13 * d_ss
    X_ws = w * a_s + s * b_w + k_21 * d_ww + k_22 * d_ws + k_23 * d_ss
    X_ss = s * (a_s + b_s) + k_31 * d_ww + k_32 * d_ws + k_33 * d_ss
    # of moments and speeds: M = P x + Q T
    M_F = k.Q_F3 * T_3 + k.Q_F1 * T_1 + k.Q_F2 * T_2
    M_1 = k.Q_13 * T_3 + k.Q_11 * T_1 + k.Q_12 * T_2
    M_2 = k.Q_23 * T_3 + k.Q_21 * T_1 + k.Q_22 * T_2
    M_1_w, M_2_w = (k.P_11 * X_ww + k.P_12 * X_ws + M_1 * a_w,
                    k.P_21 * X_ww + k.P_22 * X_ws + M_2 * a_w)
    T_3_w3 = T_3 * g_F * a_w
    lost = losses.symmetric(
        q, X_ww, X_ws, X_ss, k.P_F1 * X_ww + k.P_F2 * X_ws + M_F * a_w,
        M_1_w + (k.P_11 * X_ws + k.P_12 * X_ss + M_1 * a_s) / 2,
        M_2_w - (k.P_21 * X_ws + k.P_22 * X_ss + M_2 * a_s) / 2, M_1_w, M_2_w, T_3_w3)
    return (T_3_w3, T_1 * (a_w + a_s / 2), T_2 * (a_w - a_s / 2), energy_gained(m, start, end),
            *lost, 0.0)


class Meter:
    """What all meters have in common: what the model tells them."""

    def __init__(self, model):
        self._model, self.form = model, model.form

    def stored_energy(self, x):
        """Return the kinetic energy at the speeds x, J."""
        return kinetic_energy(self.form, x)

    def angles(self, integral):
        """Return the angles of the shafts with a port from the integral of x, rad."""
        return self._model.at_ports(integral)


class ExactMeter(Meter):
    """The books of a symmetric differential under the paper's law, exact."""

    def book(self, step, T):
        """Return the energies of a step, see the module."""
        x, _, end, integral, _, _, exact = step
        return exact_book(exact, self.form, self._model.g_F, self._model.h, x, end, integral, T)


class ClutchedMeter(Meter):
    """
    The books of a self-locking differential under the paper's law, along an adaptive step.

    In a part of that path the friction is its tangent at the start and a remainder, which is as
    small as what the step calls its error: Simpson's rule will do for it. The rest is linear, and
    known from the integral of the path, which is the angle that the simulation reports, and from
    its second moment. The path misses the equations by y' - f(y), which is another view on the
    remainder and on c; the work of it is what the error of the step takes.
    """

    CALM = 4e-6   # rad/s of c: with less, the remainder is some hundredth of the step's tolerance

    def lost_powers(self, direction, T, y, u, point):
        """Return the power that each element loses at a ``point``, W."""
        (w, s), (_, _, F_1, F_2, M_1, M_2, *_) = y, point
        return self._lost(direction, T, w, w * w, w * s, s * s, F_1 * w, F_1 * s, F_2 * w, F_2 * s,
                          M_1 * w, M_1 * s, M_2 * w, M_2 * s)

    def book(self, step, T):
        """Return the energies of a step, see the module."""
        x, direction, end, integral, _, _, (u, (first, *others)) = step
        lost, numerical = self._part(direction, u, T, first)
        for part in others:
            more, taken = self._part(direction, u, T, part)
            lost, numerical = tuple(map(add, lost, more)), numerical + taken
        work = map(mul, T, self.angles(integral))
        return *work, energy_gained(self.form, x, end), *lost, numerical

    def _part(self, direction, u, T, part):
        """Return what the elements lost in a part of the path, and what its error took."""
        k = self._model.coefficients[direction]
        (w, s), f, J, F, h, (d_w, d_s), (c_w, c_s), (a_w, a_s), straight, here, there = part
        (J_ww, J_ws, J_sw, J_ss), (F_1w, F_1s, F_2w, F_2s) = J, F
        v_w, v_s, F_1, F_2, _, _, _, _, _, _ = here
        m_ww, m_ws, m_ss = self.form
        J_path = (0.0, 0.0, 0.0, 0.0) if straight else (J_ww, J_ws, J_sw, J_ss)
        # the way vanishes at the start
        inner, _, end = rule_for(J_path, h, leads_far(w, s, d_w, d_s))
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
        return self._lost(
            direction, T, a_w, X_ww, X_ws, X_ss, F_1_w, F_1_s, F_2_w, F_2_s,
            m_1 * a_w + k.P_1w * X_ww + k.P_1s * X_ws - k.W_11 * F_1_w - k.W_12 * F_2_w,
            m_1 * a_s + k.P_1w * X_ws + k.P_1s * X_ss - k.W_11 * F_1_s - k.W_12 * F_2_s,
            m_2 * a_w + k.P_2w * X_ww + k.P_2s * X_ws - k.W_21 * F_1_w - k.W_22 * F_2_w,
            m_2 * a_s + k.P_2w * X_ws + k.P_2s * X_ss - k.W_21 * F_1_s - k.W_22 * F_2_s), -taken

    def _lost(self, direction, T, a_w, *products):
        """Return what the elements lose, from products as ``losses`` has them."""
        return losses.self_locking(self._model.losses[direction], *products, T[0] * a_w)


class ClutchedSymmetricMeter(ClutchedMeter):
    """The books of a symmetric differential with clutches under the paper's law."""

    def _lost(self, direction, T, a_w, X_ww, X_ws, X_ss, F_1_w, F_1_s, F_2_w, F_2_s, *meshes):
        k, (T_3, T_1, T_2) = self._model.final_drives[direction], T
        M_F_w = ((k.Q_0 * T_3 + k.Q_1 * T_1 + k.Q_2 * T_2) * a_w + k.P_w * X_ww + k.P_s * X_ws
                 - k.W_1 * F_1_w - k.W_2 * F_2_w)
        return losses.symmetric_with_clutches(
            self._model.losses[direction], X_ww, X_ws, X_ss, F_1_w, F_1_s, F_2_w, F_2_s, M_F_w,
            *meshes, T_3 * self._model.g_F * a_w)


class PassiveMeter(Meter):
    """
    The books of a differential under the passive law: no loss in them is ever negative.

    An exact step is linear. Along the parts of an adaptive one the lost powers are integrated as
    they are, and so is the work of y' - f(y), which is what the error of the step takes. The
    last resort has all losses at its end; what it takes beside them is the energy of its jump.
    """

    def book(self, step, T):
        """Return the energies of a step, see the module."""
        x, _, end, integral, _, _, path = step
        if type(path) is Exact:
            return exact_book(path, self.form, self._model.g_F, self._model.h, x, end, integral, T)
        u, (first, *others) = path
        lost, numerical = self._part(u, first)
        for part in others:
            more, taken = self._part(u, part)
            lost, numerical = tuple(map(add, lost, more)), numerical + taken
        work = map(mul, T, self.angles(integral))
        return *work, energy_gained(self.form, x, end), *self._of_elements(lost), numerical

    def lost_powers(self, flow, T, y, u, point):
        """Return the power that each element loses at a ``point``, W."""
        return self._of_elements(passive.lost_powers(self._model.k, u, point))

    def _of_elements(self, lost):
        """Return what the elements lose that there are, of those that ``passive`` knows."""
        drag, final_drive, mesh_1, mesh_2, bearing_3, bearing_0, *clutches = lost
        own = ((drag, final_drive, mesh_1, mesh_2, bearing_3, bearing_0) if self._model.g_F
               else (drag, mesh_1, mesh_2, bearing_0))
        return (*own, *clutches) if self._model.clutches else own

    def _part(self, u, part):
        """Return what the elements lost in a part of the path, and what its error took."""
        k, (m_ww, m_ws, m_ss) = self._model.k, self.form
        (w_0, s_0), f, J, _, h, (d_w, d_s), (c_w, c_s), _, straight, here, there = part
        if straight:
            jump = kinetic_energy(self.form, (d_w, d_s))
            return tuple([h * loss for loss in passive.lost_powers(k, u, there)]), jump
        (f_w, f_s), (J_ww, J_ws, J_sw, J_ss) = f, J
        inner, begin, end = rule_for(J, h, leads_far(w_0, s_0, d_w, d_s))
        w, s = w_0 + d_w + c_w, s_0 + d_s + c_s
        # at the start the path obeys the equations
        error_w = f_w + J_ww * d_w + J_ws * d_s + 3 * c_w / h - there[0]
        error_s = f_s + J_sw * d_w + J_ss * d_s + 3 * c_s / h - there[1]
        taken = end * ((m_ww * w + m_ws * s) * error_w + (m_ws * w + m_ss * s) * error_s)
        lost = [begin * a + end * b for a, b in zip(passive.lost_powers(k, u, here),
                                                    passive.lost_powers(k, u, there))]
        for (_, r_2, r_3, weight), (q_w, q_s) in zip(inner, way(J, f, h, inner)):
            w, s = w_0 + q_w + c_w * r_3, s_0 + q_s + c_s * r_3
            point = passive.evaluate(k, u, w, s)
            error_w = f_w + J_ww * q_w + J_ws * q_s + 3 * c_w * r_2 / h - point[0]
            error_s = f_s + J_sw * q_w + J_ss * q_s + 3 * c_s * r_2 / h - point[1]
            taken += weight * ((m_ww * w + m_ws * s) * error_w + (m_ws * w + m_ss * s) * error_s)
            lost = [a + weight * b for a, b in zip(lost, passive.lost_powers(k, u, point))]
        return tuple([h * loss for loss in lost]), -h * taken


METERS = {SymmetricModel: ExactMeter, ClutchedModel: ClutchedMeter,
          ClutchedSymmetricModel: ClutchedSymmetricMeter, PassiveModel: PassiveMeter,
          PassiveSymmetricModel: PassiveMeter}


def meter_of(model):
    """Return the meter that reads what a model did."""
    return METERS[type(model)](model)
