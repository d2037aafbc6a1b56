# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
One mechanism with one set of parameters and one step length: equations and stepper together.

A model is immutable and holds no state: the state is handed in and out, so that a model can
be exchanged for another between two steps. The state is the pair ``x`` of independent speeds
and the ``memory``: the moments at the end of the preceding step, for a self-locking differential.
"""

import numpy as np

from dm_ros.mechanism import self_locking, symmetric
from dm_ros.mechanism.parameters import SelfLockingParameters, SymmetricParameters
from dm_ros.mechanism.power_flow import DIRECT, REVERSE
from dm_ros.motion.steppers import ClutchStep, HeldTorqueStep


def responses_of(equations):
    """Return ``{+1: response, -1: response}``; raise ValueError where a number overflows."""
    with np.errstate(all='ignore'):
        try:
            responses = {d: equations.response(d) for d in (DIRECT, REVERSE)}
        except (ArithmeticError, np.linalg.LinAlgError):
            responses = {}
    if not responses or not all(np.isfinite(m).all() for r in responses.values() for m in r):
        raise ValueError(f'{equations.p.prefix}: the equations of these parameters have no '
                         'finite solution, some are too large or too small beside the others')
    return responses


class SymmetricModel:
    """A symmetric differential; ``x`` is (omega_1, omega_2)."""

    parameters_type = SymmetricParameters
    inputs = ('pinion', 'left', 'right')
    outputs = ('left', 'right')
    shafts = symmetric.SHAFTS
    moments = symmetric.MOMENTS

    def __init__(self, formulation, parameters, h):
        self.parameters = parameters
        self._g_F, self._g_2s = parameters.g_F, parameters.g_2s
        # the paper orders torques (T_1, T_2, T_3), the inputs are (T_3, T_1, T_2)
        responses = {direction: r._replace(B=r.B[:, [2, 0, 1]], Q=r.Q[:, [2, 0, 1]])
                     for direction, r in responses_of(formulation(parameters)).items()}
        self._stepper = HeldTorqueStep(responses, h)
        # M in one sign for both directions
        self._moments = {direction: tuple((direction * np.hstack([r.P, r.Q])).ravel().tolist())
                         for direction, r in responses.items()}

    def independent(self, omega_1, omega_2):
        """Return x and the memory for the given speeds of the output shafts."""
        return (omega_1, omega_2), None

    def all_shafts(self, x):
        """Return the speeds of all shafts from x, or their angles from its integral, (5)-(7)."""
        x_1, x_2 = x
        x_0 = (x_1 + x_2) / 2
        return x_0, x_1, x_2, self._g_F * x_0, (x_2 - x_1) / (2 * self._g_2s)

    def powers(self, x, torque):
        """Return the power of the input shaft and the sum of the output shafts, W."""
        x_1, x_2 = x
        T_3, T_1, T_2 = torque
        return T_3 * self._g_F * (x_1 + x_2) / 2, T_1 * x_1 + T_2 * x_2

    def step(self, x, memory, torque, direction):
        """Return x, its integral over the step, the memory, and whether the step was coarse."""
        x, integral = self._stepper.step(x, torque, direction)
        return x, integral, None, False

    def internal_moments(self, x, memory, torque, direction):
        """Return the moments, N m; a mesh is positive when the mechanism drives the shaft."""
        (P01, P02, Q03, Q01, Q02, P11, P12, Q13, Q11, Q12,
         P21, P22, Q23, Q21, Q22) = self._moments[direction]
        x_1, x_2 = x
        T_3, T_1, T_2 = torque
        return (P01 * x_1 + P02 * x_2 + Q03 * T_3 + Q01 * T_1 + Q02 * T_2,
                P11 * x_1 + P12 * x_2 + Q13 * T_3 + Q11 * T_1 + Q12 * T_2,
                P21 * x_1 + P22 * x_2 + Q23 * T_3 + Q21 * T_1 + Q22 * T_2)


class SelfLockingModel:
    """A self-locking differential; ``x`` is (omega_0, omega_1 - omega_2)."""

    parameters_type = SelfLockingParameters
    inputs = ('carrier', 'front', 'rear')
    outputs = ('front', 'rear')
    shafts = self_locking.SHAFTS
    moments = self_locking.MOMENTS

    def __init__(self, formulation, parameters, h):
        self.parameters = parameters
        self._h = h
        self._lagged = formulation.lagged
        self._g_12, self._g_2s = parameters.g_12, parameters.g_2s
        self._full_friction = self_locking.full_friction(parameters)
        # |M| of the last step feeds the friction of the next, which amplifies errors
        tolerance = ClutchStep.TOLERANCE / 5 if self._lagged else ClutchStep.TOLERANCE
        self._stepper = ClutchStep(
            responses_of(formulation(parameters)), self_locking.slip_steepness(parameters),
            self._full_friction, tolerance)

    def independent(self, omega_1, omega_2):
        """Return x and the memory, without torques, for given speeds of the output shafts."""
        x = ((omega_1 + self._g_12 * omega_2) / (1 + self._g_12), omega_1 - omega_2)
        friction = self._friction((0.0, 0.0, 0.0, 0.0))
        return x, self._stepper.moments(x, (0.0, 0.0, 0.0), DIRECT, friction)

    def all_shafts(self, x):
        """Return the speeds of all shafts from x, or their angles from its integral, (53)."""
        x_0, slip = x
        g = 1 + self._g_12
        return x_0, x_0 + self._g_12 / g * slip, x_0 - slip / g, (0.0 - slip) / (self._g_2s * g)

    def powers(self, x, torque):
        """Return the power of the input shaft and the sum of the output shafts, W."""
        x_0, x_1, x_2, _ = self.all_shafts(x)
        T_0, T_1, T_2 = torque
        return T_0 * x_0, T_1 * x_1 + T_2 * x_2

    def step(self, x, memory, torque, direction, parts=None):
        """Return x, its integral over the step, the memory, and whether the step was coarse."""
        return self._stepper.step(x, torque, direction, self._h, self._friction(memory), parts)

    def internal_moments(self, x, memory, torque, direction):
        """Return the moments, N m; a mesh is positive when the mechanism drives the shaft."""
        M_1, M_2, F_1, F_2 = memory
        return direction * M_1, direction * M_2, F_1 + 0.0, F_2 + 0.0   # no -0.0 at rest

    def _friction(self, memory):
        """Return ((tan(alpha) f_1, tan(alpha) f_2), (F_s1, F_s2)) at full slip, (56)."""
        if not self._lagged:
            return self._full_friction
        # variant 1: with |M| of the preceding step the whole friction is static
        M_1, M_2, _, _ = memory
        (phi_1, phi_2), (F_s1, F_s2) = self._full_friction
        return (0.0, 0.0), (phi_1 * abs(M_1) + F_s1, phi_2 * abs(M_2) + F_s2)


MODELS = {
    'symmetric_ode': (SymmetricModel, symmetric.SymmetricOde),
    'symmetric_dae': (SymmetricModel, symmetric.SymmetricDae),
    'lsd_lagged': (SelfLockingModel, self_locking.SelfLockingLagged),
    'lsd_ode': (SelfLockingModel, self_locking.SelfLockingOde),
    'lsd_dae': (SelfLockingModel, self_locking.SelfLockingDae),
}
VARIANTS = tuple(MODELS)
