# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The books of a differential with half-shafts: what their twist stores and their damping loses too.

Work on a port with a half-shaft is the torque times the speed outside; where nothing holds the
outside there is none. All losses are integrated along the path of the step as they are.
"""

from operator import add

from dm_ros.motion import meters
from dm_ros.motion.coupled_model import CoupledModel
from dm_ros.motion.matrices import size, times
from dm_ros.motion.meters import energy_gained

FIT = 3e-5   # of the nodes at which powers are taken


class CoupledMeter:
    """The books of a ``CoupledModel``; see ``meters`` for what a meter does."""

    def __init__(self, model):
        self._model, self._inner = model, meters.meter_of(model.inner)
        mechanism = model.mechanism
        model.keeps_books = True
        self._own = 1 + len(mechanism.gears + mechanism.bearings + mechanism.clutches)

    def stored_energy(self, x):
        """Return the kinetic energy and that of the twists, J."""
        stored = self._inner.stored_energy(x[:2])
        for shaft, twist in zip(self._model.half_shafts, x[2:]):
            stored += shaft.stiffness * twist * twist / 2
        return stored

    def book(self, step, inputs):
        """Return the energies of a step, see ``meters``; those of the half-shafts follow."""
        model = self._model
        x, flow, end, integral, _, _, path = step
        lost, damped, numerical = path if model.language == 'C' else self._along(flow, *path)
        T = model.mean_torques(inputs, [step])
        angles = self._inner.angles(integral[:2])
        outside = {shaft.port: inputs[shaft.port] for shaft in model.half_shafts}
        work = [torque * (angle if n not in outside else (outside[n] or 0.0) * model.h)
                for n, (torque, angle) in enumerate(zip(T, angles))]
        stored = energy_gained(self._inner.form, x[:2], end[:2])
        for shaft, a, b in zip(model.half_shafts, x[2:], end[2:]):
            stored += shaft.stiffness * (b - a) * (b + a) / 2
        return *work, stored, *lost, *damped, numerical

    def _along(self, flow, equations, parts):
        """Return what the elements and the half-shafts lost, and what the error took."""
        lost = [0.0] * (self._own + len(equations.half_shafts))
        numerical = 0.0
        for part in parts:
            more, taken = self._part(equations, flow, part)
            lost = list(map(add, lost, more))
            numerical += taken
        damped = dict(zip([shaft.port for shaft in equations.half_shafts], lost[self._own:]))
        return (lost[:self._own],
                [damped.get(shaft.port, 0.0) for shaft in self._model.half_shafts], numerical)

    def _powers(self, equations, flow, z, looked):
        """Return what each element loses at a state, W, the half-shafts last."""
        slope, T, u, point = looked
        own = self._inner.lost_powers(flow, T, z[:2], u, point)
        powers = list(own[:self._own])
        for shaft, faster in zip(equations.half_shafts, slope[2:]):
            slower = faster / shaft.scale
            powers.append(shaft.damping * slower * slower)
        return powers

    def _momentum(self, equations, z):
        """Return what the kinetic energy and that of the twists grow with in each of z."""
        m_ww, m_ws, m_ss = self._inner.form
        w, s, *chis = z
        return [m_ww * w + m_ws * s, m_ws * w + m_ss * s,
                *[shaft.inertia * chi for shaft, chi in zip(equations.half_shafts, chis)]]

    def _part(self, equations, flow, part):
        """Return what the elements lost in a part of the path, and what its error took."""
        here, there, c, h, exponential, way = part
        if way is None:
            lost = self._powers(equations, flow, there.z, equations.look(*there.z))
            jump = [b - a for a, b in zip(here.z, there.z)]
            taken = 0.0
            for momentum, change in zip(self._momentum(equations, jump), jump):
                taken += momentum * change
            return [h * loss for loss in lost], taken / 2
        lost = [0.0] * (self._own + len(equations.half_shafts))
        taken = 0.0
        for r, weight, q in exponential.nodes(way, FIT, size(here.z)):
            r_2 = r * r
            r_3 = r_2 * r
            z = [a + b + g * r_3 for a, b, g in zip(here.z, q, c)]
            looked = equations.look(*z)
            lost = [a + weight * b for a, b in zip(
                lost, self._powers(equations, flow, z, looked))]
            # the path misses the equations by this
            error = [f + a + 3 * g * r_2 / h - slope for f, a, g, slope in zip(
                here.slope, times(exponential.J, q), c, looked[0])]
            power = 0.0
            for momentum, miss in zip(self._momentum(equations, z), error):
                power += momentum * miss
            taken += weight * power
        return [h * loss for loss in lost], -h * taken


def meter_of(model):
    """Return the meter that reads what a model did."""
    return CoupledMeter(model) if isinstance(model, CoupledModel) else meters.meter_of(model)
