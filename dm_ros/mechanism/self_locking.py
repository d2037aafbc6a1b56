# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The equations of the asymmetric self-locking differential (section 4 of the paper).

Three formulations of one mechanism, each for direct and reverse power flow:

- ``SelfLockingLagged``, variant 1: moments eliminated, 2x2, the friction from the ``|M|`` of the
  preceding step, (61)-(70)
- ``SelfLockingOde``, variant 2: (e_1, e_2, M_1, M_2) at once, 4x4, (71)-(77)
- ``SelfLockingDae``, variant 3: (e_0, e_1, e_2, e_s, M_1, M_2) with constraints, 6x6, (78)-(88)

Symbols and signs are those of the paper, the order of the elements is (0, 1, 2, s): carrier,
front, rear, satellite. ``T`` holds the torques on the ports, in their order; a torque is positive
when it accelerates its shaft. Where a printed equation contradicts the others, the corrected form
stands here, marked "erratum", and a test shows that the printed one fails.

The clutch friction depends on the speeds through the slip omega_1 - omega_2 alone, so the
motion is written in the carrier speed and the slip, y = (omega_0, omega_1 - omega_2). Under
held torques each formulation is linear but for the clutch moments F = (F_1, F_2)::

    dy/dt = A y + B T - C F
    M     = P y + Q T - W F        M = (M_1, M_2), in the sign of the paper
    F_k   = f_k (tan(alpha) |M_k| + n_s N_k R_k),    f_k ~ tanh(c_fk (omega_k - omega_0))

