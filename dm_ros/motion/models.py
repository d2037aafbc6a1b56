# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
One variant with one set of parameters and one step length: equations and stepper together.

A model is immutable and holds no state, so that it can be exchanged for another between two
steps. What it needs of a ``State`` is handed in: the speeds x, the torques T, the power flow
and S, the friction of the clutches at full slip that does not follow the moments of the step,
which ``friction`` makes of axial forces and, for ``lsd_lagged``, the memory. ``step`` returns
what it did, a tuple::

    (x, flow, end, integral, point, coarse, path)

from the speeds at the start to those at the end, with their integral over the step. ``point`` is
what is known at the end and saves finding it again for the moments; ``path`` tells the way
between: what is ``Exact`` of an exact step, or ``(u, parts)`` of ``adaptive.step``.
"""

import numpy as np

from dm_ros.mechanism import clutched, elimination, losses, passive, symmetric
from dm_ros.mechanism.kinetic import kinetic_form
from dm_ros.mechanism.power_flow import DIRECT, power_flow, REVERSE, who_drives
from dm_ros.mechanism.variants import SYMMETRIC
from dm_ros.motion import adaptive, held_torque
from dm_ros.motion.held_torque import Exact, held_torque_step
from dm_ros.motion.patterns import exact_step, Patterns
from dm_ros.motion.quadrature import second_moment_of_the_way

PASSIVE, PAPER = LOSS_LAWS = 'passive', 'paper'


def responses_of(formulation, parameters):
    """Return ``{+1: response, -1: response}``; raise ValueError where a number overflows."""
    with np.errstate(all='ignore'):
        try:
            equations = formulation(parameters)
            responses = {d: equations.response(d) for d in (DIRECT, REVERSE)}
        except (ArithmeticError, np.linalg.LinAlgError):
            responses = {}
    if not responses or not all(np.isfinite(m).all() for r in responses.values() for m in r):
        raise no_solution(parameters)
    return responses


def no_solution(parameters):
    """Return the error of parameters that are not fit for floating point numbers."""
    return ValueError(f'{parameters.prefix}: the equations of these parameters have no finite '
                      'solution, some are too large or too small beside the others')


class Model:
    """What all have in common; x is (w, s), the carrier speed and the slip omega_1 - omega_2."""

    language = 'Python'
    lagged = False
    half_shafts = ()

    def __init__(self, parameters, h, clutches=True):
        p = self.parameters = parameters
        self.h = h
        self.g_12, self.g_2s, self.g_F = p.g_12, p.g_2s, getattr(p, 'g_F', 0.0)
        self.k_1, self.k_2 = p.g_12 / (1 + p.g_12), 1 / (1 + p.g_12)
        self.form = kinetic_form(p)
        self.phi, self.preload = (clutched.full_friction(p) if clutches
                                  else ((0.0, 0.0), (0.0, 0.0)))

    def independent(self, omega_1, omega_2):
        """Return x for the given speeds of the output shafts."""
        return (omega_1 + self.g_12 * omega_2) / (1 + self.g_12), omega_1 - omega_2

    def all_shafts(self, x):
        """Return the speeds of all shafts from x, or their angles from its integral, (5), (53)."""
        w, s = x
        spin = (0.0 - s) * self.k_2 / self.g_2s
        if self.g_F:
            return w, w + self.k_1 * s, w - self.k_2 * s, self.g_F * w, spin
        return w, w + self.k_1 * s, w - self.k_2 * s, spin

    def at_ports(self, x):
        """Return the speeds of the shafts with a port from x, or their angles."""
        w, s = x
        return (self.g_F or 1.0) * w, w + self.k_1 * s, w - self.k_2 * s

    def flow(self, x, T, deadband, last):
        """Return the power-flow index of the paper, (35)-(36)."""
        (_, x_1, x_2), (T_0, T_1, T_2) = self.at_ports(x), T
        return power_flow(T_0 * (self.g_F or 1.0) * x[0], T_1 * x_1 + T_2 * x_2, deadband, last)

    def friction(self, memory, forces):
        """Return S, see the module, N m, under axial forces on the clutches, N."""
        return clutched.held_friction(
            self.parameters, self.phi if self.lagged else None, self.preload, memory, forces)


class SymmetricModel(Model):
    """A symmetric differential under the paper's law, whose steps are exact."""

    def __init__(self, formulation, parameters, h):
        super().__init__(parameters, h, clutches=False)
        self.exact = {}
        for direction, response in responses_of(formulation, parameters).items():
            A, B, _, P, Q, _ = symmetric.in_slip(response)
            rows = direction * np.hstack([P, Q])   # M as it is reported
            try:
                second = second_moment_of_the_way(A.ravel().tolist(), h)
            except ArithmeticError:
                raise no_solution(parameters) from None
            self.exact[direction] = Exact(
                held_torque_step(A, B, h), symmetric.Moments(*rows.ravel().tolist()),
                losses.symmetric_losses(parameters, direction).of_reported(direction), second)

    def step(self, x, S, T, direction):
        """Advance by h; see the module for what is returned."""
        exact = self.exact[direction]
        end, integral = held_torque.step(exact.step, x, T)
        return x, direction, end, integral, exact, False, exact

    def point(self, x, S, T, direction):
        """Return what is exact in a direction."""
        return self.exact[direction]

    def internal_moments(self, x, T, direction, exact):
        """Return the moments, N m; a mesh is positive when the mechanism drives the shaft."""
        return symmetric.moments(exact.moments, x, T)


