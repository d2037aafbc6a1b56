# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The paper's law for both mechanisms at once, all moments eliminated, in plain floats.

It is what the core in C makes of parameters where no numpy is, as in an FMU; the formulations of
``symmetric`` and ``self_locking`` are the paper's own and agree with it. With Z_k, what the mesh
gives to shaft k, N_k, the moment within it, and C, what drives the carrier::

    Z_k = I_k e_k + L_k + F_k - T_k,     N_k = v_k Z_k                                  k = 1, 2
    I_0 e_0 + c (N_1 + N_2) + d (L_0 - L_1 - L_2 - F_1 - F_2) = b C
    g_12 N_1 - N_2 + I_s e_s + l_s s = 0                    I_s, l_s as in passive.Coefficients
    C = c_T g_F T_3 - c_I g_F^2 I_3 e_0 - c_L g_F L_3       self-locking: C = T_0

In direct flow v_k = 1/eta_kG, c = d = 1/eta_0B, b = 1 and N_k is the paper's M_k; in reverse flow
v_k = eta_kG, c = 1, b = d = 1/eta_0B and -Z_k is. Its M_F is C/eta_FG and -C.
"""

from math import isfinite
from typing import NamedTuple

from dm_ros.mechanism.power_flow import DIRECT, REVERSE


class Rows(NamedTuple):
    """What accelerations and moments grow with: each row of w, s, T_0, T_1, T_2, F_1, F_2."""

    e_0: tuple   # dw/dt
    e_s: tuple   # ds/dt
    M_1: tuple   # in the sign of the paper
    M_2: tuple
    M_F: tuple   # zeros without a final drive


def rows(p, k, direction):
    """
    Return the ``Rows`` for one direction of power flow.

    :param p: a table of parameters; k: its ``passive.Coefficients``.
    """
    g_F, d = k.g_F, 1 / p.eta_0B
    eta_F, eta_3 = getattr(p, 'eta_FG', 1.0), getattr(p, 'eta_3B', 1.0)
    if direction == DIRECT:
        v_1, v_2, c, b = 1 / p.eta_1G, 1 / p.eta_2G, d, 1.0
        c_T, c_I, c_L = eta_F * eta_3, eta_F * eta_3, eta_F
        u_1, u_2, u_F = v_1, v_2, 1 / eta_F
    else:
        v_1, v_2, c, b = p.eta_1G, p.eta_2G, 1.0, d
        c_T, c_I, c_L = 1 / (eta_F * eta_3), 1 / eta_F, 1 / (eta_F * eta_3)
        u_1 = u_2 = u_F = -1.0
    # what a unit of each cause does to (dw/dt, ds/dt, Z_1, Z_2, C), all sums without cancellation
    a_1, a_2, I_s, g, k_1, k_2 = v_1 * k.I_1, v_2 * k.I_2, k.I_s, k.g_12, k.k_1, k.k_2
    I_F = c_I * g_F * g_F * k.I_3
    I_0 = k.I_0 + b * I_F
    slip = g * a_1 * k_1 + a_2 * k_2 + I_s
    rest = c * (a_1 + a_2) * I_s + c * a_1 * a_2 * (1 + g)
    det = I_0 * slip + rest
    x = slip / det
    carrier = x, (a_2 - g * a_1) / det, k.I_1 * (a_2 + I_s) / det, k.I_2 * (g * a_1 + I_s) / det, (
        -I_F * x)
    x = c * (a_2 * k_2 - a_1 * k_1) / det
    satellite = x, (I_0 + c * (a_1 + a_2)) / det, k.I_1 * (k_1 * I_0 + c * a_2) / det, (
        -k.I_2 * (k_2 * I_0 + c * a_1) / det), -I_F * x
    both = (c * I_s - k_1 * I_0) / det
    x = c * v_1 * (a_2 + I_s) / det
    shaft_1 = x, v_1 * (g * I_0 + c * a_2 * (1 + g)) / det, (
        -(I_0 * (a_2 * k_2 + I_s) + c * a_2 * I_s) / det), k.I_2 * v_1 * both, -I_F * x
    x = c * v_2 * (g * a_1 + I_s) / det
    shaft_2 = x, -v_2 * (I_0 + c * a_1 * (1 + g)) / det, k.I_1 * v_2 * both, (
        -(I_0 * (g * a_1 * k_1 + I_s) + c * a_1 * I_s) / det), -I_F * x
    final_drive = *[b * entry for entry in carrier[:4]], (k.I_0 * slip + rest) / det

    L_0, L_3, L_1, L_2 = d * k.l_0, c_L * g_F * g_F * k.l_3, k.l_1 * k_1, k.l_2 * k_2
    per_torque = c_T * (g_F or 1.0)
    e_0, e_s, Z_1, Z_2, C = [(
        -L_0 * e - L_3 * f, L_1 * (d * e - p) - L_2 * (d * e - q) - k.l_s * h,
        per_torque * f, p, q, d * e - p, d * e - q)
        for e, h, p, q, f in zip(carrier, satellite, shaft_1, shaft_2, final_drive)]
    return Rows(e_0, e_s, tuple([u_1 * z for z in Z_1]), tuple([u_2 * z for z in Z_2]),
                tuple([u_F * z if g_F else 0.0 for z in C]))


def is_finite(p, k):
    """Return whether all ``Rows`` of both directions are finite; see ``rows``."""
    try:
        return all(isfinite(value) for direction in (DIRECT, REVERSE)
                   for row in rows(p, k, direction) for value in row)
    except ZeroDivisionError:
        return False
