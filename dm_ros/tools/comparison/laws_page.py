# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The page on both laws of losses: a picture and a table for each mechanism."""

import numpy as np

from dm_ros.motion.models import PAPER, PASSIVE
from dm_ros.tools.comparison.figures import finish, new_figure
from dm_ros.tools.comparison.laws import CASES, LOAD
from dm_ros.tools.comparison.markup import code, document, figure, table
from dm_ros.tools.comparison.page import TITLES
from dm_ros.tools.comparison.runs import RATE

TOOK, GAVE, PASSIVE_COLOR = '#8a8a8a', '#d1441f', '#1f6fb5'


def picture_name(mechanism):
    return f'laws-{mechanism.name}.png'


def picture(mechanism, outcomes):
    """Return the figure: what gears and bearings take and give back, and what comes of it."""
    fig = new_figure('What gears and bearings take (right) and give back (left, red)', 12, 7.5)
    grid = fig.add_gridspec(2, 2, width_ratios=[1.25, 1.0])
    bars, energy, speed = (fig.add_subplot(cell) for cell in (grid[:, 0], grid[0, 1], grid[1, 1]))

    names = list(outcomes)
    for row, name in enumerate(names):
        for outcome in outcomes[name]:
            at = row + (0.2 if outcome.law == PAPER else -0.2)
            lost = elements(mechanism, outcome)
            given, whole = outcome.returned.sum(), max(outcome.energy_in, 1e-9)
            bars.barh(at, 100 * (lost + given) / whole, 0.36,
                      color=TOOK if outcome.law == PAPER else PASSIVE_COLOR,
                      label=f'taken, {outcome.law}' if not row else None)
            if outcome.law == PAPER:
                bars.barh(at, -100 * given / whole, 0.36, color=GAVE,
                          label='given back, paper' if not row else None)
    bars.set_yticks(range(len(names)), names)
    bars.invert_yaxis()
    bars.axvline(0.0, color='#222222', linewidth=0.8)
    bars.set_xlabel('% of the energy that the torques bring in')
    bars.set_title('(a) in each case', loc='left', fontsize=10)
    bars.grid(alpha=0.25, axis='x')
    bars.spines[['top', 'right']].set_visible(False)
    bars.legend(loc='upper center', bbox_to_anchor=(0.5, -0.09), ncols=3, frameon=False,
                fontsize=8.5)

    for outcome in outcomes[LOAD]:
        taken = sum(outcome.lost[name] for name in mechanism.gears + mechanism.bearings)
        falls, taken = taken < 0.0, np.cumsum(taken)
        time = np.arange(1, len(taken) + 1) / RATE
        color = '#222222' if outcome.law == PAPER else PASSIVE_COLOR
        energy.plot(time, taken, color=color, linewidth=1.2, label=outcome.law)
        if outcome.law == PAPER:
            energy.plot(time, np.where(falls, taken, np.nan), color=GAVE, linewidth=2.4,
                        label='paper, while they give')
    energy.set_title(f'(b) taken since the start, {LOAD}', loc='left', fontsize=10)
    energy.set_ylabel('energy, J')
    energy.legend(loc='upper left', frameon=False, fontsize=8.5)
    finish(energy, time)

    for outcome in outcomes['rest']:
        time = np.arange(1, len(outcome.carrier) + 1) / RATE
        speed.plot(time, outcome.carrier, label=outcome.law, linewidth=1.2,
                   color=GAVE if outcome.law == PAPER else PASSIVE_COLOR)
    speed.set_title('(c) carrier under torques that balance, from rest', loc='left', fontsize=10)
    speed.set_ylabel('speed, rad/s')
    speed.legend(loc='upper left', frameon=False, fontsize=8.5)
    finish(speed, time)
    return fig


def elements(mechanism, outcome):
    """Return what gears and bearings have lost in all, J."""
    return float(sum(outcome.lost[name].sum() for name in mechanism.gears + mechanism.bearings))


def balance_rows(mechanism, outcomes):
    """Return the rows of the table of energies, for each case one for each law."""
    for name, outcome, first in each(outcomes):
        if first:
            yield None
        back = outcome.returned
        yield [f'<b>{name}</b>' if first else '', code(outcome.law),
               f'{outcome.energy_in:,.0f}', f'{outcome.energy_out:,.0f}',
               f'{elements(mechanism, outcome):,.0f}', f'{back.sum():,.0f}',
               f'{100 * np.count_nonzero(back) / len(back):.0f} %',
               f'{outcome.switches:,}', f'{round(outcome.carrier[-1], 2) + 0.0:.2f}']


def place_rows(outcomes):
    """Return the rows of the table of places, for each case one for each law."""
    for name, outcome, first in each(outcomes):
        if first:
            yield None
        yield [f'<b>{name}</b>' if first else '', code(outcome.law),
               *(f'{lost.sum():,.0f}' for lost in outcome.lost.values())]


def each(outcomes):
    """Yield name and ``Outcome`` of each case and law, and whether it is the first of a case."""
    for name, pair in outcomes.items():
        for n, outcome in enumerate(pair):
            yield name, outcome, not n


BALANCE = ['case', 'law', 'in, J', 'out, J', 'lost in gears<br>and bearings, J',
           'given back, J', 'in ticks', 'switches<br>of the index', 'carrier at the<br>end, rad/s']
INTRODUCTION = """
<p>The law of losses decides when an efficiency takes power. Under {paper} the power-flow index
decides for all gears and bearings at once; where the power through one of them runs the other
way, its loss becomes a gain. Under {passive}, the default, each decides by the power through
itself, and none ever gives anything back. Where all powers run one way, both are the same.</p>
<p>Energy is counted in every tick at {rate:,} Hz: what torques bring in and take out, and what
each gear and bearing takes. “Given back” is the sum over ticks and elements in which one gave more
than it took. The way back to <a href="index.html">the comparison with the paper</a>.</p>
"""


def laws_page(comparisons, source):
    """
    Return the page as text.

    :param comparisons: of (``Mechanism``, outcomes of ``laws.run``, PNG), one for each mechanism.
    :param source: where load and parameters come from, in words.
    """
    parts = ['<h1>Both laws of losses, side by side</h1>\n',
             INTRODUCTION.format(paper=code(PAPER), passive=code(PASSIVE), rate=RATE),
             f'<p>{source}</p>\n']
    for mechanism, outcomes, image in comparisons:
        places = outcomes[LOAD][0].lost
        parts += [
            f'<h2 id="{mechanism.name}">{TITLES[mechanism]}</h2>\n',
            figure(picture_name(mechanism), image, ''),
            table(BALANCE, balance_rows(mechanism, outcomes), numbers=range(2, len(BALANCE))),
            '<h3>Where it is lost, J</h3>\n',
            table(['case', 'law', *(place.replace('_', '<br>') for place in places)],
                  place_rows(outcomes), numbers=range(2, 2 + len(places)))]
    parts += ['<h2>The cases</h2>\n', table(['case', 'what is done', 'for'], [
        [f'<b>{name}</b>', case.words, f'{case.seconds:g} s'] for name, case in CASES.items()])]
    return document('dm_ros: both laws of losses', ''.join(parts))
