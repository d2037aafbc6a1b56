# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Run one load with many sets of parameters, and tell metrics of each run."""

import argparse
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from dataclasses import replace
from itertools import islice
import os
import sys
from threading import Event

import numpy as np

from dm_ros.ending import run_command, Signalled
from dm_ros.files.output import remove_unfinished, replacing
from dm_ros.files.parameter_file import read_parameter_file
from dm_ros.files.plot import require_matplotlib
from dm_ros.files.recorded_drive import is_bag, read_drive
from dm_ros.files.torque_table import read_torque_file
from dm_ros.mechanism.variants import VARIANTS, WITH_CLUTCHES
from dm_ros.motion.models import LOSS_LAWS
from dm_ros.settings import known_rows, make_simulation, NodeParameters
from dm_ros.tools.passed_over import warn
from dm_ros.tools.progress import progress
from dm_ros.tools.sweeping import metrics
from dm_ros.tools.sweeping.chunks import chunks_of
from dm_ros.tools.sweeping.cluster import on_cluster
from dm_ros.tools.sweeping.picture import draw
from dm_ros.tools.sweeping.samples import axis, grid, spread
from dm_ros.tools.sweeping.study import Computation, digest, names_of, STATUS, Study
from dm_ros.tools.sweeping.tables import PARQUET, require_pyarrow, write
from dm_ros.tools.tables import add_ignore_columns, remarks

BUILT_IN_SECONDS = 10.0
MOST_TICKS = 10**7   # of a load, which is held in memory
EPILOG = """\
What is varied, by --vary, once for each parameter of the mechanism or initial_velocity.<shaft>:
  NAME=A,B,C                  these values
  NAME=LOW:HIGH:COUNT[:log]   COUNT values of a range, in a grid
  NAME=LOW:HIGH[:log]         a range, with --sobol or --latin; with log evenly over powers of ten
Without --sobol and --latin it is a grid, all values of each with all of the others. For Sobol, N
should be a power of 2.

Metrics, by --metric, as often as wanted:
  STATISTIC.COLUMN      STATISTIC: final, mean, min, max, peak (largest magnitude), rms; over the
                        ends of all ticks. COLUMN: slip (speed of the first output shaft less that
                        of the second), or one of OUT.csv of simulate: velocity.<shaft>,
                        position.<shaft>, moment.<name>, power_flow, clutch_force.<clutch>
  work.<input>          J, what the torque on a shaft did
  lost_energy           J, what all torques did less what the kinetic energy gained
  locked                share of ticks at whose end the slip is below 1 rad/s
  module:function       one function of yours, in a module that Python finds from here: it gets a
                        run as a dm_ros.files.record.Record and returns a number, or numbers by
                        name, the same names for each run
Default: the final speeds of both output shafts, peak.slip and lost_energy.

IN is as in simulate: a CSV file or a bag. OUT has a row a set: the parameters, the metrics and the
status: ok, failed (it left the range of floating point numbers) or impossible (such parameters
make no mechanism). Until it is whole, what is done is kept in the folder OUT.parts: after a kill
the same command goes on from there.
"""


