# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The main job in one command: a differential and its load as processes that talk over DDS.

Starts ``differential`` and ``play_torques`` on this machine only, in a ROS domain of their own,
records what the node publishes, reports it, and writes a CSV and a picture.
"""

import argparse
from contextlib import contextmanager, nullcontext, suppress
import json
import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from dm_ros.ending import run_command, Signalled
from dm_ros.files.bag import Bag, has_rosbags, require_rosbags
from dm_ros.files.parameter_file import read_parameter_file
from dm_ros.mechanism.variants import VARIANTS
from dm_ros.motion.models import LOSS_LAWS
from dm_ros.ros.domain import own_domain
from dm_ros.ros.recorder import Recorder
from dm_ros.settings import make_simulation, NodeParameters
from dm_ros.tools.passed_over import warn
from dm_ros.tools.progress import progress

PATIENCE = 30.0   # s, until the processes have found each other


def parser():
    """Return the parser of the command line."""
    result = argparse.ArgumentParser('demo', description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    node = NodeParameters()
    result.add_argument('--params', metavar='FILE',
                        help='a ROS 2 parameter file; what is given besides counts instead of it')
    result.add_argument('--variant', choices=VARIANTS,
                        help=f'the mechanism and its formulation, default {node.variant}')
    result.add_argument('--loss-law', choices=LOSS_LAWS,
                        help=f'what gears and bearings lose, default {node.loss_law}')
    result.add_argument('--duration', type=positive, default=10.0, metavar='S',
                        help='length of the recording, default 10')
    result.add_argument('--rate', type=float, metavar='HZ',
                        help=f'ticks in a second, default {node.rate:g}')
    result.add_argument('--out', type=Path, default=Path('run'), metavar='FOLDER',
                        help='where the CSV and the PNG go, default run')
    return result


def positive(text):
    number = float(text)
    if not 0.0 < number < 1e6:
        raise argparse.ArgumentTypeError(f'{text} is not allowed, it must be in (0, 1e+06)')
    return number


@contextmanager
def folder_for_results(path):
    """Make a folder, and take it away if nothing came into it."""
    made = [folder for folder in (path, *path.parents) if not folder.exists()]
    try:   # from before it is there, since a signal may come at any moment
        path.mkdir(parents=True, exist_ok=True)
        yield
    finally:
        with suppress(OSError):   # it is not empty
            for folder in made:
                folder.rmdir()


@contextmanager
def process(name, *arguments):
    """Run a command of the package as a process that ends with the block."""
    child = subprocess.Popen([sys.executable, '-m', 'dm_ros.commands', name, *arguments])
    try:
        yield child
    finally:
        child.send_signal(signal.SIGINT)
        try:
            child.wait(10.0)
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()


def wait(condition, what, *children):
    """Wait until the condition holds; raise RuntimeError when a child ends or time runs out."""
    end = time.monotonic() + PATIENCE
    while not condition():
        if any(child.poll() is not None for child in children):
            raise RuntimeError(f'a process ended before {what}')
        if time.monotonic() > end:
            raise RuntimeError(f'after {PATIENCE:g} s still no {what}')
        time.sleep(0.02)


def next_report(recorder):
    """Return the condition that one more message of /diagnostics has come."""
    before = recorder.reports

    def condition():
        recorder.poll()
        return recorder.reports > before
    return condition


def simulation_of(arguments):
    """Return the simulation that the node will run, and all parameters that are given to it."""
    values = read_parameter_file(arguments.params) if arguments.params else {}
    given = {'variant': arguments.variant, 'loss_law': arguments.loss_law, 'rate': arguments.rate}
    values |= {name: value for name, value in given.items() if value is not None}
    simulation = make_simulation(values.get('variant', NodeParameters().variant), values)
    if speeds := simulation.mechanism.half_shafts:
        raise ValueError(f'{arguments.params}: the load is torques, but {", ".join(speeds)} '
                         'would take a speed')
    warn('demo', arguments.params, values, simulation.mechanism)
    return simulation, values


def bag_of(arguments, simulation):
    """Return the ``Bag`` for a run, or a context of none where none can be written."""
    if has_rosbags():
        return Bag(arguments.out / f'{simulation.variant}_bag', instead=True)
    return nullcontext()


def run_processes(arguments, simulation, values):
    """Return the recorder after a run of the two processes."""
    namespace = f'/demo_{os.getpid()}'   # even in a shared domain nobody else is heard
    parameters = ['--ros-args', '-r', f'__ns:={namespace}']
    for name, value in values.items():   # the file may name the node without the namespace
        parameters += ['-p', f'{name}:={json.dumps(value)}']
    with (bag_of(arguments, simulation) as bag,
          Recorder(f'{namespace}/differential', simulation.mechanism) as recorder):
        with process('differential', *parameters) as node:
            wait(recorder.poll, 'state of the differential', node)
            wait(next_report(recorder), 'report of the differential', node)
            recorder.clear()
            if bag:
                recorder.record_in(bag, '/differential')
            with process('play_torques', '--variant', simulation.variant,
                         '--joint-prefix', values.get('joint_prefix', ''),
                         '--ros-args', '-r', f'__ns:={namespace}') as player:
                wait(lambda: recorder.poll() and recorder.loaded, 'torque on a shaft',
                     node, player)
                end = time.monotonic() + arguments.duration
                with progress(total=round(arguments.duration / simulation.dt)) as bar:
                    while (left := end - time.monotonic()) > 0.0:
                        time.sleep(min(0.02, left))
                        bar.update(recorder.poll())
                        if node.poll() is not None:
                            raise RuntimeError('the differential ended before the recording')
                # missed ticks are told once a second
                wait(next_report(recorder), 'report of the differential', node, player)
                node.send_signal(signal.SIGINT)   # before it misses the load, and says so
    return recorder


def report(record, missed, rate):
    """Return the report as lines."""
    time_, flow = record.time, record.power_flow
    span = time_[-1] - time_[0]
    lines = [
        f'recorded      {len(time_)} ticks in {span:.2f} s',
        f'rate held     {(len(time_) - 1) / span:.2f} Hz of {rate:g} Hz',
        f'missed ticks  {missed}',
        f'power flow    direct {100 * (flow > 0).mean():.0f} %, '
        f'reverse {100 * (flow < 0).mean():.0f} %',
        '',
        f'{"":24}{"lowest":>12}{"highest":>12}']
    units = {'velocity': 'rad/s', 'moment': 'N m', 'torque': 'N m', 'clutch_force': 'N'}
    for name, values in record.columns.items():
        kind, _, what = name.partition('.')
        if kind in units:
            lines.append(f'{kind + " " + what:24}{values.min():12.2f}{values.max():12.2f}'
                         f'  {units[kind]}')
    return lines


def run(arguments):
    """Do what the command line says; raise OSError, RuntimeError or ValueError where it fails."""
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    simulation, values = simulation_of(arguments)
    try:
        with folder_for_results(arguments.out):
            run_and_write(arguments, simulation, values)
    except Signalled:
        print('demo: ended by a signal, the record is not whole', file=sys.stderr)
        raise


def run_and_write(arguments, simulation, values):
    """Run the processes, write the record and report it."""
    with own_domain() as domain:
        os.environ['ROS_DOMAIN_ID'] = str(domain)
        recorder = run_processes(arguments, simulation, values)
    variant, rate = simulation.variant, 1 / simulation.dt
    record = recorder.record(
        arguments.duration, f'{variant} at {rate:g} Hz, {simulation.loss_law} law of losses')
    csv = arguments.out / f'{variant}.csv'
    png = arguments.out / f'{variant}.png'
    record.save_csv(csv)
    record.save_plot(png)
    print('\n'.join(report(record, recorder.missed, rate)))
    print(f'\nwritten       {csv}\n              {png}')
    try:
        require_rosbags()
        print(f'              {arguments.out / variant}_bag')
    except ValueError as error:
        print(f'no bag        {error}')


def main(args=None):
    """Run the demo; return the exit code."""
    arguments = parser().parse_args(args)
    return run_command('demo', lambda: run(arguments), str(arguments.out),
                       expected=(OSError, RuntimeError, ValueError), code=1)


if __name__ == '__main__':
    sys.exit(main())
