# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
Fixed-step integrators under torques that are held within the step.

``HeldTorqueStep``  the symmetric differential: linear, so the step is exact
``ClutchStep``      the self-locking differential: stiff and nonlinear through the clutches

Both work in plain floats: on 2x2 systems that is several times faster than arrays.
"""

import cmath
import math

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from dm_ros.mechanism.self_locking import solve_moments


def held_torque_propagator(A, B, h):
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


class HeldTorqueStep:
    """The exact step of a linear response, made once for each direction of power flow."""

    def __init__(self, responses, h):
        """
        Make the exact step.

        :param responses: ``{+1: LinearResponse, -1: LinearResponse}``.
        :param h: length of the step, s.
        """
        self._rows = {}
        for direction, response in responses.items():
            Phi, Gamma, Psi, Theta = held_torque_propagator(response.A, response.B, h)
            rows = np.vstack([np.hstack([Phi, Gamma]), np.hstack([Psi, Theta])])
            self._rows[direction] = tuple(rows.ravel().tolist())

    def step(self, x, torque, direction):
        """Return the two speeds after the step and their integrals over it."""
        (a11, a12, b11, b12, b13, a21, a22, b21, b22, b23,
         e11, e12, d11, d12, d13, e21, e22, d21, d22, d23) = self._rows[direction]
        x1, x2 = x
        u1, u2, u3 = torque
        return ((a11 * x1 + a12 * x2 + b11 * u1 + b12 * u2 + b13 * u3,
                 a21 * x1 + a22 * x2 + b21 * u1 + b22 * u2 + b23 * u3),
                (e11 * x1 + e12 * x2 + d11 * u1 + d12 * u2 + d13 * u3,
                 e21 * x1 + e22 * x2 + d21 * u1 + d22 * u2 + d23 * u3))


def phi_2(z):
    """Return (e^z - 1 - z)/z^2 of a real or complex number."""
    if abs(z) < 0.02:
        return 1 / 2 + z * (1 / 6 + z * (1 / 24 + z * (1 / 120 + z * (1 / 720 + z / 5040))))
    if isinstance(z, complex):
        return (cmath.exp(z) - 1 - z) / (z * z)
    return (math.expm1(min(z, 300.0)) - z) / (z * z)   # growth beyond e^300 is refused anyway


def apply_phi_2(z11, z12, z21, z22, v1, v2):
    """Return the vector phi_2(Z) v for a 2x2 matrix Z, by interpolation at its eigenvalues."""
    mean, half = (z11 + z22) / 2, (z11 - z22) / 2
    square = half * half + z12 * z21
    root = math.sqrt(square) if square >= 0.0 else 1j * math.sqrt(-square)
    high, low = mean + root, mean - root
    value = phi_2(high)
    if abs(root) > 1e-4:
        slope = (value - phi_2(low)) / (2 * root)
    else:   # the two meet: the derivative, to O(root^2), by a difference wide enough
        slope = (phi_2(mean + 1e-3) - phi_2(mean - 1e-3)) / 2e-3
    w1 = value * v1 + slope * ((z11 - high) * v1 + z12 * v2)
    w2 = value * v2 + slope * (z21 * v1 + (z22 - high) * v2)
    return (w1, w2) if square >= 0.0 else (w1.real, w2.real)


def rosenbrock_part(slope, w, s, here, J, h):
    """
    Return ``d, integral, c`` of one exponential Rosenbrock step, each a pair.

    y + d is of second order and exact where the flow is linear, y + d + c is of third order.
    The integral is that of y + d over the step; c adds h c/4 to it.

    :param here: ``slope(w, s)``; J: its Jacobian as (J_ww, J_ws, J_sw, J_ss); h: the step, s.
    """
    f1, f2 = here[0], here[1]
    z11, z12, z21, z22 = h * J[0], h * J[1], h * J[2], h * J[3]
    v1, v2 = apply_phi_2(z11, z12, z21, z22, f1, f2)
    d1, d2 = h * (f1 + z11 * v1 + z12 * v2), h * (f2 + z21 * v1 + z22 * v2)   # phi_1 = 1 + Z phi_2
    there = slope(w + d1, s + d2)
    return ((d1, d2), (h * (w + h * v1), h * (s + h * v2)),
            nonlinear_part(here, there, J, h, d1, d2))


def nonlinear_part(here, there, J, h, d1, d2):
    """Return h (3 I - |h| J)^-1 (f(there) - f(here) - J d) of two points that are d apart."""
    D1 = h * (there[0] - here[0] - J[0] * d1 - J[1] * d2)
    D2 = h * (there[1] - here[1] - J[2] * d1 - J[3] * d2)
    k = abs(h)
    a, b, c, d = 3 - k * J[0], k * J[1], k * J[2], 3 - k * J[3]
    det = a * d - b * c
    return (d * D1 + b * D2) / det, (c * D1 + a * D2) / det


def backward_euler(slope, w, s, here, J, h):
    """
    Return (w, s) after a step that is stable whatever its length.

    Implicit in the slip, of which the friction is a monotone function, by a bracketed root;
    linearly implicit in the carrier speed, on which it hardly depends.
    """
    damped = h / max(1.0, 1.0 - h * J[0])

    def carrier(slip):
        return w + damped * slope(w, slip)[0]

    def residual(slip):
        return slip - s - h * slope(carrier(slip), slip)[1]

    reach = -residual(s)
    for _ in range(60):
        if residual(s + reach) * reach >= 0.0:
            slip = brentq(residual, s, s + reach, xtol=1e-12, maxiter=200, disp=False)
            return carrier(slip), slip
        reach *= 2.0
    return carrier(s), s   # no number in reach fits: the clutch holds


class ClutchStep:
    """
    One solver step of a self-locking differential, in y = (omega_0, omega_1 - omega_2).

    The step is made of as many parts as its error asks for. A part is an exponential
    Rosenbrock step (Hochbruck and Ostermann 2010, section 2.4): with the slope f, its Jacobian
    J and Z = h J,

        d = h phi_1(Z) f(y)                           exact for a linear system, order 2
        D = f(y + d) - f(y) - J d                     what is not linear
        y_new = y + d + c,  c = h (3 I - Z)^-1 D      order 3; c is the error estimate of d

    phi_1 takes the stiff clutch for what it is, so a locked or a fully slipping clutch takes
    one part, whatever the torque. Where slip reverses or starts, the part shrinks until the
    estimate fits. c may vanish by chance where slip crosses the whole of tanh, so the same
    estimate, seen from the end of the part, must fit as well. The work is bounded: after
    ``MOST_PARTS`` trials the rest of the step is one backward Euler step, stable but coarse,
    and ``coarse`` says so.
    """

    TOLERANCE = 1e-4        # rad/s, error estimate allowed in one part
    RELATIVE = 1e-6         # of the change of speed in the part
    BACKWARD = 3.0          # times that, for the estimate seen from the end
    SAFETY, SHRINK, GROW = 0.8, 0.1, 5.0
    MOST_PARTS = 200

    def __init__(self, responses, steepness, full_friction, tolerance=TOLERANCE):
        """
        Make the step.

        :param responses: ``{+1: LinearResponse, -1: LinearResponse}``.
        :param steepness: ``(a_1, a_2)``, s/rad, friction grows with tanh(a_k slip).
        :param full_friction: ``((phi_1, phi_2), (F_s1, F_s2))`` at full slip: the proportional
            factors tan(alpha) f_k and the static moments, N m.
        :param tolerance: rad/s, error estimate allowed in one part.
        """
        self._tolerance = tolerance
        self._speed = {direction: tuple(np.hstack([r.A, r.C, r.P, r.W]).ravel().tolist())
                       for direction, r in responses.items()}
        self._torque = {direction: tuple(np.vstack([r.B, r.Q]).ravel().tolist())
                        for direction, r in responses.items()}
        self._steepness = steepness
        self._full_friction = full_friction

    def flow(self, torque, direction, full_friction=None):
        """
        Return the functions ``slope`` and ``jacobian`` of the motion under held torques.

        ``slope(w, s)`` gives ``(dw/dt, ds/dt, F_1, F_2, M_1, M_2, ...)`` at the carrier speed w
        and the slip s; what follows is for ``jacobian``, which takes it whole and gives
        (J_ww, J_ws, J_sw, J_ss).
        """
        (A11, A12, C11, C12, P11, P12, W11, W12,
         A21, A22, C21, C22, P21, P22, W21, W22) = self._speed[direction]
        (B10, B11, B12, B20, B21, B22,
         Q10, Q11, Q12, Q20, Q21, Q22) = self._torque[direction]
        T0, T1, T2 = torque
        b1 = B10 * T0 + B11 * T1 + B12 * T2
        b2 = B20 * T0 + B21 * T1 + B22 * T2
        m1 = Q10 * T0 + Q11 * T1 + Q12 * T2
        m2 = Q20 * T0 + Q21 * T1 + Q22 * T2
        a1, a2 = self._steepness
        (g1, g2), (n1, n2) = full_friction or self._full_friction
        tanh = math.tanh

        def slope(w, s):
            t1, t2 = tanh(a1 * s), tanh(a2 * s)
            x1, x2, F1, F2 = g1 * t1, g2 * t2, n1 * t1, n2 * t2
            z1 = m1 + P11 * w + P12 * s - W11 * F1 - W12 * F2
            z2 = m2 + P21 * w + P22 * s - W21 * F1 - W22 * F2
            # M = z - W diag(x) |M| with the signs of z, which nearly always are those of M
            if z1 < 0.0:
                x1 = -x1
            if z2 < 0.0:
                x2 = -x2
            a, b, c, d = 1 + W11 * x1, W12 * x2, W21 * x1, 1 + W22 * x2
            det = a * d - b * c
            M1, M2 = (d * z1 - b * z2) / det, (a * z2 - c * z1) / det
            if M1 * z1 < 0.0 or M2 * z2 < 0.0:
                x1, x2 = g1 * t1, g2 * t2
                M1, M2 = solve_moments((z1, z2), ((W11, W12), (W21, W22)), (x1, x2))
                if M1 < 0.0:
                    x1 = -x1
                if M2 < 0.0:
                    x2 = -x2
            F1 += x1 * M1
            F2 += x2 * M2
            return (b1 + A11 * w + A12 * s - C11 * F1 - C12 * F2,
                    b2 + A21 * w + A22 * s - C21 * F1 - C22 * F2,
                    F1, F2, M1, M2, t1, t2, x1, x2)

        def jacobian(point):
            _, _, _, _, M1, M2, t1, t2, x1, x2 = point
            # dF = diag(x) dM + N ds with dM = P dy - W dF, so (I + diag(x) W) dF = ...
            N1 = (g1 * abs(M1) + n1) * a1 * (1 - t1 * t1)
            N2 = (g2 * abs(M2) + n2) * a2 * (1 - t2 * t2)
            a, b, c, d = 1 + x1 * W11, x1 * W12, x2 * W21, 1 + x2 * W22
            det = a * d - b * c
            r1, r2 = x1 * P11, x2 * P21
            Fw1, Fw2 = (d * r1 - b * r2) / det, (a * r2 - c * r1) / det
            r1, r2 = x1 * P12 + N1, x2 * P22 + N2
            Fs1, Fs2 = (d * r1 - b * r2) / det, (a * r2 - c * r1) / det
            return (A11 - C11 * Fw1 - C12 * Fw2, A12 - C11 * Fs1 - C12 * Fs2,
                    A21 - C21 * Fw1 - C22 * Fw2, A22 - C21 * Fs1 - C22 * Fs2)

        return slope, jacobian

    def step(self, y, torque, direction, h, full_friction=None, parts=None):
        """
        Return ``(y, integral of y, (M_1, M_2, F_1, F_2), coarse)`` at the end of the step.

        :param y: ``(omega_0, omega_1 - omega_2)``, rad/s.
        :param torque: ``(T_0, T_1, T_2)``, held, N m.
        :param direction: +1 direct or -1 reverse flow, held.
        :param h: length of the step, s.
        :param full_friction: in place of that given at the start.
        :param parts: list that gets ``(slope, w, s, (f_w, f_s), J, h, c_w, c_s)`` of each part:
            its start, f and J there, its length and its correction c.
        """
        slope, jacobian = self.flow(torque, direction, full_friction)
        w, s = y
        angle_w = angle_s = 0.0
        left = part = h
        here = slope(w, s)
        J = jacobian(here)
        for _ in range(self.MOST_PARTS):
            (dw, ds), (aw, as_), (cw, cs) = rosenbrock_part(slope, w, s, here, J, part)
            allowed = self._tolerance + self.RELATIVE * (abs(dw) + abs(ds))
            error = (abs(cw) + abs(cs)) / allowed
            if error <= 1.0:
                there = slope(w + dw + cw, s + ds + cs)
                J_there = jacobian(there)
                rw, rs = nonlinear_part(there, here, J_there, -part, -dw - cw, -ds - cs)
                error = max(error, (abs(rw) + abs(rs)) / (self.BACKWARD * allowed))
            if error <= 1.0:
                if parts is not None:
                    parts.append((slope, w, s, here[:2], J, part, cw, cs))
                angle_w += aw + part * cw / 4
                angle_s += as_ + part * cs / 4
                w += dw + cw
                s += ds + cs
                here, J = there, J_there
                left -= part
                if left <= 0.0:
                    return (w, s), (angle_w, angle_s), moments_at(here), False
            scale = self.SAFETY * error ** (-1 / 3) if error > 1e-3 else self.GROW
            part *= min(self.GROW, max(self.SHRINK, scale))
            if part > 0.999 * left:
                part = left
        w_end, s_end = backward_euler(slope, w, s, here, J, left)
        if parts is not None:   # a straight line
            parts.append((slope, w, s, ((w_end - w) / left, (s_end - s) / left),
                          (0.0, 0.0, 0.0, 0.0), left, 0.0, 0.0))
        angle_w += left * (w + w_end) / 2
        angle_s += left * (s + s_end) / 2
        return (w_end, s_end), (angle_w, angle_s), moments_at(slope(w_end, s_end)), True

    def moments(self, y, torque, direction, full_friction=None):
        """Return (M_1, M_2, F_1, F_2) at the speeds y, with the parameters of ``step``."""
        slope, _ = self.flow(torque, direction, full_friction)
        return moments_at(slope(*y))


def moments_at(point):
    """Return (M_1, M_2, F_1, F_2) from what ``slope`` gives."""
    _, _, F1, F2, M1, M2, *_ = point
    return M1, M2, F1, F2