``LinearResponse`` holds these matrices; ``clutched`` takes all three lines at once.
"""

import numpy as np

from dm_ros.mechanism.clutched import LinearResponse
from dm_ros.mechanism.efficiencies import of_flow
from dm_ros.mechanism.ports import acting_on, force, torque
from dm_ros.mechanism.power_flow import REVERSE

SHAFTS = ('carrier', 'front', 'rear', 'satellite')
PORTS = torque('carrier'), torque('front'), torque('rear')
OUTPUTS = ('front', 'rear')
GEARS = ('front_mesh', 'rear_mesh')
BEARINGS = ('carrier_bearing',)
CLUTCHES = ('front', 'rear')
ACTUATORS = force('front_clutch'), force('rear_clutch')
ON_SHAFTS = acting_on(SHAFTS, PORTS)


def kinematics(p):
    """Return g_D, (4, 2): the speeds of all elements are g_D (omega_1, omega_2), (53)-(54)."""
    g = 1 + p.g_12
    return np.array([
        [1 / g, p.g_12 / g],
        [1.0, 0.0],
        [0.0, 1.0],
        [-1 / (p.g_2s * g), 1 / (p.g_2s * g)]])


def slip_coordinates(p):
    """Return S, (2, 2): y = (omega_0, omega_1 - omega_2) is S (omega_1, omega_2)."""
    return np.array([kinematics(p)[0], [1, -1]])


def viscosities(p):
    """Return diag(l_0, l_1, l_2, l_s), (65), (86)."""
    return np.diag([p.l_0, p.l_1, p.l_2, p.l_s])


def balance(p, flow):
    """
    Return I_D (2, 2), eta_T (2, 3), eta_L (2, 4), eta_F (2, 2): (61)-(63) direct, (69) reverse.

    The total and the relative balance of the mechanism, from which the gear moments are
    eliminated: I_D e_D = eta_T T - eta_L L - eta_F F.
    """
    g, n = p.g_12, p.n_s / p.g_2s
    satellite = p.I_s * n / (p.g_2s * (1 + g))
    if flow != REVERSE:
        eta = flow
        eta_0, eta_0L = eta.carrier_mesh, eta.carrier_drag
        eta_1L, eta_2L = eta_0L / eta_0 / eta.mesh_1 - 1, eta_0L / eta_0 / eta.mesh_2 - 1
        I_D = np.array([
            [p.I_0 / (1 + g) + p.I_1 / (eta.mesh_1 * eta_0),
             p.I_0 * g / (1 + g) + p.I_2 / (eta.mesh_2 * eta_0)],
            [-(p.I_1 * g / eta.mesh_1 + satellite), p.I_2 / eta.mesh_2 + satellite]])
        eta_t = np.array([
            [eta.carrier_input, 1 / (eta.mesh_1 * eta_0), 1 / (eta.mesh_2 * eta_0)],
            [0, -g / eta.mesh_1, 1 / eta.mesh_2]])
        relative = [-g / eta.mesh_1, 1 / eta.mesh_2]
    else:
        eta_0L = p.eta_0B
        eta_1L, eta_2L = p.eta_1G * p.eta_0B - 1, p.eta_2G * p.eta_0B - 1
        I_D = np.array([
            [p.I_0 / (1 + g) + p.I_1 * p.eta_1G, p.I_0 * g / (1 + g) + p.I_2 * p.eta_2G],
            [-(p.I_1 * p.eta_1G * g + satellite), p.I_2 * p.eta_2G + satellite]])
        eta_t = np.array([
            [1 / p.eta_0B, p.eta_1G, p.eta_2G],
            [0, -g * p.eta_1G, p.eta_2G]])
        relative = [-g * p.eta_1G, p.eta_2G]
    eta_l = np.array([
        [1 / eta_0L, eta_1L / eta_0L, eta_2L / eta_0L, 0],
        [0, *relative, n]])
    eta_f = np.array([
        [eta_1L / eta_0L, eta_2L / eta_0L],
        relative])
    return I_D, eta_t, eta_l, eta_f


def viscous(p):
    """Return the matrix (4, 2) that gives L = l (omega - omega_H) from omega_D, (54), (65)."""
    g_D = kinematics(p)   # erratum (54): omega = g_D omega_D
    # erratum (54): the carrier supports both crown gears
    return viscosities(p) @ (g_D - np.outer([0, 1, 1, 0], g_D[0]))


class SelfLockingLagged:
    """
    Variant 1: two equations in omega_1, omega_2; ``|M|`` in the friction is that of the last step.

    The system is linear in the accelerations; M is recovered from them, (68), (70).
    """

    lagged = True

    def __init__(self, parameters):
        self.p = parameters

    def response(self, flow):
        """Return the ``LinearResponse`` for a flow: DIRECT, REVERSE, or ``Efficiencies``."""
        p, flow = self.p, of_flow(self.p, flow)
        I_D, eta_t, eta_l, eta_f = balance(p, flow)
        L = viscous(p)
        A, B, C = (np.linalg.solve(I_D, m)
                   for m in (-eta_l @ L, eta_t @ ON_SHAFTS[:3], eta_f))                  # (67)
        I_G, T_G, E = np.diag([p.I_1, p.I_2]), ON_SHAFTS[1:3], np.eye(2)
        P, Q, W = I_G @ A + L[1:3], I_G @ B - T_G, I_G @ C - E
        eta_G = np.diag([flow.mesh_1, flow.mesh_2]) if flow != REVERSE else -E
        P, Q, W = (np.linalg.solve(eta_G, m) for m in (P, Q, W))                  # (68), (70)
        S = slip_coordinates(p)
        S_inverse = np.linalg.inv(S)
        return LinearResponse(S @ A @ S_inverse, S @ B, S @ C, P @ S_inverse, Q, W)


class SelfLockingOde:
    """Variant 2: accelerations and gear moments at once, nonlinear in the signs of M."""

    lagged = False

    def __init__(self, parameters):
        self.p = parameters

    def system(self, flow):
        """
        Return G_D (4, 4), eta_T (4, 3), eta_L (4, 4), eta_F (4, 2): (72)-(73), (76)-(77).

        They make G_D x + eta_F F + eta_L L - eta_T T = 0 with x = (e_1, e_2, M_1, M_2), (75).
        """
        p, flow = self.p, of_flow(self.p, flow)
        I_D, eta_t, eta_l, eta_f = balance(p, flow)
        eta_M = -np.diag([flow.mesh_1, flow.mesh_2]) if flow != REVERSE else np.eye(2)
        G_D = np.block([[I_D, np.zeros((2, 2))], [np.diag([p.I_1, p.I_2]), eta_M]])
        eta_t = np.vstack([eta_t, np.eye(2, 3, k=1)])
        eta_l = np.vstack([eta_l, np.eye(2, 4, k=1)])
        eta_f = np.vstack([eta_f, np.eye(2)])   # erratum (76): four rows
        return G_D, eta_t, eta_l, eta_f

    def response(self, flow):
        """Return the ``LinearResponse`` for a flow: DIRECT, REVERSE, or ``Efficiencies``."""
        G_D, eta_t, eta_l, eta_f = self.system(flow)
        S = slip_coordinates(self.p)
        A, B, C = (np.linalg.solve(G_D, m)
                   for m in (-eta_l @ viscous(self.p) @ np.linalg.inv(S),
                             eta_t @ ON_SHAFTS[:3], eta_f))
        return LinearResponse(S @ A[:2], S @ B[:2], S @ C[:2], A[2:], B[2:], C[2:])


class SelfLockingDae:
    """
    Variant 3: four elements and two kinematic constraints, nonlinear in the signs of M.

    The constraints g_omega omega = 0 are linear, so the redundant speeds are kept on them by
    coordinate partitioning: the carrier speed and the slip are integrated, the others are
    what g_omega makes of them. Nothing can drift off.
    """

    lagged = False

    def __init__(self, parameters):
        self.p = parameters

    def constraints(self):
        """Return g_omega, (2, 4), (80)."""
        p = self.p
        return np.array([
            [1 + p.g_12, -1, -p.g_12, 0],
            [0, 1, -1, p.g_2s * (1 + p.g_12)]])

    def lift(self):
        """Return the matrix (4, 2) that gives all speeds from y, such that g_omega omega = 0."""
        return np.linalg.inv(np.vstack([self.constraints(), [1, 0, 0, 0], [0, 1, -1, 0]]))[:, 2:]

    def system(self, flow):
        """
        Return G_D (6, 6), g_T (6, 3), g_L (6, 4), g_F (6, 2): (79)-(83), (86), (88).

        They make G_D x + g_F F + g_L omega - g_T T = 0 with x = (e_0, e_1, e_2, e_s, M_1, M_2),
        (87).
        """
        p, flow = self.p, of_flow(self.p, flow)
        eta_t = np.eye(4, 3)
        if flow != REVERSE:
            eta = flow
            eta_0L = eta.carrier_drag
            eta_m = np.array([
                [1 / eta.carrier_mesh, 1 / eta.carrier_mesh],
                [-eta.mesh_1, 0],
                [0, -eta.mesh_2],
                [-p.g_12, 1]])
            eta_t[0, 0] = eta.carrier_input
        else:
            eta_0L = p.eta_0B
            eta_m = np.array([
                [-p.eta_1G, -p.eta_2G],
                [1, 0],
                [0, 1],
                [p.g_12 * p.eta_1G, -p.eta_2G]])
            eta_t[0, 0] = 1 / p.eta_0B   # erratum 4.7.2: a second matrix changes
        eta_f = np.array([
            [-1 / eta_0L, -1 / eta_0L],
            [1, 0],
            [0, 1],
            [0, 0]])
        eta_l = np.array([
            [1 / eta_0L, -1 / eta_0L, -1 / eta_0L, 0],
            [0, 1, 0, 0],
            [0, 0, 1, 0],
            [0, 0, 0, p.n_s / p.g_2s]])
        e_omega = np.array([
            [1, 0, 0, 0],
            [-1, 1, 0, 0],
            [-1, 0, 1, 0],   # erratum (86): the carrier supports the second crown gear too
            [0, 0, 0, 1]])
        inertia = np.diag([p.I_0, p.I_1, p.I_2, p.I_s * p.n_s / p.g_2s])
        G_D = np.block([[inertia, eta_m], [self.constraints(), np.zeros((2, 2))]])
        g_T, g_L, g_F = (np.vstack([m, np.zeros((2, m.shape[1]))])
                         for m in (eta_t, eta_l @ viscosities(p) @ e_omega, eta_f))
        return G_D, g_T, g_L, g_F

    def response(self, flow):
        """Return the ``LinearResponse`` for a flow: DIRECT, REVERSE, or ``Efficiencies``."""
        G_D, g_T, g_L, g_F = self.system(flow)
        A, B, C = (np.linalg.solve(G_D, m)
                   for m in (-g_L @ self.lift(), g_T @ ON_SHAFTS[:3], g_F))
        to_y = np.array([[1, 0, 0, 0], [0, 1, -1, 0]])   # (e_0, e_1 - e_2)
        return LinearResponse(to_y @ A[:4], to_y @ B[:4], to_y @ C[:4], A[4:], B[4:], C[4:])
