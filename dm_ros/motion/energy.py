# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The energy books of a differential: what the torques put in, what is stored, what is lost where.

``AuditedSimulation`` is a ``Simulation`` that keeps the books of each tick and their total, see
``Energy``; it moves bit for bit like one without them. Under held torques a tick obeys::

    work = stored + viscous + gears + bearings + clutches + numerical

Every term is computed on its own, none is the remainder of the others:

- work: the held torques times the angles that the simulation reports
- stored: the difference of the kinetic energies at the ends
- losses: of an exact step in closed form: its motion is an exponential, and its powers are
  quadratic in speeds and torques, so their integrals are quadratic too; of an adaptive one by
  quadrature along its path
- numerical: zero for an exact step. The path of an adaptive one obeys the equations but for its
  error; this is the work of that error, positive when it takes energy away
"""

from operator import add
from typing import NamedTuple

from dm_ros.motion.coupled_meter import meter_of
from dm_ros.motion.simulation import NO_FORCE, Simulation
from dm_ros.motion.state import Snapshot

AT_REST = 1e-6    # of the stored energy: with less turned over, its rounding is all there is
NO_LOSS = 1e-12   # of the energy turned over in a tick: less than that, given back, is rounding


class Layout(NamedTuple):
    """Where the entries of a mechanism's books stand, as the meters make them."""

    work: slice
    stored: int
    viscous: int
    gears: slice
    bearings: slice
    clutches: slice
    half_shafts: slice
    numerical: int
    scale: int

    @classmethod
    def of(cls, mechanism):
        """Return the layout for a ``Mechanism``."""
        stored = len(mechanism.ports)
        gears = stored + 2
        bearings = gears + len(mechanism.gears)
        clutches = bearings + len(mechanism.bearings)
        half_shafts = clutches + len(mechanism.clutches)
        numerical = half_shafts + len(mechanism.half_shafts)
        return cls(slice(0, stored), stored, stored + 1, slice(gears, bearings),
                   slice(bearings, clutches), slice(clutches, half_shafts),
                   slice(half_shafts, numerical), numerical, numerical + 1)

    @property
    def losses(self):
        """Where all losses of the mechanism stand."""
        return slice(self.viscous, self.numerical)

    @property
    def gears_and_bearings(self):
        """Where those losses stand that may give energy back."""
        return slice(self.gears.start, self.bearings.stop)


class Energy(NamedTuple):
    """Energies in J, or powers in W; each positive when the mechanism takes or loses it."""

    entries: tuple
    layout: Layout

    @property
    def work(self):
        """Of the torque on each input shaft, in the order of the inputs."""
        return self.entries[self.layout.work]

    @property
    def stored(self):
        """The change of the kinetic energy, and of that in the twist of half-shafts."""
        return self.entries[self.layout.stored]

    @property
    def viscous(self):
        """The loss in all viscous drags."""
        return self.entries[self.layout.viscous]

    @property
    def gears(self):
        """The loss in each gear mesh, in the order of ``gear_names``."""
        return self.entries[self.layout.gears]

    @property
    def bearings(self):
        """The loss in each bearing, in the order of ``bearing_names``."""
        return self.entries[self.layout.bearings]

    @property
    def clutches(self):
        """The loss in each clutch, in the order of ``clutch_names``."""
        return self.entries[self.layout.clutches]

    @property
    def half_shafts(self):
        """The loss in the damping of each half-shaft, in the order of ``half_shaft_names``."""
        return self.entries[self.layout.half_shafts]

    @property
    def numerical(self):
        """What the error of the step took."""
        return self.entries[self.layout.numerical]

    @property
    def scale(self):
        """The sum of the magnitudes of all these; see ``relative_residual``."""
        return self.entries[self.layout.scale]

    @property
    def lost(self):
        """The sum of all losses of the mechanism, without ``numerical``."""
        return sum(self.entries[self.layout.losses])

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
        driving, *others = self.work
        powers = driving, sum(others)
        taken, given = max(powers), -min(powers)
        return given / taken if taken > 0.0 and given >= 0.0 else None


class Returned(NamedTuple):
    """How often, in ticks, and how much a loss gave energy back instead of taking it, J."""

    ticks: int
    energy: float


class AuditedSnapshot(Snapshot):
    """A ``Snapshot`` with ``energy``, the books of its tick, and ``stored_energy``, both in J."""

    @classmethod
    def of(cls, reported, energy, stored_energy):
        """Return the snapshot of what was reported, in the order of the fields."""
        snapshot = tuple.__new__(cls, reported)
        snapshot.energy, snapshot.stored_energy = energy, stored_energy
        return snapshot

    def _replace(self, **changes):
        return self.of(super()._replace(**changes), self.energy, self.stored_energy)


