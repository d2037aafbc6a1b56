# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Simulate a differential without ROS, faster than real time: torques from CSV, results to CSV."""

import argparse
from array import array
from collections import deque
from contextlib import ExitStack
import os
import sys

import numpy as np

from dm_ros.ending import run_command
from dm_ros.files.bag import TickBag
from dm_ros.files.columns import as_row, column_names, write_csv
from dm_ros.files.output import replacing
from dm_ros.files.parameter_file import read_parameter_file
from dm_ros.files.plot import require_matplotlib
from dm_ros.files.record import Record
from dm_ros.files.recorded_drive import is_bag, read_drive
from dm_ros.files.torque_table import read_torque_file
from dm_ros.mechanism.variants import VARIANTS
from dm_ros.motion.models import LOSS_LAWS
from dm_ros.motion.simulation import NO_FORCE
from dm_ros.settings import make_simulation, NodeParameters
from dm_ros.tools.passed_over import warn
from dm_ros.tools.progress import progress
from dm_ros.tools.tables import add_ignore_columns, remarks, unit_hint

MANY_TICKS, MOST_TICKS = 10**6, 10**7   # beyond: their number is told before, needs --yes
CELL, NUMBER, MESSAGES = 17, 8, 1000   # bytes: of CSV, in memory, of a tick in a bag; about
EPILOG = """\
IN.csv has a header "time,<shaft>,..." with every input shaft of the variant, in any order
(symmetric: pinion, left, right; lsd: carrier, front, rear), then rows of s and N m. Columns
<clutch>_clutch may be added, forces on the clutches in N (lsd: front_clutch, rear_clutch;
symmetric with friction surfaces: left_clutch, right_clutch). A row's torques and forces hold until
the time of the next row; before the first row they are zero; the time of the last row ends the
run, which begins at time 0, or with the file where that begins later than 1000 s, as at an epoch.
Each tick takes what is in force at its start; a time less than 1/1000 of a tick after that start
counts as on it. It is told how many rows no tick takes, as their time is too short, and which S
takes all; --dt auto is that S where the default is too long. What needs more than 1e7 ticks needs
--yes. The column of a shaft with a speed port of FILE (port.<shaft>.kind: speed) is the speed
outside in rad/s; before the first row the shaft is free.

OUT.csv has the columns time, velocity.<shaft> (rad/s), position.<shaft> (rad), torque.<input>
(N m), moment.<name> (N m), power_flow (+1 direct, -1 reverse), clutch_force.<clutch> (N): a row
for the start, then one for the end of each tick. Without --out, --plot, --bag it goes to stdout.

IN may be a bag instead, a folder or an .mcap file: the torques and forces that were in force in
each tick, from ~/joint_states and ~/clutches, and the speeds outside that were commanded. What was
recorded in lockstep gives the same bits again. The tick is that of the recording, or S. In the end
it is told how far the speeds are from those of the recording.

--bag FOLDER makes a bag of the run, with the topics, stamps and quality of service of a node
/differential in lockstep, what it was commanded among them.

Of FILE, a ROS 2 parameter file, these count: variant, the parameters of the mechanism, loss_law,
rate, substeps, power_flow_deadband, initial_velocity, ports, and for bags joint_prefix and
torque_timeout.
"""


def parser():
    """Return the parser of the command line."""
    result = argparse.ArgumentParser('simulate', description=__doc__, epilog=EPILOG,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument('--variant', choices=VARIANTS,
                        help='the mechanism and its formulation; default: variant of FILE')
    result.add_argument('--loss-law', choices=LOSS_LAWS,
                        help='what gears and bearings lose; default: loss_law of FILE, '
                        f'else {NodeParameters().loss_law}')
    result.add_argument('--params', metavar='FILE', help='a ROS 2 parameter file')
    result.add_argument('--torques', metavar='IN', required=True,
                        help='torques over time: a CSV file, or a bag')
    add_ignore_columns(result, 'IN.csv')
    result.add_argument('--node', metavar='NAME', help='full name of the node in the bag IN; '
                        'default: the only differential in it')
    result.add_argument('--dt', type=_tick, metavar='S',
                        help='length of a tick; default: 1/rate of FILE, '
                        f'else {1 / NodeParameters().rate:g}, but that of a bag IN; auto: that, '
                        'or shorter so that each row of IN.csv is in force')
    result.add_argument('--yes', action='store_true', help='run more than 1e7 ticks')
    result.add_argument('--out', metavar='OUT.csv', help='where the results go')
    result.add_argument('--plot', metavar='OUT.png', help='where a picture of them goes, as PNG')
    result.add_argument('--bag', metavar='FOLDER', help='where a bag of them goes, a new folder')
    return result


def _tick(text):
    try:
        return text if text == 'auto' else float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text!r} is neither a number nor auto') from None


def size(count):
    """Return a number of bytes in words."""
    power, name = next(((power, name) for power, name in (
        (12, 'TB'), (9, 'GB'), (6, 'MB'), (3, 'kB')) if count >= 10**power), (0, 'B'))
    return f'{count / 10**power:.3g} {name}'


