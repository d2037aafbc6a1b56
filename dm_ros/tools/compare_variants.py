# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Compare all variants of both differentials, as the paper does, and write a page about it."""

import argparse
from io import BytesIO
from math import inf
import os
import sys

from dm_ros.ending import run_command
from dm_ros.files.output import replacing
from dm_ros.files.parameter_file import read_parameter_file
from dm_ros.files.plot import require_matplotlib
from dm_ros.files.torque_table import read_torque_file
from dm_ros.mechanism.variants import MECHANISMS, SELF_LOCKING, SYMMETRIC
from dm_ros.motion.simulation import checked
from dm_ros.tools.comparison import laws
from dm_ros.tools.comparison.claims import symmetric_claims
from dm_ros.tools.comparison.claims_lsd import self_locking_claims
from dm_ros.tools.comparison.figures import FIGURES
from dm_ros.tools.comparison.laws_page import laws_page, picture, picture_name
from dm_ros.tools.comparison.page import page
from dm_ros.tools.comparison.runs import (
    BUILT_IN_SECONDS,
    Load,
    RATES,
    run,
    ticks_of,
)
from dm_ros.tools.passed_over import warn
from dm_ros.tools.progress import progress
from dm_ros.tools.tables import add_ignore_columns, remarks

TABLE_SECONDS = 30.0   # of a CSV, without --duration
PAGE, LAWS_PAGE = 'index.html', 'laws.html'
CLAIMS = {SYMMETRIC: symmetric_claims, SELF_LOCKING: self_locking_claims}
EPILOG = """\
The page shows, for each mechanism, what each variant is, gives and costs, how far it is from the
exact solution at 100 Hz, 1 kHz and 10 kHz, what the paper says in words beside what is measured
here, and the paper's figures 3, 4, 7 and 8 drawn from these runs, all under the loss law "paper".
A second page has both loss laws side by side: where the energy goes on the same load, on a drive
cycle and on balanced loads. DIR gets index.html and laws.html, which hold all pictures and can be
passed on alone, and each picture as PNG beside them. All numbers but the timings are the same in
each run. It takes one to two minutes.

IN.csv is that of "simulate": a header "time,<shaft>,..." with the input shafts (symmetric: pinion,
left, right; lsd: carrier, front, rear), rows of s and N m that hold until the next row's time; the
last time ends the run, and the first one begins it where that is later than 1000 s. Of FILE, a
ROS 2 parameter file, these count: the parameters of the mechanism, power_flow_deadband and
initial_velocity.
"""


def parser():
    """Return the parser of the command line."""
    result = argparse.ArgumentParser('compare_variants', description=__doc__, epilog=EPILOG,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument('--mechanism', choices=MECHANISMS,
                        help='compare the variants of this one alone; default: both')
    result.add_argument('--torques', metavar='IN.csv',
                        help='torques over time, with --mechanism; default: built-in loads in the '
                        'manner of the figures 3 and 7')
    add_ignore_columns(result, 'IN.csv')
    result.add_argument('--params', metavar='FILE', help='a ROS 2 parameter file')
    result.add_argument('--duration', metavar='S', type=float,
                        help=f'length of the load that is run; default: {BUILT_IN_SECONDS:g}, of '
                        f'IN.csv all, but {TABLE_SECONDS:g} at most')
    result.add_argument('--out', metavar='DIR', default='comparison',
                        help='folder for the results; default: %(default)s')
    return result


def loads(arguments):
    """Return ``{Mechanism: Load}`` for the command line, and what they are in words."""
    seconds = arguments.duration
    if seconds is not None:
        checked('duration', seconds, lambda v: v > 0.0, 'a positive number of seconds')
    if arguments.torques is None:
        chosen = [arguments.mechanism] if arguments.mechanism else MECHANISMS
        return ({MECHANISMS[name]: Load(MECHANISMS[name], seconds or BUILT_IN_SECONDS)
                 for name in chosen},
                'The loads are built-in ones, in the manner of the paper.')
    if arguments.mechanism is None:
        raise ValueError('--torques needs --mechanism, as its columns are the shafts of one')
    mechanism = MECHANISMS[arguments.mechanism]
    table = read_torque_file(arguments.torques, mechanism.ports, (), arguments.ignore_columns)
    for line in remarks(arguments.torques, table, 1 / min(RATES)):
        print('compare_variants:', line, file=sys.stderr)
    whole = table.times[-1]
    used = min(whole, seconds or TABLE_SECONDS)
    part = '' if used == whole else f', the first {used:g} of {whole:g} s'
    return {mechanism: Load(mechanism, used, table)}, f'The load is {arguments.torques}{part}.'


def png(figure):
    """Return a figure as the bytes of a PNG file."""
    buffer = BytesIO()
    figure.savefig(buffer, format='png')
    return buffer.getvalue()


def compare(arguments):
    """Do what the command line says; raise ValueError or OSError where it cannot be done."""
    require_matplotlib()
    if os.path.exists(arguments.out) and not os.path.isdir(arguments.out):
        raise ValueError(f'{arguments.out}: there is a file of this name')
    values = read_parameter_file(arguments.params) if arguments.params else {}
    chosen, source = loads(arguments)
    warn('compare_variants', arguments.params, values, *chosen)
    if arguments.params:
        source += f' The parameters come from {arguments.params}.'
    for mechanism in chosen:
        table = mechanism.parameters
        if table().changed(table.part_of(values)).has_clutches and not mechanism.clutches:
            raise ValueError(f'{arguments.params}: {mechanism.name}.clutch: the {mechanism.title} '
                             'of the paper has no clutches, friction_surfaces must be 0 here')
    files = {}
    comparisons, both_laws = [], []
    longest = inf if arguments.duration is None else arguments.duration
    with progress(total=sum(ticks_of(m, load) + laws.ticks_of(load, longest)
                            for m, load in chosen.items())) as bar:
        for mechanism, load in chosen.items():
            try:
                runs = run(mechanism, load, values, bar.update)
                outcomes = laws.run(mechanism, load, values, bar.update, longest)
            except ValueError as error:
                raise ValueError(f'{arguments.torques}: {error}' if arguments.torques
                                 else error) from None
            images = {}
            for name, (which, draw, _) in FIGURES.items():
                if which is mechanism:
                    images[name] = png(draw(runs))
            image = png(picture(mechanism, outcomes))
            both_laws.append((mechanism, outcomes, image))
            files |= {**images, picture_name(mechanism): image}
            comparisons.append((runs, CLAIMS[mechanism](runs), images))
    files[PAGE] = page(comparisons, source).encode()
    files[LAWS_PAGE] = laws_page(both_laws, source).encode()
    os.makedirs(arguments.out, exist_ok=True)
    for name, content in files.items():
        with replacing(os.path.join(arguments.out, name), 'wb') as file:
            file.write(content)
    verdicts = [claim.verdict for _, found, _ in comparisons for claim in found]
    counts = ', '.join(f'{verdicts.count(v)} {v}' for v in dict.fromkeys(verdicts))
    print(f'compare_variants: {os.path.join(arguments.out, PAGE)}: {len(verdicts)} statements '
          f'of the paper: {counts}')


def main(args=None):
    """Run the tool ``compare_variants`` and return its exit code."""
    arguments = parser().parse_args(args)
    return run_command('compare_variants', lambda: compare(arguments), arguments.out)


if __name__ == '__main__':
    sys.exit(main())
