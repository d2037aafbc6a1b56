# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A differential or a driveline and a control law in one process, without topics."""

from dm_ros.driveline.driveline import Driveline
from dm_ros.files.bag import TickBag
from dm_ros.files.driveline_record import driveline_row, DrivelineRecord
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
        self._ticks = Ticks(self.simulation, rate)

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
        if not self.simulation.ticks:   # it may have been reset
            self._ticks.restart()
        step, snapshot, first = self.simulation.step, self.simulation.snapshot(), len(
            self.snapshots)
        while count is None or len(self.snapshots) - first < count:
            demand = law(snapshot)
            with_forces = isinstance(demand, (tuple, list)) and len(demand) == 2
            snapshot = step(*demand) if with_forces else step(demand)
            self.snapshots.append(snapshot)
            self._ticks.append((*demand[0], *demand[1]) if with_forces else tuple(demand),
                               snapshot)
            if until and until(snapshot):
                break
        return Record.of(self.simulation, self.snapshots[first:])

    def save_bag(self, path):
        """
        Write a bag of all runs since the start of the simulation; it needs rosbags.

        Its topics, stamps and quality of service are those of a node in lockstep.

        :param path: a folder, in place of a bag that may be there.
        """
        self._ticks.save(path)

    @property
    def record(self):
        """The ``Record`` of all runs."""
        return Record.of(self.simulation, self.snapshots)


class DirectDriveline:
    """
    A driveline and a control law, without topics.

    :param layout: ``awd``, ``fwd``, ``rwd`` or a function, see ``Driveline``; rate: ticks in a
        second; speed: of the body at the start, m/s; grade: of the slope there.
    :param options: as for ``Driveline``.
    """

    def __init__(self, layout='awd', rate=1000.0, speed=0.0, grade=0.0, **options):
        self.simulation = Driveline(layout, dt=1.0 / rate, **options)
        self.simulation.reset(speed, grade)
        self.snapshots, self._rows = [], []

    def run(self, law, seconds=None, until=None):
        """
        Step until a condition or for a time, whichever comes first.

        :param law: function of the last ``Snapshot`` that returns the inputs of the next tick, a
            mapping from the arguments of ``Driveline.step`` to their values.
        :param seconds: simulated time.
        :param until: function of a ``Snapshot``; true at the last tick.
        :return: the ``DrivelineRecord`` of this run.
        """
        car, first = self.simulation, len(self.snapshots)
        count, snapshot = ticks_of(seconds, until, car), car.snapshot()
        while count is None or len(self.snapshots) - first < count:
            snapshot = car.step(**law(snapshot))
            self.snapshots.append(snapshot)
            self._rows.append(driveline_row(snapshot, car.clutch_force))
            if until and until(snapshot):
                break
        return self._record_of(first)

    @property
    def record(self):
        """The ``DrivelineRecord`` of all runs."""
        return self._record_of(0)

    def _record_of(self, first):
        return DrivelineRecord(self.simulation, self._rows[first:], 'driveline')


class Ticks:
    """What was commanded and came out since the last start, for a bag."""

    def __init__(self, simulation, rate, prefix=''):
        self._simulation, self._rate, self._prefix = simulation, rate, prefix
        self.restart()

    def restart(self):
        """Begin with the state as it is."""
        self._start, self._ticks = self._simulation.snapshot(), []

    def append(self, command, snapshot):
        """Take a tick: a value for each port, and for each clutch if any, and the end of it."""
        self._ticks.append((command, snapshot))

    def save(self, path):
        """Write a bag in a folder, in place of one that may be there; it needs rosbags."""
        with TickBag(path, self._simulation.mechanism, self._rate, self._prefix,
                     instead=True) as bag:
            bag.start(self._start)
            for command, snapshot in self._ticks:
                bag.tick(command, snapshot)


def ticks_of(seconds, until, simulation):
    """Return the number of ticks of a run, None for as many as the condition takes."""
    if seconds is None and until is None:
        raise ValueError('seconds, until: one of them must say when the run ends')
    if seconds is not None and not seconds > 0.0:
        raise ValueError(f'seconds: {seconds!r} is not allowed, it must be above 0')
    return None if seconds is None else round(seconds / simulation.dt)
