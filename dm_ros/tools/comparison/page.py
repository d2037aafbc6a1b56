# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The page of the comparison: one HTML file that holds all it shows."""

from html import escape
import os
import platform

import numpy as np
import scipy

from dm_ros.mechanism.variants import CATALOGUE, SELF_LOCKING, SYMMETRIC, variants_of
from dm_ros.tools.comparison.claims import FOUND, OTHERWISE, PARTLY, SILENT
from dm_ros.tools.comparison.figures import FIGURES
from dm_ros.tools.comparison.markup import code, document, figure, table
from dm_ros.tools.comparison.measures import difference
from dm_ros.tools.comparison.runs import PASSES, RATE, RATES, TIMED_TICKS

GIVEN = {   # what a solution of a variant holds, and what must be computed from it
    'symmetric_ode': ('speeds of the outputs',
                      'speeds of carrier, pinion, satellite, (5); all three moments, (10), (17)'),
    'symmetric_dae': ('all speeds, all moments', 'nothing'),
    'lsd_lagged': (
        'speeds of the outputs',
        'speeds of carrier and satellite, (53); M, (68), (70); F from |M| of the last step'),
    'lsd_ode': ('speeds of the outputs, M', 'speeds of carrier and satellite, (53); F, (56)'),
    'lsd_dae': ('all speeds, M', 'F, (56)'),
}
TITLES = {SYMMETRIC: 'Symmetric differential with final drive',
          SELF_LOCKING: 'Asymmetric self-locking differential'}
VERDICT_CLASSES = {FOUND: 'found', PARTLY: 'part', OTHERWISE: 'not', SILENT: 'silent'}


def judgement(runs):
    """Return the table of what the variants are and cost."""
    rows = []
    for variant, cost in runs.costs.items():
        nature, rows_of_matrix = CATALOGUE[variant], len(CATALOGUE[variant].unknowns.split())
        rows.append([code(variant), nature.section, nature.unknowns,
                     f'{rows_of_matrix}×{rows_of_matrix}', *GIVEN[variant],
                     f'{cost.seconds * 1e6:.2f}', f'{cost.ratio:.2f}'])
    return table(['variant', 'paper', 'unknowns', 'matrix', 'given directly', 'recovered',
                  'µs a step', 'ratio'], rows, numbers=(6, 7), kind='natures')


def accuracy(runs):
    """Return the table of differences to the exact solution."""
    rows = []

    def row(variant, rate, words, exact):
        d = difference(runs.records[variant, rate], exact)
        rows.append([words, f'{rate:,} Hz', *(f'{value:.2g}' for value in d[:4]),
                     f'{d.other_index} of {len(exact.power_flow):,}'])
    for variant in variants_of(runs.mechanism):
        rows.append(None)
        for rate in RATES:
            row(variant, rate, code(variant), runs.exact[rate])
    if runs.frozen:
        rows.append(None)
        for rate in RATES:
            row('lsd_lagged', rate, f'{code("lsd_lagged")} to its own yardstick',
                runs.frozen[rate])
    return table(['variant', 'rate', 'speeds, largest, rad/s', 'RMS', 'moments, largest, N m',
                  'RMS', 'ticks of other index'], rows, numbers=(1, 2, 3, 4, 5, 6))


def words(found):
    """Return the table of claims."""
    return table(['paper', 'it says', 'measured here', ''], [
        [claim.section, escape(claim.paper), escape(claim.here),
         f'<span class="v {VERDICT_CLASSES[claim.verdict]}">{claim.verdict}</span>']
        for claim in found])


def differing(runs):
    """Return the parameters that are not the defaults, in words."""
    now, default = runs.parameters.named(), type(runs.parameters)().named()
    changes = [f'{code(name)} {value:g}' for name, value in now.items() if value != default[name]]
    return ', '.join(changes) or 'the defaults'


def machine():
    """Return machine and versions in words."""
    cpu = platform.processor() or platform.machine()
    try:
        with open('/proc/cpuinfo') as lines:
            cpu = next(line.split(':')[1].strip() for line in lines if 'model name' in line)
    except (OSError, StopIteration):
        pass
    return (f'{cpu}, {os.cpu_count()} cores, {platform.system()}, '
            f'Python {platform.python_version()}, numpy {np.__version__}, '
            f'scipy {scipy.__version__}')


METHOD = """
<h2 id="method">How it was measured</h2>
<p>Figures, words and costs are at {rate:,} Hz, torques held within a tick. <b>A step</b> is
<code>Simulation.step</code> with its snapshot, on this machine, in one run: the median of
{passes} passes over up to {ticks:,} ticks, in which the variants take turns; the ratio to the
first variant is the median of those within a pass. These are the only numbers on this page that
change from run to run. Machine: {machine}.</p>
<p><b>The exact solution</b> decides the power-flow index at the start of each tick, as the
variants do. For the symmetric differential it is a matrix exponential in extended precision, for
the self-locking one LSODA of scipy at 1e-11, begun anew in each tick, with the clutch friction at
the moments of the same instant. The yardstick of the lagged variant's own is the same, with |M|
frozen at the end of the preceding tick. Speeds are those of the carrier and the two outputs,
moments all internal ones, both at the ends of the ticks; RMS is the root mean square. A moment
jumps with the index and falls steeply where a clutch lets go, so its largest difference is that of
one tick.</p>
<p>The paper is Diachuk and Easa, "Improved models of vehicle differential mechanisms using
various approaches". It gives its loads as pictures and no crown radii, friction radii or
preloads, so its curves cannot be met number by number; what can be compared is what it says.</p>
"""


def page(comparisons, source):
    """
    Return the page as text.

    :param comparisons: of (``Runs``, claims, {file: PNG}), one for each mechanism.
    :param source: where load and parameters come from, in words.
    """
    parts = ['<h1>The variants of two differentials, compared</h1>\n',
             f'<p>All variants of a mechanism on the same load, beside the exact solution and '
             f'beside the paper that they come from. {escape(source)} How it was measured is '
             'told <a href="#method">at the end</a>.</p>\n'
             f'<p>All of this is under the law of losses {code("paper")}. How the default, '
             f'{code("passive")}, differs is on <a href="laws.html">a page of its own</a>.</p>\n']
    for runs, found, images in comparisons:
        parts += [f'<h2 id="{runs.mechanism.name}">{TITLES[runs.mechanism]}</h2>\n',
                  f'<p>{runs.load.seconds:g} s of load; parameters: {differing(runs)}.</p>\n',
                  '<h3>What each variant is, gives and costs</h3>\n', judgement(runs),
                  '<h3>Difference to the exact solution</h3>\n', accuracy(runs),
                  '<h3>What the paper says, and what is found</h3>\n', words(found),
                  '<h3>Figures</h3>\n']
        parts += [figure(name, image, FIGURES[name][2]) for name, image in images.items()]
    parts.append(METHOD.format(rate=RATE, passes=PASSES, ticks=TIMED_TICKS,
                               machine=escape(machine())))
    return document('dm_ros: the variants compared', ''.join(parts))
