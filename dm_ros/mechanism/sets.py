# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Many sets of parameters as one array, checked as a whole, the bad one named."""

from collections.abc import Mapping
from dataclasses import astuple
import math
from types import SimpleNamespace

import numpy as np

from dm_ros.mechanism.parameters import ClutchedParameters


def array_of_sets(kind, parameters):
    """
    Return the numbers of many sets, (n, parameters) in the order of their table.

    :param kind: the table, a subclass of ``Parameters``.
    :param parameters: a sequence of tables or of mappings from full names to values that differ
        from the defaults; or one mapping from full names to arrays (n,), or to one value for all.
    :raises ValueError: names the set, the parameter, its value and what is allowed.
    """
    numbers = (_of_columns if isinstance(parameters, Mapping) else _of_sets)(kind, parameters)
    if not len(numbers):
        raise ValueError('parameters: there must be one set at least')
    bad = np.zeros(len(numbers), bool)
    for column, (_, row) in zip(numbers.T, kind.rows().values()):
        bad |= ~((column >= row.low) & (column <= row.high))   # NaN too
        if row.above_low:
            bad |= column == row.low
        if row.kind is int:
            bad |= column != np.floor(column)
    if bad.any():
        table_of(kind, numbers, int(bad.argmax()))
    return numbers


def table_of(kind, numbers, n):
    """Return set n as a table; raise ValueError that names the set, too, where it is none."""
    with named(n):
        return kind(**{symbol: int(value) if row.kind is int and value.is_integer() else value
                       for (symbol, (_, row)), value in zip(kind.rows().items(),
                                                            numbers[n].tolist())})


def has_clutches(kind, numbers):
    """Return which of many sets, (n, parameters), give a mechanism clutches, (n,)."""
    if kind.has_clutches is True:
        return np.ones(len(numbers), bool)
    p = by_symbol(kind, numbers)
    return (p.n_F1 > 0.0) | (p.n_F2 > 0.0)


def possible(kind, numbers):
    """Return which of many sets, each within what is allowed, make no impossible mechanism."""
    p = by_symbol(kind, numbers)
    angles, places = np.unique(p.alpha, return_inverse=True)
    tangents = np.array([math.tan(angle) for angle in angles])[places]   # numpy has other bits
    good = getattr(p, 'g_F', tangents + 1.0) != 0.0
    for f, eta in zip(ClutchedParameters.f.fget(p), (p.eta_1G, p.eta_2G)):
        good &= (tangents * f == 0.0) | (tangents * f < eta * p.eta_0B)
    return good


def by_symbol(kind, numbers):
    """Return the columns of many sets as what the attributes of a table are of one."""
    p = SimpleNamespace(**dict(zip(kind.rows(), numbers.T)))
    if not hasattr(p, 'R_1'):
        p.R_1 = p.R_2 = p.R   # there is one radius
    p.g_12 = p.R_2 / p.R_1
    return p


class named:
    """A context in which a ValueError tells of which set it is."""

    def __init__(self, n):
        self._n = n

    def __enter__(self):
        pass

    def __exit__(self, kind, error, _):
        if kind is ValueError:
            raise ValueError(f'parameters[{self._n}]: {error}') from None


def _places(kind):
    return {name: n for n, (name, _) in enumerate(kind.rows().values())}


def _of_columns(kind, columns):
    places = _places(kind)
    try:
        values = {name: np.asarray(column, float) for name, column in columns.items()}
    except (TypeError, ValueError) as error:
        raise ValueError(f'parameters: an array of numbers for each name: {error}') from None
    for name in values:
        if name not in places:
            raise ValueError(f'{name}: there is no such parameter among {kind.prefix}.*')
    shapes = {column.shape for column in values.values() if column.ndim}
    if len(shapes) > 1 or any(len(shape) > 1 for shape in shapes):
        raise ValueError('parameters: the arrays must be of one length, not of '
                         f'{", ".join(map(str, sorted(shapes)))}')
    count, = shapes.pop() if shapes else (1,)
    numbers = np.tile(np.array(astuple(kind()), float), (count, 1))
    for name, column in values.items():
        numbers[:, places[name]] = column
    return numbers


def _of_sets(kind, sets):
    places = _places(kind)
    try:
        sets = list(sets)
    except TypeError:
        raise ValueError(f'parameters: {type(sets).__name__} is not a sequence of sets or a '
                         'mapping of arrays') from None
    numbers = np.tile(np.array(astuple(kind()), float), (len(sets), 1))
    for n, values in enumerate(sets):
        if isinstance(values, kind):
            numbers[n] = astuple(values)
            continue
        if not isinstance(values, Mapping):
            raise ValueError(f'parameters[{n}]: {type(values).__name__} is not '
                             f'{kind.__name__} or a mapping')
        row = numbers[n]
        for name, value in values.items():
            if name not in places or isinstance(value, (bool, str, bytes)) or (
                    not hasattr(value, '__float__')):
                with named(n):
                    kind().changed({name: value})
            row[places[name]] = value
    return numbers
