# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A differential and a control law in one process, without topics."""

from dm_ros.files.record import Record
from dm_ros.motion.simulation import Simulation


class DirectDifferential:
    """
    A differential and a control law, without topics.

    :param variant: one of ``dm_ros.VARIANTS``; rate: ticks in a second.
    :param options: as for ``Simulation``.
    """

    def __init__(self, variant='symmetric_ode', rate=1000.0, **options):
        self.simulation = Simulation(variant, 1.0 / rate, **options)
        self.snapshots = []

    def run(self, law, seconds=None, until=None):
        """
        Step until a condition or for a time, whichever comes first.

        :param law: function of the last ``Snapshot`` that returns the torques of the next tick,
            N m, in the order of ``simulation.inputs``; or a pair of these and of the axial forces
            on the clutches, N, in the order of ``simulation.clutches``.
        :param seconds: simulated time.
        :param until: function of a ``Snapshot``; true at the last tick.
        :return: the ``Record`` of this run.
        """
        count = ticks_of(seconds, until, self.simulation)
        step, snapshot, first = self.simulation.step, self.simulation.snapshot(), len(
            self.snapshots)
        while count is None or len(self.snapshots) - first < count:
            demand = law(snapshot)
            with_forces = isinstance(demand, (tuple, list)) and len(demand) == 2
            snapshot = step(*demand) if with_forces else step(demand)
            self.snapshots.append(snapshot)
            if until and until(snapshot):
                break
        return Record.of(self.simulation, self.snapshots[first:])

    @property
    def record(self):
        """The ``Record`` of all runs."""
        return Record.of(self.simulation, self.snapshots)


def ticks_of(seconds, until, simulation):
    """Return the number of ticks of a run, None for as many as the condition takes."""
    if seconds is None and until is None:
        raise ValueError('seconds, until: one of them must say when the run ends')
    if seconds is not None and not seconds > 0.0:
        raise ValueError(f'seconds: {seconds!r} is not allowed, it must be above 0')
    return None if seconds is None else round(seconds / simulation.dt)