def rated_efficiency(parameters):
    """Return the efficiency (37) of a mechanism, see the tables of parameters."""
    return parameters.rated_efficiency


def given_back(before, after):
    """
    Return what gears and bearings together gave back between two totals, J, 0.0 if they took.

    Less than ``NO_LOSS`` of the energy turned over since the start is rounding.
    """
    taken = sum(after.gears + after.bearings) - sum(before.gears + before.bearings)
    return -taken if taken < -NO_LOSS * after.scale else 0.0


class AuditedSimulation(Simulation):
    """
    A ``Simulation`` that keeps the books of its energy.

    Setting parameters or the state may change the stored energy without any work, as the
    inertias or the speeds change: that is in no ``Energy`` but in ``stored_by_changes``, in J, so
    that

        stored_energy = that at the start + total.stored + stored_by_changes

    ``worst`` is the largest ``relative_residual`` of a tick; it may be set back to 0.0.
    """

    @property
    def gear_names(self):
        """Names of the gears, in the order of ``Energy.gears``."""
        return self.mechanism.gears

    @property
    def bearing_names(self):
        """Names of the bearings, in the order of ``Energy.bearings``."""
        return self.mechanism.bearings

    @property
    def clutch_names(self):
        """Names of the clutches, in the order of ``Energy.clutches``."""
        return self.mechanism.clutch_moments

    @property
    def half_shaft_names(self):
        """Names of the shafts with a half-shaft, in the order of ``Energy.half_shafts``."""
        return self.mechanism.half_shafts

    def prepare(self, parameters, substeps=None, ports=None):
        model, substeps = super().prepare(parameters, substeps, ports)
        return model, substeps, meter_of(model)

    def adopt(self, prepared):
        *prepared, self._meter = prepared
        first = self._model is None
        super().adopt(prepared)
        if not first:
            self._note_change()

    @Simulation.state.setter
    def state(self, state):
        Simulation.state.fset(self, state)
        self._note_change()

    def _note_change(self):
        before, self._stored = self._stored, self._meter.stored_energy(self._x)
        self.stored_by_changes += self._stored - before

    def reset(self):
        self._stored = self.stored_by_changes = 0.0
        super().reset()
        self._layout = layout = Layout.of(self.mechanism)
        self._tick = self._total = (0.0,) * (layout.scale + 1)
        self.worst = self.stored_by_changes = 0.0   # the start is no change
        may_return = len(self.gear_names + self.bearing_names)
        self._returned_ticks, self._returned = [0] * may_return, [0.0] * may_return

    def advance(self, torques, clutch_forces=NO_FORCE):
        steps = super().advance(torques, clutch_forces)
        meter, T, layout = self._meter, self._held, self._layout
        if layout.half_shafts.start < layout.half_shafts.stop:   # a twist may be forgotten
            self.stored_by_changes += meter.stored_energy(steps[0][0]) - self._stored
        tick = meter.book(steps[0], T)
        if len(steps) > 1:
            for step in steps[1:]:
                tick = tuple(map(add, tick, meter.book(step, T)))
        self._stored = stored = meter.stored_energy(self._x)
        scale = max(sum(map(abs, tick)), AT_REST * stored)
        work = sum(tick[layout.work])
        residual = abs(work + work - sum(tick))   # work less all others
        if residual > self.worst * scale:
            self.worst = residual / scale
        losses = tick[layout.gears_and_bearings]
        if min(losses) < -NO_LOSS * scale:
            self._note_returned(losses, NO_LOSS * scale)
        self._tick = tick = (*tick, scale)
        self._total = tuple(map(add, self._total, tick))
        return steps

    def _note_returned(self, losses, rounding):
        for n, loss in enumerate(losses):
            if loss < -rounding:
                self._returned_ticks[n] += 1
                self._returned[n] -= loss

    def snapshot(self):
        """Return the ``AuditedSnapshot`` of the last tick, or of the start at zero torque."""
        return AuditedSnapshot.of(self._report(), Energy(self._tick, self._layout), self._stored)

    @property
    def stored_energy(self):
        """The kinetic energy now, and that in the twist of half-shafts, J."""
        return self._stored

    @property
    def tick(self):
        """The ``Energy`` of the last tick, J."""
        return Energy(self._tick, self._layout)

    @property
    def total(self):
        """The ``Energy`` of all ticks since the start, J."""
        return Energy(self._total, self._layout)

    @property
    def power(self):
        """The mean power in the last tick, as an ``Energy`` in W."""
        return Energy(tuple([entry / self.dt for entry in self._tick]), self._layout)

    @property
    def returned(self):
        """``{gear or bearing: Returned}`` since the start: losses that gave energy back."""
        return {name: Returned(ticks, energy) for name, ticks, energy in zip(
            self.gear_names + self.bearing_names, self._returned_ticks, self._returned)}