class ClutchedModel(Model):
    """A self-locking differential under the paper's law."""

    def __init__(self, formulation, parameters, h):
        super().__init__(parameters, h)
        self.responses = self._responses(formulation)
        self.lagged = getattr(formulation, 'lagged', False)
        # |M| of the last step feeds the friction of the next, which amplifies errors
        self.tolerance = adaptive.TOLERANCE / 5 if self.lagged else adaptive.TOLERANCE
        self.coefficients = {
            direction: clutched.coefficients(
                parameters, response, not self.lagged, direction)
            for direction, response in self.responses.items()}
        self.losses = self._losses()

    def _responses(self, formulation):
        return responses_of(formulation, self.parameters)

    def _losses(self):
        return {direction: losses.self_locking_losses(self.parameters, direction)
                for direction in self.responses}

    def coefficients_of(self, direction):
        """Return the ``Coefficients`` of a direction of power flow, see ``clutched``."""
        return self.coefficients[direction]

    def step(self, x, S, T, direction):
        """Advance by h; see the module for what is returned."""
        k = self.coefficients[direction]
        u = clutched.held(k, T, S)
        end, integral, point, coarse, parts = adaptive.step(
            adaptive.PAPER, k, u, x, self.h, self.tolerance)
        return x, direction, end, integral, point, coarse, (u, parts)

    def point(self, x, S, T, direction):
        """Return the point at a state, see ``clutched``."""
        k = self.coefficients[direction]
        return clutched.evaluate(k, clutched.held(k, T, S), *x)

    def internal_moments(self, x, T, direction, point):
        """Return the moments, N m; a mesh is positive when the mechanism drives the shaft."""
        _, _, F_1, F_2, M_1, M_2, _, _, _, _ = point
        return direction * M_1, direction * M_2, F_1 + 0.0, F_2 + 0.0   # no -0.0 at rest

    def remembered(self, point, direction):
        """Return the ``|M|`` that the friction of the next step of ``lsd_lagged`` knows."""
        _, _, _, _, M_1, M_2, _, _, _, _ = point
        return clutched.pressing(self.parameters, direction * M_1, direction * M_2)


class ClutchedSymmetricModel(ClutchedModel):
    """A symmetric differential with clutches under the paper's law."""

    def _responses(self, formulation):
        responses = {direction: symmetric.in_slip(response) for direction, response
                     in responses_of(formulation, self.parameters).items()}
        self.final_drives = {direction: clutched.final_drive(response)
                             for direction, response in responses.items()}
        return responses

    def _losses(self):
        return {direction: losses.symmetric_losses(self.parameters, direction)
                for direction in self.responses}

    def internal_moments(self, x, T, direction, point):
        """Return the moments, N m; a mesh is positive when the mechanism drives the shaft."""
        M_F = clutched.final_drive_moment(self.final_drives[direction], x, T, point)
        return direction * M_F, *super().internal_moments(x, T, direction, point)


