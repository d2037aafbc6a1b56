# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The motion of a differential with clutches, as functions of plain floats.

In y = (w, s), the carrier speed omega_0 and the slip omega_1 - omega_2, under held torques T::

    dy/dt = A y + B T - C F
    M     = P y + Q T - W F
    F_k   = tanh(a_k s) (phi_k |M_k| + S_k)       (56), (58): phi_k = tan(alpha) f_k at full slip
    M_F   = P_F y + Q_F T - W_F F                 of the final drive, where there is one

While a shaft drives the mechanism phi_k is that times the coast factor of its clutch; S_k, of the
preload and the actuator, has none. M is in the sign of the paper, whose shaft drives where the
direction and M differ in sign.

``Coefficients`` has the matrices as numbers for one direction of power flow, ``held`` turns the
inputs of a step into what of them is constant, and the rest follows from both and the state. A
``point`` is all that is known of one state, a tuple in this order::

    (dw/dt, ds/dt, F_1, F_2, M_1, M_2, t_1, t_2, x_1, x_2)

with t_k = tanh(a_k s) and x_k = dF_k/dM_k = t_k phi_k sgn(M_k).
"""

from dataclasses import dataclass
from math import tan, tanh
from typing import NamedTuple

import numpy as np

from dm_ros.mechanism.power_flow import DIRECT


class LinearResponse(NamedTuple):
    """Accelerations and internal moments, linear in speeds, torques and clutch moments."""

    A: np.ndarray   # (2, 2)
    B: np.ndarray   # (2, ports)
    C: np.ndarray   # (2, 2)
    P: np.ndarray   # (moments, 2), those of the meshes with the outputs last
    Q: np.ndarray   # (moments, ports)
    W: np.ndarray   # (moments, 2)


def slip_steepness(p):
    """Return (a_1, a_2), s/rad: f_k grows with tanh(a_k (omega_1 - omega_2)), (58)."""
    return p.c_f1 * p.g_12 / (1 + p.g_12), -p.c_f2 / (1 + p.g_12)


def full_friction(p):
    """Return tan(alpha) f_k and the preload friction f_k n_s N_k R_k at full slip, (56)."""
    (f_1, f_2), tangent = p.f, tan(p.alpha)
    return ((f_1 * tangent, f_2 * tangent),
            (f_1 * p.n_s * p.N_1 * p.R_1, f_2 * p.n_s * p.N_2 * p.R_2))


def proportional_friction(p):
    """Return phi of both clutches while the mechanism drives the shafts, and while they drive."""
    phi_1, phi_2 = full_friction(p)[0]
    return (phi_1, phi_2), (phi_1 * p.c_1, phi_2 * p.c_2)


def pressing(p, M_1, M_2):
    """Return ``|M_k|``, less the coast factor where the shaft drives; M as it is reported."""
    return (M_1 if M_1 >= 0.0 else -M_1 * p.c_1), (M_2 if M_2 >= 0.0 else -M_2 * p.c_2)


def actuated(p, preload, forces):
    """Return the friction at full slip of preload and axial forces, (2,), N m."""
    (f_1, f_2), (S_1, S_2), (A_1, A_2) = p.f, preload, forces
    return S_1 + f_1 * A_1 * p.R_1, S_2 + f_2 * A_2 * p.R_2


def held_friction(p, lagged, preload, memory, forces):
    """
    Return the friction at full slip that does not follow M in a step, (2,), N m.

    :param lagged: None, or phi of variant 1: with ``|M|`` of the preceding step, the memory, the
        whole friction is of that kind.
    :param preload: its friction, N m; forces: of the actuators, N.
    """
    S = actuated(p, preload, forces) if any(forces) else preload
    if lagged is None:
        return S
    (phi_1, phi_2), (M_1, M_2), (S_1, S_2) = lagged, memory, S
    return phi_1 * M_1 + S_1, phi_2 * M_2 + S_2


@dataclass(frozen=True, slots=True)
class Coefficients:
    """What does not change while parameters, direction and step length stay."""

    A_ww: float   # of dy/dt
    A_ws: float
    A_sw: float
    A_ss: float
    C_w1: float
    C_w2: float
    C_s1: float
    C_s2: float
    P_1w: float   # of M
    P_1s: float
    P_2w: float
    P_2s: float
    W_11: float
    W_12: float
    W_21: float
    W_22: float
    B_w0: float   # of the torques on the ports
    B_w1: float
    B_w2: float
    B_s0: float
    B_s1: float
    B_s2: float
    Q_10: float
    Q_11: float
    Q_12: float
    Q_20: float
    Q_21: float
    Q_22: float
    a_1: float    # of the clutches
    a_2: float
    phi_1: float   # where M_1 > 0
    phi_2: float
    psi_1: float   # where M_1 < 0
    psi_2: float


def coefficients(p, response, proportional=True, direction=DIRECT):
    """
    Return the ``Coefficients`` of a ``LinearResponse``.

    :param proportional: whether the friction grows with the moments of the same instant.
    :param direction: of power flow, that of the response.
    """
    r = response
    phi = proportional_friction(p) if proportional else ((0.0, 0.0), (0.0, 0.0))
    driving, coasting = phi if direction == DIRECT else phi[::-1]
    matrices = (r.A, r.C, r.P[-2:], r.W[-2:], r.B, r.Q[-2:])
    numbers = np.concatenate([np.ravel(m) for m in matrices]).tolist()
    return Coefficients(*numbers, *slip_steepness(p), *driving, *coasting)


@dataclass(frozen=True, slots=True)
class FinalDrive:
    """The coefficients of M_F, for one direction of power flow."""

    P_w: float
    P_s: float
    Q_0: float
    Q_1: float
    Q_2: float
    W_1: float
    W_2: float


def final_drive(response):
    """Return the ``FinalDrive`` of a ``LinearResponse`` in (omega_0, slip)."""
    rows = response.P[0], response.Q[0], response.W[0]
    return FinalDrive(*np.concatenate(rows).tolist())


def held(k, T, S):
    """
    Return what is constant in a step: ``(b_w, b_s, m_1, m_2, S_1, S_2)``.

    :param T: torques on the ports, N m; S: friction at full slip that does not grow with M, N m.
    """
    T_0, T_1, T_2 = T
    return (k.B_w0 * T_0 + k.B_w1 * T_1 + k.B_w2 * T_2,
            k.B_s0 * T_0 + k.B_s1 * T_1 + k.B_s2 * T_2,
            k.Q_10 * T_0 + k.Q_11 * T_1 + k.Q_12 * T_2,
            k.Q_20 * T_0 + k.Q_21 * T_1 + k.Q_22 * T_2, *S)


def evaluate(k, u, w, s):
    """Return the ``point`` at the carrier speed w and the slip s, under what ``held`` gave."""
    b_w, b_s, m_1, m_2, S_1, S_2 = u
    W_11, W_12, W_21, W_22 = k.W_11, k.W_12, k.W_21, k.W_22
    t_1, t_2 = tanh(k.a_1 * s), tanh(k.a_2 * s)
    F_1, F_2 = S_1 * t_1, S_2 * t_2
    z_1 = m_1 + k.P_1w * w + k.P_1s * s - W_11 * F_1 - W_12 * F_2
    z_2 = m_2 + k.P_2w * w + k.P_2s * s - W_21 * F_1 - W_22 * F_2
    # M = z - W diag(x) |M| with the signs of z, which nearly always are those of M
    x_1 = k.phi_1 * t_1 if z_1 >= 0.0 else -(k.psi_1 * t_1)
    x_2 = k.phi_2 * t_2 if z_2 >= 0.0 else -(k.psi_2 * t_2)
    a, b, c, d = 1 + W_11 * x_1, W_12 * x_2, W_21 * x_1, 1 + W_22 * x_2
    det = a * d - b * c
    M_1, M_2 = (d * z_1 - b * z_2) / det, (a * z_2 - c * z_1) / det
    if M_1 * z_1 < 0.0 or M_2 * z_2 < 0.0:
        M_1, M_2 = solve_moments(
            (z_1, z_2), ((W_11, W_12), (W_21, W_22)), (k.phi_1 * t_1, k.phi_2 * t_2),
            (k.psi_1 * t_1, k.psi_2 * t_2))
        x_1 = k.phi_1 * t_1 if M_1 >= 0.0 else -(k.psi_1 * t_1)
        x_2 = k.phi_2 * t_2 if M_2 >= 0.0 else -(k.psi_2 * t_2)
    F_1 += x_1 * M_1
    F_2 += x_2 * M_2
    return (b_w + k.A_ww * w + k.A_ws * s - k.C_w1 * F_1 - k.C_w2 * F_2,
            b_s + k.A_sw * w + k.A_ss * s - k.C_s1 * F_1 - k.C_s2 * F_2,
            F_1, F_2, M_1, M_2, t_1, t_2, x_1, x_2)


def jacobian(k, u, point):
    """
    Return (J_ww, J_ws, J_sw, J_ss) and (F_1w, F_1s, F_2w, F_2s) at a ``point``.

    J is the Jacobian of dy/dt, and F_1w what F_1 grows with w, and so on.
    """
    _, _, _, _, S_1, S_2 = u
    _, _, _, _, M_1, M_2, t_1, t_2, x_1, x_2 = point
    # dF = diag(x) dM + N ds with dM = P dy - W dF, so (I + diag(x) W) dF = ...
    phi_1, phi_2 = k.phi_1 if M_1 >= 0.0 else k.psi_1, k.phi_2 if M_2 >= 0.0 else k.psi_2
    N_1 = (phi_1 * abs(M_1) + S_1) * k.a_1 * (1 - t_1 * t_1)
    N_2 = (phi_2 * abs(M_2) + S_2) * k.a_2 * (1 - t_2 * t_2)
    a, b, c, d = 1 + x_1 * k.W_11, x_1 * k.W_12, x_2 * k.W_21, 1 + x_2 * k.W_22
    det = a * d - b * c
    r_1, r_2 = x_1 * k.P_1w, x_2 * k.P_2w
    F_1w, F_2w = (d * r_1 - b * r_2) / det, (a * r_2 - c * r_1) / det
    r_1, r_2 = x_1 * k.P_1s + N_1, x_2 * k.P_2s + N_2
    F_1s, F_2s = (d * r_1 - b * r_2) / det, (a * r_2 - c * r_1) / det
    return ((k.A_ww - k.C_w1 * F_1w - k.C_w2 * F_2w, k.A_ws - k.C_w1 * F_1s - k.C_w2 * F_2s,
             k.A_sw - k.C_s1 * F_1w - k.C_s2 * F_2w, k.A_ss - k.C_s1 * F_1s - k.C_s2 * F_2s),
            (F_1w, F_1s, F_2w, F_2s))


def torque_slopes(k, u, point):
    """Return what dw/dt, and what ds/dt, grows with per torque on each port, two triples."""
    _, _, _, _, _, _, _, _, x_1, x_2 = point
    a, b, c, d = 1 + x_1 * k.W_11, x_1 * k.W_12, x_2 * k.W_21, 1 + x_2 * k.W_22
    det = a * d - b * c
    slopes = []
    for B_w, B_s, Q_1, Q_2 in ((k.B_w0, k.B_s0, k.Q_10, k.Q_20), (k.B_w1, k.B_s1, k.Q_11, k.Q_21),
                               (k.B_w2, k.B_s2, k.Q_12, k.Q_22)):
        F_1, F_2 = (d * x_1 * Q_1 - b * x_2 * Q_2) / det, (a * x_2 * Q_2 - c * x_1 * Q_1) / det
        slopes.append((B_w - k.C_w1 * F_1 - k.C_w2 * F_2, B_s - k.C_s1 * F_1 - k.C_s2 * F_2))
    return tuple(zip(*slopes))


def final_drive_moment(k, y, T, point):
    """Return M_F at a ``point`` of the state y, by ``FinalDrive``."""
    (w, s), (T_0, T_1, T_2) = y, T
    _, _, F_1, F_2, _, _, _, _, _, _ = point
    return (k.P_w * w + k.P_s * s + k.Q_0 * T_0 + k.Q_1 * T_1 + k.Q_2 * T_2
            - k.W_1 * F_1 - k.W_2 * F_2)


def solve_moments(z, W, x, coasting=None):
    """
    Solve ``M = z - W diag(x) |M|`` for the gear moments.

    For each of the four sign patterns of M the system is linear; for admissible parameters
    exactly one pattern agrees with its own solution, and it is found by looking, not by
    iteration.

    :param z: gear moments without the proportional friction, (2,), N m.
    :param W: influence of the clutch moments on the gear moments, (2, 2).
    :param x: signed proportional friction factors tan(alpha) f_k, (2,).
    :param coasting: those where M_k < 0, if they differ.
    :return: ``(M_1, M_2)``, N m.
    """
    (W_11, W_12), (W_21, W_22) = W
    y = x if coasting is None else coasting
    best = None
    for sign_1, x_1 in ((1.0, x[0]), (-1.0, y[0])):
        for sign_2, x_2 in ((1.0, x[1]), (-1.0, y[1])):
            # (I + W diag(x sign)) M = z
            a, b = 1 + W_11 * x_1 * sign_1, W_12 * x_2 * sign_2
            c, d = W_21 * x_1 * sign_1, 1 + W_22 * x_2 * sign_2
            det = a * d - b * c
            M_1, M_2 = (d * z[0] - b * z[1]) / det, (a * z[1] - c * z[0]) / det
            wrong = max(0.0, -M_1 * sign_1, -M_2 * sign_2)
            if best is None or wrong < best[0]:
                best = wrong, M_1, M_2
    # where M_k is zero up to rounding two patterns meet, and the less wrong one stands
    return best[1:]
