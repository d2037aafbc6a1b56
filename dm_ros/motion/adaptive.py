# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The adaptive step: for motion that is stiff or nonlinear through clutches or the signs of losses.

A step in y = (omega_0, omega_1 - omega_2) is made of as many parts as its error asks for. A part
is an exponential Rosenbrock step (Hochbruck and Ostermann 2010, section 2.4): with the slope f,
its Jacobian J and Z = h J::

    d = h phi_1(Z) f(y)                           exact for a linear system, order 2
    D = f(y + d) - f(y) - J d                     what is not linear
    y_new = y + d + c,  c = h (3 I - Z)^-1 D      order 3; c is the error estimate of d

phi_1 takes the stiff clutch for what it is, so a locked or a fully slipping clutch takes one
part, whatever the torque. Where slip reverses or starts, the part shrinks until the estimate
fits. c may vanish by chance where slip crosses the whole of tanh, so the same estimate, seen
from the end of the part, must fit as well, unless the law knows that nothing bends. The work is
bounded: after as many trials as a law may take the rest of the step is its last resort, an Euler
step, stable but coarse.

All works in plain floats: on 2x2 systems that is several times faster than arrays.
"""

from typing import Callable, NamedTuple

from dm_ros.mechanism import clutched, passive
from dm_ros.motion.exponentials import apply_phi_2
from dm_ros.motion.roots import bracketed_root

TOLERANCE = 1e-4        # rad/s, error estimate allowed in one part
BACKWARD = 3.0          # times that, for the estimate seen from the end
SAFETY, SHRINK, GROW = 0.8, 0.1, 5.0
NEWTON = 30             # steps of Newton's method
FASTEST = 1e150         # rad/s^2, of which squares are still numbers
MOST_RESORTS = 1000     # steps of the last resort, which is halved where it finds no solution


class Law(NamedTuple):
    """The equations of motion under a law of losses, as functions of plain floats."""

    held: Callable          # (k, T, S) -> u, what is constant in a step
    evaluate: Callable      # (k, u, w, s) -> point, which begins with dw/dt, ds/dt
    jacobian: Callable      # (k, u, point) -> (J_ww, J_ws, J_sw, J_ss) and what else it knows
    torque_slopes: Callable   # (k, u, point) -> what dw/dt and ds/dt grow with per torque
    last_resort: Callable   # (law, k, u, y, J, h) -> y and its integral after a step, or None
    most_trials: int
    relative: float         # error estimate allowed besides, of the change of speed in a part
    bends: Callable         # (k, point, point) -> whether the motion may be nonlinear in between


def rosenbrock_part(law, k, u, w, s, here, J, h):
    """
    Return ``d, integral, c`` of one exponential Rosenbrock step, each a pair.

    y + d is of second order and exact where the flow is linear, y + d + c is of third order.
    The integral is that of y + d over the step; c adds h c/4 to it.

    :param here: the point at (w, s); J: the Jacobian there; h: the step, s.
    """
    f_w, f_s = here[0], here[1]
    J_ww, J_ws, J_sw, J_ss = J
    z_ww, z_ws, z_sw, z_ss = h * J_ww, h * J_ws, h * J_sw, h * J_ss
    v_w, v_s = apply_phi_2(z_ww, z_ws, z_sw, z_ss, f_w, f_s)
    # phi_1 = 1 + Z phi_2
    d_w, d_s = h * (f_w + z_ww * v_w + z_ws * v_s), h * (f_s + z_sw * v_w + z_ss * v_s)
    there = law.evaluate(k, u, w + d_w, s + d_s)
    return ((d_w, d_s), (h * (w + h * v_w), h * (s + h * v_s)),
            nonlinear_part(here, there, J, h, d_w, d_s))


def nonlinear_part(here, there, J, h, d_w, d_s):
    """Return ``h (3 I - |h| J)^-1 (f(there) - f(here) - J d)`` of two points that are d apart."""
    J_ww, J_ws, J_sw, J_ss = J
    D_w = h * (there[0] - here[0] - J_ww * d_w - J_ws * d_s)
    D_s = h * (there[1] - here[1] - J_sw * d_w - J_ss * d_s)
    k = abs(h)
    a, b, c, d = 3 - k * J_ww, k * J_ws, k * J_sw, 3 - k * J_ss
    det = a * d - b * c
    return (d * D_w + b * D_s) / det, (c * D_w + a * D_s) / det


def root(residual, start, guess):
    """
    Return a root of a function that grows on the whole, None where none is in reach.

    :param guess: the way from the start to where it may be, which tells the side.
    """
    if guess == 0.0:
        return start
    if guess != guess:   # no number, nor will any other be
        return None
    for _ in range(60):
        if residual(start + guess) * guess >= 0.0:
            return bracketed_root(residual, start, start + guess)
        guess *= 2.0
    return start if start + guess == start else None   # nearer than numbers are


def backward_euler(law, k, u, y, J, h):
    """
    Return y and its integral after a step that is stable whatever its length; the paper's law.

    Implicit in the slip, of which the friction is a monotone function, by a bracketed root;
    linearly implicit in the carrier speed, on which it hardly depends.
    """
    w, s = y
    damped = h / max(1.0, 1.0 - h * J[0])

    def carrier(slip):
        return w + damped * law.evaluate(k, u, w, slip)[0]

    def residual(slip):
        return slip - s - h * law.evaluate(k, u, carrier(slip), slip)[1]

    slip = root(residual, s, -residual(s))
    if slip is None:
        slip = s   # no number in reach fits: the clutch holds
    w_end = carrier(slip)
    return (w_end, slip), (h * (w + w_end) / 2, h * (s + slip) / 2)


def newton(law, k, u, y, h):
    """Return y_end = y + h f(y_end) by Newton's method from y, None where it does not converge."""
    w, s = w_0, s_0 = y
    try:
        for _ in range(NEWTON):
            point = law.evaluate(k, u, w, s)
            (J_ww, J_ws, J_sw, J_ss), _ = law.jacobian(k, u, point)
            r_w, r_s = w - w_0 - h * point[0], s - s_0 - h * point[1]
            a, b, c, d = 1 - h * J_ww, -h * J_ws, -h * J_sw, 1 - h * J_ss
            det = a * d - b * c
            d_w, d_s = (d * r_w - b * r_s) / det, (a * r_s - c * r_w) / det
            w, s = w - d_w, s - d_s
            if abs(d_w) + abs(d_s) <= 1e-12 * (abs(w) + abs(s)) + 1e-12:
                return (w, s) if solved(law, k, u, y, (w, s), h) else None
    except ArithmeticError:
        pass
    return None


