# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What the paper says in words of the self-locking differential, beside what is measured here."""

import math

import numpy as np

from dm_ros.tools.comparison.claims import change, Claim, cost, percent, SILENT, verdict
from dm_ros.tools.comparison.measures import (
    all_moments,
    CLEAR,
    difference,
    gear_share,
    lags,
    LOCKED,
    longest_stretch,
    near,
    order,
    rms,
    SLIDING,
    switches,
    three_speeds,
    TRANSITION,
)
from dm_ros.tools.comparison.runs import RATE, RATES


def forty_sixty(runs):
    record = runs.records['lsd_ode', RATE]
    paper = 'The gear moments keep the ratio M₁ : M₂ of about 40 : 60.'
    shares, mask = gear_share(record)
    if not len(shares):
        return Claim('4.8.2', paper, 'There are no gear moments.', SILENT)
    base = 1 / (1 + runs.parameters.g_12)
    median, low, high = np.percentile(shares, [50, 5, 95])
    within = np.mean(np.abs(shares - base) < 0.01)
    return Claim(
        '4.8.2', paper,
        f'Median {100 * median:.1f} : {100 * (1 - median):.1f}, where the design has '
        f'{100 * base:.0f} : {100 * (1 - base):.0f}; {percent(within)} of the time within one '
        f'point of it, 90 % of the time between {100 * low:.0f} and {100 * high:.0f}. It leaves '
        f'the ratio while slip accelerates, as the satellites take their share (counted where '
        f'M₁ + M₂ exceeds a tenth of its peak, {percent(mask.mean())} of the time).',
        verdict(abs(median - base) < 0.01 and within > 0.95, abs(median - base) < 0.01))


def moment_lag(runs):
    paper = 'The moments of variant 1 may lag in phase behind intensive changes of the load.'
    words, found = [], []
    for rate in RATES:
        lag = lags(runs.records['lsd_lagged', rate], runs.exact[rate], rate)
        if np.isfinite(lag).all():
            found.append(lag)
            ms = 1e3 / rate
            words.append(f'{rate:,} Hz: M₁ {lag[0]:.2f}, M₂ {lag[1]:.2f}, F₁ {lag[2]:.2f}, '
                         f'F₂ {lag[3]:.2f} ticks (F₂ {lag[3] * ms:.3g} ms)')
    if not found:
        return Claim('4.8.1', paper, 'There is too little steady sliding to measure it.', SILENT)
    return Claim(
        '4.8.1', paper,
        f'Lag behind the exact moments in steady sliding (more than {SLIDING:g} rad/s of slip, '
        f'{1e3 * CLEAR:g} ms from any change): {"; ".join(words)}. A clutch moment lags by the '
        'one tick of its |M|, and more where the gear moment that it follows lags too. Locked, '
        'the moments follow from the load and do not lag.',
        verdict(np.max(found) > 0.5))


def good_speeds(runs):
    words, shares = [], []
    for rate in RATES:
        d = difference(runs.records['lsd_lagged', rate], runs.exact[rate])
        shares.append(d.relative_speed)
        words.append(f'{rate:,} Hz: {percent(d.relative_speed, 3)} (moments '
                     f'{percent(d.relative_moment, 3)}), at most {d.speed:.2g} rad/s')
    exponent = order(runs, 'lsd_lagged', 'speed')
    falls = '' if math.isnan(exponent) else (
        f' The largest error falls with the power {exponent:.2f} of the step.')
    return Claim(
        '4.8.1', 'Yet the kinematic accuracy of variant 1 is relatively high.',
        f'Root mean square of the error of speeds, relative: {"; ".join(words)}.{falls}',
        verdict(max(shares) < 0.002, shares[1] < 0.002))


def locked(runs):
    paper = 'There are sections where the speeds of carrier and outputs coincide.'
    record = runs.records['lsd_ode', RATE]
    mask = np.abs(record.slip) < LOCKED
    creep = rms(record.slip[mask]) if mask.any() else 0.0
    without = np.mean(np.abs(runs.without.slip) < LOCKED)
    return Claim(
        '4.8.2', paper,
        f'Locked, with less than {LOCKED:g} rad/s of slip, {percent(mask.mean())} of the time; '
        f'the longest section lasts {longest_stretch(mask) / RATE:.2f} s. Without proportional '
        f'friction: {percent(without, 1)}. They coincide to within the creep of the smooth '
        f'friction, {creep:.2f} rad/s in the root mean square.',
        verdict(longest_stretch(mask) / RATE > 0.1))


def friction_signs(runs):
    record = runs.records['lsd_ode', RATE]
    carrier, front, rear = three_speeds(record).T
    power = np.minimum(record.moment['front_clutch'] * (front - carrier),
                       record.moment['rear_clutch'] * (rear - carrier))
    part = np.mean(power >= 0.0)
    return Claim(
        '4.8.2', 'Friction takes from the outrunning shaft and adds to the lagging one.',
        f'Both clutch moments oppose the slip of their shafts {percent(part, 1)} of the time.',
        verdict(part > 0.999))


