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
from dm_ros.files.columns import as_row, column_names, write_csv
from dm_ros.files.output import replacing
from dm_ros.files.parameter_file import read_parameter_file
from dm_ros.files.plot import require_matplotlib
from dm_ros.files.record import Record
from dm_ros.files.torque_table import read_torque_file
from dm_ros.mechanism.variants import VARIANTS
from dm_ros.motion.models import LOSS_LAWS
from dm_ros.motion.simulation import NO_FORCE
from dm_ros.settings import make_simulation, NodeParameters
from dm_ros.tools.passed_over import warn
from dm_ros.tools.progress import progress
from dm_ros.tools.tables import add_ignore_columns, remarks, unit_hint

MANY_TICKS, MOST_TICKS = 10**6, 10**7   # beyond: their number is told before, needs --yes
CELL = 17   # bytes of CSV, about
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
for the start, then one for the end of each tick. Without --out and --plot it goes to stdout.

Of FILE, a ROS 2 parameter file, these count: variant, the parameters of the mechanism, loss_law,
rate, substeps, power_flow_deadband, initial_velocity and ports.
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
    result.add_argument('--torques', metavar='IN.csv', required=True, help='torques over time')
    add_ignore_columns(result, 'IN.csv')
    result.add_argument('--dt', type=_tick, metavar='S',
                        help='length of a tick; default: 1/rate of FILE, '
                        f'else {1 / NodeParameters().rate:g}; auto: that, or shorter so that each '
                        'row of IN.csv is in force')
    result.add_argument('--yes', action='store_true', help='run more than 1e7 ticks')
    result.add_argument('--out', metavar='OUT.csv', help='where the results go')
    result.add_argument('--plot', metavar='OUT.png', help='where a picture of them goes, as PNG')
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
    if arguments.out or not arguments.plot:
        sizes.append(f'{size(ticks * columns * CELL)} of CSV')
    if arguments.plot:
        sizes.append(f'{size(ticks * columns * array("d").itemsize)} of memory')
    needs = f'{ticks} ticks of {simulation.dt:.6g} s, about {" and ".join(sizes)}'
    if ticks > MOST_TICKS and not arguments.yes:
        raise ValueError(f'{arguments.torques}: time: {needs}, run only with --yes'
                         f'{unit_hint(table)}')
    for line in remarks(arguments.torques, table, simulation.dt,
                        lambda dt: f'--dt {dt!r} (or --dt auto)'):
        print('simulate:', line, file=sys.stderr)
    if ticks > MANY_TICKS:
        print('simulate:', needs, file=sys.stderr, flush=True)


def rows_of(simulation, torques):
    """Run a simulation; yield the start and the end of each tick as rows of a record."""
    yield as_row(simulation.snapshot())
    count = len(simulation.inputs)
    for row in progress(torques, total=len(torques)):
        yield as_row(simulation.step(row[:count], row[count:] or NO_FORCE))


def kept(rows, numbers):
    """Yield rows and keep their numbers in an array."""
    for row in rows:
        numbers.extend(row)
        yield row


def run(arguments):
    """Do what the command line says; raise ValueError or OSError where it cannot be done."""
    if arguments.plot:
        require_matplotlib()   # before a run that may take minutes
    files = [os.path.realpath(path) for path in (arguments.torques, arguments.params,
                                                 arguments.out, arguments.plot) if path]
    if len(set(files)) < len(files):
        raise ValueError(f'{max(files, key=files.count)}: given for two files')
    values = read_parameter_file(arguments.params) if arguments.params else {}
    if arguments.loss_law:
        values['loss_law'] = arguments.loss_law
    variant = arguments.variant or values.get('variant')
    if variant is None:
        raise ValueError('--variant: it is needed where no FILE has the parameter variant')
    is_auto = arguments.dt == 'auto'
    simulation = make_simulation(variant, values, None if is_auto else arguments.dt)
    mechanism = simulation.mechanism
    warn('simulate', arguments.params, values, mechanism)
    table = read_torque_file(arguments.torques, mechanism.ports, mechanism.clutch_moments,
                             arguments.ignore_columns)
    try:
        if is_auto:
            simulation = make_simulation(variant, values, table.tick_for_all(simulation.dt))
        torques = table.held(simulation.dt)
    except ValueError as error:
        raise ValueError(f'{arguments.torques}: {error}') from None
    announced(arguments, table, simulation, torques)
    with ExitStack() as stack:
        file, rows, numbers = None, rows_of(simulation, torques), array('d')
        if arguments.plot:
            picture = stack.enter_context(replacing(arguments.plot, 'wb'))
            rows = kept(rows, numbers)
        if arguments.out:
            file = stack.enter_context(replacing(arguments.out, 'w'))
        elif not arguments.plot:
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


def main(args=None):
    """Run the tool ``simulate`` and return its exit code."""
    arguments = parser().parse_args(args)
    outputs = [path for path in (arguments.out, arguments.plot) if path] or ['stdout']
    return run_command('simulate', lambda: run(arguments), ', '.join(outputs))


if __name__ == '__main__':
    sys.exit(main())
