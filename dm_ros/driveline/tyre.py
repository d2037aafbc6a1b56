# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
A tyre: the magic formula of a carcass that has to be deflected first, and a damping at low speed.

The state is the slip, kappa forward and alpha to the left, which at rest is a spring. In the frame
of the wheel, with the speed of its tread R omega and the velocity (V_x, V_y) of its centre::

    V_sx = R omega - V_x,  V_sy = -V_y,  V_r = (|V_x| + |R omega| + |V_s|)/2
    dkappa/dt = (V_sx - V_r kappa)/sigma_x,  dalpha/dt = (V_sy - V_r alpha)/sigma_y,  sigma = ell K
    p = (K_x kappa, K_y alpha)/mu,  rho = |p|,  f = sin(C atan(rho/C))
    F = mu F_z [f p/rho + c_d/(1 + (V_r/v_low)^2)^2 (1 - f^2) V_s]

F acts on the body, and -R F_x on the wheel. alpha is positive with F_y: minus the slip angle of
ISO 8855. Straight ahead V_r is the faster of tread and road, so slip stays in [-1, 1].

The carcass stores ``mu^2 F_z ell`` times the integral of f over rho. Of the power F V_s that body
and wheel give it loses ``V_r (F_x kappa + F_y alpha)``, F without damping, and the damping.
"""

from dataclasses import dataclass
from math import asinh, atan, cos, hypot, pi, sin, sinh

import numpy as np

SMALL = 1e-4           # rho below which its series stand for what is divided by it
LEAST_GRIP = 0.2       # share of the grip of the road that no load takes away
NODES_PER_UNIT = 64    # of asinh(rho/C), for the integral of f
LAST_NODE = 30.0       # asinh(rho/C) of 5e12
GAUSS = np.polynomial.legendre.leggauss(12)


@dataclass(frozen=True, slots=True)
class Coefficients:
    """What does not change while the parameters stay."""

    K_x: float
    K_y: float
    sigma_x: float
    sigma_y: float
    ell: float
    C: float
    c_d: float
    v_low: float
    k_mu: float
    load_0: float


def coefficients(p):
    """Return the ``Coefficients`` of ``VehicleParameters``."""
    return Coefficients(p.K_x, p.K_y, p.ell * p.K_x, p.ell * p.K_y, p.ell, p.C, p.c_d, p.v_low,
                        p.k_mu, p.load_0)


def friction(k, grip, F_z):
    """Return mu under a wheel load F_z, N, and what it grows with per newton."""
    share = 1.0 - k.k_mu * (F_z / k.load_0 - 1.0)
    if share > LEAST_GRIP:
        return grip * share, -grip * k.k_mu / k.load_0
    return grip * LEAST_GRIP, 0.0


def contact(k, mu, F_z, kappa, alpha, U, V_x, V_y):
    """
    Return the contact of one tyre with the road.

    :param U: R omega, m/s; V_x, V_y: velocity of the wheel centre in its frame, m/s.
    :return: (F_x, F_y, dkappa/dt, dalpha/dt, V_sx, V_sy, V_s, V_r, p_x, p_y, rho, f, share,
        damping), with share = f/rho and the damping over mu F_z, s/m.
    """
    V_sx, V_sy = U - V_x, -V_y
    V_s = hypot(V_sx, V_sy)
    V_r = 0.5 * (abs(V_x) + abs(U) + V_s)
    p_x, p_y = k.K_x * kappa / mu, k.K_y * alpha / mu
    rho = hypot(p_x, p_y)
    f = sin(k.C * atan(rho / k.C))
    share = f / rho if rho > SMALL else 1.0 - rho * rho * (1.0 / 6.0 + 1.0 / (3.0 * k.C * k.C))
    fade = 1.0 + (V_r / k.v_low) * (V_r / k.v_low)
    damping = k.c_d * (1.0 - f * f) / (fade * fade)
    N = mu * F_z
    return (N * (share * p_x + damping * V_sx), N * (share * p_y + damping * V_sy),
            (V_sx - V_r * kappa) / k.sigma_x, (V_sy - V_r * alpha) / k.sigma_y,
            V_sx, V_sy, V_s, V_r, p_x, p_y, rho, f, share, damping)


def slopes(k, mu, F_z, kappa, alpha, U, V_x, point):
    """
    Return what (F_x, F_y, dkappa/dt, dalpha/dt) grow with, at a given load.

    :param point: what ``contact`` returned.
    :return: 20 numbers: four rows, per kappa, alpha, R omega, V_x, V_y.
    """
    _, _, _, _, V_sx, V_sy, V_s, V_r, p_x, p_y, rho, f, share, damping = point
    q = rho / k.C
    f_rho = cos(k.C * atan(q)) / (1.0 + q * q)
    # share and damping grow with rho^2/2 by a and b, and V_r with U, V_x, V_y by r_*
    a = ((f_rho - share) / (rho * rho) if rho > SMALL
         else -1.0 / 3.0 - 2.0 / (3.0 * k.C * k.C))
    v = V_r / k.v_low
    fade = 1.0 + v * v
    b = -2.0 * k.c_d / (fade * fade) * share * f_rho
    e_x, e_y = (V_sx / V_s, V_sy / V_s) if V_s else (0.0, 0.0)
    r_U, r_x, r_y = 0.5 * (_sign(U) + e_x), 0.5 * (_sign(V_x) - e_x), -0.5 * e_y
    N = mu * F_z
    g_x, g_y = F_z * k.K_x, F_z * k.K_y
    A_x, A_y = a * p_x + b * V_sx, a * p_y + b * V_sy
    D = -4.0 * damping * v / (k.v_low * fade)
    N_x, N_y, N_d = N * D * V_sx, N * D * V_sy, N * damping
    c_x, c_y = kappa / k.sigma_x, alpha / k.sigma_y
    return (g_x * (share + p_x * A_x), g_y * p_y * A_x,
            N_d + N_x * r_U, N_x * r_x - N_d, N_x * r_y,
            g_x * p_x * A_y, g_y * (share + p_y * A_y),
            N_y * r_U, N_y * r_x, N_y * r_y - N_d,
            -V_r / k.sigma_x, 0.0,
            1.0 / k.sigma_x - c_x * r_U, -1.0 / k.sigma_x - c_x * r_x, -c_x * r_y,
            0.0, -V_r / k.sigma_y,
            -c_y * r_U, -c_y * r_x, -1.0 / k.sigma_y - c_y * r_y)


def lost_powers(mu, F_z, kappa, alpha, point):
    """Return what slip and damping take, W; neither is ever negative."""
    _, _, _, _, _, _, V_s, V_r, p_x, p_y, _, _, share, damping = point
    N = mu * F_z
    return N * share * (p_x * kappa + p_y * alpha) * V_r, N * damping * V_s * V_s


class Carcass:
    """
    The energy in the deflection of a tyre.

    The integral of f over rho is a quintic spline in asinh(rho/C), right to 1e-13 of itself.
    """

    def __init__(self, k):
        C = self._C = k.C
        self._ell = k.ell
        t = np.arange(LAST_NODE * NODES_PER_UNIT + 1) / NODES_PER_UNIT
        nodes, weights = GAUSS
        inner = t[:-1, None] + (nodes + 1) / (2 * NODES_PER_UNIT)
        pieces = (np.sin(C * np.arctan(np.sinh(inner))) * C * np.cosh(inner)) @ weights
        value = np.concatenate([[0.0], np.cumsum(pieces / (2 * NODES_PER_UNIT))])
        rho, rho_t = np.sinh(t), np.cosh(t)
        f, f_t = np.sin(C * np.arctan(rho)), np.cos(C * np.arctan(rho)) * C / rho_t
        h = 1 / NODES_PER_UNIT
        first, second = h * C * f * rho_t, h * h * C * (f_t * rho_t + f * rho)
        dv = value[1:] - value[:-1] - first[:-1] - second[:-1] / 2
        d1 = first[1:] - first[:-1] - second[:-1]
        d2 = second[1:] - second[:-1]
        self._pieces = [tuple(row) for row in np.column_stack([
            value[:-1], first[:-1], second[:-1] / 2, 10 * dv - 4 * d1 + d2 / 2,
            -15 * dv + 7 * d1 - d2, 6 * dv - 3 * d1 + d2 / 2]).tolist()]
        self._beyond = float(value[-1]), C * sinh(LAST_NODE), sin(C * pi / 2)

    def integral(self, rho):
        """Return the integral of f from 0 to rho."""
        n = NODES_PER_UNIT * asinh(rho / self._C)
        if n >= len(self._pieces):
            value, end, f = self._beyond
            return value + (rho - end) * f
        place = int(n)
        u = n - place
        a, b, c, d, e, g = self._pieces[place]
        return a + u * (b + u * (c + u * (d + u * (e + u * g))))

    def energy(self, mu, mu_slope, F_z, point):
        """Return the energy, J, at a ``contact``, and what it grows with per newton of load."""
        *_, rho, f, _, _ = point
        integral = self.integral(rho)
        return (mu * mu * F_z * self._ell * integral,
                self._ell * mu * ((mu + 2.0 * mu_slope * F_z) * integral
                                  - mu_slope * F_z * f * rho))


def _sign(v):
    return 1.0 if v > 0.0 else -1.0 if v < 0.0 else 0.0
