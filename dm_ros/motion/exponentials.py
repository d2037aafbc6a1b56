# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Exponentials of small matrices, in which linear equations are exact."""

import math

import numpy as np
from scipy.linalg import expm

STEEPEST = 300.0   # growth beyond e to that is refused, but where all rests
SMALL = 0.02       # number whose phi is that of a short series
APART = 1e-4       # half the difference of eigenvalues, from which on they are two


def held_propagator(A, B, h):
    """
    Return the exact step of x' = A x + B u and of its integral under a constant u.

    :param A: (n, n); B: (n, m); h: the step, s.
    :return: ``Phi, Gamma, Psi, Theta`` with x(h) = Phi x + Gamma u and
        integral of x over the step = Psi x + Theta u.
    """
    n, m = B.shape
    # z = (integral of x, x, u): one matrix exponential holds all four blocks (Van Loan 1978)
    generator = np.zeros((2 * n + m, 2 * n + m))
    generator[:n, n:2 * n] = np.eye(n)
    generator[n:2 * n, n:2 * n] = A
    generator[n:2 * n, 2 * n:] = B
    E = expm(generator * h)
    return E[n:2 * n, n:2 * n], E[n:2 * n, 2 * n:], E[:n, n:2 * n], E[:n, 2 * n:]


def product(X, Y):
    """Return the product of two 2x2 matrices, each (11, 12, 21, 22)."""
    a, b, c, d = X
    e, f, g, h = Y
    return a * e + b * g, a * f + b * h, c * e + d * g, c * f + d * h


def phi_matrices(Z):
    """
    Return phi_1(Z) and phi_2(Z) of a 2x2 matrix, in plain floats to rounding.

    By Taylor's series of Z/2^n, doubled n times: phi_2(2Z) = (phi_1(Z)^2 + 2 phi_2(Z))/4,
    phi_1(2Z) = (e^Z + 1) phi_1(Z)/2 and e^2Z = (e^Z)^2.

    :param Z: (11, 12, 21, 22).
    """
    size = max(abs(Z[0]) + abs(Z[1]), abs(Z[2]) + abs(Z[3]))
    doublings = max(0, math.frexp(size)[1] + 2)
    small = tuple([math.ldexp(z, -doublings) for z in Z])
    # 1/2! + Z/3! + Z^2/4! + ... by Horner's rule
    a, b, c, d = 1.0, 0.0, 0.0, 1.0
    for n in range(16, 2, -1):
        e, f, g, h = product(small, (a, b, c, d))
        a, b, c, d = 1 + e / n, f / n, g / n, 1 + h / n
    second = a / 2, b / 2, c / 2, d / 2
    a, b, c, d = product(small, second)
    first = 1 + a, b, c, 1 + d
    a, b, c, d = product(small, first)
    a, d = 1 + a, 1 + d
    for _ in range(doublings):
        second = tuple([(x + 2 * y) / 4 for x, y in zip(product(first, first), second)])
        first = tuple([x / 2 for x in product((1 + a, b, c, 1 + d), first)])
        a, b, c, d = product((a, b, c, d), (a, b, c, d))
    return first, second


def phi_2(z):
    """Return (e^z - 1 - z)/z^2."""
    if abs(z) < SMALL:
        return 1 / 2 + z * (1 / 6 + z * (1 / 24 + z * (1 / 120 + z * (1 / 720 + z / 5040))))
    return (math.expm1(min(z, STEEPEST)) - z) / (z * z)


def complex_phi_2(a, b):
    """Return the same of a + ib, b > 0, as a real and an imaginary part."""
    if abs(a) + b < SMALL:
        p, q = 1 / 720 + a / 5040, b / 5040
        for start in (1 / 120, 1 / 24, 1 / 6, 1 / 2):
            p, q = start + (a * p - b * q), a * q + b * p
        return p, q
    if math.isinf(b):   # of which there is no cosine
        raise OverflowError('a mode swings too fast')
    growth = math.exp(min(a, STEEPEST))
    p, q = growth * math.cos(b) - 1.0 - a, growth * math.sin(b) - b
    c, d = a * a - b * b, 2.0 * a * b   # z^2
    size = c * c + d * d
    return (p * c + q * d) / size, (q * c - p * d) / size


def apply_phi_2(z11, z12, z21, z22, v1, v2):
    """Return the vector phi_2(Z) v for a 2x2 matrix Z, by interpolation at its eigenvalues."""
    mean, half = (z11 + z22) / 2, (z11 - z22) / 2
    square = half * half + z12 * z21
    root = math.sqrt(abs(square))
    if square < 0.0:   # mean +- i root: what is imaginary cancels
        center = mean
        value, turning = complex_phi_2(mean, root)
        slope = turning / root
    else:
        center = mean + root
        value, low = phi_2(center), mean - root
        slope = (value - phi_2(low)) / (2 * root) if root > APART else 0.0
    if not root > APART:   # the two meet: the derivative, to O(root^2), by a wide difference
        slope = (phi_2(mean + 1e-3) - phi_2(mean - 1e-3)) / 2e-3
    return (value * v1 + slope * ((z11 - center) * v1 + z12 * v2),
            value * v2 + slope * (z21 * v1 + (z22 - center) * v2))


def way(J, f, h, nodes):
    """
    Return the way q = t phi_1(t J) f of x' = J (x - x_0) + f at the times t = r h, pairs.

    :param J: (J_11, J_12, J_21, J_22); nodes: ``(r, r^2, r^3, weight)`` of each.
    """
    J_11, J_12, J_21, J_22 = J
    f_1, f_2 = f
    mean, half = (J_11 + J_22) / 2, (J_11 - J_22) / 2
    square = half * half + J_12 * J_21
    path = []
    if square > 1e-6 * mean * mean:   # two modes that are far from each other
        root = math.sqrt(square)
        high, low = mean + root, mean - root
        b_1 = ((high - J_11) * f_1 - J_12 * f_2) / (2 * root)
        b_2 = ((high - J_22) * f_2 - J_21 * f_1) / (2 * root)
        a_1, a_2 = f_1 - b_1, f_2 - b_2
        for r, _, _, _ in nodes:
            t = h * r
            slow = math.expm1(min(high * t, STEEPEST)) / high if high else t
            fast = math.expm1(min(low * t, STEEPEST)) / low if low else t
            path.append((a_1 * slow + b_1 * fast, a_2 * slow + b_2 * fast))
    else:
        for r, _, _, _ in nodes:
            t = h * r
            v_1, v_2 = apply_phi_2(t * J_11, t * J_12, t * J_21, t * J_22, f_1, f_2)
            path.append((t * (f_1 + t * (J_11 * v_1 + J_12 * v_2)),
                         t * (f_2 + t * (J_21 * v_1 + J_22 * v_2))))
    return path
