# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Matrices of two to five rows in plain floats, and the ways of linear equations with them."""

import math
import struct
from typing import NamedTuple

MOST_KEPT = 64         # exponentials that are kept
TERMS = 8              # of the series of an exponential, enough for matrices below 1/16
MOST_DOUBLINGS = 80    # beyond, the numbers of a step have no common scale
MOST_PIECES = 64       # of a rule; where these will not do, it is coarser
ROMBERG = tuple([weight / 5670 for weight in (217, 1024, 352, 1024, 436, 1024, 352, 1024)])


def _times_2(A, x):
    a, b = x
    return [p * a + q * b for p, q in A]


def _times_3(A, x):
    a, b, c = x
    return [p * a + q * b + r * c for p, q, r in A]


def _times_4(A, x):
    a, b, c, d = x
    return [p * a + q * b + r * c + s * d for p, q, r, s in A]


def _times_5(A, x):
    a, b, c, d, e = x
    return [p * a + q * b + r * c + s * d + t * e for p, q, r, s, t in A]


TIMES = None, None, _times_2, _times_3, _times_4, _times_5


def times(A, x):
    """Return the product of a matrix, a list of rows, and a vector."""
    return TIMES[len(x)](A, x)


def product(X, Y):
    """Return the product of two matrices."""
    rows, columns = TIMES[len(X)], list(zip(*Y))
    return [rows(columns, row) for row in X]


def size(x):
    """Return the sum of the magnitudes of a vector."""
    total = 0.0
    for value in x:
        total += abs(value)
    return total


def inverse(A):
    """Return the inverse of a matrix; raise ZeroDivisionError where there is none."""
    n = len(A)
    rows = [[*row, *[float(i == j) for j in range(n)]] for i, row in enumerate(A)]
    for i in range(n):
        best = max(range(i, n), key=lambda j: abs(rows[j][i]))
        rows[i], rows[best] = rows[best], rows[i]
        pivot = rows[i][i]
        lead = rows[i] = [value / pivot for value in rows[i]]
        for j in range(n):
            if j != i:
                factor = rows[j][i]
                rows[j] = [value - factor * other for value, other in zip(rows[j], lead)]
    return [row[n:] for row in rows]


def implicit(J, h):
    """Return (3 - h J)^-1."""
    return inverse([[(3.0 if i == j else 0.0) - h * value for j, value in enumerate(row)]
                    for i, row in enumerate(J)])


class Way(NamedTuple):
    """
    The way q of x' = J (x - x_0) + f from x_0, over a time h.

    ``doubled`` are the ways after h/2^n, ..., h/2, h, and ``integral`` is that of q.
    """

    f: list
    doubled: list
    integral: list

    @property
    def end(self):
        """The whole of it."""
        return self.doubled[-1]


class Exponential:
    """
    The exponential of h J, by which x' = J (x - x_0) + f is exact however stiff it is.

    It is kept as e^(t J) - 1 of the times t = h/2^n, ..., h/2, h, of which the slow modes beside
    fast ones lose nothing. Times as short as the first of them have a short series.
    """

    def __init__(self, J, h):
        largest = 0.0
        for row in J:
            total = h * size(row)
            if total > largest:
                largest = total
        n = max(3, math.frexp(largest)[1] + 4)
        if n > MOST_DOUBLINGS:
            raise ArithmeticError('beyond the range of floating point numbers')
        self.J, self.h = J, h
        self._start = start = math.ldexp(h, -n)
        self._small = small = [[start * value for value in row] for row in J]
        E = small
        for k in range(TERMS, 1, -1):
            E = [[a + b / k for a, b in zip(row, more)]
                 for row, more in zip(small, product(small, E))]
        self._powers = powers = [E]
        for _ in range(n):
            E = [[2 * a + b for a, b in zip(row, more)] for row, more in zip(E, product(E, E))]
            powers.append(E)
        self.solver = implicit(J, h)

    def way(self, f):
        """Return the ``Way`` with the slope f at the start."""
        small, t = self._small, self._start
        times = TIMES[len(f)]
        v = f
        for k in range(TERMS, 2, -1):
            v = [a + b / k for a, b in zip(f, times(small, v))]
        integral = [t * t * (value / 2) for value in v]
        q = [t * (a + b / 2) for a, b in zip(f, times(small, v))]
        doubled = [q]
        for E in self._powers[:-1]:
            integral = [2 * a + b + t * c for a, b, c in zip(integral, times(E, integral), q)]
            q = [2 * a + b for a, b in zip(q, times(E, q))]
            t *= 2.0
            doubled.append(q)
        return Way(f, doubled, integral)

    def nodes(self, way, fit, speed=0.0):
        """
        Return a rule along a way: ``(r, weight, q)`` at the times t = r h, in their order.

        It is Romberg's of nine nodes, exact to degree 7, in pieces so short that the way within is
        nearly a cubic: q'' in the middle is the mean slope of q', which neither what decays nor
        what swings within a piece can hide.

        :param fit: how far from a cubic, over the size of the way; or over the geometric mean of
            that and itself with speed: that of x_0, beside which a short way matters less.
        """
        while True:
            if found := self._pieces(way, fit, speed):
                return found
            fit *= 16.0

    def _pieces(self, way, fit, speed):
        """Return these nodes, or [] where they are too many."""
        J, h, powers, doubled = self.J, self.h, self._powers, way.doubled
        times = TIMES[len(J)]

        def after(level, q):
            return [a + b + c for a, b, c in zip(doubled[level], q, times(powers[level], q))]

        def slope(q):
            return [a + b for a, b in zip(way.f, times(J, q))]
        top = level = len(doubled) - 1
        place, pieces = 0.0, 0   # of the next piece, in its lengths
        q, q_t = [0.0] * len(J), way.f
        largest = size(way.end)
        found, weight = [], 0.0   # of a node, by the piece before it
        while place < 1.0 or level < top:
            length = math.ldexp(1.0, level - top)
            middle, end = after(level - 1, q), after(level, q)
            end_t, t = slope(end), length * h
            bend = [t * a - (b - c) for a, b, c in zip(times(J, slope(middle)), end_t, q_t)]
            largest = max(largest, size(middle), size(end))
            if t / 16 * size(bend) > fit * math.sqrt(largest * (largest + speed)) and level > 3:
                level -= 1
                place *= 2.0
                continue
            if pieces == MOST_PIECES:
                return []
            pieces += 1
            quarter, last = after(level - 2, q), after(level - 2, middle)
            inside = (q, after(level - 3, q), quarter, after(level - 3, quarter),
                      middle, after(level - 3, middle), last, after(level - 3, last))
            for n, (share, x) in enumerate(zip(ROMBERG, inside)):
                found.append((length * (place + n / 8), weight + length * share, x))
                weight = 0.0
            weight = length * ROMBERG[0]
            q, q_t = end, end_t
            place += 1.0
            while level < top and place % 2.0 == 0.0:
                place /= 2.0
                level += 1
        found.append((1.0, weight, q))
        return found


class Exponentials(dict):
    """The ``Exponential`` of each J and h that was asked for, as they often come again."""

    def of(self, J, h):
        """Return that of J and h."""
        key = struct.pack(f'{len(J) * len(J) + 1}d', h, *[value for row in J for value in row])
        if key not in self:
            if len(self) >= MOST_KEPT:
                self.clear()
            self[key] = Exponential(J, h)
        return self[key]
