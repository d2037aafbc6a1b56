# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The step with elastic shafts: speeds of the outside come in, and the twists move with the speeds.

With phi_j the twist of the elastic shaft on port j, and Omega_j the speed that is held outside::

    dphi_j/dt = Omega_j - omega_j,    T_j = c_j phi_j + d_j (Omega_j - omega_j)

and T_j acts on the differential, whose equations under torques are those of a ``Law``. All
together is integrated in z = (omega_0, slip, chi_1, ...), where chi_j = phi_j sqrt(c_j/I_j) with
the inertia I_j of the shaft: a speed like the others, by which the matrices are balanced.

The step is the one of ``adaptive`` in more dimensions: exact where all is linear, however stiff or
light, since the exponential of the whole is taken. As more than two modes may turn round within a
part, what is not linear is looked for on the way too, and not at its ends alone.
"""

import math
from typing import NamedTuple

import numpy as np

from dm_ros.motion.adaptive import (
    BACKWARD,
    GROW,
    implicit_euler,
    MOST_RESORTS,
    SAFETY,
    SHRINK,
)
from dm_ros.motion.quadrature import FINE, lobatto, STIFF

MOST_TRIALS = 2000   # of parts; a light gear on a shaft without damping swings often in a tick
MOST_LOOKS = 32      # along a part that swings
TERMS = 12           # of the series of an exponential, enough for matrices below 1/4
MOST_KEPT = 64       # exponentials that are kept
SWING = 1.5          # rad of an oscillation that a piece of a rule may take
MOST_PIECES, MOST_HALVINGS = 64, 40
INNER, FIRST, LAST = lobatto(1)
NODES = np.array([*sorted(r for r, *_ in INNER), 1.0])
WEIGHTS = np.array([weight for *_, weight in sorted(INNER)] + [LAST])


class HalfShaft(NamedTuple):
    """An elastic shaft between a port and the outside."""

    port: int          # its number
    stiffness: float   # c, N m/rad
    damping: float     # d, N m s/rad
    per_w: float       # speed of its end at the differential, per carrier speed
    per_s: float       # and per slip
    inertia: float     # of the shaft that it turns, kg m^2

    @property
    def scale(self):
        """Rad/s of chi for each rad of twist."""
        return math.sqrt(self.stiffness / self.inertia)

    def torque(self, twist, outside, w, s):
        """Return the torque on the differential, N m."""
        return self.stiffness * twist + self.damping * (
            outside - self.per_w * w - self.per_s * s)


class At(NamedTuple):
    """All that is known of one state."""

    z: np.ndarray
    slope: np.ndarray   # dz/dt
    u: tuple            # of ``Law.held``
    point: tuple        # of ``Law.evaluate``


class Equations:
    """The equations of a step: a law under torques, some of them by half-shafts."""

    def __init__(self, law, k, half_shafts, inputs, S):
        """
        Hold the inputs.

        :param half_shafts: those whose outside is held. inputs: for each port the torque on it,
            N m, or the speed that is held outside, rad/s; S: friction as for ``Law.held``.
        """
        self.law, self.k, self.half_shafts = law, k, half_shafts
        self._S, self._inputs = S, inputs
        self._scales = [shaft.scale for shaft in half_shafts]

    def state(self, w, s, twists):
        """Return z."""
        return np.array([w, s, *(twist * scale for twist, scale in zip(twists, self._scales))])

    def twists(self, z):
        """Return the twists, rad, of a state or of its integral."""
        return [float(chi) / scale for chi, scale in zip(z[2:], self._scales)]

    def torques(self, w, s, twists):
        """Return the torque on each port, N m."""
        T = list(self._inputs)
        for shaft, twist in zip(self.half_shafts, twists):
            T[shaft.port] = shaft.torque(twist, self._inputs[shaft.port], w, s)
        return T

    def look(self, w, s, *chis):
        """Return dz/dt at a state as a list, the torques on the ports, u and the point there."""
        T, slope = list(self._inputs), [0.0, 0.0]
        for shaft, chi, scale in zip(self.half_shafts, chis, self._scales):
            port, stiffness, damping, per_w, per_s, _ = shaft
            faster = T[port] - per_w * w - per_s * s   # the outside
            T[port] = stiffness / scale * chi + damping * faster
            slope.append(scale * faster)
        u = self.law.held(self.k, T, self._S)
        point = self.law.evaluate(self.k, u, w, s)
        slope[:2] = point[:2]
        return slope, T, u, point

    def at(self, z):
        """Return what is known of a state."""
        slope, _, u, point = self.look(*z.tolist())
        return At(z, np.array(slope), u, point)

    def jacobian(self, at):
        """Return the Jacobian of dz/dt."""
        (J_ww, J_ws, J_sw, J_ss), _ = self.law.jacobian(self.k, at.u, at.point)
        n = len(at.z)
        J = np.zeros((n, n))
        if self.half_shafts:
            slopes_w, slopes_s = self.law.torque_slopes(self.k, at.u, at.point)
        for i, (shaft, scale) in enumerate(zip(self.half_shafts, self._scales), 2):
            of_w, of_s = slopes_w[shaft.port], slopes_s[shaft.port]
            c, d = shaft.stiffness / scale, shaft.damping
            J[0, i], J[1, i] = of_w * c, of_s * c
            J[i, 0], J[i, 1] = -scale * shaft.per_w, -scale * shaft.per_s
            J_ww -= of_w * d * shaft.per_w
            J_ws -= of_w * d * shaft.per_s
            J_sw -= of_s * d * shaft.per_w
            J_ss -= of_s * d * shaft.per_s
        J[0, 0], J[0, 1], J[1, 0], J[1, 1] = J_ww, J_ws, J_sw, J_ss
        return J

    def euler(self, z, h):
        """
        Return z after an implicit Euler step, None where none is found, see ``adaptive``.

        The twists at its end follow from the speeds there, so that these are all there is to find.
        """
        w_0, s_0, *chis = z.tolist()
        twists = [chi / scale for chi, scale in zip(chis, self._scales)]
        law, k = self.law, self.k

        def end_twists(w, s):
            return [twist + h * (self._inputs[shaft.port] - shaft.per_w * w - shaft.per_s * s)
                    for shaft, twist in zip(self.half_shafts, twists)]

        def held(w, s):
            return law.held(k, self.torques(w, s, end_twists(w, s)), self._S)

        def evaluate(k, _, w, s):
            u = held(w, s)
            return *law.evaluate(k, u, w, s), u

        def jacobian(k, _, point):
            *point, u = point
            (J_ww, J_ws, J_sw, J_ss), _ = law.jacobian(k, u, point)
            slopes_w, slopes_s = law.torque_slopes(k, u, point)
            for shaft in self.half_shafts:
                stiff = shaft.damping + h * shaft.stiffness
                of_w, of_s = slopes_w[shaft.port] * stiff, slopes_s[shaft.port] * stiff
                J_ww -= of_w * shaft.per_w
                J_ws -= of_w * shaft.per_s
                J_sw -= of_s * shaft.per_w
                J_ss -= of_s * shaft.per_s
            return (J_ww, J_ws, J_sw, J_ss), None

        done = implicit_euler(law._replace(evaluate=evaluate, jacobian=jacobian), k, None,
                              (w_0, s_0), None, h)
        if done is None:
            return None
        (w, s), _ = done
        return self.state(w, s, end_twists(w, s))


class Exponential:
    """
    The exponential of h J and what belongs to it: ways t phi_1(t J) slope from the start on.

    ``first`` and ``second`` are phi_1 and phi_2 of h J, ``looks`` are t phi_1(t J), (n, m, m), for
    times at which what is not linear shall be looked for, ``solver`` is (3 - h J)^-1.
    """

    def __init__(self, J, h):
        self._J, self._h, self._rules = J, h, {}
        Z, unit = h * J, np.eye(len(J))
        n = max(0, math.frexp(float(np.abs(Z).sum(axis=1).max()))[1] + 2)
        small = math.ldexp(1.0, -n) * Z
        second = unit
        for k in range(TERMS, 2, -1):
            second = unit + small @ second / k
        second = second / 2
        first = unit + small @ second
        power = unit + small @ first
        levels = [(power, first)]   # e and phi_1, of h/2^n first
        for _ in range(n):
            second = (first @ first + 2 * second) / 4
            first = (power + unit) @ first / 2
            power = power @ power
            levels.append((power, first))
        self.first, self.second, self.solver = first, second, np.linalg.inv(3 * unit - Z)
        self._swing = h * float(np.abs(np.linalg.eigvals(J).imag).max())   # rad
        looks = [math.ldexp(h, k - n) * first for k, (_, first) in enumerate(levels[:-1])]
        if self._swing > 1.0:
            halvings = min(math.ceil(math.log2(self._swing)), n, MOST_LOOKS.bit_length() - 1)
            power, first = levels[n - halvings]
            one = way = math.ldexp(h, -halvings) * first
            for _ in range(2**halvings - 2):
                way = one + power @ way
                looks.append(way)
        self.looks = np.array(looks or [h / 2 * first])

    def rule(self, far):
        """
        Return a rule along the way: t, weights and t phi_1(t J), (n,), (n,), (n, m, m).

        Of as many pieces as an oscillation asks for; in the first of them each part is as long as
        all before it, as the fastest decay asks for, see ``quadrature``.

        :param far: whether the speeds change by more than a small part of them.
        """
        if far not in self._rules:
            self._rules[far] = self._make_rule(far)
        return self._rules[far]

    def _make_rule(self, far):
        J, h = self._J, self._h
        pieces = min(MOST_PIECES, 2**max(0, math.ceil(math.log2(max(self._swing, 1e-9) / SWING))))
        stiff, most = h / pieces * float(np.abs(np.diag(J)).sum()), FINE if far else STIFF
        halvings = min(MOST_HALVINGS, max(0, math.ceil(math.log2(max(stiff, 1e-9) / most))))
        part = math.ldexp(h / pieces, -halvings)
        power, way = ways(J, part)
        times, weights, found = [np.zeros(1)], [[part * FIRST]], [np.zeros((1, *J.shape))]

        def add(start, from_start):
            weights[-1][-1] += part * FIRST   # the end of the part before is the start of this
            times.append(start + part * NODES)
            weights.append((part * WEIGHTS).tolist())
            found.append(from_start)

        weights[0][0] = 0.0
        add(0.0, way)
        for _ in range(halvings):
            after = way + power @ way[3]
            add(part, after)
            way = way + power @ way
            power = power @ power
            part *= 2.0
        there = way[3]
        for n in range(1, pieces):
            after = way + power @ there
            add(n * part, after)
            there = after[3]
        return np.concatenate(times), np.concatenate(weights), np.concatenate(found)


def ways(J, h):
    """Return e^(t J) and t phi_1(t J), (4, m, m) each, at the times t = h r of ``NODES``."""
    unit = np.eye(len(J))
    doublings = max(0, math.frexp(float(h * np.abs(J).sum(axis=1).max()))[1] + 2)
    times = (math.ldexp(h, -doublings) * NODES)[:, None, None]
    small = times * J
    first = unit + small / TERMS
    for k in range(TERMS - 1, 1, -1):
        first = unit + small @ first / k
    power, way = unit + small @ first, times * first
    for _ in range(doublings):
        way = way + power @ way
        power = power @ power
    return power, way


class Exponentials(dict):
    """The ``Exponential`` of each J and h that was asked for, as they often come again."""

    def of(self, J, h):
        """Return that of J and h."""
        key = J.tobytes(), h
        if key not in self:
            if len(self) >= MOST_KEPT:
                self.clear()
            self[key] = Exponential(J, h)
        return self[key]


class Part(NamedTuple):
    """
    A part of the path of a step, from ``here`` to ``there``.

    Within it the path is z + t phi_1(t J) f + c (t/h)^3, or, of the last resort, a jump at its
    start, with J None.
    """

    here: At
    there: At
    J: 'np.ndarray | None'
    c: np.ndarray
    h: float
    exponential: Exponential | None


def bend(equations, here, J, e, h, least):
    """
    Return the largest estimate of what is not linear on the way of a part, rad/s.

    :param e: its ``Exponential``; least: rad/s, how far a way must lead that is looked at.
    """
    ways = e.looks @ here.slope
    ways = ways[np.abs(ways).sum(axis=1) > least]
    if not len(ways):
        return 0.0
    slopes = np.array([equations.look(*z)[0] for z in (here.z + ways).tolist()])
    D = h * (slopes - here.slope - ways @ J.T)
    return float(np.abs(D @ e.solver.T).sum(axis=1).max())


def step(equations, z, h, tolerance, exponentials):
    """
    Return ``(z, integral of z, At, coarse, parts)`` at the end of a step.

    :param tolerance: rad/s, error estimate allowed in one part, all components together; h: s.
    :raises ArithmeticError: where no speed in reach fits.
    """
    law = equations.law
    integral, parts = np.zeros(len(z)), []
    left = part = h
    here = equations.at(z)
    J = equations.jacobian(here)
    for _ in range(MOST_TRIALS):
        e = exponentials.of(J, part)
        d = part * (e.first @ here.slope)

        linear = equations.at(here.z + d)
        c = e.solver @ (part * (linear.slope - here.slope - J @ d))
        allowed = tolerance + law.relative * float(np.abs(d).sum())
        error = float(np.abs(c).sum()) / allowed
        if error <= 1.0:
            error = max(error, bend(equations, here, J, e, part, tolerance) / (BACKWARD * allowed))
        if error <= 1.0:
            there = equations.at(here.z + d + c)
            J_there = equations.jacobian(there)
            if not np.array_equal(J, J_there):
                n = len(z)
                D = part * (there.slope - here.slope - J_there @ (d + c))
                back = np.linalg.solve(3 * np.eye(n) - part * J_there, D)
                error = max(error, float(np.abs(back).sum()) / (BACKWARD * allowed))
        if not math.isfinite(error):
            raise ArithmeticError('beyond the range of floating point numbers')
        if error <= 1.0:
            integral += part * here.z + part**2 * (e.second @ here.slope) + (part / 4) * c
            parts.append(Part(here, there, J, c, part, e))
            left -= part
            here, J = there, J_there
            if left <= 0.0:
                return here.z, integral, here, False, parts
        scale = SAFETY * error ** (-1 / 3) if error > 1e-3 else GROW
        part *= min(GROW, max(SHRINK, scale))
        if part > 0.999 * left:
            part = left
    part = left
    for _ in range(MOST_RESORTS):
        end = equations.euler(here.z, part)
        if end is None:
            part /= 2.0
            continue
        there = equations.at(end)
        integral += part * end
        parts.append(Part(here, there, None, np.zeros(len(z)), part, None))
        left -= part
        here = there
        if left <= 0.0:
            return here.z, integral, here, True, parts
        part = min(2.0 * part, left)
    raise ArithmeticError('no speed in reach fits')
