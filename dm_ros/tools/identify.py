# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Find the parameters of a differential with which it does what was measured in a drive."""

import argparse
from contextlib import ExitStack
import json
import os
import sys

from dm_ros.ending import run_command
from dm_ros.files.measured_drive import read_measured_bag, read_measured_file
from dm_ros.files.output import replacing
from dm_ros.files.parameter_file import read_parameter_file
from dm_ros.files.plot import require_matplotlib
from dm_ros.files.recorded_drive import is_bag
from dm_ros.mechanism.variants import VARIANTS
from dm_ros.motion.models import LOSS_LAWS
from dm_ros.settings import known_rows, make_simulation, NodeParameters
from dm_ros.tools.identification.fit import fit, parameter, within_reach
from dm_ros.tools.identification.picture import draw
from dm_ros.tools.identification.report import as_data, as_parameter_file, as_text
from dm_ros.tools.identification.runs import Runs
from dm_ros.tools.identification.worth import worth
from dm_ros.tools.passed_over import warn
from dm_ros.tools.tables import add_ignore_columns, remarks

EPILOG = """\
IN.csv is one as simulate reads, time and torques (and forces on clutches), with columns
velocity.<shaft> beside, rad/s, measured at the time of the row; an empty cell there is no
measurement. Or it is one as simulate writes, whose row has the torques until its time. Or IN is a
bag: the inputs as in simulate, and the speeds of both output shafts from ~/joint_states.

NAME is the full name of a parameter of the mechanism, such as lsd.clutch.rear.preload, or
initial_velocity.<output shaft>. It starts at its value in FILE, or else at its default, and stays
within LOW to HIGH, or else within what is allowed.

On stdout: the estimates with their intervals and correlations. A warning on stderr tells what the
drive cannot: which parameters hardly matter, which it cannot tell apart, which end at a limit.
FITTED.yaml is a parameter file, FILE with the estimates.
"""


