# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The equations of the symmetric differential with final drive (section 3 of the paper).

Two formulations of one mechanism, each for direct and reverse power flow:

- ``SymmetricOde``, variant 1: the internal moments eliminated, 2x2, (18)-(34), (38)-(39)
- ``SymmetricDae``, variant 2: all elements and their constraints, 8x8, (40)-(52)

Symbols and signs are those of the paper, the order of the elements is (0, 1, 2, 3, s):
carrier, left, right, pinion, satellite. ``T`` holds the torques on the ports, in their order; a
torque is positive when it accelerates its shaft. Where a printed equation contradicts the others,
the corrected form stands here, marked "erratum", and a test shows that the printed one fails.

Under held torques both are linear but for the moments F = (F_1, F_2) of clutches between the side
gears and the carrier, if there are any; those react as in (59). Each gives, for one flow of power
(direct, reverse, or what stands for the efficiencies of direct flow under the passive law, see
``efficiencies``)::

    e_D = A omega_D + B T - C F      omega_D = (omega_1, omega_2), e_D = d omega_D/dt
    M   = P omega_D + Q T - W F      M = (M_F, M_1, M_2), in the sign of the paper
"""

from dataclasses import dataclass

import numpy as np

from dm_ros.mechanism.clutched import LinearResponse
from dm_ros.mechanism.efficiencies import of_flow
from dm_ros.mechanism.ports import acting_on, force, torque
from dm_ros.mechanism.power_flow import REVERSE

SHAFTS = ('carrier', 'left', 'right', 'pinion', 'satellite')
PORTS = torque('pinion'), torque('left'), torque('right')
OUTPUTS = ('left', 'right')
GEARS = ('final_drive', 'left_mesh', 'right_mesh')
BEARINGS = ('pinion_bearing', 'carrier_bearing')
CLUTCHES = OUTPUTS
ACTUATORS = force('left_clutch'), force('right_clutch')
ON_SHAFTS = acting_on(SHAFTS, PORTS)
TO_SLIP = np.array([[0.5, 0.5], [1.0, -1.0]])   # (omega_0, slip) from (omega_1, omega_2)


def in_slip(r):
    """Return a ``LinearResponse`` in (omega_0, slip), from one in (omega_1, omega_2)."""
    from_slip = np.linalg.inv(TO_SLIP)
    return LinearResponse(TO_SLIP @ r.A @ from_slip, TO_SLIP @ r.B, TO_SLIP @ r.C,
                          r.P @ from_slip, r.Q, r.W)


def kinematics(p):
    """Return g_D, (5, 2): the speeds of all elements are g_D omega_D, (5)-(6)."""
    return np.array([
        [0.5, 0.5],
        [1.0, 0.0],
        [0.0, 1.0],
        [p.g_F / 2, p.g_F / 2],
        [-1 / (2 * p.g_2s), 1 / (2 * p.g_2s)]])


class SymmetricOde:
    """Variant 1: two equations in omega_1, omega_2; the moments are recovered from them."""

    def __init__(self, parameters):
        self.p = parameters

    def inertia(self):
        """Return I = (I_0, I_1, I_2, I_3, I_s), (26)."""
        p = self.p
        return np.array([p.I_0, p.I_1, p.I_2, p.I_3, p.I_s])

    def efficiencies(self, flow):
        """Return eta_Sigma, eta_S, eta_T, eta_L: (26), (28), (30) direct, (38)-(39) reverse."""
        p = self.p
        satellite = p.n_s / (2 * p.g_2s**2)
        if flow != REVERSE:
            eta = flow
            eta_F = eta.mesh_F * eta.carrier_input
            eta_0, eta_0L = eta_F * eta.carrier_mesh, eta_F * eta.carrier_drag
            share = eta.carrier_drag / eta.carrier_mesh
            eta_1L, eta_2L = share / eta.mesh_1 - 1, share / eta.mesh_2 - 1
            eta_sigma = np.array([
                [1 / (2 * eta_F), 1 / (2 * eta_F)],
                [1 / (eta_0 * eta.mesh_1), 0],
                [0, 1 / (eta_0 * eta.mesh_2)],
                [p.g_F**2 * eta.pinion_mesh / 2, p.g_F**2 * eta.pinion_mesh / 2],
                [0, 0]])
            eta_s = np.array([
                [0, 0],
                [-1 / eta.mesh_1, 0],
                [0, 1 / eta.mesh_2],
                [0, 0],
                [-satellite, satellite]])
            eta_t = np.array([
                [1 / (eta_0 * eta.mesh_1), 1 / (eta_0 * eta.mesh_2),
                 eta.pinion_mesh * eta.pinion_input],
                [-1 / eta.mesh_1, 1 / eta.mesh_2, 0]])
            eta_l = np.array([   # erratum (30): no eta_kG below eta_kL
                [1 / eta_0L, eta_1L / eta_0L, eta_2L / eta_0L,
                 eta.pinion_mesh / eta.pinion_drag, 0],
                [0, -1 / eta.mesh_1, 1 / eta.mesh_2, 0, 1]])
        else:
            eta_1L, eta_2L = p.eta_0B * p.eta_1G - 1, p.eta_0B * p.eta_2G - 1
            eta_sigma = np.array([
                [p.eta_0B / 2, p.eta_0B / 2],
                [p.eta_1G * p.eta_0B, 0],
                [0, p.eta_0B * p.eta_2G],
                [p.g_F**2 / (2 * p.eta_FG), p.g_F**2 / (2 * p.eta_FG)],
                [0, 0]])
            eta_s = np.array([
                [0, 0],
                [-p.eta_1G, 0],
                [0, p.eta_2G],
                [0, 0],
                [-satellite, satellite]])
            eta_t = np.array([
                [p.eta_1G * p.eta_0B, p.eta_2G * p.eta_0B, 1 / (p.eta_FG * p.eta_3B)],
                [-p.eta_1G, p.eta_2G, 0]])
            eta_l = np.array([
                [1, eta_1L, eta_2L, 1 / (p.eta_FG * p.eta_3B), 0],
                [0, -p.eta_1G, p.eta_2G, 0, 1]])
        return eta_sigma, eta_s, eta_t, eta_l

    def viscous(self):
        """Return the matrix (5, 2) that gives L from omega_D: l (g_D - g_H), (6), (31)."""
        p = self.p
        g_H = np.array([[0, 0], [0.5, 0.5], [0.5, 0.5], [0, 0], [0, 0]])
        # erratum (31): the speeds of all elements, omega and not omega_D
        return np.diag([p.l_0, p.l_1, p.l_2, p.l_3, p.l_s]) @ (kinematics(p) - g_H)

    def response(self, flow):
        """Return the ``LinearResponse`` for a flow: DIRECT, REVERSE, or ``Efficiencies``."""
        p, flow = self.p, of_flow(self.p, flow)
        eta_sigma, eta_s, eta_t, eta_l = self.efficiencies(flow)
        I_D = np.array([self.inertia() @ eta_sigma, self.inertia() @ eta_s])          # (25), (27)
        g_T = np.diag([1, 1, p.g_F]) @ ON_SHAFTS[1:4]            # (28) of T_D = (T_1, T_2, T_3)
        g_L = np.diag([1, 1, 1, p.g_F, p.n_s / p.g_2s])                                # (30)
        L = self.viscous()
        A = -np.linalg.solve(I_D, eta_l @ g_L @ L)                                     # (34)
        B = np.linalg.solve(I_D, eta_t @ g_T)
        C = np.linalg.solve(I_D, eta_l[:, 1:3])   # F_k acts wherever L_k does

        # the moments: M_F from (17) or the pinion equation in reverse flow, M_k from (10)
        e = np.array([[0.5, 0.5], [1, 0], [0, 1]])   # (e_0, e_1, e_2) from e_D
        if flow != REVERSE:
            eta = flow
            eta_M = np.diag([1, 1 / eta.mesh_1, 1 / eta.mesh_2])
            inertia = np.diag([-p.I_3 * p.g_F**2 * eta.pinion_mesh, p.I_1, p.I_2])
            drag = np.array([-p.g_F * (eta.pinion_mesh / eta.pinion_drag) * L[3], L[1], L[2]])
            load = np.array([[0, 0, p.g_F * eta.pinion_mesh * eta.pinion_input],
                             [-1, 0, 0], [0, -1, 0]])
            friction = np.eye(3, 2, k=-1)
        else:
            eta_M = np.diag([1 / p.eta_FG, 1, 1])
            inertia = np.diag([p.I_3 * p.g_F**2, -p.I_1, -p.I_2])
            drag = np.array([p.g_F / p.eta_3B * L[3], -L[1], -L[2]])
            load = np.array([[0, 0, -p.g_F / p.eta_3B], [1, 0, 0], [0, 1, 0]])
            friction = -np.eye(3, 2, k=-1)
        return LinearResponse(A, B, C,
                              eta_M @ (inertia @ e @ A + drag),
                              eta_M @ (inertia @ e @ B + load @ ON_SHAFTS[1:4]),
                              eta_M @ (inertia @ e @ C - friction))


class SymmetricDae:
    """
    Variant 2: five elements and three kinematic constraints, solved for (e, M), (40)-(52).

    The constraints g_omega omega = 0 are linear, so the redundant speeds are kept on them by
    coordinate partitioning: omega_1 and omega_2 are integrated, the other three are what
    g_omega makes of them. Nothing can drift off.
    """

    INDEPENDENT, DEPENDENT = [1, 2], [0, 3, 4]   # of (0, 1, 2, 3, s)

    def __init__(self, parameters):
        self.p = parameters

    def constraints(self):
        """Return g_omega, (3, 5), (47)."""
        p = self.p
        return np.array([
            [2, -1, -1, 0, 0],
            [p.g_F, 0, 0, -1, 0],
            [0, 1, -1, 0, 2 * p.g_2s]])

    def lift(self):
        """Return the matrix (5, 2) that gives all speeds from the independent ones."""
        g = self.constraints()
        N = np.zeros((5, 2))
        N[self.INDEPENDENT] = np.eye(2)
        N[self.DEPENDENT] = -np.linalg.solve(g[:, self.DEPENDENT], g[:, self.INDEPENDENT])
        return N

    def efficiencies(self, flow):
        """Return eta_M (5, 3), eta_L (5, 5) and eta_T (5, 5): (42) direct, (52) reverse."""
        p = self.p
        if flow != REVERSE:
            eta = flow
            eta_0L, eta_3L = eta.carrier_drag, eta.pinion_drag
            eta_m = np.array([
                [-eta.mesh_F * eta.carrier_input, 1 / eta.carrier_mesh, 1 / eta.carrier_mesh],
                [0, -eta.mesh_1, 0],
                [0, 0, -eta.mesh_2],
                [1 / eta.pinion_mesh, 0, 0],
                [0, -1, 1]])
            eta_t = np.diag([1, 1, 1, eta.pinion_input, 1])
        else:
            eta_0L, eta_3L = p.eta_0B, p.eta_3B
            eta_m = np.array([   # erratum (52): eta_kG in the satellite row
                [1 / p.eta_0B, -p.eta_1G, -p.eta_2G],
                [0, 1, 0],
                [0, 0, 1],
                [-p.eta_FG, 0, 0],
                [0, p.eta_1G, -p.eta_2G]])
            eta_t = np.diag([1, 1, 1, 1 / p.eta_3B, 1])   # erratum (52): T_3/eta_3B
        eta_l = np.array([
            [1 / eta_0L, -1 / eta_0L, -1 / eta_0L, 0, 0],
            [0, 1, 0, 0, 0],
            [0, 0, 1, 0, 0],
            [0, 0, 0, 1 / eta_3L, 0],
            [0, 0, 0, 0, 1]])
        return eta_m, eta_l, eta_t

    def system(self, flow):
        """
        Return A (8, 8), B (8, 8), C (8, 2) of x' = A x + B u - C F, (49)-(51).

        x is (omega, K), u the torques on the elements, F the moments of the clutches.
        """
        p = self.p
        eta_m, eta_l, eta_t = self.efficiencies(of_flow(p, flow))
        inertia = np.diag([p.I_0, p.I_1, p.I_2, p.I_3, p.I_s])
        g = np.diag([1, 1, 1, p.g_F, p.n_s / p.g_2s])   # erratum (41): five entries
        l_omega = np.diag([p.l_0, p.l_1, p.l_2, p.l_3, p.l_s])
        e_omega = np.array([
            [1, 0, 0, 0, 0],
            [-1, 1, 0, 0, 0],
            [-1, 0, 1, 0, 0],
            [0, 0, 0, 1, 0],
            [0, 0, 0, 0, 1]])
        I_D = np.block([[inertia @ g, eta_m], [self.constraints(), np.zeros((3, 3))]])
        g_L = np.block([[eta_l @ g @ l_omega @ e_omega, np.zeros((5, 3))],
                        [np.zeros((3, 8))]])
        g_T = np.block([[eta_t @ g, np.zeros((5, 3))], [np.zeros((3, 8))]])
        g_C = np.vstack([eta_l[:, 1:3], np.zeros((3, 2))])   # F_k acts wherever L_k does
        return -np.linalg.solve(I_D, g_L), np.linalg.solve(I_D, g_T), np.linalg.solve(I_D, g_C)

    def response(self, flow):
        """Return the ``LinearResponse`` for a flow: DIRECT, REVERSE, or ``Efficiencies``."""
        A, B, C = self.system(flow)
        A, B = A[:, :5] @ self.lift(), B[:, :5] @ ON_SHAFTS   # T_D of (48), 0 where no port is
        D = self.INDEPENDENT
        return LinearResponse(A[D], B[D], C[D], A[5:], B[5:], C[5:])


@dataclass(frozen=True, slots=True)
class Moments:
    """The internal moments in plain floats, for one direction; the torques are (T_3, T_1, T_2)."""

    P_F1: float
    P_F2: float
    Q_F3: float
    Q_F1: float
    Q_F2: float
    P_11: float
    P_12: float
    Q_13: float
    Q_11: float
    Q_12: float
    P_21: float
    P_22: float
    Q_23: float
    Q_21: float
    Q_22: float


def moments(k, x, T):
    """Return (M_F, M_1, M_2) at the speeds x under the torques T, by ``Moments``."""
    x_1, x_2 = x
    T_3, T_1, T_2 = T
    return (k.P_F1 * x_1 + k.P_F2 * x_2 + k.Q_F3 * T_3 + k.Q_F1 * T_1 + k.Q_F2 * T_2,
            k.P_11 * x_1 + k.P_12 * x_2 + k.Q_13 * T_3 + k.Q_11 * T_1 + k.Q_12 * T_2,
            k.P_21 * x_1 + k.P_22 * x_2 + k.Q_23 * T_3 + k.Q_21 * T_1 + k.Q_22 * T_2)
