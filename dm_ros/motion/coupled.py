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
part, what is not linear is looked for on the way too, and not at its ends alone. core/coupled.c
repeats all of it line by line.
"""

import math
from typing import NamedTuple

from dm_ros.motion.adaptive import (
    BACKWARD,
    GROW,
    implicit_euler,
    MOST_RESORTS,
    SAFETY,
    SHRINK,
)
from dm_ros.motion.matrices import Exponential, implicit, size, times, Way

MOST_TRIALS = 2000   # of parts; a light gear on a shaft without damping swings often in a tick
LOOSE = 0.3          # fit of the nodes at which a way is looked at


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

    z: list
    slope: list    # dz/dt
    u: tuple       # of ``Law.held``
    point: tuple   # of ``Law.evaluate``


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
        return [w, s, *[twist * scale for twist, scale in zip(twists, self._scales)]]

    def twists(self, z):
        """Return the twists, rad, of a state or of its integral."""
        return [chi / scale for chi, scale in zip(z[2:], self._scales)]

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
        slope, _, u, point = self.look(*z)
        return At(z, slope, u, point)

    def jacobian(self, at):
        """Return the Jacobian of dz/dt, a list of rows."""
        (J_ww, J_ws, J_sw, J_ss), _ = self.law.jacobian(self.k, at.u, at.point)
        slopes_w, slopes_s = self.law.torque_slopes(self.k, at.u, at.point)
        n = len(self.half_shafts)
        row_w, row_s, rows = [], [], []
        for shaft, scale in zip(self.half_shafts, self._scales):
            port, stiffness, d, per_w, per_s, _ = shaft
            of_w, of_s = slopes_w[port], slopes_s[port]
            c = stiffness / scale
            row_w.append(of_w * c)
            row_s.append(of_s * c)
            rows.append([-scale * per_w, -scale * per_s, *[0.0] * n])
            J_ww -= of_w * d * per_w
            J_ws -= of_w * d * per_s
            J_sw -= of_s * d * per_w
            J_ss -= of_s * d * per_s
        return [[J_ww, J_ws, *row_w], [J_sw, J_ss, *row_s], *rows]

    def euler(self, z, h):
        """
        Return z after an implicit Euler step, None where none is found, see ``adaptive``.

        The twists at its end follow from the speeds there, so that these are all there is to find.
        """
        w_0, s_0, *chis = z
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


class Part(NamedTuple):
    """
    A part of the path of a step, from ``here`` to ``there``.

    Within it the path is z + q + c (t/h)^3 with the way q of the linear equations; or, of the
    last resort, a jump at its start, without these.
    """

    here: At
    there: At
    c: list | None
    h: float
    exponential: Exponential | None
    way: Way | None


def bend(equations, here, e, way, least):
    """
    Return the largest estimate of what is not linear on the way of a part, rad/s.

    :param e: its ``Exponential``; least: rad/s, how far a way must lead that is looked at.
    """
    largest = 0.0
    for _, _, q in e.nodes(way, LOOSE)[2:-1:2]:
        if size(q) > least:
            slope, *_ = equations.look(*[a + b for a, b in zip(here.z, q)])
            D = [e.h * (a - b - c) for a, b, c in zip(slope, here.slope, times(e.J, q))]
            largest = max(largest, size(times(e.solver, D)))
    return largest


def step(equations, z, h, tolerance, exponentials):
    """
    Return ``(z, integral of z, At, coarse, parts)`` at the end of a step.

    :param tolerance: rad/s, error estimate allowed in one part, all components together; h: s.
    :raises ArithmeticError: where no speed in reach fits.
    """
    law = equations.law
    integral, parts = [0.0] * len(z), []
    left = part = h
    here = equations.at(z)
    J = equations.jacobian(here)
    for _ in range(MOST_TRIALS):
        e = exponentials.of(J, part)
        way = e.way(here.slope)
        d = way.end

        linear = equations.at([a + b for a, b in zip(here.z, d)])
        c = times(e.solver, [part * (a - b - g) for a, b, g in zip(
            linear.slope, here.slope, times(J, d))])
        allowed = tolerance + law.relative * size(d)
        error = size(c) / allowed
        if error <= 1.0:
            error = max(error, bend(equations, here, e, way, tolerance) / (BACKWARD * allowed))
        if error <= 1.0:
            there = equations.at([a + b + g for a, b, g in zip(here.z, d, c)])
            J_there = equations.jacobian(there)
            if J != J_there:
                back = times(J_there, [a + b for a, b in zip(d, c)])
                D = [part * (a - b - g) for a, b, g in zip(there.slope, here.slope, back)]
                seen = size(times(implicit(J_there, part), D))
                error = max(error, seen / (BACKWARD * allowed))
        if not math.isfinite(error):   # what grows may do so beyond all numbers in a long part
            if not math.isfinite(size(here.slope)):
                raise ArithmeticError('beyond the range of floating point numbers')
            error = math.inf
        if error <= 1.0:
            integral = [total + (part * a + b + part * g / 4) for total, a, b, g in zip(
                integral, here.z, way.integral, c)]
            parts.append(Part(here, there, c, part, e, way))
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
        integral = [total + part * a for total, a in zip(integral, end)]
        parts.append(Part(here, there, None, part, None, None))
        left -= part
        here = there
        if left <= 0.0:
            return here.z, integral, here, True, parts
        part = min(2.0 * part, left)
    raise ArithmeticError('no speed in reach fits')
