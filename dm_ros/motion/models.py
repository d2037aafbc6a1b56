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
what is known at the end and saves finding it again for the moments, or None; ``path`` tells the
way between: the ``Pattern`` of an exact step, ``(u, parts)`` of ``adaptive.step``, what was
``Booked`` along it in C, or None where the flow tells it.
"""

import struct
from typing import NamedTuple

import numpy as np

from dm_ros import core
from dm_ros.mechanism import clutched, losses, passive, symmetric
from dm_ros.mechanism.kinetic import self_locking_form, symmetric_form
from dm_ros.mechanism.power_flow import DIRECT, power_flow, REVERSE, who_drives
from dm_ros.mechanism.variants import SYMMETRIC
from dm_ros.motion import adaptive, held_torque
from dm_ros.motion.patterns import exact_step, Pattern, Patterns

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


class Booked(NamedTuple):
    """What the elements lost along the path of a step, and what its error took, J."""

    lost: tuple        # in the order of ``passive.lost_powers``, or of ``losses``
    numerical: float


class SymmetricModel:
    """A symmetric differential under the paper's law; x is (omega_1, omega_2)."""

    lagged = False
    half_shafts = ()
    language = 'Python'   # of its steps

    def __init__(self, formulation, parameters, h):
        self.parameters, self.h = parameters, h
        self.responses = responses_of(formulation, parameters)
        self._g_F, self._g_2s = parameters.g_F, parameters.g_2s
        self._step, self.moments = {}, {}
        for direction, response in self.responses.items():
            self._step[direction] = held_torque.held_torque_step(response.A, response.B, h)
            # M in one sign for both directions
            rows = direction * np.hstack([response.P, response.Q])
            self.moments[direction] = symmetric.Moments(*rows.ravel().tolist())

    def independent(self, omega_1, omega_2):
        """Return x for the given speeds of the output shafts."""
        return omega_1, omega_2

    def all_shafts(self, x):
        """Return the speeds of all shafts from x, or their angles from its integral, (5)-(7)."""
        x_1, x_2 = x
        x_0 = (x_1 + x_2) / 2
        return x_0, x_1, x_2, self._g_F * x_0, (x_2 - x_1) / (2 * self._g_2s)

    def flow(self, x, T, deadband, last):
        """Return the power-flow index, (35)-(36)."""
        x_1, x_2 = x
        T_3, T_1, T_2 = T
        return power_flow(T_3 * self._g_F * (x_1 + x_2) / 2, T_1 * x_1 + T_2 * x_2, deadband,
                          last)

    def step(self, x, S, T, direction):
        """Advance by h; see the module for what is returned."""
        end, integral = held_torque.step(self._step[direction], x, T)
        return x, direction, end, integral, None, False, None

    def friction(self, memory, forces):
        """Return None: there is no clutch."""

    def point(self, x, S, T, direction):
        """Return None: the moments need no point."""

    def internal_moments(self, x, T, direction, point):
        """Return the moments, N m; a mesh is positive when the mechanism drives the shaft."""
        return symmetric.moments(self.moments[direction], x, T)


