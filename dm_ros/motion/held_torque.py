# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The step of the symmetric differential: linear under held torques, hence exact at any length."""

from dataclasses import dataclass

import numpy as np

from dm_ros.motion.exponentials import held_propagator


@dataclass(frozen=True, slots=True)
class HeldTorqueStep:
    """
    The exact step of a linear response, for one direction and one length.

    Speeds x(h) = Phi x + Gamma T, their integral over the step = Psi x + Theta T; the torques
    are numbered as the shafts of the paper, (T_3, T_1, T_2).
    """

    Phi_11: float
    Phi_12: float
    Gamma_13: float
    Gamma_11: float
    Gamma_12: float
    Phi_21: float
    Phi_22: float
    Gamma_23: float
    Gamma_21: float
    Gamma_22: float
    Psi_11: float
    Psi_12: float
    Theta_13: float
    Theta_11: float
    Theta_12: float
    Psi_21: float
    Psi_22: float
    Theta_23: float
    Theta_21: float
    Theta_22: float


def held_torque_step(response, h):
    """Return the ``HeldTorqueStep`` of a ``LinearResponse`` over h, s."""
    Phi, Gamma, Psi, Theta = held_propagator(response.A, response.B, h)
    rows = np.vstack([np.hstack([Phi, Gamma]), np.hstack([Psi, Theta])])
    return HeldTorqueStep(*rows.ravel().tolist())


def step(k, x, T):
    """Return the two speeds after the step and their integrals over it."""
    x_1, x_2 = x
    T_3, T_1, T_2 = T
    return ((k.Phi_11 * x_1 + k.Phi_12 * x_2
             + k.Gamma_13 * T_3 + k.Gamma_11 * T_1 + k.Gamma_12 * T_2,
             k.Phi_21 * x_1 + k.Phi_22 * x_2
             + k.Gamma_23 * T_3 + k.Gamma_21 * T_1 + k.Gamma_22 * T_2),
            (k.Psi_11 * x_1 + k.Psi_12 * x_2
             + k.Theta_13 * T_3 + k.Theta_11 * T_1 + k.Theta_12 * T_2,
             k.Psi_21 * x_1 + k.Psi_22 * x_2
             + k.Theta_23 * T_3 + k.Theta_21 * T_1 + k.Theta_22 * T_2))
