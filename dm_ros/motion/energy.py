# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The energy books of a differential: what the torques put in, what is stored, what is lost where.

``AuditedSimulation`` is a ``Simulation`` that keeps the books of each tick and their total, see
``Energy``; it moves bit for bit like one without them. Under held torques, with the symbols and
the signs of the paper (L, M, F as in ``symmetric`` and ``self_locking``), a tick obeys

    work = stored + viscous + gears + bearings + clutches + numerical

Every term is computed on its own, none is the remainder of the others:

work       the held torques times the angles that the simulation reports
stored     the difference of the kinetic energies at the ends
losses     of the symmetric differential in closed form: its motion is an exponential, and its
           powers are quadratic in speeds and torques, so their integrals are quadratic too;
           of the self-locking one by quadrature along the path of ``ClutchStep``
numerical  zero for the symmetric one. The path of ``ClutchStep`` obeys the equations but for
           its error; this is the work of that error, positive when it takes energy away
"""

from operator import add
from typing import NamedTuple

from dm_ros.motion.meters import AT_REST, METERS
from dm_ros.motion.models import MODELS
from dm_ros.motion.simulation import Simulation, Snapshot

NO_LOSS = 1e-12   # of the energy turned over in a tick: less than that, given back, is rounding


class Energy(NamedTuple):
    """Energies in J, or powers in W; each positive when the mechanism takes or loses it."""

    work: tuple         # of the torque on each input shaft, in the order of the inputs
    stored: float       # change of the kinetic energy
    viscous: float      # loss in all viscous drags
    gears: tuple        # loss in each gear mesh, in the order of ``gear_names``
    bearings: tuple     # loss in each bearing, in the order of ``bearing_names``
    clutches: tuple     # loss in each clutch, in the order of ``clutch_names``
    numerical: float    # taken by the error of the step
    scale: float        # sum of the magnitudes of all these; see ``relative_residual``

    @property
    def lost(self):
        """The sum of all losses of the mechanism, without ``numerical``."""
        return self.viscous + sum(self.gears) + sum(self.bearings) + sum(self.clutches)

    @property
    def residual(self):
        """What the balance misses, zero but for rounding and the error of the quadrature."""
        return sum(self.work) - self.stored - self.lost - self.numerical

    @property
    def relative_residual(self):
        """The magnitude of the residual over ``scale``, zero at rest."""
        return abs(self.residual) / self.scale if self.scale else 0.0

    @property
    def efficiency(self):
        """Power given over power taken, input shaft against outputs, or None if none is given."""
        powers = self.work[0], self.work[1] + self.work[2]
        taken, given = max(powers), -min(powers)
        return given / taken if taken > 0.0 and given >= 0.0 else None


class Returned(NamedTuple):
    """How often, in ticks, and how much a loss gave energy back instead of taking it, J."""

    ticks: int
    energy: float


def rated_efficiency(p):
    """
    Return the efficiency (37), with its erratum: eta_2G beside eta_1G, not eta_1G twice.

    That of the self-locking differential is made alike: without a final drive, and with the
    gears weighted by the torque that they carry, 1 : g_12.
    """
    if p.prefix == 'lsd':
        return p.eta_0B * (p.eta_1G + p.g_12 * p.eta_2G) / (1 + p.g_12)
    return p.eta_3B * p.eta_FG * p.eta_0B * (p.eta_1G + p.eta_2G) / 2


class MeteredModel:
    """A model whose ``step`` writes to a book, which is that of one tick."""

    def __init__(self, model, meter):
        self._model, self._meter = model, meter
        for name in ('parameters', 'inputs', 'outputs', 'shafts', 'moments', 'independent',
                     'all_shafts', 'powers', 'internal_moments'):
            setattr(self, name, getattr(model, name))
        self._driving = self.shafts.index(self.inputs[0])
        self.layout = tuple(map(len, (meter.gears, meter.bearings, meter.clutches)))
        self.clear()

    def clear(self):
        """Begin a tick."""
        self.book = [0.0] * (6 + sum(self.layout))

    def stored_energy(self, x):
        """Return the kinetic energy, J."""
        return sum(I_k * w * w for I_k, w in zip(self._meter.inertias, self.all_shafts(x))) / 2

    def step(self, x, memory, torque, direction):
        """Step as the model does and book it."""
        result, losses = self._meter.step(self._model, x, memory, torque, direction)
        all_shafts = self.all_shafts
        angles = all_shafts(result[1])
        stored = sum([I_k * (b - a) * (b + a) for I_k, a, b in
                      zip(self._meter.inertias, all_shafts(x), all_shafts(result[0]))]) / 2
        T_a, T_b, T_c = torque   # of the carrier or the pinion, and of the outputs
        entries = (T_a * angles[self._driving], T_b * angles[1], T_c * angles[2], stored, *losses)
        self.book = list(map(add, self.book, entries))
        return result


class AuditedSnapshot(Snapshot):
    """A ``Snapshot`` with ``energy``, the books of its tick, and ``stored_energy``, both in J."""


class AuditedSimulation(Simulation):
    """
    A ``Simulation`` that keeps the books of its energy.

    Setting parameters may change the stored energy without any work, as the inertias change and
    the speeds go on: that is in no ``Energy`` but in ``stored_by_changes``, in J, so that

        stored_energy = that at the start + total.stored + stored_by_changes

    ``worst`` is the largest ``relative_residual`` of a tick; it may be set back to 0.0.
    """

    @property
    def gear_names(self):
        """Names of the gears, in the order of ``Energy.gears``."""
        return METERS[self.parameters.prefix].gears

    @property
    def bearing_names(self):
        """Names of the bearings, in the order of ``Energy.bearings``."""
        return METERS[self.parameters.prefix].bearings

    @property
    def clutch_names(self):
        """Names of the clutches, in the order of ``Energy.clutches``."""
        return METERS[self.parameters.prefix].clutches

    def prepare(self, parameters, substeps=None):
        model, substeps = super().prepare(parameters, substeps)
        formulation = MODELS[self.variant][1]
        meter = METERS[model.parameters.prefix](formulation, model.parameters, self.dt / substeps)
        return MeteredModel(model, meter), substeps

    def adopt(self, prepared):
        if self._model is None:
            super().adopt(prepared)
            return
        before = self.stored_energy
        super().adopt(prepared)
        self.stored_by_changes += self.stored_energy - before

    def reset(self):
        super().reset()
        self._model.clear()
        self.worst = self.stored_by_changes = self._tick_scale = self._total_scale = 0.0
        self._tick = self._total = self._model.book
        gears, bearings, _ = self._model.layout
        self._losses = range(5, 5 + gears + bearings)
        self._returned_ticks = [0] * len(self._losses)
        self._returned = [0.0] * len(self._losses)

    def advance(self, torques):
        self._model.clear()
        super().advance(torques)
        tick = self._tick = self._model.book
        scale = self._tick_scale = max(sum(map(abs, tick)), AT_REST * self.stored_energy)
        self._total = list(map(add, self._total, tick))
        self._total_scale += scale
        residual = abs(sum(tick[:3]) - sum(tick[3:]))
        if residual > self.worst * scale:
            self.worst = residual / scale
        for i in self._losses:
            if tick[i] < -NO_LOSS * scale:
                self._returned_ticks[i - 5] += 1
                self._returned[i - 5] -= tick[i]

    def snapshot(self):
        """Return the ``AuditedSnapshot`` of the last tick, or of the start at zero torque."""
        snapshot = AuditedSnapshot(*super().snapshot())
        snapshot.energy, snapshot.stored_energy = self.tick, self.stored_energy
        return snapshot

    @property
    def stored_energy(self):
        """The kinetic energy now, J."""
        return self._model.stored_energy(self._x)

    @property
    def tick(self):
        """The ``Energy`` of the last tick, J."""
        return self._energy(self._tick, self._tick_scale)

    @property
    def total(self):
        """The ``Energy`` of all ticks since the start, J."""
        return self._energy(self._total, self._total_scale)

    @property
    def power(self):
        """The mean power in the last tick, as an ``Energy`` in W."""
        return self._energy([energy / self.dt for energy in self._tick],
                            self._tick_scale / self.dt)

    @property
    def returned(self):
        """``{gear or bearing: Returned}`` since the start: losses that gave energy back."""
        return {name: Returned(ticks, energy) for name, ticks, energy in zip(
            self.gear_names + self.bearing_names, self._returned_ticks, self._returned)}

    def _energy(self, book, scale):
        gears, bearings, _ = self._model.layout
        return Energy(tuple(book[:3]), book[3], book[4], tuple(book[5:5 + gears]),
                      tuple(book[5 + gears:5 + gears + bearings]),
                      tuple(book[5 + gears + bearings:-1]), book[-1], scale)
