# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The passive law of losses: each mesh and each bearing decides by the power through itself.

The paper puts all efficiencies on one index of power flow; where the power through an element
runs against the index, its loss becomes a gain. Here a loss depends on the local power alone, so
no element ever gives energy back, and where all local powers run one way these are the paper's
equations of that direction. M is positive when the mechanism drives the shaft (M_F when the
pinion drives the carrier), in all flows. With sigma = tanh(omega/mesh_sign_speed) a mesh gives::

    within   N = (1 + eta)/2 M + (1 - eta)/2 |M| sigma     at the satellites, at the pinion
    without  S = (1 + eta)/2 M - (1 - eta)/2 |M| sigma     at the shaft, at the carrier (C)

so that N - S is ``(1 - eta) |M|`` with a sign that always brakes, and with [v]+ = max(v, 0)::

    I_k e_k = S_k - L_k - F_k + T_k                                            k = 1, 2
    I_0 e_0 = C - (N_1 + N_2) - X - D_0,     X = L_0 - L_1 - L_2 - F_1 - F_2
    I_3 e_3 = T_3 - L_3 - P - D_3,           P = N_F/g_F       self-locking: C = T_0
    (n_s I_s/g_2s) e_s = g_12 N_1 - N_2 - (n_s/g_2s) L_s
    D_0 = (1/eta_0B - 1) |sigma_0| d [ [d (N_1 + N_2)]+ + [-d C]+ + d X ]+,    d = sgn(omega_0)
    D_3 = (1/eta_3B - 1) |sigma_0| d_3 [ [d_3 P]+ + [-d_3 T_3]+ + d_3 L_3 ]+,  d_3 = sgn(omega_3)

with the friction of the clutches F_k as in ``clutched``. The motion is in y = (w, s), the carrier
speed omega_0 and the slip omega_1 - omega_2. The accelerations e_0 and ds/dt solve two equations
that are linear while the signs of the moments are known, and exactly one set of signs agrees with
its own solution. A ``point`` is all that is known of one state, a tuple in this order::

    (dw/dt, ds/dt, F_1, F_2, M_1, M_2, M_F, signs, state, solved)

