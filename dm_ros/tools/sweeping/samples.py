# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Which sets of parameters a sweep has: a grid, a Latin hypercube or a Sobol sequence."""

import math
from typing import NamedTuple
import warnings

import numpy as np
from scipy.stats import qmc

from dm_ros.mechanism.parameters import Row

MOST = 10**8   # sets


class Axis(NamedTuple):
    """One parameter that is varied: over values, or over a range."""

    name: str
    row: Row
    values: tuple = ()
    low: float = math.nan
    high: float = math.nan
    count: int = 0        # of values of a range in a grid; 0 where it is not given
    is_log: bool = False


def axis(text, rows):
    """
    Return the ``Axis`` of ``NAME=A,B,...`` or ``NAME=LOW:HIGH[:COUNT][:log]``.

    :param rows: ``{full name: Row}`` of the parameters that may be varied.
    :raises ValueError: names the parameter and what is wrong.
    """
    name, equals, given = text.partition('=')
    if name not in rows:
        raise ValueError(f'--vary: {name}: there is no such parameter that can be varied')
    row = rows[name]
    if not equals or not given:
        raise ValueError(f'--vary: {name}: values are missing, such as {name}=LOW:HIGH')
    if ':' not in given:
        return Axis(name, row, tuple(_number(name, row, one) for one in given.split(',')))
    low, high, *more = given.split(':')
    is_log = more[-1:] == ['log']
    count = more[:-1] if is_log else more
    low, high = _number(name, row, low), _number(name, row, high)
    if not low < high:
        raise ValueError(f'--vary: {name}: {low:g} is not below {high:g}')
    if is_log and not low > 0.0:
        raise ValueError(f'--vary: {name}: {low:g} is not above 0, as it must be for log')
    if len(count) > 1 or count and not (count[0].isdecimal() and 1 < int(count[0]) <= MOST):
        raise ValueError(f'--vary: {name}: {":".join(more)!r} is not allowed, it must be COUNT, '
                         'an integer above 1, or log, or COUNT:log')
    return Axis(name, row, (), low, high, int(count[0]) if count else 0, is_log)


def _number(name, row, text):
    try:
        number = float(text)
    except ValueError:
        raise ValueError(f'--vary: {name}: {text!r} is not a number') from None
    try:
        return row.checked(name, number)
    except ValueError as error:
        raise ValueError(f'--vary: {error}') from None


def grid(axes):
    """Return ``{name: values}`` of all sets of a grid; the last axis varies fastest."""
    sizes = [len(a.values) or a.count for a in axes]
    for a, size in zip(axes, sizes):
        if not size:
            raise ValueError(f'--vary: {a.name}: a grid needs LOW:HIGH:COUNT; a range alone is '
                             'for --sobol or --latin')
    _check_count(math.prod(sizes))
    places = np.unravel_index(np.arange(math.prod(sizes)), sizes)
    return {a.name: np.array(_steps(a), float)[place] for a, place in zip(axes, places)}


def _steps(a):
    if a.values:
        return a.values
    steps = (np.geomspace if a.is_log else np.linspace)(a.low, a.high, a.count)
    if a.row.kind is int and (steps != np.round(steps)).any():
        raise ValueError(f'--vary: {a.name}: {a.count} values from {a.low} to {a.high} are no '
                         'integers; list them')
    return steps.clip(a.low, a.high)


def spread(axes, count, is_sobol, seed):
    """Return ``{name: values}`` of sets that are spread over all axes at once."""
    _check_count(count)
    for a in axes:
        if a.count:
            raise ValueError(f'--vary: {a.name}: COUNT is for a grid, not for --sobol or --latin')
    rng = np.random.default_rng(seed)
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')   # numbers that are no power of 2: the page tells
        engine = (qmc.Sobol if is_sobol else qmc.LatinHypercube)(len(axes), seed=rng)
        shares = engine.random(count)
    return {a.name: _spread(a, u) for a, u in zip(axes, shares.T)}


def _spread(a, u):
    """Return values of an axis at shares in [0, 1) of it."""
    if a.values:
        count = len(a.values)
        return np.array(a.values, float)[np.minimum(u * count, count - 1).astype(int)]
    if a.row.kind is int:
        return np.minimum(a.low + np.floor(u * (a.high - a.low + 1)), a.high)
    if a.is_log:
        ratio = math.log(a.high / a.low)
        return np.clip([a.low * math.exp(ratio * share) for share in u.tolist()], a.low, a.high)
    return np.clip(a.low + u * (a.high - a.low), a.low, a.high)


def _check_count(count):
    if not 1 <= count <= MOST:
        raise ValueError(f'{count} sets are not allowed, there may be 1 to {MOST:.0e}')