class ClutchedModel:
    """A self-locking differential under the paper's law; x is (omega_0, omega_1 - omega_2)."""

    half_shafts = ()
    language = 'Python'   # of its steps

    def __init__(self, formulation, parameters, h):
        self.parameters, self.h = parameters, h
        self.responses = self._responses(formulation)
        self.lagged = getattr(formulation, 'lagged', False)
        self._g_12, self._g_2s = parameters.g_12, parameters.g_2s
        self._phi, self._preload = clutched.full_friction(parameters)
        # |M| of the last step feeds the friction of the next, which amplifies errors
        self.tolerance = adaptive.TOLERANCE / 5 if self.lagged else adaptive.TOLERANCE
        self.coefficients = {
            direction: clutched.coefficients(
                parameters, response, not self.lagged, direction)
            for direction, response in self.responses.items()}
        self.losses, self.form = self._books()
        self._core_step = core.paper_step
        self.language = core.language if self._core_step else 'Python'
        self._packed = {
            direction: (core.packed(self.coefficients[direction]), self._packed_losses(direction))
            for direction in self.responses}

    def _responses(self, formulation):
        return responses_of(formulation, self.parameters)

    def _books(self):
        """Return the coefficients of the losses by direction, and the form of the energy."""
        p = self.parameters
        return ({direction: losses.self_locking_losses(p, direction)
                 for direction in self.responses}, self_locking_form(p))

    def _packed_losses(self, direction):
        return core.packed(self.losses[direction])

    def coefficients_of(self, direction):
        """Return the ``Coefficients`` of a direction of power flow, see ``clutched``."""
        return self.coefficients[direction]

    def independent(self, omega_1, omega_2):
        """Return x for the given speeds of the output shafts."""
        return (omega_1 + self._g_12 * omega_2) / (1 + self._g_12), omega_1 - omega_2

    def all_shafts(self, x):
        """Return the speeds of all shafts from x, or their angles from its integral, (53)."""
        x_0, slip = x
        g = 1 + self._g_12
        return x_0, x_0 + self._g_12 / g * slip, x_0 - slip / g, (0.0 - slip) / (self._g_2s * g)

    def flow(self, x, T, deadband, last):
        """Return the power-flow index, (35)-(36)."""
        x_0, x_1, x_2, _ = self.all_shafts(x)
        T_0, T_1, T_2 = T
        return power_flow(T_0 * x_0, T_1 * x_1 + T_2 * x_2, deadband, last)

    def step(self, x, S, T, direction):
        """Advance by h; see the module for what is returned."""
        k = self.coefficients[direction]
        u = clutched.held(k, T, S)
        if self._core_step:
            end, integral, point, coarse, books = self._core_step(
                *self._packed[direction], u, T, x, self.h, self.tolerance, self.form)
            return x, direction, end, integral, point, coarse, Booked(*books)
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

    def friction(self, memory, forces):
        """Return S, see the module, N m, under axial forces on the clutches, N."""
        return clutched.held_friction(
            self.parameters, self._phi if self.lagged else None, self._preload, memory, forces)


class ClutchedSymmetricModel(ClutchedModel):
    """A symmetric differential with clutches under the paper's law; x is as of the other."""

    def __init__(self, formulation, parameters, h):
        self._g_F = parameters.g_F
        super().__init__(formulation, parameters, h)

    def _responses(self, formulation):
        responses = {direction: symmetric.in_slip(response) for direction, response
                     in responses_of(formulation, self.parameters).items()}
        self.final_drives = {direction: clutched.final_drive(response)
                             for direction, response in responses.items()}
        return responses

    def _books(self):
        p = self.parameters
        return ({direction: losses.symmetric_losses(p, direction)
                 for direction in self.responses}, symmetric_form(p))

    def _packed_losses(self, direction):
        return core.packed(self.losses[direction], self.final_drives[direction]) + (
            struct.pack('d', self._g_F))

    def all_shafts(self, x):
        """Return the speeds of all shafts from x, or their angles from its integral, (5)-(7)."""
        x_0, slip = x
        return (x_0, x_0 + slip / 2, x_0 - slip / 2, self._g_F * x_0,
                (0.0 - slip) / (2 * self._g_2s))

    def flow(self, x, T, deadband, last):
        """Return the power-flow index, (35)-(36)."""
        x_0, x_1, x_2, x_3, _ = self.all_shafts(x)
        T_3, T_1, T_2 = T
        return power_flow(T_3 * x_3, T_1 * x_1 + T_2 * x_2, deadband, last)

    def internal_moments(self, x, T, direction, point):
        """Return the moments, N m; a mesh is positive when the mechanism drives the shaft."""
        M_F = clutched.final_drive_moment(self.final_drives[direction], x, T, point)
        return direction * M_F, *super().internal_moments(x, T, direction, point)


