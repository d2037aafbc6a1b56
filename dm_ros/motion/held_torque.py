# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The step of the symmetric differential: linear under held torques, hence exact at any length."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from dm_ros.mechanism.losses import SymmetricLosses
from dm_ros.mechanism.symmetric import Moments
from dm_ros.motion.exponentials import held_propagator, phi_matrices, product


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


class Exact(NamedTuple):
    """What a step that is exact does, in x = (w, s), and what its books need."""

    step: HeldTorqueStep
    moments: Moments
    losses: SymmetricLosses
    second: tuple   # of ``quadrature.second_moment_of_the_way``


def held_torque_step(A, B, h):
    """Return the ``HeldTorqueStep`` over h, s, of dx/dt = A x + B T."""
    Phi, Gamma, Psi, Theta = held_propagator(A, B, h)
    rows = np.vstack([np.hstack([Phi, Gamma]), np.hstack([Psi, Theta])])
    return HeldTorqueStep(*rows.ravel().tolist())


def held_torque_step_by_floats(A, B, h):
    """
    Return the same in plain floats, which is quick enough for the middle of a run.

    :param A: (11, 12, 21, 22); B: its two rows.
    """
    first, second = phi_matrices([h * a for a in A])
    rows = []
    # x + h phi_1 (A x + B T), and its integral h x + h^2 phi_2 (A x + B T)
    for phi, of_x, of_slope in ((first, 1.0, h), (second, h, h * h)):
        a, b, c, d = product(phi, A)
        (e, f), (g, i) = phi[:2], phi[2:]
        rows += [of_x + of_slope * a, of_slope * b,
                 *(of_slope * (e * u + f * v) for u, v in zip(*B)),
                 of_slope * c, of_x + of_slope * d,
                 *(of_slope * (g * u + i * v) for u, v in zip(*B))]
    return HeldTorqueStep(*rows)


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