def growth(runs):
    with_, without = runs.records['lsd_ode', RATE], runs.without
    largest = {name: [np.abs(r.velocity[name]).max() for r in (with_, without)]
               for name in ('carrier', 'front', 'rear')}
    speeds = [f'{name} {a:.0f} to {b:.0f}' for name, (a, b) in largest.items()]
    grown = rms(three_speeds(without)) / max(rms(three_speeds(with_)), 1e-300)
    return Claim(
        '4.8.2', 'Without proportional friction the angular speeds grow essentially.',
        f'Largest speeds, in rad/s: {", ".join(speeds)}; root mean square '
        f'{change(grown, 1.0)}.',
        verdict(grown > 1.2, grown > 1.0))


def gear_growth(runs):
    with_, without = runs.records['lsd_ode', RATE].moment, runs.without.moment
    ratios = {name: rms(without[name]) / max(rms(with_[name]), 1e-300)
              for name in ('front_mesh', 'rear_mesh')}
    peaks = {name: change(np.abs(without[name]).max(), np.abs(with_[name]).max())
             for name in ratios}
    left = {name: rms(without[name]) / max(rms(with_[name]), 1e-300)
            for name in ('front_clutch', 'rear_clutch')}
    fewer = ratios['rear_mesh'] < 1.0
    return Claim(
        '4.8.2', 'Without it |M₁| and |M₂| grow: the output torques pass through the crown gears '
        'alone.',
        f'Root mean square of M₁ {change(ratios["front_mesh"], 1.0)} (peak '
        f'{peaks["front_mesh"]}), of M₂ {change(ratios["rear_mesh"], 1.0)} (peak '
        f'{peaks["rear_mesh"]}); of F₁ and F₂ {percent(left["front_clutch"])} and '
        f'{percent(left["rear_clutch"])} remain. '
        + ('M₂ falls: where the rear shaft outruns, its mesh has to carry the drag of its '
           'clutch on top of the load.' if fewer else ''),
        verdict(min(ratios.values()) > 1.05, max(ratios.values()) > 1.0))


def two_and_three(runs):
    ode, dae = runs.records['lsd_ode', RATE], runs.records['lsd_dae', RATE]
    apart = np.abs(three_speeds(dae) - three_speeds(ode)).max(axis=1)
    moments = np.abs(all_moments(dae) - all_moments(ode)).max()
    changes = switches(ode.power_flow)
    first = changes[0] if len(changes) else len(apart)
    before = apart[:first].max()
    after = apart[first:].max(initial=0.0)
    return Claim(
        '4.8.1', 'Variants 2 and 3 deviate minimally until the direction first changes; each '
        'change then brings an error that stays.',
        f'Largest difference of speeds {before:.1e} rad/s before the first change, {after:.1e} '
        f'after it; of moments {moments:.1e} N m. Rounding throughout: both decide the '
        'direction at the same tick, and M is found without iteration.',
        verdict(after > 1e-6))


def steady_direction(runs):
    paper = 'The fewer changes of direction, the closer the variants.'
    lagged, ode = runs.records['lsd_lagged', RATE], runs.records['lsd_ode', RATE]
    apart = np.abs(three_speeds(lagged) - three_speeds(ode)).max(axis=1)
    changes = switches(ode.power_flow)
    if not len(changes):
        return Claim('4.8.1', paper, 'The direction never changes.', SILENT)
    mask = near(changes, len(apart), round(TRANSITION * RATE))
    free = np.abs(ode.slip) >= LOCKED
    parts = [rms(apart[part]) if part.any() else 0.0 for part in (mask, ~mask, ~free, free)]
    before, after = apart[:changes[0]].max(), apart[changes[0]:].max()
    return Claim(
        '4.8.1', paper,
        f'Variants 2 and 1: at most {before:.2g} rad/s apart before the first of '
        f'{len(changes)} changes, {after:.2g} after it. Root mean square {parts[0]:.2g} '
        f'within {TRANSITION:g} s after a change and {parts[1]:.2g} elsewhere; {parts[2]:.2g} '
        f'locked and {parts[3]:.2g} sliding'
        + (': here it is sliding that drives them apart, and locking that brings them together '
           'again.' if parts[3] > 2.0 * parts[2] else '.'),
        verdict(parts[0] > 1.5 * parts[1], before < after))


def self_locking_claims(runs):
    """Return the claims about the self-locking differential."""
    return [claim(runs) for claim in (
        forty_sixty, moment_lag, good_speeds, locked, friction_signs, growth, gear_growth,
        two_and_three, steady_direction, cost)]
