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

from typing import NamedTuple

from dm_ros.motion.books import Books, Layout, NO_LOSS
from dm_ros.motion.coupled_meter import meter_of
from dm_ros.motion.simulation import NO_FORCE, Simulation
from dm_ros.motion.state import Snapshot


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

    def _made(self, model, run, books=None):
        self._layout = layout = Layout.of(self.mechanism)
        return super()._made(model, run, Books(meter_of(model), layout))

    def snapshot(self):
        """Return the ``AuditedSnapshot`` of the last tick, or of the start at zero torque."""
        return self._audited(self._ticker.report())

    def step(self, torques, clutch_forces=NO_FORCE):
        """Advance one tick, as ``advance``, and return its ``AuditedSnapshot``."""
        return self._audited(self._stepped(torques, clutch_forces))

    def _audited(self, reported):
        tick, stored = self._ticker.energy()
        return AuditedSnapshot.of(reported, Energy(tick, self._layout), stored)

    @property
    def stored_energy(self):
        """The kinetic energy now, and that in the twist of half-shafts, J."""
        return self._ticker.energy()[1]

    @property
    def stored_by_changes(self):
        """What changes of parameters or state added to the stored energy, J."""
        return self._ticker.booked().changes

    @property
    def worst(self):
        """The largest ``relative_residual`` of a tick; it may be set back to 0.0."""
        return self._ticker.worst

    @worst.setter
    def worst(self, value):
        self._ticker.worst = value

    @property
    def tick(self):
        """The ``Energy`` of the last tick, J."""
        return Energy(self._ticker.energy()[0], self._layout)

    @property
    def total(self):
        """The ``Energy`` of all ticks since the start, J."""
        return Energy(self._ticker.booked().total, self._layout)

    @property
    def power(self):
        """The mean power in the last tick, as an ``Energy`` in W."""
        return Energy(tuple([entry / self.dt for entry in self._ticker.energy()[0]]), self._layout)

    @property
    def returned(self):
        """``{gear or bearing: Returned}`` since the start: losses that gave energy back."""
        booked = self._ticker.booked()
        return {name: Returned(ticks, energy) for name, ticks, energy in zip(
            self.gear_names + self.bearing_names, booked.returned_ticks, booked.returned)}