def parser():
    """Return the parser of the command line."""
    result = argparse.ArgumentParser('identify', description=__doc__, epilog=EPILOG,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument('--variant', choices=VARIANTS,
                        help='the mechanism and its formulation; default: variant of FILE')
    result.add_argument('--loss-law', choices=LOSS_LAWS,
                        help='what gears and bearings lose; default: loss_law of FILE, '
                        f'else {NodeParameters().loss_law}')
    result.add_argument('--params', metavar='FILE', help='a ROS 2 parameter file')
    result.add_argument('--drive', metavar='IN', required=True,
                        help='torques and measured speeds over time: a CSV file, or a bag')
    add_ignore_columns(result, 'IN.csv')
    result.add_argument('--node', metavar='NAME', help='full name of the node in the bag IN; '
                        'default: the only differential in it')
    result.add_argument('--fit', nargs='+', required=True, action='extend',
                        metavar='NAME[=LOW:HIGH]', help='what is to be found')
    result.add_argument('--dt', type=float, metavar='S',
                        help='length of a tick; default: 1/rate of FILE, '
                        f'else {1 / NodeParameters().rate:g}, or shorter so that each row of '
                        'IN.csv is in force, but that of a bag IN')
    result.add_argument('--out', metavar='FITTED.yaml', help='where the parameters go')
    result.add_argument('--report', metavar='REPORT.json', help='where the report goes as JSON')
    result.add_argument('--plot', metavar='OUT.png',
                        help='where a picture of the speeds and their residuals goes, as PNG')
    return result


def loaded(arguments, variant, values):
    """Return the ``MeasuredDrive``, all values of its run, and the length of a tick, s."""
    simulation = make_simulation(variant, values, arguments.dt)
    mechanism = simulation.mechanism
    warn('identify', arguments.params, values, mechanism)
    if mechanism.half_shafts:
        raise ValueError(f'port.{mechanism.half_shafts[0]}.kind: speed: a fit is to torques alone')
    if is_bag(arguments.drive):
        if arguments.ignore_columns:
            raise ValueError('--ignore-columns: a bag has no columns')
        timeout = NodeParameters().changed(NodeParameters.part_of(values)).torque_timeout
        drive = read_measured_bag(arguments.drive, mechanism, 1 / simulation.dt, arguments.node,
                                  timeout)
        told, dt = drive.remarks, arguments.dt or drive.dt
    else:
        if arguments.node:
            raise ValueError('--node: only a bag has nodes')
        drive = read_measured_file(arguments.drive, mechanism, arguments.ignore_columns)
        try:
            dt = arguments.dt or drive.table.tick_for_all(simulation.dt)
        except ValueError as error:
            raise ValueError(f'{arguments.drive}: {error}') from None
        told = [line.partition(': ')[2] for line in remarks(
            arguments.drive, drive.table, dt, lambda dt: f'--dt {dt!r}')]
    for line in told:
        print(f'identify: {arguments.drive}: {line}', file=sys.stderr)
    return drive, values | drive.values, dt


def parameters_of(words, simulation, values, drive):
    """Return the ``Parameter`` s that the option ``--fit`` names."""
    starts = simulation.parameters.named() | {
        f'initial_velocity.{shaft}': speed
        for shaft, speed in zip(simulation.outputs, simulation.initial_velocity)}
    found = []
    for word in words:
        name, equals, text = word.partition('=')
        if name not in starts:
            raise ValueError(f'--fit: {name}: there is no such parameter of the '
                             f'{simulation.mechanism.title} to fit')
        if any(name == p.name for p in found):
            raise ValueError(f'--fit: {name}: given twice')
        if drive.forces_in_force and name.endswith(('.actuator_time_constant',
                                                    '.actuator_limit')):
            raise ValueError(f'--fit: {name}: the forces of the drive are those in force, behind '
                             'the actuators')
        try:
            found.append(within_reach(
                parameter(name, known_rows()[name], starts[name],
                          _limits(text) if equals else None), simulation.parameters))
        except ValueError as error:
            raise ValueError(f'--fit: {error}') from None
    return found


def _limits(text):
    try:
        low, high = map(float, text.split(':'))
    except ValueError:
        raise ValueError(f'{text!r} is no range, it must be LOW:HIGH') from None
    return low, high


def run(arguments):
    """Do what the command line says; raise ValueError or OSError where it cannot be done."""
    if arguments.plot:
        require_matplotlib()   # before a fit that may take minutes
    outputs = [path for path in (arguments.out, arguments.report, arguments.plot) if path]
    files = [os.path.realpath(path)
             for path in (arguments.drive, arguments.params, *outputs) if path]
    if len(set(files)) < len(files):
        raise ValueError(f'{max(files, key=files.count)}: given for two files')
    values = read_parameter_file(arguments.params) if arguments.params else {}
    if arguments.loss_law:
        values['loss_law'] = arguments.loss_law
    variant = arguments.variant or values.get('variant')
    if variant is None:
        raise ValueError('--variant: it is needed where no FILE has the parameter variant')
    values['variant'] = variant
    drive, all_values, dt = loaded(arguments, variant, values)
    simulation = make_simulation(variant, all_values, dt)
    parameters = parameters_of(arguments.fit, simulation, all_values, drive)
    fitted = {p.name for p in parameters}
    if make_simulation(variant, values).dt != dt:
        values['rate'] = 1 / dt   # so that what is written runs as the fit did
    try:
        found = fit(Runs(variant, all_values, drive, dt), parameters)
    except ValueError as error:
        raise ValueError(f'{arguments.drive}: {error}') from None
    value = worth(found, drive, {
        shaft: speed for shaft, speed in zip(simulation.outputs, simulation.initial_velocity)
        if f'initial_velocity.{shaft}' not in fitted})
    title = (f'{variant} fitted to {os.path.basename(os.path.realpath(arguments.drive))}: '
             f'{len(drive.table.held(dt))} ticks of {dt:.6g} s, {found.runs} runs')
    with ExitStack() as stack:
        if arguments.out:
            stack.enter_context(replacing(arguments.out, 'w')).write(
                as_parameter_file(values, value, title))
        if arguments.report:
            json.dump(as_data(found, value, title),
                      stack.enter_context(replacing(arguments.report, 'w')), indent=2)
        if arguments.plot:
            draw(stack.enter_context(replacing(arguments.plot, 'wb')), found, drive, title)
        print(as_text(found, value, title), end='', flush=True)
    for line in value.warnings:
        print('identify: warning:', line, file=sys.stderr)


def main(args=None):
    """Run the tool ``identify`` and return its exit code."""
    arguments = parser().parse_args(args)
    outputs = [path for path in (arguments.out, arguments.report, arguments.plot) if path]
    return run_command('identify', lambda: run(arguments), ', '.join(outputs or ['stdout']))


if __name__ == '__main__':
    sys.exit(main())
