# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What the paper says in words of the symmetric differential, beside what is measured here."""

from typing import NamedTuple

import numpy as np

from dm_ros.mechanism.variants import SYMMETRIC
from dm_ros.tools.comparison.measures import difference, relative_rms, switches, three_speeds
from dm_ros.tools.comparison.runs import RATE, RATES

FOUND, PARTLY, OTHERWISE, SILENT = 'found', 'in part', 'not found', 'load does not show it'


class Claim(NamedTuple):
    """A statement of the paper and ours."""

    section: str    # of the paper
    paper: str      # what it says
    here: str       # what is measured here, with the number
    verdict: str    # FOUND, PARTLY, OTHERWISE or SILENT


def verdict(holds, partly=False):
    return FOUND if holds else PARTLY if partly else OTHERWISE


def percent(part, digits=0):
    return f'{100 * part:.{digits}f} %'


def change(new, old):
    """Return a change in words, such as '+17 %' or '×2.8'."""
    if not old:
        return 'from 0'
    ratio = new / old
    return f'×{ratio:.1f}' if ratio >= 2.0 else f'{100 * (ratio - 1):+.0f} %'


def identical(runs):
    ode, dae = runs.records['symmetric_ode', RATE], runs.records['symmetric_dae', RATE]
    apart = np.abs(three_speeds(dae) - three_speeds(ode)).max()
    median = np.median(relative_rms(dae, ode))
    return Claim(
        '3.5.2', 'Signals of the two variants are almost identical.',
        f'Speeds differ by at most {apart:.1e} rad/s; the root mean square of the relative '
        f'difference (Figure 4) is {median:.1e} in the median: rounding.',
        verdict(apart <= 1e-9 * max(1.0, np.abs(three_speeds(ode)).max())))


def switching_delay(runs):
    paper = 'The two differ by a slight alternating delay in switching the power flow.'
    ticks = changes = late = 0
    for rate in RATES:
        ode, dae = runs.records['symmetric_ode', rate], runs.records['symmetric_dae', rate]
        ticks += len(ode.power_flow)
        changes += len(switches(ode.power_flow))
        late += int((ode.power_flow != dae.power_flow).sum())
    if not changes:
        return Claim('3.5.2', paper, 'The power flow never switches.', SILENT)
    return Claim(
        '3.5.2', paper,
        f'{late} of {ticks:,} ticks have another index, over {changes} switches at '
        f'{len(RATES)} rates. Both variants decide at the start of a tick, from speeds that are '
        'equal to rounding; a solver that chooses its own steps may well switch at other times.',
        verdict(late))


def tolerance(runs):
    words, better = [], []
    for rate in RATES:
        errors = [difference(runs.records[v, rate], runs.exact[rate]).speed
                  for v in ('symmetric_ode', 'symmetric_dae')]
        words.append(f'{errors[0]:.1e} and {errors[1]:.1e} at {rate:,} Hz')
        better.append(2.0 * errors[0] < errors[1])
    return Claim(
        '3.5.2', 'Variant 1 has a bit better tolerance, as imprecision accumulates from the '
        'inversion of the larger matrix in variant 2.',
        f'Largest error of variants 1 and 2, in rad/s: {"; ".join(words)}. Both are rounding; '
        'the matrices are solved once, before the run.',
        verdict(all(better)))


def counter_rotation(runs):
    r = runs.records['symmetric_ode', RATE]
    part = np.mean(r.velocity['left'] * r.velocity['right'] < 0.0)
    return Claim(
        '3.5.1', 'The side gears turn in opposite directions, as the left torque is the larger.',
        f'Left and right have opposite signs {percent(part)} of the time.',
        verdict(part > 0.5, part > 0.0))


def cost(runs):
    first, *others = runs.costs
    ratios = {variant: runs.costs[variant].ratio for variant in others}
    words = ', '.join(f'{variant} {ratio:.2f}' for variant, ratio in ratios.items())
    slower = min(ratios.values()) > 1.1
    return Claim(
        '5', 'Variant 1 computes fastest; the others are slower.',
        f'Time of a step relative to {first}, in this run: {words}. Whatever is constant is '
        'solved once, so the size of the matrices does not reach the step'
        + ('.' if runs.mechanism is SYMMETRIC else
           ', and four sign patterns of M take the place of the iteration.'),
        verdict(slower))


def symmetric_claims(runs):
    """Return the claims about the symmetric differential."""
    return [claim(runs) for claim in (
        identical, switching_delay, tolerance, counter_rotation, cost)]
