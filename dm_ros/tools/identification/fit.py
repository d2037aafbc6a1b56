# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The fit: the parameters whose run is nearest to what was measured, by least squares."""

import math
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares

from dm_ros.motion.adaptive import TOLERANCE

# of an inner parameter, to both sides, for the slopes: further down the adaptive steps begin to
# show, further up it shows that a standstill begins at another time; measured in doc/identify.md
STEP = 1e-6
WEAKEST = 1e-3     # singular value of the slopes as unit vectors; one below is made of errors
MANYFOLD = 100.0   # a range that spans more is one of orders of magnitude
PRECISION = 1e-6   # relative, of parameters, at which a fit is at its end
GAIN = 1e-3        # likewise, of half the sum of squares, which a standard error raises by 1/2
FLAT = 1e-15       # slope of the sum of squares, where nothing matters
MOST_STEPS = 100   # of a fit with given noise
INSIDE = 0.99      # of the way to an impossible mechanism, to where a range may reach
MOST_FITS = 5      # each with the noise that the one before left
SAME_NOISE = 0.05  # relative


class Parameter(NamedTuple):
    """One parameter to fit; ``inner`` is how the solver sees it."""

    name: str       # full name
    unit: str
    start: float
    low: float
    high: float
    is_log: bool    # whether ``inner`` is the logarithm, else value / scale
    scale: float

    def inner(self, value):
        """Return how the solver sees a value."""
        if self.is_log:
            return math.log(value) if value > 0.0 else -math.inf
        return value / self.scale

    def size(self, inner):
        """Return what a change by all of the value is to the solver."""
        return 1.0 if self.is_log else max(1.0, abs(inner))

    def value(self, inner):
        """Return the value of what the solver sees, within the range whatever that is."""
        inner = min(max(inner, self.inner(self.low)), self.inner(self.high))
        value = math.exp(inner) if self.is_log else inner * self.scale
        return float(min(max(value, self.low), self.high))


def parameter(name, entry, start, limits=None):
    """
    Return the ``Parameter`` of a ``Row``.

    Where zero is not allowed and the range spans orders of magnitude, as of an inertia, the
    logarithm is fitted; else the value, in parts of that at the start.

    :param start: value to begin with; limits: ``(low, high)``, None for what the row allows.
    :raises ValueError: names the parameter and says what is wrong.
    """
    if entry.kind is not float:
        raise ValueError(f'{name}: a number of things cannot be fitted; sweep it'
                         if entry.kind is int else f'{name}: it is no number that can be fitted')
    low, high = limits or (entry.low, entry.high)
    for limit in (low, high):
        if not entry.low <= limit <= entry.high:
            raise ValueError(f'{name}: the limit {limit!r} is not allowed, it must be '
                             f'{entry.allowed}')
    if not low < high:
        raise ValueError(f'{name}: the limits {low!r} and {high!r} leave nothing between them')
    if not low <= start <= high:
        raise ValueError(f'{name}: it starts at {start!r}, outside of {low!r} to {high!r}; '
                         'give another start by --params')
    if start == 0.0 and limits is None:
        raise ValueError(f'{name}: it starts at 0, so its size is not known; give its range, '
                         f'{name}=LOW:HIGH')
    is_log = (entry.low > 0.0 or entry.low == 0.0 and entry.above_low) and (
        entry.high > 1.0 and entry.high >= MANYFOLD * entry.low)
    return Parameter(name, entry.unit, start, low, high, is_log, abs(start) or high - low)


def within_reach(p, table):
    """
    Return a ``Parameter`` whose range ends where the table makes an impossible mechanism.

    Such as by a clutch that locks itself, with all others at the start: a fit follows a limit,
    and is lost at a wall that it does not know.
    """
    def is_possible(value):
        try:
            table.changed({p.name: value})
        except ValueError:
            return False
        return True

    def reach(end):
        if is_possible(end):
            return end
        good, bad = p.start, end
        for _ in range(60):
            middle = (good + bad) / 2
            good, bad = (middle, bad) if is_possible(middle) else (good, middle)
        return p.start + INSIDE * (good - p.start)
    if not table.part_of({p.name: p.start}):   # a speed at the start
        return p
    return Parameter(p.name, p.unit, p.start, reach(p.low), reach(p.high), p.is_log, p.scale)


class Fit(NamedTuple):
    """What least squares found."""

    parameters: tuple       # of ``Parameter``
    inner: np.ndarray       # (parameters,) where it ended, as the solver sees it
    speeds: np.ndarray      # (columns, times) of the run there, rad/s
    residuals: np.ndarray   # (columns, times) measured less run, rad/s, NaN where not measured
    slopes: np.ndarray      # (columns, times, parameters) of the speeds, rad/s per inner unit
    noise: np.ndarray       # (columns,) rad/s, what the residuals of each column are weighed by
    converged: bool
    runs: int               # of the drive

    @property
    def estimates(self):
        """Return ``{full name: value}``."""
        return {p.name: p.value(z) for p, z in zip(self.parameters, self.inner)}


