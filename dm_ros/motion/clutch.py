# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The step of a differential with clutches: stiff, and nonlinear through the friction.

A step in y = (omega_0, omega_1 - omega_2) is made of as many parts as its error asks for. A part
is an exponential Rosenbrock step (Hochbruck and Ostermann 2010, section 2.4): with the slope f,
its Jacobian J and Z = h J,

    d = h phi_1(Z) f(y)                           exact for a linear system, order 2
    D = f(y + d) - f(y) - J d                     what is not linear
    y_new = y + d + c,  c = h (3 I - Z)^-1 D      order 3; c is the error estimate of d

phi_1 takes the stiff clutch for what it is, so a locked or a fully slipping clutch takes one
part, whatever the torque. Where slip reverses or starts, the part shrinks until the estimate
fits. c may vanish by chance where slip crosses the whole of tanh, so the same estimate, seen
from the end of the part, must fit as well. The work is bounded: after ``MOST_PARTS`` trials the
rest of the step is one backward Euler step, stable but coarse.

All works in plain floats: on 2x2 systems that is several times faster than arrays.
"""

from scipy.optimize import brentq

from dm_ros.mechanism.clutched import evaluate, jacobian
from dm_ros.motion.exponentials import apply_phi_2

TOLERANCE = 1e-4        # rad/s, error estimate allowed in one part
RELATIVE = 1e-6         # of the change of speed in the part
BACKWARD = 3.0          # times that, for the estimate seen from the end
SAFETY, SHRINK, GROW = 0.8, 0.1, 5.0
MOST_PARTS = 200


def rosenbrock_part(k, u, w, s, here, J, h):
    """
    Return ``d, integral, c`` of one exponential Rosenbrock step, each a pair.

    y + d is of second order and exact where the flow is linear, y + d + c is of third order.
    The integral is that of y + d over the step; c adds h c/4 to it.

    :param here: the point at (w, s); J: the Jacobian there; h: the step, s.
    """
    f_w, f_s = here[0], here[1]
    J_ww, J_ws, J_sw, J_ss, _, _, _, _ = J
    z_ww, z_ws, z_sw, z_ss = h * J_ww, h * J_ws, h * J_sw, h * J_ss
    v_w, v_s = apply_phi_2(z_ww, z_ws, z_sw, z_ss, f_w, f_s)
    # phi_1 = 1 + Z phi_2
    d_w, d_s = h * (f_w + z_ww * v_w + z_ws * v_s), h * (f_s + z_sw * v_w + z_ss * v_s)
    there = evaluate(k, u, w + d_w, s + d_s)
    return ((d_w, d_s), (h * (w + h * v_w), h * (s + h * v_s)),
            nonlinear_part(here, there, J, h, d_w, d_s))


def nonlinear_part(here, there, J, h, d_w, d_s):
    """Return h (3 I - |h| J)^-1 (f(there) - f(here) - J d) of two points that are d apart."""
    J_ww, J_ws, J_sw, J_ss, _, _, _, _ = J
    D_w = h * (there[0] - here[0] - J_ww * d_w - J_ws * d_s)
    D_s = h * (there[1] - here[1] - J_sw * d_w - J_ss * d_s)
    k = abs(h)
    a, b, c, d = 3 - k * J_ww, k * J_ws, k * J_sw, 3 - k * J_ss
    det = a * d - b * c
    return (d * D_w + b * D_s) / det, (c * D_w + a * D_s) / det


def backward_euler(k, u, w, s, J, h):
    """
    Return (w, s) after a step that is stable whatever its length.

    Implicit in the slip, of which the friction is a monotone function, by a bracketed root;
    linearly implicit in the carrier speed, on which it hardly depends.
    """
    damped = h / max(1.0, 1.0 - h * J[0])

    def carrier(slip):
        return w + damped * evaluate(k, u, w, slip)[0]

    def residual(slip):
        return slip - s - h * evaluate(k, u, carrier(slip), slip)[1]

    reach = -residual(s)
    for _ in range(60):
        if residual(s + reach) * reach >= 0.0:
            slip = brentq(residual, s, s + reach, xtol=1e-12, maxiter=200, disp=False)
            return carrier(slip), slip
        reach *= 2.0
    return carrier(s), s   # no number in reach fits: the clutch holds


def step(k, u, y, h, tolerance=TOLERANCE):
    """
    Return ``(y, integral of y, point, coarse, parts)`` at the end of a step.

    :param k: ``Coefficients``; u: what ``held`` makes of the inputs.
    :param y: ``(omega_0, omega_1 - omega_2)``, rad/s; h: length of the step, s.
    :param tolerance: rad/s, error estimate allowed in one part.
    :return: whether the step was coarse, and the parts of its path, each ``(y, f, J, h, d, c,
        integral, here, there)``: within a part of length h the path is y + q + c (t/h)^3 with
        q = t phi_1(t J) f, which is d at its end; ``here`` and ``there`` are the points at the
        ends, and the integral is that of the path.
    """
    w, s = y
    angle_w = angle_s = 0.0
    left = part = h
    parts = []
    here = evaluate(k, u, w, s)
    J = jacobian(k, u, here)
    for _ in range(MOST_PARTS):
        (d_w, d_s), (i_w, i_s), (c_w, c_s) = rosenbrock_part(k, u, w, s, here, J, part)
        allowed = tolerance + RELATIVE * (abs(d_w) + abs(d_s))
        error = (abs(c_w) + abs(c_s)) / allowed
        if error <= 1.0:
            there = evaluate(k, u, w + d_w + c_w, s + d_s + c_s)
            J_there = jacobian(k, u, there)
            r_w, r_s = nonlinear_part(there, here, J_there, -part, -d_w - c_w, -d_s - c_s)
            error = max(error, (abs(r_w) + abs(r_s)) / (BACKWARD * allowed))
        if error <= 1.0:
            i_w += part * c_w / 4
            i_s += part * c_s / 4
            parts.append(((w, s), (here[0], here[1]), J, part, (d_w, d_s), (c_w, c_s),
                          (i_w, i_s), False, here, there))
            angle_w += i_w
            angle_s += i_s
            w += d_w + c_w
            s += d_s + c_s
            here, J = there, J_there
            left -= part
            if left <= 0.0:
                return (w, s), (angle_w, angle_s), here, False, parts
        scale = SAFETY * error ** (-1 / 3) if error > 1e-3 else GROW
        part *= min(GROW, max(SHRINK, scale))
        if part > 0.999 * left:
            part = left
    w_end, s_end = backward_euler(k, u, w, s, J, left)
    there = evaluate(k, u, w_end, s_end)
    d_w, d_s = w_end - w, s_end - s
    i_w, i_s = left * (w + w_end) / 2, left * (s + s_end) / 2
    parts.append(((w, s), (d_w / left, d_s / left), J, left, (d_w, d_s), (0.0, 0.0),
                  (i_w, i_s), True, here, there))
    return (w_end, s_end), (angle_w + i_w, angle_s + i_s), there, True, parts
