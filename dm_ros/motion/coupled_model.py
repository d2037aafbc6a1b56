# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A differential with half-shafts on some of its ports: see ``coupled`` for its equations."""

from operator import add

from dm_ros import core
from dm_ros.mechanism.variants import SYMMETRIC
from dm_ros.motion import adaptive, coupled
from dm_ros.motion.coupled import Equations, HalfShaft
from dm_ros.motion.matrices import Exponentials
from dm_ros.motion.models import (
    ClutchedModel,
    ClutchedSymmetricModel,
    model_of,
    PAPER,
    PassiveModel,
)
from dm_ros.motion.packing import packed_coupling


def half_shafts_of(mechanism, p, ports):
    """
    Return the ``HalfShaft`` of each speed port of a ``Mechanism``.

    :param p: its table of parameters; ports: ``{shaft: (stiffness, damping)}``.
    """
    k_1, k_2 = p.g_12 / (1 + p.g_12), 1 / (1 + p.g_12)
    driving = ((p.g_F, 0.0, p.I_3) if mechanism.name == SYMMETRIC.name else (1.0, 0.0, p.I_0))
    ends = driving, (1.0, k_1, p.I_1), (1.0, -k_2, p.I_2)
    return tuple([HalfShaft(n, *ports[name], *ends[n])
                  for n, name in enumerate(mechanism.inputs) if name in ports])


class CoupledModel:
    """
    A differential with half-shafts, under either law; see ``models`` for what a model does.

    x is (omega_0, omega_1 - omega_2, twist of each half-shaft in rad). What comes in on a port
    with a half-shaft is the speed outside, rad/s, or None where nothing holds it: it is free, and
    its twist zero.
    """

    keeps_books = False   # whether steps in C shall tell what was lost

    def __init__(self, formulation, mechanism, loss_law, parameters, h, ports):
        self.parameters, self.h = parameters, h
        self.mechanism = mechanism
        if loss_law == PAPER:
            kind = (ClutchedSymmetricModel if mechanism.name == SYMMETRIC.name
                    else ClutchedModel)
            self.inner, self._law = kind(formulation, parameters, h), adaptive.PAPER
        else:
            self.inner = PassiveModel(formulation, parameters, h, bool(mechanism.clutches))
            self._law = adaptive.PASSIVE
        self.lagged = self.inner.lagged
        self.half_shafts = half_shafts_of(mechanism, parameters, ports)
        self._exponentials, self._coupled_step = Exponentials(), core.coupled_step
        self._packed = packed_coupling(self)
        self.independent = self.inner.independent
        self.friction, self.remembered = self.inner.friction, self.inner.remembered

    @property
    def language(self):
        """What the steps are made in."""
        return 'C' if self._coupled_step else 'Python'

    def all_shafts(self, x):
        """Return the speeds of all shafts from x, or their angles from its integral."""
        return self.inner.all_shafts(x[:2])

    def torques(self, x, inputs):
        """Return the torque on each port at a state, N m."""
        w, s, *twists = x
        T = list(inputs)
        for shaft, twist in zip(self.half_shafts, twists):
            outside = inputs[shaft.port]
            T[shaft.port] = 0.0 if outside is None else shaft.torque(twist, outside, w, s)
        return T

    def mean_torques(self, inputs, steps):
        """Return the mean torque on each port over some steps, N m."""
        (_, _, _, total, *_), *others = steps
        for _, _, _, integral, *_ in others:
            total = map(add, total, integral)
        a_w, a_s, *twisted = total
        time = len(steps) * self.h
        T = list(inputs)
        for shaft, turned in zip(self.half_shafts, twisted):
            outside = inputs[shaft.port]
            T[shaft.port] = 0.0 if outside is None else shaft.torque(
                turned, outside * time, a_w, a_s) / time
        return tuple(T)

    def flow(self, x, inputs, deadband, last):
        """Return the power-flow index, with the torques at the state x."""
        return self.inner.flow(x[:2], self.torques(x, inputs), deadband, last)

    def step(self, x, S, inputs, flow):
        """
        Advance by h; see ``models`` for what is returned.

        The path are equations and parts; from C what was lost instead, or None.
        """
        if self._coupled_step:
            return self._coupled_step(self._packed, x, S, inputs, flow, self.keeps_books)
        w, s, *twists = x
        active = [n for n, shaft in enumerate(self.half_shafts)
                  if inputs[shaft.port] is not None]
        T = [0.0 if value is None else value for value in inputs]
        equations = Equations(self._law, self.inner.coefficients_of(flow),
                              [self.half_shafts[n] for n in active], T, S)
        z, integral, at, coarse, parts = coupled.step(
            equations, equations.state(w, s, [twists[n] for n in active]), self.h,
            self.inner.tolerance, self._exponentials)
        start, end, turned = ([0.0] * len(twists) for _ in range(3))
        for n, twist, total in zip(active, equations.twists(z), equations.twists(integral)):
            start[n], end[n], turned[n] = twists[n], twist, total
        (w_end, s_end), (a_w, a_s) = z[:2], integral[:2]
        return ((w, s, *start), flow, (w_end, s_end, *end), (a_w, a_s, *turned), at.point, coarse,
                (equations, parts))

    def point(self, x, S, inputs, flow):
        """Return the point at a state, see ``clutched`` and ``passive``."""
        return self.inner.point(x[:2], S, self.torques(x, inputs), flow)

    def internal_moments(self, x, inputs, flow, point):
        """Return the moments, N m; a mesh is positive when the mechanism drives the shaft."""
        moments = self.inner.internal_moments(x[:2], self.torques(x, inputs), flow, point)
        return moments[:len(self.mechanism.moments)]   # without clutches that are not there


def model_with(ports, formulation, mechanism, loss_law, parameters, h):
    """
    Return the model of a formulation under a law of losses, with half-shafts or without.

    :param ports: ``{shaft: (stiffness, damping)}``; the others: as for ``model_of``.
    """
    if ports:
        return CoupledModel(formulation, mechanism, loss_law, parameters, h, ports)
    return model_of(formulation, mechanism, loss_law, parameters, h)
