# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
What ``simulate`` runs: a differential, or a driveline.

Both have a ``simulation``, the ``table`` of its inputs, a ``title``, the names of the ``columns``
of their rows, and what became of a run in words, ``told``.
"""

import sys

import numpy as np

from dm_ros.driveline_plant import make_driveline, node_ports, step_arguments
from dm_ros.files.bag import TickBag
from dm_ros.files.columns import as_row, column_names
from dm_ros.files.driveline_record import driveline_columns, driveline_row, DrivelineRecord
from dm_ros.files.parameter_file import read_parameter_file
from dm_ros.files.record import Record
from dm_ros.files.recorded_drive import is_bag, read_drive
from dm_ros.files.torque_table import read_input_file, read_torque_file
from dm_ros.motion.simulation import NO_FORCE
from dm_ros.settings import make_simulation, NodeParameters
from dm_ros.tools.driveline_option import (
    driveline_values,
    layout_of,
    NOT_A_DRIVELINE,
    refuse,
    SEVERAL,
)
from dm_ros.tools.passed_over import warn

NO_BAG = 'no bag of a driveline is written or read; record the node driveline by ros2 bag'
STEER = {'steer': ' (--planar)'}


class Comparison:
    """How far a run is from the one that was recorded."""

    def __init__(self, speeds):
        """:param speeds: those of a ``RecordedDrive``."""
        self._speeds, self._largest = speeds, (0.0, 0.0)   # rad/s, and when, s

    def __str__(self):
        if self._largest[0] == 0.0:
            return 'all speeds are those of the recording, bit by bit'
        return 'speeds are up to {:.3g} rad/s from those of the recording, at {:.6g} s'.format(
            *self._largest)

    def note(self, tick, snapshot):
        """Take the end of a tick."""
        recorded = self._speeds.get(tick, snapshot.velocity)
        if recorded != snapshot.velocity:
            away = max(abs(a - b) for a, b in zip(recorded, snapshot.velocity))
            self._largest = max(self._largest, (away, snapshot.time))


class DifferentialRun:
    """
    A differential as the command line asks for it.

    :raises ValueError: in one line.
    """

    def __init__(self, arguments):
        refuse(arguments, dict.fromkeys(('--planar', '--initial-speed'), NOT_A_DRIVELINE))
        values = read_parameter_file(arguments.params) if arguments.params else {}
        if arguments.loss_law:
            values['loss_law'] = arguments.loss_law
        self.title = arguments.variant or values.get('variant')
        if self.title is None:
            raise ValueError('--variant: it is needed where no FILE has the parameter variant')
        self._node = NodeParameters().changed(NodeParameters.part_of(values))
        self.simulation, self.table, self._comparison = self._loaded(arguments, values)
        self.columns = column_names(self.simulation)

    def _loaded(self, arguments, values):
        """Return a simulation, its ``TorqueTable``, and its ``Comparison`` or None."""
        is_auto, variant = arguments.dt == 'auto', self.title
        simulation = make_simulation(variant, values, None if is_auto else arguments.dt)
        mechanism = simulation.mechanism
        warn('simulate', arguments.params, values, mechanism)
        if is_bag(arguments.torques):
            if arguments.ignore_columns:
                raise ValueError('--ignore-columns: a bag has no columns')
            drive = read_drive(arguments.torques, mechanism, 1 / simulation.dt, arguments.node,
                               self._node.torque_timeout)
            for line in drive.remarks:
                print(f'simulate: {arguments.torques}: {line}', file=sys.stderr)
            dt = drive.dt if is_auto or arguments.dt is None else arguments.dt
            return (make_simulation(variant, values | drive.values, dt), drive.table,
                    Comparison(drive.speeds) if drive.speeds and dt == drive.dt else None)
        if arguments.node:
            raise ValueError('--node: only a bag has nodes')
        table = read_torque_file(arguments.torques, mechanism.ports, mechanism.clutch_moments,
                                 arguments.ignore_columns)
        if is_auto:
            simulation = make_simulation(
                variant, values, tick_for_all(arguments.torques, table, simulation.dt))
        return simulation, table, None

    @property
    def told(self):
        """What became of the run, in lines."""
        speeds = zip(self.simulation.shafts, self.simulation.snapshot().velocity, strict=True)
        return [f'final speeds in rad/s: {listed(speeds)}',
                *([str(self._comparison)] if self._comparison else [])]

    def bag(self, path):
        """Return a ``TickBag`` of the run."""
        return TickBag(path, self.simulation.mechanism, 1 / self.simulation.dt,
                       self._node.joint_prefix)

    def rows(self, torques, bag=None):
        """Run it; yield the start and the end of each tick as rows of a record."""
        simulation, comparison = self.simulation, self._comparison
        snapshot = simulation.snapshot()
        if bag:
            bag.start(snapshot)
        yield as_row(snapshot)
        count = len(simulation.inputs)
        for row in torques:
            snapshot = simulation.step(row[:count], row[count:] or NO_FORCE)
            if bag:
                bag.tick(row, snapshot)
            if comparison:
                comparison.note(simulation.ticks, snapshot)
            yield as_row(snapshot)

    def draw(self, numbers, file):
        """Draw all numbers of all rows as PNG into a file."""
        Record(self.simulation, np.frombuffer(numbers), self.title).draw(file)


class DrivelineRun:
    """
    A driveline as the command line asks for it.

    :raises ValueError: in one line.
    """

    def __init__(self, arguments):
        refuse(arguments, {
            '--variant': SEVERAL, '--loss-law': 'a driveline has the passive law alone',
            '--bag': NO_BAG, '--node': NO_BAG})
        if is_bag(arguments.torques):
            raise ValueError(f'{arguments.torques}: {NO_BAG}')
        values = driveline_values('simulate', arguments, initial_speed=arguments.initial_speed)
        is_auto = arguments.dt == 'auto'
        car = make_driveline(values, None if is_auto else arguments.dt)
        self.table = read_input_file(arguments.torques, node_ports(car), arguments.ignore_columns,
                                     {} if car.planar else STEER)
        if is_auto:
            car = make_driveline(values, tick_for_all(arguments.torques, self.table, car.dt))
        self.simulation, self.columns = car, driveline_columns(car)
        self.title = f'{layout_of(values)}{" planar" * car.planar}'

    @property
    def told(self):
        """What became of the run, in lines."""
        snapshot = self.simulation.snapshot()
        x, y, _ = snapshot.pose
        wheels = {wheel: snapshot.velocity[self.simulation.shafts.index(wheel)]
                  for wheel in self.simulation.wheels}
        return [f'final speed {snapshot.twist_body[0]:.6g} m/s at x {x:.6g} m, y {y:.6g} m, '
                f'wheels in rad/s: {listed(wheels.items())}']

    def rows(self, inputs, bag=None):
        """Run it; yield the start and the end of each tick as rows of a record."""
        car = self.simulation
        arguments = step_arguments(car)
        yield driveline_row(car.snapshot(), car.clutch_force)
        for held in inputs:
            yield driveline_row(car.step(*arguments(held)), car.clutch_force)

    def draw(self, numbers, file):
        """Draw all numbers of all rows as PNG into a file."""
        DrivelineRecord(self.simulation, np.frombuffer(numbers), self.title).draw(file)


def tick_for_all(path, table, longest):
    """Return a length of a tick, s, for a ``TorqueTable``; raise ValueError where none is."""
    try:
        return table.tick_for_all(longest)
    except ValueError as error:
        raise ValueError(f'{path}: {error}') from None


def listed(speeds):
    """Return pairs of names and numbers in words."""
    return ', '.join(f'{name} {speed:.6g}' for name, speed in speeds)