def parser():
    """Return the parser of the command line."""
    result = argparse.ArgumentParser('sweep', description=__doc__, epilog=EPILOG,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument('--variant', choices=VARIANTS,
                        help='the mechanism and its formulation; default: variant of FILE')
    result.add_argument('--loss-law', choices=LOSS_LAWS,
                        help='what gears and bearings lose; default: loss_law of FILE, '
                        f'else {NodeParameters().loss_law}')
    result.add_argument('--params', metavar='FILE',
                        help='a ROS 2 parameter file, for what is not varied')
    result.add_argument('--vary', metavar='NAME=...', action='append', required=True,
                        help='what is varied, see below')
    ways = result.add_mutually_exclusive_group()
    ways.add_argument('--sobol', metavar='N', type=int, help='N sets of a Sobol sequence')
    ways.add_argument('--latin', metavar='N', type=int, help='N sets of a Latin hypercube')
    result.add_argument('--seed', type=int, default=0, metavar='K',
                        help='of both, another one gives other sets; default: %(default)s')
    result.add_argument('--torques', metavar='IN',
                        help='torques over time: a CSV file, or a bag; default: a built-in load')
    add_ignore_columns(result, 'IN.csv')
    result.add_argument('--node', metavar='NAME', help='full name of the node in the bag IN; '
                        'default: the only differential in it')
    result.add_argument('--duration', metavar='S', type=float,
                        help=f'length of the built-in load; default: {BUILT_IN_SECONDS:g}')
    result.add_argument('--dt', type=float, metavar='S',
                        help='length of a tick; default: 1/rate of FILE, '
                        f'else {1 / NodeParameters().rate:g}, but that of a bag IN')
    result.add_argument('--metric', metavar='NAME', action='append', help='see below')
    result.add_argument('--out', metavar='OUT', required=True,
                        help='where the results go, .csv or .parquet')
    result.add_argument('--plot', metavar='OUT.png', help='where a picture of them goes, as PNG')
    result.add_argument('--chunk', metavar='N', type=int,
                        help='sets that are computed and kept together; default: by the ticks')
    result.add_argument('--scheduler', metavar='ADDRESS',
                        help='compute on a cluster of dask.distributed, as tcp://host:8786')
    return result


def loaded(arguments, variant, values, is_clutched):
    """
    Return a simulation of the base, the ``Mechanism``, and the inputs of all ticks, (ticks, ...).

    :param is_clutched: whether some set gives the mechanism clutches.
    """
    simulation = make_simulation(variant, values, arguments.dt)
    mechanism = simulation.mechanism
    warn('sweep', arguments.params, values, mechanism)
    if mechanism.half_shafts:
        raise ValueError(f'port.{mechanism.half_shafts[0]}.kind: speed: a sweep is of torques '
                         'alone')
    if is_clutched:
        mechanism = WITH_CLUTCHES[mechanism.name]
    path = arguments.torques
    if path is None:
        for option in ('node', 'ignore_columns'):
            if getattr(arguments, option):
                raise ValueError(f'--{option.replace("_", "-")}: it needs --torques')
        seconds = BUILT_IN_SECONDS if arguments.duration is None else arguments.duration
        if not 0.5 < seconds / simulation.dt <= MOST_TICKS:
            raise ValueError(f'--duration: {seconds!r} is not allowed, it must be a number of s '
                             f'that has a tick of {simulation.dt:g} s, and at most {MOST_TICKS}')
        return simulation, mechanism, np.array([
            mechanism.load(n * simulation.dt) for n in range(round(seconds / simulation.dt))])
    if arguments.duration is not None:
        raise ValueError('--duration: it is for the built-in load')
    if is_bag(path):
        if arguments.ignore_columns:
            raise ValueError('--ignore-columns: a bag has no columns')
        timeout = NodeParameters().changed(NodeParameters.part_of(values)).torque_timeout
        drive = read_drive(path, mechanism, 1 / simulation.dt, arguments.node, timeout)
        table, told = drive.table, [f'{path}: {line}' for line in drive.remarks]
        simulation = make_simulation(variant, values | drive.values, arguments.dt or drive.dt)
    else:
        if arguments.node:
            raise ValueError('--node: only a bag has nodes')
        table = read_torque_file(path, mechanism.ports, mechanism.clutch_moments,
                                 arguments.ignore_columns)
        told = remarks(path, table, simulation.dt, lambda dt: f'--dt {dt!r}')
    for line in told:
        print('sweep:', line, file=sys.stderr)
    try:
        held = table.held(simulation.dt)
        if len(held) > MOST_TICKS:
            raise ValueError(f'{len(held)} ticks of {simulation.dt:g} s, at most {MOST_TICKS} are '
                             'allowed; --dt makes them longer')
        return simulation, mechanism, np.array(list(held))
    except ValueError as error:
        raise ValueError(f'{path}: {error}') from None


def study_of(arguments, variant, values, columns):
    """Return the ``Study`` of a command line; raise ValueError where there is none."""
    surfaces = [name for name in columns if name.endswith('.friction_surfaces')]
    simulation, mechanism, inputs = loaded(
        arguments, variant, values, any(columns[name].any() for name in surfaces))
    for name in columns:
        if name not in (*simulation.parameters.named(),
                        *(f'initial_velocity.{shaft}' for shaft in mechanism.outputs)):
            raise ValueError(f'--vary: {name}: the {mechanism.title} has no such parameter')
    first, second = mechanism.outputs
    wanted = arguments.metric or [f'final.velocity.{first}', f'final.velocity.{second}',
                                  'peak.slip', 'lost_energy']
    functions = [name for name in wanted if ':' in name]
    named = tuple(dict.fromkeys(name for name in wanted if ':' not in name))
    for name in named:
        metrics.check(name, mechanism)
    if len(functions) > 1:
        raise ValueError('--metric: one function may be given, it may return numbers by name')
    count = len(mechanism.inputs)
    study = Study(
        variant, simulation.dt, {
            'loss_law': simulation.loss_law, 'substeps': simulation.substeps,
            'power_flow_deadband': simulation.power_flow_deadband},
        simulation.parameters.named(),
        {f'initial_velocity.{shaft}': speed
         for shaft, speed in zip(mechanism.outputs, simulation.initial_velocity)},
        np.ascontiguousarray(inputs[:, :count]),
        np.ascontiguousarray(inputs[:, count:]) if inputs.shape[1] > count else None,
        named, '', named)
    if functions:
        metrics.function_named(functions[0])
        names = names_of(functions[0], study)
        if not names or set(names) & {*named, *columns, 'status'}:
            raise ValueError(f'--metric: {functions[0]}: it returned '
                             f'{", ".join(names) or "nothing"}, names that no column has are '
                             'needed')
        study = replace(study, function=functions[0], names=(*named, *names))
    return study


class Sweep:
    """A study with its sets, in chunks."""

    def __init__(self, study, columns, chunk):
        self.study, self.columns = study, columns
        self.count = len(next(iter(columns.values())))
        self._chunk = chunk or study.chunk
        self.numbers = range(-(-self.count // self._chunk))

    def description(self):
        """Return what makes it this sweep, as plain data."""
        return {**self.study.description(), 'sets': self.count, 'chunk': self._chunk,
                'varied': {name: digest(values) for name, values in self.columns.items()}}

    def of_chunk(self, number):
        """Return what is varied of the sets of a chunk, ``{full name: values}``."""
        part = slice(number * self._chunk, (number + 1) * self._chunk)
        return {name: values[part] for name, values in self.columns.items()}

    def size(self, number):
        """Return how many sets a chunk has."""
        return min(self._chunk, self.count - number * self._chunk)

    def computed(self, numbers, scheduler):
        """Yield (number, table) of some chunks, in any order."""
        if scheduler:
            yield from on_cluster(scheduler, self.study, numbers, self.of_chunk)
            return
        cores = len(os.sched_getaffinity(0))
        if 1 < cores <= len(numbers) / 2:
            yield from self._on_cores(numbers, cores)
            return
        for number in numbers:   # the threads of the ensemble take all cores
            yield number, Computation(self.study, self.of_chunk(number)).table

    def _on_cores(self, numbers, cores):
        """Yield as ``computed``, a chunk on each core: what Python does is done together, too."""
        left, running, stop = iter(numbers), {}, Event()
        pool = ThreadPoolExecutor(cores)
        try:
            while True:
                for number in islice(left, cores - len(running)):
                    running[pool.submit(Computation, self.study, self.of_chunk(number), 1,
                                        stop)] = number
                if not running:
                    return
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    yield running.pop(future), future.result().table
        finally:
            stop.set()
            pool.shutdown(cancel_futures=True)

    def compute(self, chunks, scheduler):
        """Compute and keep the chunks that are not done."""
        left = [number for number in self.numbers if not chunks.has(number, self.size(number))]
        done = self.count - sum(map(self.size, left))
        if done:
            print(f'sweep: {done} of {self.count} sets are done already', file=sys.stderr)
        try:
            with progress(total=self.count, unit='set', initial=done) as bar:
                for number, table in self.computed(left, scheduler):
                    chunks.save(number, table)
                    done += self.size(number)
                    bar.update(self.size(number))
        except Signalled:
            print(f'sweep: {done} of {self.count} sets are done, the same command goes on from '
                  'there', file=sys.stderr)
            raise

    def rows(self, chunks):
        """Yield the rows of the result, an array for each chunk."""
        for number in self.numbers:
            yield np.column_stack([*self.of_chunk(number).values(), chunks.load(number)])


def run(arguments):
    """Do what the command line says; raise ValueError or OSError where it cannot be done."""
    if arguments.plot:
        require_matplotlib()   # before a run that may take hours
    require_pyarrow(arguments.out)
    for path, endings in ((arguments.out, ('.csv', PARQUET)), (arguments.plot, ('.png',))):
        if path and os.path.splitext(path)[1] not in endings and not path.startswith('/dev/'):
            raise ValueError(f'{path}: its name must end in {" or ".join(endings)}')
    files = [os.path.realpath(path) for path in (
        arguments.torques, arguments.params, arguments.out, arguments.plot) if path]
    if len(set(files)) < len(files):
        raise ValueError(f'{max(files, key=files.count)}: given for two files')
    for path in filter(None, (arguments.out, arguments.plot)):
        folder = os.path.dirname(os.path.realpath(path))
        if not os.path.isdir(folder):
            raise ValueError(f'{path}: there is no folder {folder}')
    if arguments.chunk is not None and arguments.chunk < 1:
        raise ValueError(f'--chunk: {arguments.chunk} is not allowed, it must be at least 1')
    if arguments.seed < 0:
        raise ValueError(f'--seed: {arguments.seed} is not allowed, it must not be below 0')
    values = read_parameter_file(arguments.params) if arguments.params else {}
    if arguments.loss_law:
        values['loss_law'] = arguments.loss_law
    variant = arguments.variant or values.get('variant')
    if variant is None:
        raise ValueError('--variant: it is needed where no FILE has the parameter variant')
    axes = [axis(text, known_rows()) for text in arguments.vary]
    names = [one.name for one in axes]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f'--vary: {name}: given twice')
    number = arguments.sobol if arguments.latin is None else arguments.latin
    columns = (grid(axes) if number is None
               else spread(axes, number, arguments.latin is None, arguments.seed))
    sweep = Sweep(study_of(arguments, variant, values, columns), columns, arguments.chunk)
    with chunks_of(f'{arguments.out}.parts', sweep.description(),
                   len(sweep.study.names) + 1) as chunks:
        sweep.compute(chunks, arguments.scheduler)
        write(arguments.out, [*names, *sweep.study.names], sweep.rows(chunks))
        tables = np.concatenate([chunks.load(number) for number in sweep.numbers])
        if arguments.plot:
            with replacing(arguments.plot, 'wb') as picture:
                draw(picture, {one: columns[one.name] for one in axes}, dict(zip(
                    sweep.study.names, tables.T)), f'{variant}, {sweep.count} sets')
        for path in filter(None, (arguments.out, arguments.plot)):
            remove_unfinished(path)   # what a kill before this run had left
        chunks.remove()
    counts = np.bincount(tables[:, -1].astype(int), minlength=len(STATUS))
    print(f'sweep: {sweep.count} sets, {len(sweep.study.torques)} ticks each: ' + ', '.join(
        f'{count} {status}' for count, status in zip(counts, STATUS) if count), file=sys.stderr)


def main(args=None):
    """Run the tool ``sweep`` and return its exit code."""
    arguments = parser().parse_args(args)
    return run_command('sweep', lambda: run(arguments), arguments.out)


if __name__ == '__main__':
    sys.exit(main())
