# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
What a fit is worth: intervals, correlations, and what the drive cannot tell.

Near its end a fit is linear: with J the slopes and s_c the noise of column c, the covariance of
the estimates is (sum of J_c' J_c n_c / (N_c s_c^2))^-1. It holds for noise on the measured
speeds that is independent from column to column and from time to time, with the inputs known and
the model right. N_c is how many measurements the column has, n_c how many independent ones they
are worth, as the autocorrelation of the residuals tells.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy import stats

from dm_ros.motion.adaptive import TOLERANCE

CONFIDENCE = 0.95
SIGNIFICANT = 2.0    # standard deviations; a smaller autocorrelation is taken for chance
CORRELATED = 2.0     # measurements for one independent one, from which on it is told
SHARED = 0.5         # correlation of the residuals of two columns, likewise
ROUGH, VAGUE = 0.1, 1.0   # half an interval in parts of the value: known by its size, or not even
WEAK = 0.14          # singular value of the slopes as unit vectors; a pair correlated by 0.98
MOST_OF_IT = 0.5     # share of its variance that a parameter has from one such direction
AT_LIMIT = 0.01      # standard errors, or parts of the value, from a limit
FAR_START = 5.0      # times the noise, of the first measurement from the start of the run


class Estimate(NamedTuple):
    """What is known of one parameter after a fit."""

    name: str
    unit: str
    start: float
    value: float
    low: float         # ends of its interval
    high: float
    alone_low: float   # ends of its interval if all others were known
    alone_high: float


class Worth(NamedTuple):
    """What a fit is worth."""

    estimates: tuple          # of ``Estimate``
    correlation: np.ndarray   # (parameters, parameters), of the errors of the estimates
    measured: dict            # {shaft: number of measurements}
    independent: dict         # {shaft: how many independent ones they are worth}
    warnings: tuple           # lines for who wants to use the estimates


def worth(fit, drive, initial):
    """
    Return the ``Worth`` of a ``Fit``.

    :param drive: its ``MeasuredDrive``.
    :param initial: ``{shaft: rad/s}`` that the run begins with and that were not fitted.
    """
    shafts = list(drive.speeds)
    there = np.isfinite(fit.residuals)
    series = [column[here] for column, here in zip(fit.residuals, there)]
    # what is left at the tolerance of the steps is theirs
    for_one = np.array([for_one_independent(residuals) if noise > TOLERANCE else 1.0
                        for residuals, noise in zip(series, fit.noise)])
    independent = there.sum(axis=1) / for_one
    wide = stats.t.ppf(0.5 + CONFIDENCE / 2,
                       max(1.0, independent.sum() - len(fit.parameters)))
    unit = fit.noise * np.sqrt(for_one)
    slopes = (fit.slopes / unit[:, None, None])[there]
    lengths = np.linalg.norm(slopes, axis=0)
    seen = np.flatnonzero(lengths)
    alone = np.full(len(lengths), np.inf)   # standard errors with all others known
    alone[seen] = 1 / lengths[seen]
    covariance, directions = _covariance(slopes[:, seen] / lengths[seen])
    deviation = np.sqrt(np.diag(covariance))
    error = alone.copy()
    error[seen] *= deviation
    correlation = np.eye(len(lengths))
    correlation[np.ix_(seen, seen)] = covariance / np.outer(deviation, deviation)
    estimates = tuple(
        Estimate(p.name, p.unit, p.start, p.value(z), p.value(z - wide * e), p.value(z + wide * e),
                 p.value(z - wide * a), p.value(z + wide * a))
        for p, z, e, a in zip(fit.parameters, fit.inner, error, alone))
    # how far each would go on if it could
    steps = np.zeros(len(lengths))
    steps[seen] = (slopes.T @ (fit.residuals / unit[:, None])[there])[seen] / lengths[seen]**2
    limits = dict(_at_limits(fit, alone, steps))
    relative = np.array([1 / p.size(z) for p, z in zip(fit.parameters, fit.inner)])
    barely = wide * alone * relative > VAGUE
    barely[list(limits)] = False
    warnings = [
        *_barely_seen(fit, estimates, barely),
        *_not_told_apart([estimates[k] for k in seen], directions, relative[seen] / lengths[seen],
                         barely[seen], (wide * error * relative)[seen]),
        *limits.values(), *_residuals(shafts, fit, for_one),
        *_start(drive, dict(zip(shafts, series)), initial)]
    if not fit.converged:
        warnings.append('the fit has not come to its end; begin anew with what it found')
    return Worth(estimates, correlation, dict(zip(shafts, there.sum(axis=1).tolist())),
                 dict(zip(shafts, independent.tolist())), tuple(warnings))


def for_one_independent(residuals):
    """
    Return how many of the residuals are worth one independent one, at least 1.

    That is 1 plus twice the sum of the autocorrelations, up to the first that may be chance.
    """
    count = len(residuals)
    spectrum = np.fft.rfft(residuals, 2 * count)   # as long again: the ends are not neighbours
    sums = np.fft.irfft(spectrum * spectrum.conj())[:count]
    result = 1.0
    if sums[0] > 0.0:
        for correlation in sums[1:count // 2] / sums[0]:
            if correlation < SIGNIFICANT / math.sqrt(count):
                break
            result += 2.0 * correlation
    return min(result, max(1.0, count / 2))


def _covariance(units):
    """
    Return the covariance (J' J)^-1 of slopes that are unit vectors, and its directions.

    :return: the covariance, and a list of (singular value, direction), the weakest first.
    """
    if not units.shape[1]:
        return np.empty((0, 0)), []
    _, values, directions = np.linalg.svd(units, full_matrices=False)
    # what is nothing but rounding leaves an interval without end, not a division by zero
    values = np.maximum(values, 1e-12)
    scaled = directions / values[:, None]
    return scaled.T @ scaled, list(zip(values, directions))[::-1]


def _interval(low, high):
    return f'{low:.4g} to {high:.4g}'


def _barely_seen(fit, estimates, barely):
    for e, p, is_barely in zip(estimates, fit.parameters, barely):
        if is_barely:
            yield (f'{e.name}: it hardly matters in this drive; were all others known, it could '
                   f'still be {_interval(e.alone_low, e.alone_high)}{_unit(p)}')


def _not_told_apart(estimates, directions, relative, barely, halves):
    """
    Yield a line for each direction in which the parameters can go without being noticed.

    :param estimates: those of the parameters that the directions are of, as is all that follows.
    :param relative: change of each by a unit of a direction, in parts of its value.
    :param barely: which hardly matter; halves: half of each interval in parts of the value.
    """
    variances = sum((direction / value)**2 for value, direction in directions)
    for value, direction in directions:
        if value >= WEAK:
            break
        members = np.flatnonzero((direction / value)**2 > MOST_OF_IT * variances)
        if len(members) < 2:   # several weak directions share them
            members = np.sort(np.argsort(-np.abs(direction))[:2])
        if barely[members].any() or halves[members].max() < ROUGH:
            continue
        steps = direction[members] * relative[members]
        steps *= 10.0 / steps[np.abs(steps).argmax()]   # percent
        some = [estimates[member] for member in members]
        changes = ', '.join(f'{e.name} by {step:+.2g} %' for e, step in zip(some, steps))
        joint = ', '.join(_interval(e.low, e.high) for e in some)
        alone = ', '.join(_interval(e.alone_low, e.alone_high) for e in some)
        *names, last = [e.name for e in some]
        can = 'cannot' if halves[members].max() > VAGUE else 'can hardly'
        yield (f'{", ".join(names)} and {last}: this drive {can} tell them apart, as the speeds '
               f'stay nearly the same under changes of {changes}; their intervals are {joint}, '
               f'and would be {alone} with all others known')


def _at_limits(fit, alone, steps):
    """
    Yield (index, line) of each parameter that is at a limit.

    :param alone: standard error of each with all others known.
    :param steps: by which each would go on if it could, with all others as they are.
    """
    for index, (p, z, error, step) in enumerate(zip(fit.parameters, fit.inner, alone, steps)):
        if error > VAGUE * p.size(z):
            continue
        low, high = p.inner(p.low), p.inner(p.high)
        for limit, beyond, word in ((p.low, low - z, 'less'), (p.high, z - high, 'more')):
            outward = step if word == 'more' else -step
            # the solver comes near a limit and never reaches it
            if -beyond < max(outward, AT_LIMIT * error):
                yield index, (f'{p.name}: it ends at its limit, {limit:.6g}{_unit(p)}, the drive '
                              f'asks for {word}; no interval counts as it stands')


def _unit(p):
    return '' if p.unit == '1' else f' {p.unit}'


def _residuals(shafts, fit, for_one):
    for shaft, count in zip(shafts, for_one):
        if count > CORRELATED:
            yield (f'velocity.{shaft}: its residuals are no independent noise, {count:.3g} of '
                   'them are worth one, and the intervals are wider for it; the model may lack '
                   'something')
    for second in range(len(shafts)):
        for first in range(second):
            one, other = fit.residuals[first], fit.residuals[second]
            both = np.isfinite(one) & np.isfinite(other)
            if both.sum() < 10 or min(fit.noise[first], fit.noise[second]) <= TOLERANCE:
                continue
            one, other = one[both], other[both]
            length = math.sqrt((one @ one) * (other @ other))
            share = one @ other / length if length else 0.0
            if abs(share) > SHARED:
                yield (f'velocity.{shafts[first]} and velocity.{shafts[second]}: their residuals '
                       f'go together (correlation {share:+.2f}), so they are not measured '
                       'independently, and the intervals are too narrow; leave one out by '
                       '--ignore-columns')


def _start(drive, series, initial):
    for shaft, speed in initial.items():
        if drive.times[0] > 0.0 or len(series.get(shaft, ())) < 2:
            continue
        measured = drive.speeds[shaft][0]
        # of the noise from one time to the next: a run with a wrong start is off for long
        noise = math.sqrt(np.mean(np.diff(series[shaft])**2) / 2)
        if abs(measured - speed) > FAR_START * max(noise, TOLERANCE):
            yield (f'velocity.{shaft}: it begins at {measured:.6g} rad/s and the run at '
                   f'{speed:.6g}; set initial_velocity.{shaft}, or fit it')
