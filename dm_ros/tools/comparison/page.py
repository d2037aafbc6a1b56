# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The page of the comparison: one HTML file that holds all it shows."""

from base64 import b64encode
from html import escape
import os
import platform

import numpy as np
import scipy

from dm_ros.mechanism.variants import CATALOGUE, SELF_LOCKING, SYMMETRIC, variants_of
from dm_ros.tools.comparison.claims import FOUND, OTHERWISE, PARTLY, SILENT
from dm_ros.tools.comparison.figures import FIGURES
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
STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #222; background: #fff; max-width: 1100px;
       margin: 2em auto; padding: 0 1em; }
h1 { line-height: 1.2; } h2 { margin-top: 2.2em; border-bottom: 2px solid #222; }
table { border-collapse: collapse; margin: 1em 0; font-size: 14.5px; line-height: 1.35; }
th, td { text-align: left; vertical-align: top; padding: .4em .8em .4em 0;
         border-bottom: 1px solid #ddd; }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
tr.new td { border-top: 2px solid #aaa; }
code { font-size: 92%; white-space: nowrap; }
.natures td:nth-child(-n+4) { white-space: nowrap; }
figure { margin: 2em 0; } figure img { width: 100%; height: auto; }
figcaption { color: #444; font-size: 15px; }
.v { white-space: nowrap; font-weight: 600; }
.found { color: #1b7a34; } .part { color: #9a6400; }
.not { color: #b3261e; } .silent { color: #666; }
"""
VERDICT_CLASSES = {FOUND: 'found', PARTLY: 'part', OTHERWISE: 'not', SILENT: 'silent'}


def table(head, rows, numbers=(), kind='plain'):
    """Return a table; cells are HTML; a row that begins anew is marked by None before it."""
    def cells(tag, row):
        return ''.join(f'<{tag} class="n">{cell}</{tag}>' if n in numbers else
                       f'<{tag}>{cell}</{tag}>' for n, cell in enumerate(row))
    lines, new = [f'<tr>{cells("th", head)}</tr>'], ''
    for row in rows:
        if row is None:
            new = ' class="new"'
        else:
            lines.append(f'<tr{new}>{cells("td", row)}</tr>')
            new = ''
    return f'<table class="{kind}">\n' + '\n'.join(lines) + '\n</table>\n'


def code(text):
    return f'<code>{escape(text)}</code>'


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


def figure(name, image, caption):
    return (f'<figure id="{name.removesuffix(".png")}"><a href="{name}"><img alt="{name}" '
            f'src="data:image/png;base64,{b64encode(image).decode()}"></a>\n'
            f'<figcaption>{escape(" ".join(caption.split()))}</figcaption></figure>\n')


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
             'told <a href="#method">at the end</a>.</p>\n']
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
    return ('<!doctype html>\n<html lang="en"><head><meta charset="utf-8">\n'
            '<meta name="viewport" content="width=device-width">\n'
            f'<title>dm_ros: the variants compared</title>\n<style>{STYLE}</style></head>\n'
            f'<body>\n{"".join(parts)}</body></html>\n')