class _Squares:
    """The sum of squares and its slopes, as functions of what the solver sees."""

    def __init__(self, runs, parameters):
        self._runs, self._parameters = runs, parameters
        self._measured = np.array(list(runs.drive.speeds.values()))
        self._there = np.isfinite(self._measured)
        self._speeds_at = self._slopes_at = None, None   # the last place, and what is there
        self.bounds = (np.array([p.inner(p.low) for p in parameters]),
                       np.array([p.inner(p.high) for p in parameters]))
        self.noise = np.ones(len(self._measured))
        self.count = 0

    def speeds(self, inner):
        if not np.array_equal(inner, self._speeds_at[0]):
            self._speeds_at = inner.copy(), self._all([inner])[0]
        return self._speeds_at[1]

    def _all(self, places):
        self.count += len(places)
        return self._runs.speeds(
            [{p.name: p.value(z) for p, z in zip(self._parameters, place)} for place in places],
            f'run {self.count} of the fit')

    def residuals(self, inner):
        return self._measured - self.speeds(inner)

    def slopes(self, inner):
        """Return the slopes of the speeds, (columns, times, parameters)."""
        if not np.array_equal(inner, self._slopes_at[0]):
            self._slopes_at = inner.copy(), self._slopes(inner)
        return self._slopes_at[1]

    def _slopes(self, inner):
        here, (low, high) = self.speeds(inner), self.bounds
        sizes = [p.size(z) for p, z in zip(self._parameters, inner)]
        places = []
        for index, size in enumerate(sizes):
            for step in (-STEP * size, STEP * size):
                place = inner.copy()
                place[index] = min(max(inner[index] + step, low[index]), high[index])
                places.append(place)
        speeds = self._all(places)
        slopes = np.zeros((*here.shape, len(inner)))
        for index, size in enumerate(sizes):
            ends = []
            for at in (2 * index, 2 * index + 1):
                # where no mechanism is possible the way is one-sided
                is_run = np.isfinite(speeds[at]).all()
                ends.append((places[at][index], speeds[at]) if is_run else (inner[index], here))
            (z_0, low_end), (z_1, high_end) = ends
            difference = high_end - low_end
            # what is less for all of the value is nothing but rounding
            if np.abs(difference).max() * size > TOLERANCE * (z_1 - z_0):
                slopes[..., index] = difference / (z_1 - z_0)
        return slopes

    def weighed(self, inner):
        residuals = (self.residuals(inner) / self.noise[:, None])[self._there]
        # the solver takes a shorter step from where it cannot be
        return np.where(np.isfinite(residuals), residuals, np.inf)

    def weighed_slopes(self, inner):
        slopes = -(self.slopes(inner) / self.noise[:, None, None])[self._there]
        lengths = np.linalg.norm(slopes, axis=0)
        lengths[lengths == 0.0] = 1.0
        left, values, right = np.linalg.svd(slopes / lengths, full_matrices=False)
        values[values < WEAKEST] = 0.0   # a way that nothing tells is not to be gone
        return left * values @ right * lengths

    def noise_left(self, inner):
        """Return the root mean square of the residuals of each column, less what was fitted."""
        counts = self._there.sum(axis=1)
        free = counts * (1.0 - len(inner) / counts.sum())
        squares = np.nansum(self.residuals(inner)**2, axis=1)
        return np.maximum(np.sqrt(squares / free), TOLERANCE)


def fit(runs, parameters):
    """
    Return the ``Fit`` of some parameters to the drive of some ``Runs``.

    The residuals of all measured columns count, each in parts of its noise. That is what the
    residuals themselves show: a first fit takes it to be the same in all columns, the next one
    as that left it, until it stays. It is never taken to be below the tolerance of the steps.

    :raises ValueError: where the start cannot be run, or there are too few measurements.
    """
    squares = _Squares(runs, parameters)
    count = sum(np.isfinite(column).sum() for column in runs.drive.speeds.values())
    if count <= len(parameters):
        raise ValueError(f'{count} measured speeds are too few for {len(parameters)} parameters')
    inner = np.array([p.inner(p.start) for p in parameters])
    if not np.isfinite(squares.speeds(inner)).all():
        raise ValueError('the run with the parameters at the start leads out of the range of '
                         'floating point numbers')
    for _ in range(MOST_FITS):
        result = least_squares(squares.weighed, inner, squares.weighed_slopes, squares.bounds,
                               x_scale='jac', ftol=2 * GAIN / count, xtol=PRECISION, gtol=FLAT,
                               max_nfev=MOST_STEPS)
        inner, before = result.x, squares.noise
        squares.noise = squares.noise_left(inner)
        if np.abs(np.log(squares.noise / before)).max() < SAME_NOISE:
            break
    return Fit(tuple(parameters), inner, squares.speeds(inner), squares.residuals(inner),
               squares.slopes(inner), squares.noise, result.status > 0,
               squares.count)