def solved(law, k, u, y, end, h):
    """Return whether y_end = y + h f(y_end), but for what a root leaves where f is steep."""
    d_w, d_s = end[0] - y[0], end[1] - y[1]
    f_w, f_s, *_ = law.evaluate(k, u, *end)
    return abs(d_w - h * f_w) + abs(d_s - h * f_s) <= 1e-4 + 1e-6 * (abs(d_w) + abs(d_s))


def implicit_euler(law, k, u, y, J, h):
    """
    Return y and its integral after a step that makes no energy, None where none is found.

    y_end = y + h f(y_end), and h y_end is the integral: all losses are then those at y_end, so
    the energy grows by less than the work. It is sought by Newton's method. Where that finds no
    end, the slip is sought by a bracketed root, and for each slip the carrier speed by another.
    """
    w_0, s_0 = y
    end = newton(law, k, u, y, h)
    if end:
        w, s = end
        return end, (h * w, h * s)

    def found(residual, start):
        at = root(residual, start, -residual(start))
        if at is None:
            raise ArithmeticError('no speed in reach fits')
        return at

    def carrier(slip):
        return found(lambda w: w - w_0 - h * law.evaluate(k, u, w, slip)[0], w_0)

    try:
        s = found(lambda slip: slip - s_0 - h * law.evaluate(k, u, carrier(slip), slip)[1], s_0)
        w = carrier(s)
    except ArithmeticError:
        return None
    # a jump is no root
    return ((w, s), (h * w, h * s)) if solved(law, k, u, y, (w, s), h) else None


