# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The losses of a solver step, one meter for each mechanism; ``energy`` makes books of them.

A meter has the names of its ``gears``, ``bearings`` and ``clutches``, the ``inertias`` of the
shafts, and a ``step`` that does what that of the model does and returns the losses with it.
"""

import numpy as np

from dm_ros.mechanism import self_locking, symmetric
from dm_ros.mechanism.power_flow import DIRECT
from dm_ros.motion.models import responses_of
from dm_ros.motion.steppers import apply_phi_2, held_torque_propagator

AT_REST = 1e-6   # of the stored energy: with less turned over, its rounding is all there is


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


SPREAD, PICK = pairs_of(5)


class SymmetricMeter:
    """The books of a symmetric differential, exact: z = (omega_1, omega_2, T_3, T_1, T_2)."""

    gears, bearings, clutches = symmetric.MOMENTS, ('pinion_bearing', 'carrier_bearing'), ()

    def __init__(self, formulation, p, h):
        self.inertias = p.I_0, p.I_1, p.I_2, p.I_3, p.n_s * p.I_s
        # of each direction the (6, 5, 5) quadratic forms of the losses over h
        self._forms = {direction: self._integrals(p, response, direction, h) for
                       direction, response in responses_of(formulation(p)).items()}

    def _integrals(self, p, response, direction, h):
        # z' = K z, so z z' grows with K on both sides: its integral is a matrix exponential too
        K = np.zeros((5, 5))
        K[:2] = np.hstack([response.A, response.B[:, [2, 0, 1]]])
        both = PICK @ (np.kron(K, np.eye(5)) + np.kron(np.eye(5), K)) @ SPREAD
        _, _, integral, _ = held_torque_propagator(both, np.zeros((15, 0)), h)
        powers = np.array(self._powers(p, response, direction)).reshape(-1, 25)
        forms = (powers @ SPREAD @ integral @ PICK).reshape(-1, 5, 5)
        return (forms + forms.transpose(0, 2, 1)) / 2

    def _powers(self, p, response, direction):
        """Return the lost powers as matrices, z' matrix z, W."""
        w_0, w_1, w_2, w_3, w_s = np.hstack([symmetric.kinematics(p), np.zeros((5, 3))])
        L_0, L_1, L_2, L_3, _ = np.hstack([symmetric.SymmetricOde(p).viscous(),
                                           np.zeros((5, 3))])
        M_F, M_1, M_2 = np.hstack([response.P, response.Q[:, [2, 0, 1]]])
        T_3 = np.eye(5)[2]
        viscous = sum(l_k * np.outer(w, w) for l_k, w in (
            (p.l_0, w_0), (p.l_1, w_1 - w_0), (p.l_2, w_2 - w_0), (p.l_3, w_3),
            (p.n_s * p.l_s, w_s)))
        if direction == DIRECT:   # what (40) takes from the moments
            on_pinion, on_carrier = M_F / p.g_F + L_3, M_1 + M_2 + L_0 - L_1 - L_2
        else:                     # (38)-(39), (52)
            on_pinion, on_carrier = L_3 - T_3, M_F + L_0 - L_1 - L_2
        return (viscous, (1 - p.eta_FG) * np.outer(M_F, w_0), (1 - p.eta_1G) * np.outer(M_1, w_1),
                (1 - p.eta_2G) * np.outer(M_2, w_2), (1 / p.eta_3B - 1) * np.outer(on_pinion, w_3),
                (1 / p.eta_0B - 1) * np.outer(on_carrier, w_0))

    def step(self, model, x, memory, torque, direction):
        """Return what ``model.step`` does and [viscous, gears, bearings, clutches, numerical]."""
        z = np.array((*x, *torque))
        losses = (self._forms[direction] @ z @ z).tolist()
        losses.append(0.0)
        return model.step(x, memory, torque, direction), losses


def gauss_kronrod_nodes():
    """
    Return (node, weight, weight of Gauss's rule) of the Gauss-Kronrod rule (3, 7) on [0, 1].

    Kronrod's rule on all seven nodes is exact to degree 11, Gauss's on three of them to 5.
    """
    half = ((0.96049126870802028342, 0.10465622602646726519, 0.0),
            (0.77459666924148337704, 0.26848808986833344073, 5 / 9),
            (0.43424374934680255800, 0.40139741477596222291, 0.0))
    middle = (0.0, 0.45091653865847414235, 8 / 9)
    both = [(-x, *weights) for x, *weights in half] + [middle] + list(half[::-1])
    return tuple(((1 + x) / 2, kronrod / 2, gauss / 2) for x, kronrod, gauss in both)


