# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The benchmark of ensembles: what a tick of a member costs, beside a ``Simulation`` of its own.

It prints a Markdown table. Run ``make bench``; ``bench/ensemble.py --help`` has the options.
"""

import argparse
from datetime import date
import os
import platform
from time import perf_counter
from unittest import mock

import numpy as np

from dm_ros import core, Ensemble, Simulation
from dm_ros.mechanism.variants import CATALOGUE
from dm_ros.motion.models import LOSS_LAWS, PAPER
from dm_ros.tools.progress import progress

DT = 1e-3   # s
BLOCK = 500  # ticks in a call
HEAD = ['a tick at 1 kHz', 'members', 'to make, us', 'one thread, ns', 'all cores, ns',
        'Simulation.step in C, us', 'in Python, us', 'one thread over C', 'over Python']
AT_ONCE = '{} at once, ns'
LEGEND = """\
All rows step the reference load of the scenarios at 1 kHz. `to make` is that of one member, `one
thread` and `all cores` are the time of `Ensemble.run` over {block} ticks, for one tick and member.
The ratios are of `Simulation.step`, with its snapshot, to `one thread`, which takes {lanes}
members at once in a register; other machines take fewer. All are medians over {passes} passes
through all rows in turn.
"""


def seconds(function, *arguments):
    """Return how long a call takes, s, and what it returns."""
    start = perf_counter()
    result = function(*arguments)
    return perf_counter() - start, result


def of_steps(ticker, variant, law, load):
    """Return how long a ``Simulation.step`` takes, s."""
    with mock.patch.object(core, 'Ticker', ticker):
        simulation = Simulation(variant, DT, loss_law=law)

    def run():
        for T in load:
            simulation.step(T)
    return seconds(run)[0] / len(load)


def measure(variant, law, members, ticks):
    """Return the numbers of a row: s to make one, s of a tick by threads, s of a step."""
    load = [CATALOGUE[variant].mechanism.load(n * DT) for n in range(ticks)]
    rows = np.array(load)
    sets = [{}] * members
    found = [seconds(lambda: Ensemble(variant, sets, DT, loss_law=law))[0] / members]
    lanes = core._chosen('').LANES
    for threads, at_once in ((1, lanes[-1]), (None, lanes[-1]), *((1, n) for n in lanes[:-1])):
        with mock.patch('dm_ros.ensemble.lanes_of', lambda _, at_once=at_once: at_once):
            ensemble = Ensemble(variant, sets, DT, loss_law=law, threads=threads)
        times = [seconds(ensemble.run, rows[n:n + BLOCK])[0] for n in range(0, ticks, BLOCK)]
        found.append(sum(times) / (ticks * members))
    return [*found, of_steps(core.Ticker, variant, law, load),
            of_steps(None, variant, law, load)]


def parser():
    result = argparse.ArgumentParser('ensemble', description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument('--passes', type=int, default=5, help='default: %(default)s')
    result.add_argument('--ticks', type=int, default=2000, help='default: %(default)s')
    result.add_argument('--members', type=int, default=2000,
                        help="under the paper's law a tenth of them; default: %(default)s")
    return result


def main():
    arguments = parser().parse_args()
    if not core.Ticker:
        print('ensembles: the core in C is not built or not chosen: nothing to measure')
        return
    lanes = core._chosen('').LANES
    print(f'{date.today()}, {platform.machine()}, {len(os.sched_getaffinity(0))} cores, '
          f'Python {platform.python_version()}, load average {os.getloadavg()[0]:.1f} before\n\n'
          + LEGEND.format(block=BLOCK, lanes=lanes[-1], passes=arguments.passes))
    rows = [(variant, law) for law in LOSS_LAWS for variant in ('symmetric_ode', 'lsd_ode')]
    found = {row: [] for row in rows}
    ticks = max(BLOCK, arguments.ticks // BLOCK * BLOCK)
    for _ in progress(range(arguments.passes)):
        for variant, law in rows:
            members = max(1, arguments.members // (10 if law == PAPER else 1))
            found[variant, law].append(measure(variant, law, members, ticks))
    head = HEAD + [AT_ONCE.format(n) for n in lanes[:-1]]
    print('|', ' | '.join(head), '|')
    print('|---' + '|---:' * (len(head) - 1) + '|')
    for (variant, law), runs in found.items():
        made, one, all_cores, *fewer, in_c, in_python = np.median(runs, axis=0)
        members = max(1, arguments.members // (10 if law == PAPER else 1))
        print(f'| {variant} {law} | {members} | {1e6 * made:.0f} | {1e9 * one:.1f} '
              f'| {1e9 * all_cores:.1f} | {1e6 * in_c:.2f} | {1e6 * in_python:.2f} '
              f'| {in_c / one:.1f} | {in_python / one:.0f} '
              + ''.join(f'| {1e9 * time:.1f} ' for time in fewer) + '|')


if __name__ == '__main__':
    main()
