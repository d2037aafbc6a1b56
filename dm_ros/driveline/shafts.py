# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
An elastic shaft with damping and backlash between two flanges a and b.

With the twist phi, ``dphi/dt = omega_a - omega_b``, and the half gap beta it gives to flange b,
and takes from flange a::

    T = T_c + T_d
    T_c = k phi,              T_d = d dphi/dt                         without a gap
    T_c = k (phi -+ beta)     outside the gap, 0 inside
    T_d = d dphi/dt           limited to +-|T_c|, so that the flanks never pull

as ``ElastoBacklash`` of the Modelica Standard Library. It stores T_c^2/(2 k), and T_d dphi/dt is
lost.
"""


def torques(connected, twists, speeds):
    """
    Return (dphi/dt, T_c, T_d) of all shafts, three lists: rad/s, N m, N m.

    :param connected: of each (k, d, beta, a, b): N m/rad, N m s/rad, rad, and which flanges.
    :param twists: phi of each, rad; speeds: of all flanges, rad/s.
    """
    rates, springs, dampings = [], [], []
    for (k, d, beta, a, b), phi in zip(connected, twists):
        rate = speeds[a] - speeds[b]
        spring, damping = k * phi, d * rate
        if beta:
            if phi > beta:
                spring = k * (phi - beta)
                damping = min(max(damping, -spring), spring)
            elif phi < -beta:
                spring = k * (phi + beta)
                damping = min(max(damping, spring), -spring)
            else:
                spring = damping = 0.0
        rates.append(rate)
        springs.append(spring)
        dampings.append(damping)
    return rates, springs, dampings


def slopes(k, d, beta, phi, rate):
    """Return what T grows with per phi, N m/rad, and per dphi/dt, N m s/rad."""
    if not beta:
        return k, d
    if -beta <= phi <= beta:
        return 0.0, 0.0
    spring, damping = k * (phi - beta if phi > 0.0 else phi + beta), d * rate
    if -abs(spring) < damping < abs(spring):
        return k, d
    # limited: T_d is T_c or -T_c
    return (2.0 * k if (damping > 0.0) == (spring > 0.0) else 0.0), 0.0
