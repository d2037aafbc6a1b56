# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The kinetic energy of a mechanism, a quadratic form (m_11, m_12, m_22) in two speeds."""


def kinetic_form(p):
    """Return the form of the kinetic energy in (w, s) of a table of parameters."""
    g_F, I_3 = getattr(p, 'g_F', 0.0), getattr(p, 'I_3', 0.0)
    k_1, k_2 = p.g_12 / (1 + p.g_12), 1 / (1 + p.g_12)
    spin = k_2 / p.g_2s   # of the satellites, over the slip
    return (p.I_0 + p.I_1 + p.I_2 + I_3 * g_F * g_F, p.I_1 * k_1 - p.I_2 * k_2,
            p.I_1 * k_1 * k_1 + p.I_2 * k_2 * k_2 + p.n_s * p.I_s * spin * spin)


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
