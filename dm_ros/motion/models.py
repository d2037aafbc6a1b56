# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
One variant with one set of parameters and one step length: equations and stepper together.

A model is immutable and holds no state, so that it can be exchanged for another between two
steps. What it needs of a ``State`` is handed in: the speeds x, the torques T, the direction and,
for the friction of ``lsd_lagged``, the memory. ``step`` returns what it did, a tuple

    (x, direction, end, integral, point, coarse, path)

from the speeds at the start to those at the end, with their integral over the step. ``point`` is
what was evaluated at the end and saves doing so again for the moments, or None; ``path`` is
``(u, parts)`` of ``clutch.step``, or None where start and end tell it.
"""

import numpy as np

from dm_ros.mechanism import clutched, symmetric
from dm_ros.mechanism.power_flow import DIRECT, REVERSE
from dm_ros.mechanism.variants import SELF_LOCKING, SYMMETRIC
from dm_ros.motion import clutch, held_torque


def responses_of(formulation, parameters):
    """Return ``{+1: response, -1: response}``; raise ValueError where a number overflows."""
    with np.errstate(all='ignore'):
        try:
            equations = formulation(parameters)
            responses = {d: equations.response(d) for d in (DIRECT, REVERSE)}
        except (ArithmeticError, np.linalg.LinAlgError):
            responses = {}
    if not responses or not all(np.isfinite(m).all() for r in responses.values() for m in r):
        raise ValueError(f'{parameters.prefix}: the equations of these parameters have no '
                         'finite solution, some are too large or too small beside the others')
    return responses


class SymmetricModel:
    """A symmetric differential; x is (omega_1, omega_2)."""

    lagged = False

    def __init__(self, formulation, parameters, h):
        self.parameters, self.h = parameters, h
        self.responses = responses_of(formulation, parameters)
        self._g_F, self._g_2s = parameters.g_F, parameters.g_2s
        self._step, self.moments = {}, {}
        for direction, response in self.responses.items():
            self._step[direction] = held_torque.held_torque_step(response, h)
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

    def powers(self, x, T):
        """Return the power of the input shaft and the sum of the output shafts, W."""
        x_1, x_2 = x
        T_3, T_1, T_2 = T
        return T_3 * self._g_F * (x_1 + x_2) / 2, T_1 * x_1 + T_2 * x_2

    def step(self, x, memory, T, direction):
        """Advance by h; see the module for what is returned."""
        end, integral = held_torque.step(self._step[direction], x, T)
        return x, direction, end, integral, None, False, None

    def point(self, x, memory, T, direction):
        """Return None: the moments need no point."""

    def internal_moments(self, x, T, direction, point):
        """Return the moments, N m; a mesh is positive when the mechanism drives the shaft."""
        return symmetric.moments(self.moments[direction], x, T)


class SelfLockingModel:
    """A self-locking differential; x is (omega_0, omega_1 - omega_2)."""

    def __init__(self, formulation, parameters, h):
        self.parameters, self.h = parameters, h
        self.responses = responses_of(formulation, parameters)
        self.lagged = formulation.lagged
        self._g_12, self._g_2s = parameters.g_12, parameters.g_2s
        self._phi, self._preload = clutched.full_friction(parameters)
        # |M| of the last step feeds the friction of the next, which amplifies errors
        self._tolerance = clutch.TOLERANCE / 5 if self.lagged else clutch.TOLERANCE
        self.coefficients = {
            direction: clutched.coefficients(parameters, response, not self.lagged)
            for direction, response in self.responses.items()}

    def independent(self, omega_1, omega_2):
        """Return x for the given speeds of the output shafts."""
        return (omega_1 + self._g_12 * omega_2) / (1 + self._g_12), omega_1 - omega_2

    def all_shafts(self, x):
        """Return the speeds of all shafts from x, or their angles from its integral, (53)."""
        x_0, slip = x
        g = 1 + self._g_12
        return x_0, x_0 + self._g_12 / g * slip, x_0 - slip / g, (0.0 - slip) / (self._g_2s * g)

    def powers(self, x, T):
        """Return the power of the input shaft and the sum of the output shafts, W."""
        x_0, x_1, x_2, _ = self.all_shafts(x)
        T_0, T_1, T_2 = T
        return T_0 * x_0, T_1 * x_1 + T_2 * x_2

    def step(self, x, memory, T, direction):
        """Advance by h; see the module for what is returned."""
        k = self.coefficients[direction]
        u = clutched.held(k, T, self._friction(memory))
        end, integral, point, coarse, parts = clutch.step(k, u, x, self.h, self._tolerance)
        return x, direction, end, integral, point, coarse, (u, parts)

    def point(self, x, memory, T, direction):
        """Return the point at a state, see ``clutched``."""
        k = self.coefficients[direction]
        return clutched.evaluate(k, clutched.held(k, T, self._friction(memory)), *x)

    def internal_moments(self, x, T, direction, point):
        """Return the moments, N m; a mesh is positive when the mechanism drives the shaft."""
        _, _, F_1, F_2, M_1, M_2, _, _, _, _ = point
        return direction * M_1, direction * M_2, F_1 + 0.0, F_2 + 0.0   # no -0.0 at rest

    def remembered(self, point):
        """Return the |M| that the friction of the next step of ``lsd_lagged`` knows."""
        _, _, _, _, M_1, M_2, _, _, _, _ = point
        return abs(M_1), abs(M_2)

    def _friction(self, memory):
        """Return the friction at full slip that does not follow M in the step, N m."""
        if not self.lagged:
            return self._preload
        # variant 1: with |M| of the preceding step the whole friction is of that kind
        (phi_1, phi_2), (S_1, S_2), (M_1, M_2) = self._phi, self._preload, memory
        return phi_1 * M_1 + S_1, phi_2 * M_2 + S_2


MODELS = {SYMMETRIC.name: SymmetricModel, SELF_LOCKING.name: SelfLockingModel}


def model_of(variant, parameters, h):
    """Return the model of a ``Variant`` with parameters and a step of h, s."""
    return MODELS[variant.mechanism.name](variant.formulation, parameters, h)