class PassiveModel(Model):
    """A differential under the passive law."""

    def __init__(self, formulation, parameters, h, clutches):
        super().__init__(parameters, h, clutches)
        self.clutches = clutches
        self.lagged = getattr(formulation, 'lagged', False)
        self.k = passive.coefficients(parameters, clutches, not self.lagged)
        if not (elimination.is_finite(parameters, self.k) and passive.has_solutions(self.k)):
            raise no_solution(parameters)
        self.tolerance = adaptive.TOLERANCE / 5   # signs that turn round make kinks

    def coefficients_of(self, flow):
        """Return the ``Coefficients``, see ``passive``; nothing depends on the flow."""
        return self.k

    def flow(self, x, T, deadband, last):
        """Return who drives, +1 for the input shaft; nothing depends on it."""
        k, (w, _) = self.k, x
        return who_drives(T[0] * (k.g_F or 1.0) * w, abs(w) > k.sign_speed, deadband, last)

    def step(self, x, S, T, flow):
        """Advance by h; see the module for what is returned."""
        return self._adaptive_step(x, passive.held(self.k, T, S), flow)

    def point(self, x, S, T, flow):
        """Return the point at a state, see ``passive``."""
        return passive.evaluate(self.k, passive.held(self.k, T, S), *x)

    def internal_moments(self, x, T, flow, point):
        """Return the moments, N m; a mesh is positive when the mechanism drives the shaft."""
        _, _, F_1, F_2, M_1, M_2, M_F, *_ = point
        outputs = M_1, M_2, F_1 + 0.0, F_2 + 0.0   # no -0.0 at rest
        return (M_F + 0.0, *outputs) if self.g_F else outputs

    def remembered(self, point, flow):
        """Return the ``|M|`` that the friction of the next step of ``lsd_lagged`` knows."""
        _, _, _, _, M_1, M_2, *_ = point
        return clutched.pressing(self.parameters, M_1, M_2)

    def _adaptive_step(self, x, u, flow, here=None):
        end, integral, point, coarse, parts = adaptive.step(
            adaptive.PASSIVE, self.k, u, x, self.h, self.tolerance, here)
        return x, flow, end, integral, point, coarse, (u, parts)


class PassiveSymmetricModel(PassiveModel):
    """A symmetric differential under the passive law: exact steps while no sign changes."""

    def __init__(self, formulation, parameters, h, clutches):
        super().__init__(formulation, parameters, h, clutches)
        self._patterns = Patterns(self.k, h)
        self._guess = None   # the pattern met last: where it fits, it is the one

    def step(self, x, S, T, flow):
        """Advance by h; see the module for what is returned."""
        u, here = passive.held(self.k, T, S), None
        patterns = self._patterns
        if patterns.has_one_at(x):
            guess = self._guess
            done = guess and exact_step(guess, x, T)
            if not done:
                here = passive.evaluate(self.k, u, *x)
                pattern = patterns.of(u, here)
                done = pattern and pattern is not guess and exact_step(pattern, x, T)
                self._guess = guess = pattern or guess
            if done:
                end, integral = done
                return x, flow, end, integral, guess.exact, False, guess.exact
        x, flow, end, integral, point, coarse, path = self._adaptive_step(x, u, flow, here)
        return x, flow, end, integral, self._exact_or(point, end, u), coarse, path

    def point(self, x, S, T, flow):
        """Return what is exact at a state, or its point where nothing is."""
        u = passive.held(self.k, T, S)
        return self._exact_or(passive.evaluate(self.k, u, *x), x, u)

    def _exact_or(self, point, x, u):
        pattern = self._patterns.has_one_at(x) and self._patterns.of(u, point)
        return pattern.exact if pattern else point

    def internal_moments(self, x, T, flow, point):
        """Return the moments, N m; a mesh is positive when the mechanism drives the shaft."""
        if type(point) is Exact:
            return symmetric.moments(point.moments, x, T)
        return point[6] + 0.0, point[4] + 0.0, point[5] + 0.0


def model_of(formulation, mechanism, loss_law, parameters, h):
    """
    Return the model of a formulation under a law of losses.

    :param mechanism: its ``Mechanism``, with clutches or without; h: length of a step, s.
    """
    is_symmetric, clutches = mechanism.name == SYMMETRIC.name, bool(mechanism.clutches)
    if loss_law == PAPER:
        kind = ClutchedModel if not is_symmetric else (
            ClutchedSymmetricModel if clutches else SymmetricModel)
        return kind(formulation, parameters, h)
    if clutches:
        return PassiveModel(formulation, parameters, h, clutches)
    return PassiveSymmetricModel(formulation, parameters, h, clutches)
