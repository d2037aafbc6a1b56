# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The books of a differential with half-shafts: what their twist stores and their damping loses too.

Work on a port with a half-shaft is the torque times the speed outside; where nothing holds the
outside there is none. All losses are integrated along the path of the step as they are.
"""

import numpy as np

from dm_ros.motion import meters
from dm_ros.motion.coupled_model import CoupledModel
from dm_ros.motion.meters import energy_gained, leads_far


class CoupledMeter:
    """The books of a ``CoupledModel``; see ``meters`` for what a meter does."""

    def __init__(self, model):
        self._model, self._inner = model, meters.meter_of(model.inner)
        mechanism = model.mechanism
        self._own = 1 + len(mechanism.gears + mechanism.bearings + mechanism.clutches)

    def stored_energy(self, x):
        """Return the kinetic energy and that of the twists, J."""
        return self._inner.stored_energy(x[:2]) + sum(
            shaft.stiffness * twist * twist / 2
            for shaft, twist in zip(self._model.half_shafts, x[2:]))

    def book(self, step, inputs):
        """Return the energies of a step, see ``meters``; those of the half-shafts follow."""
        model = self._model
        x, flow, end, integral, _, _, (equations, parts) = step
        T = model.mean_torques(inputs, [step])
        angles = self._inner.angles(integral[:2])
        outside = {shaft.port: inputs[shaft.port] for shaft in model.half_shafts}
        work = [torque * (angle if n not in outside else (outside[n] or 0.0) * model.h)
                for n, (torque, angle) in enumerate(zip(T, angles))]
        stored = energy_gained(self._inner.form, x[:2], end[:2]) + sum(
            shaft.stiffness * (b - a) * (b + a) / 2
            for shaft, a, b in zip(model.half_shafts, x[2:], end[2:]))
        lost = np.zeros(self._own + len(equations.half_shafts))
        numerical = 0.0
        for part in parts:
            more, taken = self._part(equations, flow, part)
            lost += more
            numerical += taken
        lost = lost.tolist()
        damped = dict(zip((shaft.port for shaft in equations.half_shafts),
                          lost[self._own:]))
        return (*work, stored, *lost[:self._own],
                *(damped.get(shaft.port, 0.0) for shaft in model.half_shafts), numerical)

    def _powers(self, equations, flow, z, looked):
        """Return what each element loses at a state, W, the half-shafts last."""
        slope, T, u, point = looked
        own = self._inner.lost_powers(flow, T, z[:2], u, point)
        return *own[:self._own], *(
            shaft.damping * (faster / shaft.scale)**2
            for shaft, faster in zip(equations.half_shafts, slope[2:]))

    def _part(self, equations, flow, part):
        """Return what the elements lost in a part of the path, and what its error took."""
        here, there, J, c, h, exponential = part
        m_ww, m_ws, m_ss = self._inner.form
        form = np.diag([m_ww, m_ss, *(shaft.inertia for shaft in equations.half_shafts)])
        form[0, 1] = form[1, 0] = m_ws
        whole = there.z - here.z
        if J is None:
            z = there.z.tolist()
            lost = self._powers(equations, flow, z, equations.look(*z))
            return h * np.array(lost), float(whole @ form @ whole) / 2
        far = leads_far(*here.z[:2].tolist(), *whole[:2].tolist())
        times, weights, ways = exponential.rule(far)
        r, ways = times[:, None] / h, ways @ here.slope
        states = here.z + ways + c * r**3
        looks = [(z, equations.look(*z)) for z in states.tolist()]
        lost = weights @ np.array([self._powers(equations, flow, *look) for look in looks])
        # the path misses the equations by this
        error = (here.slope + ways @ J.T + (3 / h) * c * r**2
                 - np.array([slope for _, (slope, *_) in looks]))
        return lost, -float(weights @ np.sum(states @ form * error, axis=1))


def meter_of(model):
    """Return the meter that reads what a model did."""
    return CoupledMeter(model) if isinstance(model, CoupledModel) else meters.meter_of(model)