def announced(arguments, table, simulation, torques):
    """Tell what a user may not know before a run; raise ValueError where ``--yes`` is needed."""
    ticks, columns = len(torques), len(column_names(simulation))
    sizes = []
    if written_as_csv(arguments):
        sizes.append(f'{size(ticks * columns * CELL)} of CSV')
    if arguments.bag:
        sizes.append(f'{size(ticks * (columns * NUMBER + MESSAGES))} of a bag')
    if arguments.plot:
        sizes.append(f'{size(ticks * columns * NUMBER)} of memory')
    needs = f'{ticks} ticks of {simulation.dt:.6g} s, about {" and ".join(sizes)}'
    if ticks > MOST_TICKS and not arguments.yes:
        raise ValueError(f'{arguments.torques}: time: {needs}, run only with --yes'
                         f'{unit_hint(table)}')
    for line in remarks(arguments.torques, table, simulation.dt,
                        lambda dt: f'--dt {dt!r} (or --dt auto)'):
        print('simulate:', line, file=sys.stderr)
    if ticks > MANY_TICKS:
        print('simulate:', needs, file=sys.stderr, flush=True)


def written_as_csv(arguments):
    """Return whether the results go to a CSV, if only on stdout."""
    return arguments.out or not (arguments.plot or arguments.bag)


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


def rows_of(simulation, torques, bag=None, comparison=None):
    """Run a simulation; yield the start and the end of each tick as rows of a record."""
    snapshot = simulation.snapshot()
    if bag:
        bag.start(snapshot)
    yield as_row(snapshot)
    count = len(simulation.inputs)
    for row in progress(torques, total=len(torques)):
        snapshot = simulation.step(row[:count], row[count:] or NO_FORCE)
        if bag:
            bag.tick(row, snapshot)
        if comparison:
            comparison.note(simulation.ticks, snapshot)
        yield as_row(snapshot)


def kept(rows, numbers):
    """Yield rows and keep their numbers in an array."""
    for row in rows:
        numbers.extend(row)
        yield row


def loaded(arguments, variant, values):
    """Return a simulation, its ``TorqueTable``, and its ``Comparison`` or None."""
    is_auto = arguments.dt == 'auto'
    simulation = make_simulation(variant, values, None if is_auto else arguments.dt)
    mechanism = simulation.mechanism
    warn('simulate', arguments.params, values, mechanism)
    if is_bag(arguments.torques):
        if arguments.ignore_columns:
            raise ValueError('--ignore-columns: a bag has no columns')
        timeout = NodeParameters().changed(NodeParameters.part_of(values)).torque_timeout
        drive = read_drive(arguments.torques, mechanism, 1 / simulation.dt, arguments.node,
                           timeout)
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
        try:
            dt = table.tick_for_all(simulation.dt)
        except ValueError as error:
            raise ValueError(f'{arguments.torques}: {error}') from None
        simulation = make_simulation(variant, values, dt)
    return simulation, table, None


def run(arguments):
    """Do what the command line says; raise ValueError or OSError where it cannot be done."""
    if arguments.plot:
        require_matplotlib()   # before a run that may take minutes
    files = [os.path.realpath(path) for path in (
        arguments.torques, arguments.params, arguments.out, arguments.plot, arguments.bag) if path]
    if len(set(files)) < len(files):
        raise ValueError(f'{max(files, key=files.count)}: given for two files')
    values = read_parameter_file(arguments.params) if arguments.params else {}
    if arguments.loss_law:
        values['loss_law'] = arguments.loss_law
    variant = arguments.variant or values.get('variant')
    if variant is None:
        raise ValueError('--variant: it is needed where no FILE has the parameter variant')
    simulation, table, comparison = loaded(arguments, variant, values)
    try:
        torques = table.held(simulation.dt)
    except ValueError as error:
        raise ValueError(f'{arguments.torques}: {error}') from None
    announced(arguments, table, simulation, torques)
    with ExitStack() as stack:
        bag = arguments.bag and stack.enter_context(TickBag(
            arguments.bag, simulation.mechanism, 1 / simulation.dt,
            NodeParameters().changed(NodeParameters.part_of(values)).joint_prefix))
        file, rows, numbers = None, rows_of(
            simulation, torques, bag, comparison), array('d')
        if arguments.plot:
            picture = stack.enter_context(replacing(arguments.plot, 'wb'))
            rows = kept(rows, numbers)
        if arguments.out:
            file = stack.enter_context(replacing(arguments.out, 'w'))
        elif written_as_csv(arguments):
            # a file of its own: the interpreter stumbles at its end over a sys.stdout that failed
            file = stack.enter_context(open(1, 'w', closefd=False))
        try:
            if file:
                write_csv(file, column_names(simulation), rows)
            else:
                deque(rows, 0)
        except ValueError as error:
            raise ValueError(f'{arguments.torques}: after {simulation.time:g} s: '
                             f'{error}') from None
        if arguments.plot:
            Record(simulation, np.frombuffer(numbers), variant).draw(picture)
    speeds = zip(simulation.shafts, simulation.snapshot().velocity, strict=True)
    print(f'simulate: {len(torques)} ticks, {simulation.time:.6g} s, final speeds in rad/s:',
          ', '.join(f'{shaft} {speed:.6g}' for shaft, speed in speeds), file=sys.stderr)
    if comparison:
        print('simulate:', comparison, file=sys.stderr)


def main(args=None):
    """Run the tool ``simulate`` and return its exit code."""
    arguments = parser().parse_args(args)
    outputs = [path for path in (arguments.out, arguments.plot, arguments.bag) if path]
    return run_command('simulate', lambda: run(arguments), ', '.join(outputs or ['stdout']))


if __name__ == '__main__':
    sys.exit(main())