class SelfLockingMeter:
    """
    The books of a self-locking differential, along the path of ``ClutchStep``.

    Within a part of length h that path is y + t phi_1(t J) f + c (t/h)^3: its ends are those of
    the part, its integral is the angle that the simulation reports, and it misses the equations
    by y' - f(y), whose work is ``numerical``. The losses are integrated by Kronrod's rule of seven
    points, that work by Gauss's rule on three of them. A piece of a part is divided near its
    start, where a stiff clutch settles, until the first rule finds the known change of kinetic
    energy and both rules agree on the numerical work.
    """

    gears, bearings = self_locking.MOMENTS[:2], ('carrier_bearing',)
    clutches = self_locking.MOMENTS[2:]

    TOLERANCE = 1e-10   # of the energy turned over in a step
    MOST_PIECES = 40
    FIRST = 0.35        # of a piece that is divided
    NODES = gauss_kronrod_nodes()

    def __init__(self, formulation, p, h):
        self._h = h
        k_1, k_2 = p.g_12 / (1 + p.g_12), 1 / (1 + p.g_12)
        G = self_locking.kinematics(p) @ np.linalg.inv(self_locking.slip_coordinates(p))
        self.inertias = p.I_0, p.I_1, p.I_2, p.n_s * p.I_s
        inertia = G.T @ (np.array(self.inertias)[:, None] * G)
        slip_drag = p.l_1 * k_1**2 + p.l_2 * k_2**2 + p.n_s * p.l_s * (k_2 / p.g_2s)**2
        self._constants = tuple(map(float, (
            k_1, k_2, inertia[0, 0], inertia[0, 1], inertia[1, 1], p.l_0, slip_drag,
            p.l_1 * k_1 - p.l_2 * k_2, 1 - p.eta_1G, 1 - p.eta_2G, 1 / p.eta_0B - 1)))

    def step(self, model, x, memory, torque, direction):
        """Return what ``model.step`` does and [viscous, gears, bearings, clutches, numerical]."""
        parts = []
        result = model.step(x, memory, torque, direction, parts)
        losses = [0.0] * 7
        m_ww, m_ss = self._constants[2], self._constants[4]
        (w, s), (w_end, s_end) = x, result[0]
        fast, slip = max(abs(w), abs(w_end)), max(abs(s), abs(s_end))
        turned_over = (
            self._h * (abs(torque[0]) * fast + (abs(torque[1]) + abs(torque[2])) * (fast + slip))
            + AT_REST * (m_ww * fast * fast + m_ss * slip * slip))
        for part in parts:
            self._add(part, torque, direction, self.TOLERANCE * turned_over / len(parts), losses)
        return result, losses

    def _add(self, part, torque, direction, allowed, losses):
        """Add the losses in a part to the sums, each piece within the allowed error, J."""
        k_1, k_2, m_ww, m_ws, m_ss, l_w, l_s, l_ws, lost_1, lost_2, lost_0 = self._constants
        slope, w_0, s_0, (f_w, f_s), (J_ww, J_ws, J_sw, J_ss), h, c_w, c_s = part
        T_0, direct = torque[0], direction == DIRECT

        def path(t):
            """Return y and y' at the time t."""
            v_w, v_s = apply_phi_2(t * J_ww, t * J_ws, t * J_sw, t * J_ss, f_w, f_s)
            d_w = t * (f_w + t * (J_ww * v_w + J_ws * v_s))
            d_s = t * (f_s + t * (J_sw * v_w + J_ss * v_s))
            r = t / h
            r_2 = r * r
            return (w_0 + d_w + c_w * r * r_2, s_0 + d_s + c_s * r * r_2,
                    f_w + J_ww * d_w + J_ws * d_s + 3 * c_w * r_2 / h,
                    f_s + J_sw * d_w + J_ss * d_s + 3 * c_s * r_2 / h)

        begin, w, s, pieces = 0.0, w_0, s_0, 1
        w_end, s_end, *_ = path(h)
        todo = [(h, w_end, s_end)]
        while todo:
            end, w_end, s_end = todo[-1]
            length = end - begin
            viscous = front = rear = bearing = clutch_1 = clutch_2 = 0.0
            gained = error_7 = error_3 = 0.0
            for node, weight, other in self.NODES:
                w_t, s_t, rate_w, rate_s = path(begin + node * length)
                f = slope(w_t, s_t)
                F_1, F_2, M_1, M_2 = f[2:6]
                # (59) or (60): what the carrier bearing carries
                on_carrier = l_w * w_t - l_ws * s_t - F_1 - F_2 + (M_1 + M_2 if direct else -T_0)
                viscous += weight * (l_w * w_t * w_t + l_s * s_t * s_t)
                front += weight * M_1 * (w_t + k_1 * s_t)
                rear += weight * M_2 * (w_t - k_2 * s_t)
                bearing += weight * on_carrier * w_t
                clutch_1 += weight * F_1 * s_t
                clutch_2 -= weight * F_2 * s_t
                p_w, p_s = m_ww * w_t + m_ws * s_t, m_ws * w_t + m_ss * s_t
                gained += weight * (p_w * rate_w + p_s * rate_s)
                error = p_w * (rate_w - f[0]) + p_s * (rate_s - f[1])
                error_7 += weight * error
                error_3 += other * error
            known = ((w_end - w) * (m_ww * (w_end + w) + m_ws * (s_end + s))
                     + (s_end - s) * (m_ws * (w_end + w) + m_ss * (s_end + s))) / 2
            off = abs(length * gained - known) + length * abs(error_7 - error_3)
            if off > allowed and pieces < self.MOST_PIECES:
                middle = begin + self.FIRST * length
                todo.append((middle, *path(middle)[:2]))
                pieces += 1
                continue
            for i, loss in enumerate((viscous, lost_1 * front, lost_2 * rear, lost_0 * bearing,
                                      k_1 * clutch_1, k_2 * clutch_2, -error_3)):
                losses[i] += length * loss
            begin, w, s = todo.pop()


METERS = {'symmetric': SymmetricMeter, 'lsd': SelfLockingMeter}
