# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The kinetic energy of a mechanism, a quadratic form (m_11, m_12, m_22) in two speeds."""

import numpy as np

from dm_ros.mechanism import self_locking, symmetric
from dm_ros.mechanism.symmetric import TO_SLIP


def kinetic_form(inertias, shafts):
    """Return (m_11, m_12, m_22): kinetic energy is (m_11 x_1^2 + m_22 x_2^2)/2 + m_12 x_1 x_2."""
    m = shafts.T @ (np.array(inertias)[:, None] * shafts)
    return float(m[0, 0]), float(m[0, 1]), float(m[1, 1])


def symmetric_form(p):
    """Return the form of the kinetic energy of a symmetric differential in (w, s)."""
    return kinetic_form((p.I_0, p.I_1, p.I_2, p.I_3, p.n_s * p.I_s),
                        symmetric.kinematics(p) @ np.linalg.inv(TO_SLIP))


def self_locking_form(p):
    """Return the form of the kinetic energy of a self-locking differential in (w, s)."""
    return kinetic_form(
        (p.I_0, p.I_1, p.I_2, p.n_s * p.I_s),
        self_locking.kinematics(p) @ np.linalg.inv(self_locking.slip_coordinates(p)))


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