PAPER = Law(clutched.held, clutched.evaluate, clutched.jacobian, clutched.torque_slopes,
            backward_euler, 200, 1e-6, lambda *_: True)
PASSIVE = Law(passive.held, passive.evaluate, passive.jacobian, passive.torque_slopes,
              implicit_euler, 400, 1e-12, passive.bends)


def step(law, k, u, y, h, tolerance=TOLERANCE, here=None):
    """
    Return ``(y, integral of y, point, coarse, parts)`` at the end of a step.

    :param law: PAPER or PASSIVE; k: its coefficients; u: what its ``held`` makes of the inputs.
    :param y: ``(omega_0, omega_1 - omega_2)``, rad/s; h: length of the step, s.
    :param tolerance: rad/s, error estimate allowed in one part; here: the point at y, if known.
    :return: whether the step was coarse, and the parts of its path, each ``(y, f, J, more, h, d,
        c, integral, straight, here, there)``: within a part of length h the path is
        y + q + c (t/h)^3 with q = t phi_1(t J) f, which is d at its end; or, of the last resort,
        a straight line with the slope f. ``here`` and ``there`` are the points at the ends,
        and the integral is that of the path.
    :raises ArithmeticError: where the motion leaves the range of floating point numbers.
    """
    evaluate, jacobian = law.evaluate, law.jacobian
    w, s = y
    angle_w = angle_s = 0.0
    left = part = h
    parts = []
    here = here or evaluate(k, u, w, s)
    if not abs(here[0]) + abs(here[1]) < FASTEST:
        raise ArithmeticError('beyond the range of floating point numbers')
    J, more = jacobian(k, u, here)
    for _ in range(law.most_trials):
        (d_w, d_s), (i_w, i_s), (c_w, c_s) = rosenbrock_part(law, k, u, w, s, here, J, part)
        allowed = tolerance + law.relative * (abs(d_w) + abs(d_s))
        error = (abs(c_w) + abs(c_s)) / allowed
        if error <= 1.0:
            there = evaluate(k, u, w + d_w + c_w, s + d_s + c_s)
            J_there = None
            if law.bends(k, here, there):
                J_there, more_there = jacobian(k, u, there)
                r_w, r_s = nonlinear_part(there, here, J_there, -part, -d_w - c_w, -d_s - c_s)
                error = max(error, (abs(r_w) + abs(r_s)) / (BACKWARD * allowed))
        if error <= 1.0:
            i_w += part * c_w / 4
            i_s += part * c_s / 4
            parts.append(((w, s), (here[0], here[1]), J, more, part, (d_w, d_s), (c_w, c_s),
                          (i_w, i_s), False, here, there))
            angle_w += i_w
            angle_s += i_s
            w, s = w + d_w + c_w, s + d_s + c_s   # where there is, to the last bit
            left -= part
            if left <= 0.0:
                return (w, s), (angle_w, angle_s), there, False, parts
            J, more = (J_there, more_there) if J_there else jacobian(k, u, there)
            here = there
        scale = SAFETY * error ** (-1 / 3) if error > 1e-3 else GROW
        part *= min(GROW, max(SHRINK, scale))
        if part > 0.999 * left:
            part = left
    part = left
    for _ in range(MOST_RESORTS):
        done = law.last_resort(law, k, u, (w, s), J, part)
        if done is None:
            part /= 2.0
            continue
        (w_end, s_end), (i_w, i_s) = done
        there = evaluate(k, u, w_end, s_end)
        d_w, d_s = w_end - w, s_end - s
        parts.append(((w, s), (d_w / part, d_s / part), J, more, part, (d_w, d_s), (0.0, 0.0),
                      (i_w, i_s), True, here, there))
        angle_w += i_w
        angle_s += i_s
        left -= part
        if left <= 0.0:
            return (w_end, s_end), (angle_w, angle_s), there, True, parts
        w, s, here = w_end, s_end, there
        J, more = jacobian(k, u, here)
        part = min(2.0 * part, left)
    raise ArithmeticError('no speed in reach fits')