class PassiveModel:
    """A differential under the passive law; x is (omega_0, omega_1 - omega_2)."""

    half_shafts = ()

    def __init__(self, formulation, parameters, h, clutches):
        self.parameters, self.h, self.clutches = parameters, h, clutches
        self.lagged = getattr(formulation, 'lagged', False)
        responses_of(formulation, parameters)   # refuses what overflows
        self.k = passive.coefficients(parameters, clutches, not self.lagged)
        if not passive.has_solutions(self.k):
            raise no_solution(parameters)
        self._phi, self._preload = (clutched.full_friction(parameters) if clutches
                                    else ((0.0, 0.0), (0.0, 0.0)))
        self._g_2s = parameters.g_2s
        self.form = (symmetric_form if self.k.g_F else self_locking_form)(parameters)
        self.tolerance = adaptive.TOLERANCE / 5   # signs that turn round make kinks
        self._core_step, self._packed = core.passive_step, core.packed(self.k)
        self.language = core.language if self._core_step else 'Python'

    def coefficients_of(self, flow):
        """Return the ``Coefficients``, see ``passive``; nothing depends on the flow."""
        return self.k

    def independent(self, omega_1, omega_2):
        """Return x for the given speeds of the output shafts."""
        return (omega_1 + self.k.g_12 * omega_2) / (1 + self.k.g_12), omega_1 - omega_2

    def all_shafts(self, x):
        """Return the speeds of all shafts from x, or their angles from its integral."""
        x_0, slip = x
        k = self.k
        spin = (0.0 - slip) * k.k_2 / self._g_2s
        if k.g_F:
            return x_0, x_0 + k.k_1 * slip, x_0 - k.k_2 * slip, k.g_F * x_0, spin
        return x_0, x_0 + k.k_1 * slip, x_0 - k.k_2 * slip, spin

    def flow(self, x, T, deadband, last):
        """Return who drives, +1 for the input shaft; nothing depends on it."""
        k, (w, _) = self.k, x
        return who_drives(T[0] * (k.g_F or 1.0) * w, abs(w) > k.sign_speed, deadband, last)

    def step(self, x, S, T, flow):
        """Advance by h; see the module for what is returned."""
        u = passive.held(self.k, T, S)
        return self._adaptive_step(x, u, flow)

    def point(self, x, S, T, flow):
        """Return the point at a state, see ``passive``."""
        return passive.evaluate(self.k, passive.held(self.k, T, S), *x)

    def internal_moments(self, x, T, flow, point):
        """Return the moments, N m; a mesh is positive when the mechanism drives the shaft."""
        _, _, F_1, F_2, M_1, M_2, M_F, *_ = point
        outputs = M_1, M_2, F_1 + 0.0, F_2 + 0.0   # no -0.0 at rest
        return (M_F + 0.0, *outputs) if self.k.g_F else outputs

    def remembered(self, point, flow):
        """Return the ``|M|`` that the friction of the next step of ``lsd_lagged`` knows."""
        _, _, _, _, M_1, M_2, *_ = point
        return clutched.pressing(self.parameters, M_1, M_2)

    def _adaptive_step(self, x, u, flow, here=None):
        if self._core_step:
            end, integral, point, coarse, books = self._core_step(
                self._packed, u, x, self.h, self.tolerance, self.form)
            return x, flow, end, integral, point, coarse, Booked(*books)
        end, integral, point, coarse, parts = adaptive.step(
            adaptive.PASSIVE, self.k, u, x, self.h, self.tolerance, here)
        return x, flow, end, integral, point, coarse, (u, parts)

    def friction(self, memory, forces):
        """Return S, see the module, N m, under axial forces on the clutches, N."""
        return clutched.held_friction(
            self.parameters, self._phi if self.lagged else None, self._preload, memory, forces)


class PassiveSymmetricModel(PassiveModel):
    """A symmetric differential under the passive law: exact steps while no sign changes."""

    def __init__(self, formulation, parameters, h, clutches):
        super().__init__(formulation, parameters, h, clutches)
        self._patterns = Patterns(formulation(parameters), parameters, self.k, h)
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
                return x, flow, end, integral, guess, False, guess
        x, flow, end, integral, point, coarse, path = self._adaptive_step(x, u, flow, here)
        return x, flow, end, integral, self._with_pattern(end, u, point), coarse, path

    def point(self, x, S, T, flow):
        """Return the pattern at a state, or its point where there is none."""
        u = passive.held(self.k, T, S)
        return self._with_pattern(x, u, passive.evaluate(self.k, u, *x))

    def _with_pattern(self, x, u, point):
        return self._patterns.has_one_at(x) and self._patterns.of(u, point) or point

    def internal_moments(self, x, T, flow, point):
        """Return the moments, N m; a mesh is positive when the mechanism drives the shaft."""
        if type(point) is Pattern:
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
