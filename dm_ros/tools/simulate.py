# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Simulate a differential, or a car, without ROS: torques from CSV, results to CSV."""

import argparse
from array import array
from collections import deque
from contextlib import ExitStack
import os
import sys

from dm_ros.ending import run_command
from dm_ros.files.columns import write_csv
from dm_ros.files.output import replacing
from dm_ros.files.plot import require_matplotlib
from dm_ros.mechanism.variants import VARIANTS
from dm_ros.motion.models import LOSS_LAWS
from dm_ros.settings import NodeParameters
from dm_ros.tools.driveline_option import add_driveline
from dm_ros.tools.progress import progress
from dm_ros.tools.simulated import DifferentialRun, DrivelineRun
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

With --driveline it is a whole car, as the node driveline runs it; doc/driveline.md tells of it.
The columns of IN.csv are then time and any of: input (N m, torque of the gearbox), <wheel>_brake
(N m it can hold), <clutch>_clutch (N), steer (rad), grade (tangent of the slope), <wheel>_grip,
<wheel>_contact (1). A column that is left out has its idle value: 1 for grip and contact, 0 for
all others; so it is before the first row. The wheels are front_left, front_right, rear_left and
rear_right; the clutches of awd centre_front and centre_rear, and those of axles with friction
surfaces. OUT.csv has time, velocity, position (of shafts), torque, twist (of connections), moment,
power_flow (of differentials), longitudinal_slip, lateral_slip, longitudinal_force, lateral_force,
load (of wheels), clutch_force, and x, y, yaw, longitudinal_speed, lateral_speed, yaw_rate,
longitudinal_acceleration, lateral_acceleration of the body. Of FILE, for a node /driveline, these
count: layout, planar, driveline.*, rate, initial_speed. There are no bags of a driveline, and no
FMUs (export_fmu) and ensembles (Ensemble, sweep) of it either.
"""


def parser():
    """Return the parser of the command line."""
    result = argparse.ArgumentParser('simulate', description=__doc__, epilog=EPILOG,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument('--variant', choices=VARIANTS,
                        help='the mechanism and its formulation; default: variant of FILE')
    add_driveline(result)
    result.add_argument('--initial-speed', type=float, metavar='V', help='of the car at the '
                        'start, m/s; default: initial_speed of FILE, else 0')
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


def announced(arguments, what, inputs):
    """Tell what a user may not know before a run; raise ValueError where ``--yes`` is needed."""
    ticks, columns, table, dt = len(inputs), len(what.columns), what.table, what.simulation.dt
    sizes = []
    if written_as_csv(arguments):
        sizes.append(f'{size(ticks * columns * CELL)} of CSV')
    if arguments.bag:
        sizes.append(f'{size(ticks * (columns * NUMBER + MESSAGES))} of a bag')
    if arguments.plot:
        sizes.append(f'{size(ticks * columns * NUMBER)} of memory')
    needs = f'{ticks} ticks of {dt:.6g} s, about {" and ".join(sizes)}'
    if ticks > MOST_TICKS and not arguments.yes:
        raise ValueError(f'{arguments.torques}: time: {needs}, run only with --yes'
                         f'{unit_hint(table)}')
    for line in remarks(arguments.torques, table, dt, lambda dt: f'--dt {dt!r} (or --dt auto)'):
        print('simulate:', line, file=sys.stderr)
    if ticks > MANY_TICKS:
        print('simulate:', needs, file=sys.stderr, flush=True)


def written_as_csv(arguments):
    """Return whether the results go to a CSV, if only on stdout."""
    return arguments.out or not (arguments.plot or arguments.bag)


def kept(rows, numbers):
    """Yield rows and keep their numbers in an array."""
    for row in rows:
        numbers.extend(row)
        yield row


def run(arguments):
    """Do what the command line says; raise ValueError or OSError where it cannot be done."""
    if arguments.plot:
        require_matplotlib()   # before a run that may take minutes
    files = [os.path.realpath(path) for path in (
        arguments.torques, arguments.params, arguments.out, arguments.plot, arguments.bag) if path]
    if len(set(files)) < len(files):
        raise ValueError(f'{max(files, key=files.count)}: given for two files')
    what = (DifferentialRun if arguments.driveline is None else DrivelineRun)(arguments)
    simulation = what.simulation
    try:
        inputs = what.table.held(simulation.dt)
    except ValueError as error:
        raise ValueError(f'{arguments.torques}: {error}') from None
    announced(arguments, what, inputs)
    with ExitStack() as stack:
        bag = arguments.bag and stack.enter_context(what.bag(arguments.bag))
        file, numbers = None, array('d')
        rows = what.rows(progress(inputs, total=len(inputs)), bag)
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
                write_csv(file, what.columns, rows)
            else:
                deque(rows, 0)
        except ValueError as error:
            raise ValueError(f'{arguments.torques}: after {simulation.time:g} s: '
                             f'{error}') from None
        if arguments.plot:
            what.draw(numbers, picture)
    first, *others = what.told
    print(f'simulate: {len(inputs)} ticks, {simulation.time:.6g} s, {first}', file=sys.stderr)
    for line in others:
        print('simulate:', line, file=sys.stderr)


def main(args=None):
    """Run the tool ``simulate`` and return its exit code."""
    arguments = parser().parse_args(args)
    outputs = [path for path in (arguments.out, arguments.plot, arguments.bag) if path]
    return run_command('simulate', lambda: run(arguments), ', '.join(outputs or ['stdout']))


if __name__ == '__main__':
    sys.exit(main())
