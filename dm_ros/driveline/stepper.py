# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The step: ROS2 of Verwer, in equal parts of a tick.

With gamma = 1 - 1/sqrt(2), W = 1 - gamma h J and f the right side::

    W k1 = f(x),   W k2 = f(x + h k1) - 2 k1,   x += h (3 k1 + k2)/2,   error h (k1 + k2)/2

It is L-stable, and of second order with any J; so J may leave out what is not stiff, and may be
kept. (J. G. Verwer, E. J. Spee, J. G. Blom, W. Hundsdorfer: A second-order Rosenbrock method
applied to photochemical dispersion problems, SIAM J. Sci. Comput. 20, 1999.)

Deflections of pads and slips of tyres have bounds that no solution exceeds; where x + h k1 or
the end of a step does, it is brought back to them. That changes nothing where the step is short
enough, and keeps one that is not from growing without end: a brake that locks within it.

A tick is tried whole; while the error of a part is above the tolerance it is tried again in more
equal parts, up to ``max_parts``, which are taken as they are. That is at most 2 max_parts - 1
parts in all, whatever happens.
"""

from math import isfinite, sqrt
from typing import NamedTuple

import numpy as np

GAMMA = 1.0 - 1.0 / sqrt(2.0)


def cuts(max_parts):
    """Return the numbers of parts to try, the last is max_parts: each half of the next."""
    numbers = []
    while max_parts:
        numbers.insert(0, max_parts)
        max_parts //= 2
    return tuple(numbers)


class Kept(NamedTuple):
    """A Jacobian that is kept."""

    J: np.ndarray
    inverses: dict    # of W, by the number of parts
    ticks: int        # that it has served


class Stepper:
    """
    Makes ticks of ``Equations``.

    :param dt: length of a tick, s; p: ``StepParameters``.
    """

    def __init__(self, equations, dt, p):
        self._equations, self._dt = equations, dt
        self._cuts, self._jacobian_ticks = cuts(p.max_parts), p.jacobian_ticks
        layout = equations.layout
        self._bounded, self._low, self._high = layout.bounded, -layout.bounds, layout.bounds
        self._one = np.eye(len(layout))
        self._per_allowed = 1.0 / (p.tolerance * layout.scale)
        self.reset()

    def reset(self):
        """Forget the Jacobian that is kept."""
        self.kept = None

    def tick(self, start, friction, given):
        """
        Return the ``Point`` s at the ends of the equal parts of a tick that begins at one.

        Then come what is to be ``kept`` where the tick is taken, and whether it was coarse: its
        parts may not be shorter, though an error was above the tolerance.

        :raises ArithmeticError: where that leads out of the range of floating point numbers.
        """
        kept = self.kept
        if kept is None or kept.ticks >= self._jacobian_ticks:
            kept = Kept(self._equations.jacobian(start, given), {}, 0)
        cut = 0
        while True:
            parts = self._cuts[cut]
            points, worst = self._in_parts(start, friction, given, parts, kept,
                                           parts == self._cuts[-1])
            if points:
                break
            cut += 1
            # the error falls with the square of the length
            while self._cuts[cut] < parts * sqrt(worst) and self._cuts[cut] < self._cuts[-1]:
                cut += 1
            if kept.ticks:   # it may be too old
                kept = Kept(self._equations.jacobian(start, given), {}, 0)
        return (points, kept._replace(ticks=kept.ticks + 1) if self._jacobian_ticks else None,
                worst > 1.0)

    def _in_parts(self, start, friction, given, parts, kept, is_last):
        """Return the points at the ends of the parts, or None, and the error over the allowed."""
        equations, h = self._equations, self._dt / parts
        point, points, largest = start, [], 0.0
        for part in range(parts):
            if part and not self._jacobian_ticks:
                kept = Kept(equations.jacobian(point, given), {}, 0)
            inverse = kept.inverses.get(parts)
            if inverse is None:
                inverse = kept.inverses[parts] = np.linalg.inv(
                    self._one - (GAMMA * h) * kept.J)
            k1 = inverse @ point.rates
            x = point.array + h * k1
            stage = equations.at(self._within_bounds(x.copy()), friction, given).rates
            k2 = inverse @ (stage - 2.0 * k1)
            error = (0.5 * h) * (k1 + k2)
            errors = (error * self._per_allowed).tolist()
            worst = max(max(errors), -min(errors))
            if not isfinite(sum(errors)):
                if is_last:
                    raise ArithmeticError('beyond the range of floating point numbers')
                return None, float('inf')
            if worst > 1.0 and not is_last:
                return None, worst
            largest = max(largest, worst)
            x += error   # x + h (3 k1 + k2)/2
            point = equations.at(self._within_bounds(x), friction, given)
            points.append(point)
        return points, largest

    def _within_bounds(self, x):
        """Return x, changed, with deflections and slips brought back to their bounds."""
        bounded = x[self._bounded]
        np.maximum(bounded, self._low, out=bounded)
        np.minimum(bounded, self._high, out=bounded)
        return x
