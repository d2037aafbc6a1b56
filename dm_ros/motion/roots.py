# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Roots of functions of one number, bracketed: Brent's method, in plain floats."""

from math import copysign, isnan

XTOL, RTOL = 1e-12, 2.0**-50   # absolute and relative, within which a root is found
MOST_STEPS = 200


def bracketed_root(function, start, end):
    """
    Return a root between two numbers at which a function has different signs, else None.

    Brent (1973), Algorithms for Minimization without Derivatives, chapter 4: secant or inverse
    quadratic interpolation where that is nearer than half of the bracket, else bisection.
    """
    before, at = start, end
    f_before, f_at = function(before), function(at)
    if f_before == 0.0:
        return before
    if f_at == 0.0:
        return at
    if isnan(f_before) or isnan(f_at) or copysign(1.0, f_before) == copysign(1.0, f_at):
        return None
    across = f_across = last = step = 0.0   # across: on the other side of the root
    for _ in range(MOST_STEPS):
        if f_before != 0.0 and f_at != 0.0 and copysign(1.0, f_before) != copysign(1.0, f_at):
            across, f_across = before, f_before
            last = step = at - before
        if abs(f_across) < abs(f_at):
            before, at, across = at, across, at
            f_before, f_at, f_across = f_at, f_across, f_at
        near, half = (XTOL + RTOL * abs(at)) / 2, (across - at) / 2
        if f_at == 0.0 or abs(half) < near:
            return at
        down = 0.0
        if abs(last) > near and abs(f_at) < abs(f_before):
            if before == across:
                up, down = -f_at * (at - before), f_at - f_before
            else:
                d_before, d_across = (f_before - f_at) / (before - at), (
                    f_across - f_at) / (across - at)
                up = -f_at * (f_across * d_across - f_before * d_before)
                down = d_across * d_before * (f_across - f_before)
        if down and 2 * abs(up / down) < min(abs(last), 3 * abs(half) - near):
            last, step = step, up / down
        else:
            last = step = half
        before, f_before = at, f_at
        at += step if abs(step) > near else near if half > 0.0 else -near
        f_at = function(at)
        if isnan(f_at):
            return None
    return at
