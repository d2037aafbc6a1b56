# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
A second model of a differential with the passive law of losses, for the yardstick.

It is written from the laws of the single meshes and bearings and shares no line with the
package. A moment is positive when the mechanism drives the shaft.
"""

import math
from math import hypot, tan, tanh
from typing import NamedTuple

from scipy.optimize import brentq

CENTRE = {   # Table 2, the crown radii and the clutches as assumed
    'crown_radius.front': 0.040, 'crown_radius.rear': 0.060, 'satellite_ratio': 10 / 24,
    'satellite_count': 4,
    'inertia.carrier': 2.9e-2, 'inertia.front': 4.8e-3, 'inertia.rear': 5.8e-3,
    'inertia.satellite': 6.0e-3,
    'viscosity.carrier': 5e-3, 'viscosity.front': 1e-3, 'viscosity.rear': 1e-3,
    'viscosity.satellite': 1e-3,
    'efficiency.carrier_bearing': 0.995, 'efficiency.front_mesh': 0.99,
    'efficiency.rear_mesh': 0.99, 'mesh_sign_speed': 0.02, 'pressure_angle': math.radians(20.0),
    'clutch.front.friction_surfaces': 1, 'clutch.rear.friction_surfaces': 9,
    'clutch.front.friction_coefficient': 0.15, 'clutch.rear.friction_coefficient': 0.15,
    'clutch.front.slip_steepness': 4.0, 'clutch.rear.slip_steepness': 4.0,
    'clutch.front.radius': 0.040, 'clutch.rear.radius': 0.060,
    'clutch.front.preload': 100.0, 'clutch.rear.preload': 100.0,
    'clutch.front.coast_factor': 1.0, 'clutch.rear.coast_factor': 1.0}

AXLE = {   # Table 1, with a joint at each side gear and a flange at the pinion
    'final_drive_ratio': 3.517, 'satellite_ratio': 0.5, 'satellite_count': 2,
    'inertia.carrier': 0.1, 'inertia.left': 1.8e-4 + 4e-3, 'inertia.right': 1.8e-4 + 4e-3,
    'inertia.pinion': 1.56e-4 + 5e-3, 'inertia.satellite': 4.0e-5,
    'viscosity.carrier': 5e-3, 'viscosity.left': 1e-3, 'viscosity.right': 1e-3,
    'viscosity.pinion': 1e-3, 'viscosity.satellite': 1e-3,
    'efficiency.pinion_bearing': 0.995, 'efficiency.final_drive': 0.975,
    'efficiency.carrier_bearing': 0.995, 'efficiency.left_mesh': 0.99,
    'efficiency.right_mesh': 0.99, 'mesh_sign_speed': 0.02,
    'pressure_angle': math.radians(20.0), 'side_gear_radius': 0.03,
    'clutch.left.friction_surfaces': 0, 'clutch.right.friction_surfaces': 0,
    'clutch.left.friction_coefficient': 0.15, 'clutch.right.friction_coefficient': 0.15,
    'clutch.left.slip_steepness': 4.0, 'clutch.right.slip_steepness': 4.0,
    'clutch.left.radius': 0.050, 'clutch.right.radius': 0.050,
    'clutch.left.preload': 0.0, 'clutch.right.preload': 0.0,
    'clutch.left.coast_factor': 1.0, 'clutch.right.coast_factor': 1.0}


def plus(value):
    return max(value, 0.0)


def sign(value):
    return float(value > 0.0) - float(value < 0.0)


def newton(residuals, e_0, ds, enough):
    """Return (e_0, ds, residual), where no step that is halved up to 13 times gets nearer."""
    one, two = residuals(e_0, ds)
    for _ in range(100):
        size = hypot(one, two)
        if size <= enough:
            break
        h = 1e-3 * (1.0 + abs(e_0))
        h_s = 1e-3 * (1.0 + abs(ds))
        one_0, two_0 = residuals(e_0 + h, ds)
        one_s, two_s = residuals(e_0, ds + h_s)
        a, b = (one_0 - one) / h, (one_s - one) / h_s
        c, d = (two_0 - two) / h, (two_s - two) / h_s
        determinant = a * d - b * c
        step, step_s = (b * two - d * one) / determinant, (c * one - a * two) / determinant
        for _ in range(14):
            new_one, new_two = residuals(e_0 + step, ds + step_s)
            if hypot(new_one, new_two) < size:
                break
            step, step_s = step / 2.0, step_s / 2.0
        else:
            break
        e_0, ds, one, two = e_0 + step, ds + step_s, new_one, new_two
    return e_0, ds, hypot(one, two)


def nested_roots(residuals):
    """Return (e_0, ds): for each e_0 the second equation has one ds, and then the first one."""
    def slip(e_0):
        return root(lambda ds: residuals(e_0, ds)[1])
    e_0 = root(lambda e_0: residuals(e_0, slip(e_0))[0])
    return e_0, slip(e_0)


def root(function):
    """Return the zero of a continuous function that changes its sign once."""
    end = 1.0
    while function(end) * function(-end) > 0.0:
        end *= 10.0
    return brentq(function, -end, end, xtol=1e-12, rtol=1e-14)


class Solution(NamedTuple):
    """What the law of losses says of a differential at given speeds and torques."""

    e_0: float          # of the carrier
    ds: float           # of output 1 less output 2
    moments: tuple      # as the interface names them: (final drive,) meshes (, clutches)
    losses: dict        # W


class Differential:
    """
    One differential with the passive law: self-locking with the input on its carrier, or axle.

    Every internal moment follows from the two accelerations in one pass, since each law of a
    mesh or a bearing can be turned round by hand. What is left are two equations with as many
    unknowns, piecewise linear, and they are solved by Newton's method with difference quotients
    (exact within a piece) and halved steps.
    """

    def __init__(self, values, shafts, is_axle):
        self.is_axle = is_axle
        self.shafts = shafts
        self.g_12 = 1.0
        if not is_axle:
            self.g_12 = values['crown_radius.rear'] / values['crown_radius.front']
        self.k_1 = self.g_12 / (1.0 + self.g_12)
        self.k_2 = 1.0 / (1.0 + self.g_12)
        self.g_2s = values['satellite_ratio']
        self.n_s = values['satellite_count']
        self.I_0, self.I_s = values['inertia.carrier'], values['inertia.satellite']
        self.l_0, self.l_s = values['viscosity.carrier'], values['viscosity.satellite']
        self.I = [values[f'inertia.{shaft}'] for shaft in shafts]
        self.l = [values[f'viscosity.{shaft}'] for shaft in shafts]  # noqa: E741
        self.eta = [values[f'efficiency.{shaft}_mesh'] for shaft in shafts]
        self.eta_0B = values['efficiency.carrier_bearing']
        self.sign_speed = values['mesh_sign_speed']
        self.tan_alpha = tan(values['pressure_angle'])
        self.R = [values['side_gear_radius' if is_axle else f'crown_radius.{shaft}']
                  for shaft in shafts]
        self.clutches = [[values[f'clutch.{shaft}.{name}'] for name in (
            'friction_surfaces', 'friction_coefficient', 'radius', 'slip_steepness', 'preload',
            'coast_factor')] for shaft in shafts]
        self.g_F = values['final_drive_ratio'] if is_axle else 1.0
        if is_axle:
            self.I_3, self.l_3 = values['inertia.pinion'], values['viscosity.pinion']
            self.eta_3B = values['efficiency.pinion_bearing']
            self.eta_FG = values['efficiency.final_drive']

    def outputs(self, omega_0, s):
        """Return the speeds of both outputs."""
        return omega_0 + self.k_1 * s, omega_0 - self.k_2 * s

    def input_speed(self, omega_0):
        return self.g_F * omega_0

    def energy(self, omega_0, s):
        omega = self.outputs(omega_0, s)
        omega_s = -s / (self.g_2s * (1.0 + self.g_12))
        twice = self.I_0 * omega_0**2 + self.n_s * self.I_s * omega_s**2
        twice += sum(inertia * speed**2 for inertia, speed in zip(self.I, omega))
        if self.is_axle:
            twice += self.I_3 * (self.g_F * omega_0)**2
        return twice / 2.0

    def solve(self, omega_0, s, torque_in, torques_out, forces):
        """Return the one solution of the law of losses."""
        residuals, report = self._law(omega_0, s, torque_in, torques_out, forces)
        scale = 1.0 + abs(torque_in) + sum(map(abs, torques_out)) + sum(map(abs, forces))
        e_0, ds, left = newton(residuals, 0.0, 0.0, 1e-14 * scale)
        if left > 1e-10 * scale:   # rare: stuck where pieces meet
            e_0, ds, left = newton(residuals, *nested_roots(residuals), 1e-14 * scale)
        if left > 1e-10 * scale:
            raise ArithmeticError(f'no solution: {left} is left')
        return Solution(e_0, ds, *report(e_0, ds))

    def _law(self, omega_0, s, torque_in, torques_out, forces):
        """Return two functions of (e_0, ds): what is to be zero, and what there is to tell."""
        omega = self.outputs(omega_0, s)
        sigma_0 = tanh(omega_0 / self.sign_speed)
        sigma = [tanh(speed / self.sign_speed) for speed in omega]
        L_0 = self.l_0 * omega_0
        L = [drag * (speed - omega_0) for drag, speed in zip(self.l, omega)]
        satellite = self.n_s / (self.g_2s * self.g_2s * (1.0 + self.g_12))
        omega_s = -s / (self.g_2s * (1.0 + self.g_12))
        beta = 1.0 / self.eta_0B - 1.0
        d = sign(omega_0)

        friction = []   # of each clutch: (by |M|, the same on coast, constant)
        for k in (0, 1):
            surfaces, coefficient, radius, steepness, preload, coast = self.clutches[k]
            arm = surfaces * coefficient * radius * tanh(steepness * (omega[k] - omega_0))
            by_moment = arm / self.R[k] * self.tan_alpha
            constant = arm * (self.n_s * preload + forces[k])
            friction.append((by_moment, by_moment * coast, constant))

        def side(k, e_k):
            """Return (M, N, F) of the side mesh: S - F = I e + L - T, S and F by |M|."""
            on_drive, on_coast, constant = friction[k]
            rest = self.I[k] * e_k + L[k] + constant - torques_out[k]
            mean, half = (1.0 + self.eta[k]) / 2.0, (1.0 - self.eta[k]) / 2.0
            if rest >= 0.0:     # then M >= 0, and |M| = M
                M = rest / (mean - half * sigma[k] - on_drive)
                by_moment = on_drive
            else:               # |M| = -M
                M = rest / (mean + half * sigma[k] + on_coast)
                by_moment = on_coast
            return M, mean * M + half * abs(M) * sigma[k], by_moment * abs(M) + constant

        def final_drive(e_0):
            """Return (M_F, moment C on the carrier, loss moment D_3 on the pinion)."""
            omega_3 = self.g_F * omega_0
            # sigma of the pinion is that of the carrier, with the sign of its own speed
            sigma_3 = math.copysign(1.0, self.g_F) * sigma_0
            L_3 = self.l_3 * omega_3
            d_3 = sign(omega_3)
            beta_3 = (1.0 / self.eta_3B - 1.0) * abs(sigma_3)
            known = plus(-d_3 * torque_in) + d_3 * L_3
            moving = torque_in - L_3 - self.I_3 * self.g_F * e_0   # P + D_3, P = N_F/g_F
            if d_3 == 0:
                P = moving
            else:
                q = d_3 * moving - beta_3 * known                  # d P + beta_3 [d P]+
                P = d_3 * (q / (1.0 + beta_3) if q > 0.0 else q)
            D_3 = moving - P
            N_F = self.g_F * P
            mean, half = (1.0 + self.eta_FG) / 2.0, (1.0 - self.eta_FG) / 2.0
            M_F = N_F / (mean + half * sigma_0 * sign(N_F))        # M has the sign of N
            return M_F, mean * M_F - half * abs(M_F) * sigma_0, D_3

        def moments(e_0, ds):
            """Return all internal moments."""
            e = self.outputs(e_0, ds)
            (M_1, N_1, F_1), (M_2, N_2, F_2) = side(0, e[0]), side(1, e[1])
            M_F, C, D_3 = final_drive(e_0) if self.is_axle else (0.0, torque_in, 0.0)
            reaction = L_0 - L[0] - L[1] - F_1 - F_2
            bracket = plus(d * (N_1 + N_2)) + plus(-d * C) + d * reaction
            D_0 = beta * sigma_0 * plus(bracket)
            return M_1, M_2, M_F, N_1, N_2, F_1, F_2, C, reaction, D_0, D_3

        def residuals(e_0, ds):
            """Return what is left of the equations of the carrier and of the satellites."""
            _, _, _, N_1, N_2, _, _, C, reaction, D_0, _ = moments(e_0, ds)
            return (self.I_0 * e_0 - C + N_1 + N_2 + reaction + D_0,
                    self.g_12 * N_1 - N_2 + satellite * (self.I_s * ds + self.l_s * s))

        def report(e_0, ds):
            """Return the moments as the interface has them, and the losses."""
            M_1, M_2, M_F, _, _, F_1, F_2, _, _, D_0, D_3 = moments(e_0, ds)
            slips = [speed - omega_0 for speed in omega]
            losses = {
                'meshes': sum((1.0 - eta) * abs(M) * z * speed
                              for eta, M, z, speed in zip(self.eta, (M_1, M_2), sigma, omega)),
                'bearings': D_0 * omega_0,
                'clutches': F_1 * slips[0] + F_2 * slips[1],
                'drag': (L_0 * omega_0 + L[0] * slips[0] + L[1] * slips[1]
                         + self.n_s * self.l_s * omega_s**2)}
            if not self.is_axle:
                return (M_1, M_2, F_1, F_2), losses
            omega_3 = self.g_F * omega_0
            losses['meshes'] += (1.0 - self.eta_FG) * abs(M_F) * sigma_0 * omega_0
            losses['bearings'] += D_3 * omega_3
            losses['drag'] += self.l_3 * omega_3**2
            return (M_F, M_1, M_2, F_1, F_2), losses

        return residuals, report
