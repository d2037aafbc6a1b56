# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The benchmark of sweeps: how time and memory grow with the sets, on one core and on more.

It prints a Markdown table. Run ``python bench/sweep.py``; ``--help`` has the options.
"""

import argparse
from datetime import date
import os
import platform
import sys
import tempfile
from time import perf_counter

from dm_ros.tools.progress import progress

SECONDS, DT = 0.5, 0.005   # of the load
TOOL = [sys.executable, '-m', 'dm_ros.tools.sweep', '--duration', str(SECONDS), '--dt', str(DT)]
VARIED = {
    'lsd_ode': ['lsd.clutch.rear.preload=0:300', 'lsd.inertia.rear=0.001:0.1:log'],
    'symmetric_ode': ['symmetric.viscosity.left=1e-4:0.1:log',
                      'symmetric.inertia.left=1e-4:0.1:log']}
HEAD = ['', 'sets', 'cores', 's', 'us a set', 'ns a tick of a set', 'memory, MB']


def command(variant, sets, out):
    """Return the command line of a sweep."""
    return [*TOOL, '--variant', variant, '--sobol', str(sets), '--out', out,
            *(word for given in VARIED[variant] for word in ('--vary', given))]


def measured(arguments, cores):
    """Return how long a command took on some cores, s, and how much memory, bytes."""
    start = perf_counter()
    child = os.fork()
    if not child:
        os.sched_setaffinity(0, cores)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
        os.execv(arguments[0], arguments)
    _, status, usage = os.wait4(child, 0)
    if status:
        raise RuntimeError(f'{" ".join(arguments)} ended with {status}')
    return perf_counter() - start, 1024 * usage.ru_maxrss


def draw(path, found):
    """Draw the seconds over the sets."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7, 4.2), dpi=120, layout='constrained')
    ax = figure.subplots()
    for variant in dict.fromkeys(variant for variant, _, _ in found):
        for cores in sorted({cores for _, _, cores in found}):
            points = [(sets, seconds) for (v, sets, c), (seconds, _) in found.items()
                      if (v, c) == (variant, cores)]
            ax.loglog(*zip(*points), 'o-' if cores == 1 else 's--', markersize=4,
                      label=f'{variant}, {cores} core{"s" * (cores > 1)}',
                      color='#1f6fb5' if variant == 'lsd_ode' else '#d1441f')
    ax.grid(alpha=0.25)
    ax.spines[['top', 'right']].set_visible(False)
    ax.set_xlabel(f'sets, of {SECONDS / DT:.0f} ticks each')
    ax.set_ylabel('time of the whole command, s')
    ax.legend(frameon=False)
    figure.savefig(path, format='png')


def parser():
    """Return the parser of the command line."""
    result = argparse.ArgumentParser('sweep', description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument('--most', type=float, default=1e6, help='sets; default: %(default)g')
    result.add_argument('--plot', metavar='OUT.png', help='where a picture goes')
    return result


def main():
    """Print the table."""
    arguments = parser().parse_args()
    cores = sorted(os.sched_getaffinity(0))
    print(f'{date.today()}, {platform.machine()}, {len(cores)} cores, '
          f'Python {platform.python_version()}, load average {os.getloadavg()[0]:.1f} before\n\n'
          f'A load of {SECONDS / DT:.0f} ticks, the four metrics of the default, a CSV.\n\n'
          f'| {" | ".join(HEAD)} |\n|---' + '|---:' * (len(HEAD) - 1) + '|')
    sizes = [10**n for n in range(2, 10) if 10**n <= arguments.most]
    rows = [(variant, sets, count) for variant in VARIED for sets in sizes
            for count in dict.fromkeys((1, len(cores)))]
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for variant, sets, count in progress(rows, total=len(rows), unit='row'):
            seconds, memory = found[variant, sets, count] = measured(
                command(variant, sets, os.path.join(folder, 'OUT.csv')), cores[:count])
            each = seconds / sets
            print(f'| {variant} | {sets:,} | {count} | {seconds:.3g} | {1e6 * each:.3g} '
                  f'| {1e9 * each * DT / SECONDS:.0f} | {memory / 1e6:.0f} |', flush=True)
    if arguments.plot:
        draw(arguments.plot, found)


if __name__ == '__main__':
    main()