with ``signs`` = (sgn M_1, sgn M_2, sgn M_F, h_N, b), where h_N is 1 while omega_0 (N_1 + N_2) > 0,
b while the bracket of D_0 is positive, and else they are 0; ``state`` = (w, s, sigma_0, sigma_1,
sigma_2, t_1, t_2) with t_k = tanh(a_k s); and ``solved``, coefficients of the two equations that
the Jacobian needs again.
"""

from dataclasses import dataclass
from itertools import product
from math import isfinite, tanh

from dm_ros.mechanism.clutched import proportional_friction, slip_steepness
from dm_ros.mechanism.efficiencies import Efficiencies
from dm_ros.mechanism.losses import lost_in_bearing

SATURATED = 20.0   # times mesh_sign_speed: above, sigma is 1 to rounding
STRAIGHT = 0.02    # change of a sigma or t_k over which the equations are nearly linear
TINY = 1e-280      # determinant, with which the range of floating point ends
ROUNDS = 8         # of looking for the signs, before all patterns are tried
PATTERNS = tuple(product((1.0, -1.0), (1.0, -1.0), (1.0, -1.0), (1.0, 0.0), (1.0, 0.0)))


@dataclass(frozen=True, slots=True)
class Coefficients:
    """What does not change while the parameters stay."""

    sign_speed: float
    g_12: float
    k_1: float         # omega_1 - omega_0 over the slip
    k_2: float         # omega_0 - omega_2 over the slip
    g_F: float         # 0 without a final drive
    I_0: float
    I_1: float
    I_2: float
    I_3: float
    I_s: float         # of the satellites, n_s k_2/g_2s^2 times theirs
    l_0: float
    l_1: float
    l_2: float
    l_3: float
    l_s: float         # as I_s
    mean_1: float      # (1 + eta)/2 of each mesh
    mean_2: float
    mean_F: float
    half_1: float      # (1 - eta)/2
    half_2: float
    half_F: float
    bearing_0: float   # 1/eta - 1
    bearing_3: float
    a_1: float         # of the clutches, see ``clutched``
    a_2: float
    phi_1: float       # while the mechanism drives the shaft
    phi_2: float
    psi_1: float       # while the shaft drives
    psi_2: float


def coefficients(p, clutches, proportional=True):
    """
    Return the ``Coefficients`` of a table of parameters.

    :param clutches: whether the mechanism has any.
    :param proportional: whether their friction grows with the moments of the same instant.
    """
    g_12 = getattr(p, 'g_12', 1.0)
    k_2 = 1 / (1 + g_12)
    spin = p.n_s * k_2 / (p.g_2s * p.g_2s)
    eta_F, eta_3B = getattr(p, 'eta_FG', 1.0), getattr(p, 'eta_3B', 1.0)
    a = slip_steepness(p) if clutches else (0.0, 0.0)
    phi, psi = proportional_friction(p) if clutches and proportional else ((0.0, 0.0), (0.0, 0.0))
    return Coefficients(
        p.sign_speed, g_12, g_12 * k_2, k_2, getattr(p, 'g_F', 0.0),
        p.I_0, p.I_1, p.I_2, getattr(p, 'I_3', 0.0), spin * p.I_s,
        p.l_0, p.l_1, p.l_2, getattr(p, 'l_3', 0.0), spin * p.l_s,
        (1 + p.eta_1G) / 2, (1 + p.eta_2G) / 2, (1 + eta_F) / 2,
        (1 - p.eta_1G) / 2, (1 - p.eta_2G) / 2, (1 - eta_F) / 2,
        lost_in_bearing(p.eta_0B), lost_in_bearing(eta_3B), *a, *phi, *psi)


def has_solutions(k):
    """Return whether the numbers of all sets of signs stay in the range of floating point."""
    u = 1.0, 1.0, 1.0, 0.0, 0.0
    try:
        for turned in (1.0, -1.0):
            state = 1.0, turned, 1.0, 1.0, 1.0, turned, -turned
            for signs in PATTERNS:
                _, _, point = solve(k, u, -1.0, -1.0, state, signs)
                if not (point[-1][-1] > TINY and isfinite(sum(point[:7]))):
                    return False
    except ArithmeticError:
        return False
    return True


def held(k, T, S):
    """
    Return what is constant in a step: ``(T_in, T_1, T_2, S_1, S_2)``, N m.

    :param T: torques on the ports; S: friction at full slip that does not grow with M.
    """
    return (*T, *S)


def evaluate(k, u, w, s):
    """Return the ``point`` at the carrier speed w and the slip s, under what ``held`` gave."""
    _, T_1, T_2, S_1, S_2 = u
    k_1s, k_2s = k.k_1 * s, k.k_2 * s
    t_1, t_2 = tanh(k.a_1 * s), tanh(k.a_2 * s)
    state = (w, s, tanh(w / k.sign_speed), tanh((w + k_1s) / k.sign_speed),
             tanh((w - k_2s) / k.sign_speed), t_1, t_2)
    # begun with the signs of a mechanism without inertia, whose friction is that of the preload
    q_1, q_2 = S_1 * t_1 + k.l_1 * k_1s - T_1, S_2 * t_2 - k.l_2 * k_2s - T_2
    both = q_1 + q_2
    signs = (1.0 if q_1 >= 0.0 else -1.0, 1.0 if q_2 >= 0.0 else -1.0,
             1.0 if both >= 0.0 else -1.0, 1.0 if both * w > 0.0 else 0.0, 1.0)
    for _ in range(ROUNDS):
        wrong, found, point = solve(k, u, q_1, q_2, state, signs)
        if not wrong:
            return point
        signs = found
    _, _, point = min((solve(k, u, q_1, q_2, state, signs) for signs in PATTERNS),
                      key=lambda solution: solution[0])
    return point


def solve(k, u, q_1, q_2, state, signs):
    """
    Solve the equations at given signs.

    :param q_1, q_2: L_k - T_k with the friction of the preload, N m.
    :return: by how much the solution disagrees with the signs, N m, its own signs, the point.
    """
    T_in, _, _, S_1, S_2 = u
    w, s, sigma_0, sigma_1, sigma_2, t_1, t_2 = state
    s_1, s_2, s_F, h_N, b = signs
    h_1, h_2 = k.half_1 * sigma_1 * s_1, k.half_2 * sigma_2 * s_2
    x_1 = k.phi_1 * t_1 * s_1 if s_1 > 0.0 else k.psi_1 * t_1 * s_1   # F_k = x_k M_k + S_k t_k
    x_2 = k.phi_2 * t_2 * s_2 if s_2 > 0.0 else k.psi_2 * t_2 * s_2
    n_1, n_2 = k.mean_1 + h_1, k.mean_2 + h_2                    # N_k = n_k M_k
    p_1, p_2 = k.mean_1 - h_1 - x_1, k.mean_2 - h_2 - x_2        # S_k - F_k = p_k M_k - preload
    m_1, m_2, r_1, r_2 = k.I_1 / p_1, k.I_2 / p_2, q_1 / p_1, q_2 / p_2   # M_k = m_k e_k + r_k
    F_1, F_2 = S_1 * t_1, S_2 * t_2
    X = k.l_0 * w - (k.l_1 * k.k_1 - k.l_2 * k.k_2) * s - F_1 - F_2
    beta_0 = k.bearing_0 * abs(sigma_0)
    beta = beta_0 * b
    a_N, a_X = 1 + beta * h_N, 1 + beta
    y_1, y_2 = a_N * n_1 - a_X * x_1, a_N * n_2 - a_X * x_2
    if k.g_F:
        h = k.half_F * sigma_0 * s_F
        n_F, c_F = k.mean_F + h, k.mean_F - h                    # N_F = n_F M_F, C = c_F M_F
        beta_3 = k.bearing_3 * abs(sigma_0)
        a_P, a_C = (1 + beta_3, 1.0) if w * s_F > 0.0 else (1.0, a_X)
        T_3 = T_in * (1 + beta_3) if T_in * k.g_F * w < 0.0 else T_in
        T_3 -= (1 + beta_3) * k.l_3 * k.g_F * w
        per_torque = k.g_F / (a_P * n_F)                         # M_F is that times the next line
        C = a_C * c_F * per_torque                               # times T_3 - I_3 g_F e_0
        inertia, drive = k.I_0 + C * k.I_3 * k.g_F, C * T_3
    else:
        c_F = per_torque = T_3 = 0.0
        inertia, drive = k.I_0, a_X * T_in if T_in * w < 0.0 else T_in
    # the carrier and the satellites: G (e_0, ds/dt) = R
    z_1, z_2 = k.g_12 * n_1, n_2
    G_11 = inertia + y_1 * m_1 + y_2 * m_2
    G_12 = y_1 * m_1 * k.k_1 - y_2 * m_2 * k.k_2
    G_21 = z_1 * m_1 - z_2 * m_2
    G_22 = z_1 * m_1 * k.k_1 + z_2 * m_2 * k.k_2 + k.I_s
    R_1 = drive - a_X * X - y_1 * r_1 - y_2 * r_2
    R_2 = z_2 * r_2 - z_1 * r_1 - k.l_s * s
    det = G_11 * G_22 - G_12 * G_21
    e_0, e_s = (R_1 * G_22 - R_2 * G_12) / det, (G_11 * R_2 - G_21 * R_1) / det
    M_1 = m_1 * (e_0 + k.k_1 * e_s) + r_1
    M_2 = m_2 * (e_0 - k.k_2 * e_s) + r_2
    M_F = per_torque * (T_3 - k.I_3 * k.g_F * e_0)

    # the signs of the solution itself
    N, C = n_1 * M_1 + n_2 * M_2, c_F * M_F if k.g_F else T_in
    F_1x, F_2x = x_1 * M_1, x_2 * M_2
    bracket = X - F_1x - F_2x
    if w < 0.0:
        bracket, N, C = -bracket, -N, -C
    if N > 0.0:
        bracket += N
    if C < 0.0:
        bracket -= C
    if not w:
        N = 0.0
    point = (e_0, e_s, F_1 + F_1x, F_2 + F_2x, M_1, M_2, M_F, signs, state,
             (n_1, n_2, p_1, p_2, m_1, m_2, y_1, y_2, X, a_N, a_X, inertia, G_11, G_12, G_21,
              G_22, det))
    if (M_1 * s_1 >= 0.0 and M_2 * s_2 >= 0.0 and M_F * s_F >= 0.0
            and (N >= 0.0 if h_N else N <= 0.0) and (bracket >= 0.0 if b else bracket <= 0.0)):
        return 0.0, signs, point
    found = (1.0 if M_1 >= 0.0 else -1.0, 1.0 if M_2 >= 0.0 else -1.0,
             1.0 if M_F >= 0.0 else -1.0, 1.0 if N > 0.0 else 0.0, 1.0 if bracket > 0.0 else 0.0)
    wrong = max(-M_1 * s_1, -M_2 * s_2, -M_F * s_F, -N if h_N else N,
                -bracket if b else bracket)
    return wrong, found, point


def jacobian(k, u, point):
    """Return (J_ww, J_ws, J_sw, J_ss) of dy/dt at a ``point``, at fixed signs, and None."""
    T_in, _, _, S_1, S_2 = u
    _, _, _, _, M_1, M_2, M_F, (s_1, s_2, s_F, h_N, b), state, solved = point
    w, _, sigma_0, sigma_1, sigma_2, t_1, t_2 = state
    (n_1, n_2, p_1, p_2, m_1, m_2, y_1, y_2, X, a_N, a_X, inertia, G_11, G_12, G_21, G_22,
     det) = solved
    # what n_k, x_k and the moments grow with, per w and per s, at fixed accelerations
    n_1w = k.half_1 * s_1 * (1 - sigma_1 * sigma_1) / k.sign_speed
    n_2w = k.half_2 * s_2 * (1 - sigma_2 * sigma_2) / k.sign_speed
    n_1s, n_2s = n_1w * k.k_1, -n_2w * k.k_2
    u_1, u_2 = k.a_1 * (1 - t_1 * t_1), k.a_2 * (1 - t_2 * t_2)
    phi_1, phi_2 = k.phi_1 if s_1 > 0.0 else k.psi_1, k.phi_2 if s_2 > 0.0 else k.psi_2
    x_1s, x_2s = phi_1 * s_1 * u_1, phi_2 * s_2 * u_2
    q_1s, q_2s = k.l_1 * k.k_1 + S_1 * u_1, S_2 * u_2 - k.l_2 * k.k_2
    M_1w, M_1s = M_1 * n_1w / p_1, (q_1s + M_1 * (n_1s + x_1s)) / p_1
    M_2w, M_2s = M_2 * n_2w / p_2, (q_2s + M_2 * (n_2s + x_2s)) / p_2
    # both equations likewise
    g_w = M_1 * a_N * n_1w + y_1 * M_1w + M_2 * a_N * n_2w + y_2 * M_2w + a_X * k.l_0
    g_s = (M_1 * (a_N * n_1s - a_X * x_1s) + y_1 * M_1s
           + M_2 * (a_N * n_2s - a_X * x_2s) + y_2 * M_2s - a_X * (q_1s + q_2s))
    sigma_w = (1 - sigma_0 * sigma_0) / k.sign_speed
    if k.g_F or sigma_w:
        side = -1.0 if w < 0.0 else 1.0
        beta_w = k.bearing_0 * side * sigma_w * b
        N = n_1 * M_1 + n_2 * M_2
        x_M = phi_1 * t_1 * s_1 * M_1 + phi_2 * t_2 * s_2 * M_2
        g_w += beta_w * (h_N * N + X - x_M)
        if k.g_F:
            h = k.half_F * sigma_0 * s_F
            n_F, c_F, n_Fw = k.mean_F + h, k.mean_F - h, k.half_F * s_F * sigma_w
            beta_3, beta_3w = k.bearing_3 * abs(sigma_0), k.bearing_3 * side * sigma_w
            a_P, a_Pw, a_C, a_Cw = ((1 + beta_3, beta_3w, 1.0, 0.0) if w * s_F > 0.0
                                    else (1.0, 0.0, a_X, beta_w))
            T_3w = -k.l_3 * k.g_F * (1 + beta_3 + beta_3w * w)
            if T_in * k.g_F * w < 0.0:
                T_3w += T_in * beta_3w
            M_Fw = k.g_F / (a_P * n_F) * T_3w - M_F * (a_Pw / a_P + n_Fw / n_F)
            g_w -= a_Cw * c_F * M_F + a_C * (c_F * M_Fw - n_Fw * M_F)
        elif T_in * w < 0.0:
            g_w -= beta_w * T_in
    r_w = k.g_12 * (n_1w * M_1 + n_1 * M_1w) - n_2w * M_2 - n_2 * M_2w
    r_s = k.g_12 * (n_1s * M_1 + n_1 * M_1s) - n_2s * M_2 - n_2 * M_2s + k.l_s
    return ((G_12 * r_w - G_22 * g_w) / det, (G_12 * r_s - G_22 * g_s) / det,
            (G_21 * g_w - G_11 * r_w) / det, (G_21 * g_s - G_11 * r_s) / det), None


def torque_slopes(k, u, point):
    """Return what dw/dt, and what ds/dt, grows with per torque on each port, at fixed signs."""
    T_in = u[0]
    _, _, _, _, _, _, _, (_, _, s_F, _, b), (w, _, sigma_0, *_), solved = point
    n_1, n_2, p_1, p_2, _, _, y_1, y_2, _, _, a_X, _, G_11, G_12, G_21, G_22, det = solved
    drive = a_X if T_in * w < 0.0 else 1.0
    if k.g_F:
        h, beta_3 = k.half_F * sigma_0 * s_F, k.bearing_3 * abs(sigma_0)
        a_P, a_C = (1 + beta_3, 1.0) if w * s_F > 0.0 else (1.0, a_X)
        drive = a_C * (k.mean_F - h) * k.g_F / (a_P * (k.mean_F + h))
        if T_in * k.g_F * w < 0.0:
            drive *= 1 + beta_3
    # G (e_0, ds/dt) = R, and R grows with the torques as follows
    R = ((drive, 0.0), (y_1 / p_1, k.g_12 * n_1 / p_1), (y_2 / p_2, -n_2 / p_2))
    return (tuple([(R_1 * G_22 - R_2 * G_12) / det for R_1, R_2 in R]),
            tuple([(G_11 * R_2 - G_21 * R_1) / det for R_1, R_2 in R]))


def bends(k, here, there):
    """
    Return whether the motion from one point to another may be far from linear in between.

    It is not where the signs stay, no sigma and no t_k changes much, and no speed has turned
    round: of two modes together none does so more than once.
    """
    v_w, v_s, _, _, _, _, _, signs, (_, _, a, b, c, d, e), _ = here
    w_w, w_s, _, _, _, _, _, signs_there, (_, _, f, g, h, i, j), _ = there
    return not (
        signs == signs_there
        and -STRAIGHT < f - a < STRAIGHT and -STRAIGHT < g - b < STRAIGHT
        and -STRAIGHT < h - c < STRAIGHT and -STRAIGHT < i - d < STRAIGHT
        and -STRAIGHT < j - e < STRAIGHT
        and v_w * w_w >= 0.0 and v_s * w_s >= 0.0
        and (v_w + k.k_1 * v_s) * (w_w + k.k_1 * w_s) >= 0.0
        and (v_w - k.k_2 * v_s) * (w_w - k.k_2 * w_s) >= 0.0)


def lost_powers(k, u, point):
    """
    Return the power that each element takes, W, none of them ever negative.

    :return: drag, final drive, side meshes 1 and 2, pinion and carrier bearing, clutches 1 and 2;
        zero where there is no such element.
    """
    T_in = u[0]
    _, _, F_1, F_2, M_1, M_2, M_F, (_, _, _, h_N, b), state, _ = point
    w, s, sigma_0, sigma_1, sigma_2, _, _ = state
    k_1s, k_2s = k.k_1 * s, k.k_2 * s
    N = ((k.mean_1 * M_1 + k.half_1 * abs(M_1) * sigma_1)
         + (k.mean_2 * M_2 + k.half_2 * abs(M_2) * sigma_2))
    mesh_F = bearing_3 = 0.0
    C, w_3 = T_in, k.g_F * w
    if k.g_F:
        C = k.mean_F * M_F - k.half_F * abs(M_F) * sigma_0
        P_w3 = (k.mean_F * M_F + k.half_F * abs(M_F) * sigma_0) * w
        T_w3 = T_in * w_3
        mesh_F = 2 * k.half_F * abs(M_F) * sigma_0 * w
        bearing_3 = k.bearing_3 * abs(sigma_0) * (
            k.l_3 * w_3 * w_3 + (P_w3 if P_w3 > 0.0 else 0.0) - (T_w3 if T_w3 < 0.0 else 0.0))
    X = k.l_0 * w - k.l_1 * k_1s + k.l_2 * k_2s - F_1 - F_2
    # the bracket is 0 at least, but for rounding
    bearing_0 = k.bearing_0 * abs(sigma_0) * b * max(
        0.0, X * w + h_N * N * w - (C * w if C * w < 0.0 else 0.0))
    return (k.l_0 * w * w + k.l_3 * w_3 * w_3 + k.l_1 * k_1s * k_1s + k.l_2 * k_2s * k_2s
            + k.l_s * k.k_2 * s * s,
            mesh_F, 2 * k.half_1 * abs(M_1) * sigma_1 * (w + k_1s),
            2 * k.half_2 * abs(M_2) * sigma_2 * (w - k_2s),
            bearing_3, bearing_0, F_1 * k_1s, -F_2 * k_2s)


def efficiencies(k, T_in, point):
    """Return the ``Efficiencies`` with which the direct-flow equations hold at a ``point``."""
    _, _, _, _, _, _, _, (s_1, s_2, s_F, h_N, b), state, _ = point
    w, _, sigma_0, sigma_1, sigma_2, _, _ = state

    def mesh(mean, half, sigma, sign):
        return (mean - half * sigma * sign) / (mean + half * sigma * sign)
    beta, beta_3 = k.bearing_0 * abs(sigma_0) * b, k.bearing_3 * abs(sigma_0)
    brakes = w * s_F < 0.0 if k.g_F else w * T_in < 0.0
    return Efficiencies(
        mesh(k.mean_F, k.half_F, sigma_0, s_F), mesh(k.mean_1, k.half_1, sigma_1, s_1),
        mesh(k.mean_2, k.half_2, sigma_2, s_2), 1 / (1 + beta * h_N), 1 / (1 + beta),
        1 + beta if brakes else 1.0, 1 / (1 + beta_3 * (w * s_F > 0.0)), 1 / (1 + beta_3),
        1 + beta_3 if w * k.g_F * T_in < 0.0 else 1.0)
