# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The metrics of a run: by name, for all sets at once, or by a function of the user, one by one.

What is summed is summed tick by tick, so that no bit depends on how many sets are beside.
"""

from importlib import import_module
import os
import re
import sys
import traceback

import numpy as np

from dm_ros.files.record import Record
from dm_ros.mechanism.kinetic import energy_gained, kinetic_form

QUANTITIES = 'velocity', 'position', 'moment', 'power_flow', 'clutch_force'
STATISTICS = 'final', 'mean', 'min', 'max', 'peak', 'rms'
OTHERS = 'lost_energy', 'locked'
NAME = re.compile(r'[^,"\r\n]+')   # of a column
LOCKED = 1.0   # rad/s of slip, below which the output shafts count as locked


def columns_of(names):
    """Return ``{column: (quantity, place)}`` of what a statistic may be of; slip has no place."""
    shafts, moments, clutches = names.shafts, names.moments, names.clutches
    return {**{f'velocity.{name}': ('velocity', n) for n, name in enumerate(shafts)},
            **{f'position.{name}': ('position', n) for n, name in enumerate(shafts)},
            **{f'moment.{name}': ('moment', n) for n, name in enumerate(moments)},
            **{f'clutch_force.{name}': ('clutch_force', n) for n, name in enumerate(clutches)},
            'power_flow': ('power_flow', None), 'slip': ('velocity', None)}


def check(metric, names):
    """Raise ValueError for a metric by name that there is not."""
    statistic, _, column = metric.partition('.')
    works = [f'work.{shaft}' for shaft in names.inputs]
    if metric in OTHERS or metric in works:
        return
    if statistic not in STATISTICS or column not in columns_of(names):
        raise ValueError(
            f'--metric: {metric!r} is none of {", ".join([*OTHERS, *works])}, nor a statistic '
            f'({", ".join(STATISTICS)}) and a column, as final.slip or '
            f'max.velocity.{names.outputs[0]}; columns: {", ".join(columns_of(names))}')


class Metric:
    """One metric by name of some sets; ``take`` gets blocks of ticks, ``value`` is (sets,)."""

    def __init__(self, name, ensemble, p):
        """:param p: the parameters by their symbols, see ``sets.by_symbol``."""
        self._p = p
        self._statistic, _, self._column = name.partition('.')
        self._ensemble, self._ticks = ensemble, 0
        self._total = np.zeros(len(ensemble))
        self._value = {'min': np.inf, 'max': -np.inf}.get(self._statistic, 0.0)
        self._position = np.zeros((len(ensemble), len(ensemble.shafts)))
        self._start = self._speeds(ensemble.velocity)

    @staticmethod
    def needs(name, ensemble):
        """Return the quantities that a metric is made of."""
        statistic, _, column = name.partition('.')
        if name == 'lost_energy':
            return {'position', 'velocity'}
        if name == 'locked':
            return {'velocity'}
        if statistic == 'work':
            return {'position'}
        quantity, _ = columns_of(ensemble).get(column, (None, None))
        return {quantity} - {None}

    def take(self, torques, recorded):
        """Take a block: torques (ticks, inputs), N m; what was recorded, (ticks, sets, ...)."""
        self._ticks += len(torques)
        if self._statistic in ('work', 'lost_energy'):
            self._work(torques, recorded['position'])
        elif self._statistic == 'locked':
            for row in np.abs(self._slip(recorded)) < LOCKED:
                self._total += row
        if self._statistic in ('lost_energy', 'locked'):
            self._end = recorded['velocity'][-1]
        if self._statistic in STATISTICS:
            self._fold(self._values(recorded))

    def value(self):
        """Return the metric of each set, NaN of those that failed."""
        if self._statistic == 'mean' or self._statistic == 'locked':
            value = self._total / self._ticks
        elif self._statistic == 'rms':
            value = np.sqrt(self._total / self._ticks)
        elif self._statistic == 'work':
            value = self._total
        elif self._statistic == 'lost_energy':
            value = self._total - energy_gained(kinetic_form(self._p), self._start,
                                                self._speeds(self._end))
        else:
            value = self._value
        return np.where(self._ensemble.failed, np.nan, value)

    def _fold(self, block):
        if self._statistic == 'final':
            self._value = block[-1]
        elif self._statistic == 'min':
            self._value = np.minimum(self._value, block.min(axis=0))
        elif self._statistic == 'max':
            self._value = np.maximum(self._value, block.max(axis=0))
        elif self._statistic == 'peak':
            self._value = np.maximum(self._value, np.abs(block).max(axis=0))
        else:
            for row in block if self._statistic == 'mean' else block * block:
                self._total += row

    def _values(self, recorded):
        """Return the column, (ticks, sets); 0 of what a mechanism without clutches has not."""
        if self._column == 'slip':
            return self._slip(recorded)
        columns = columns_of(self._ensemble)
        if self._column not in columns:
            return np.zeros((1, len(self._ensemble)))
        quantity, place = columns[self._column]
        values = recorded[quantity]
        return values if place is None else values[..., place]

    @staticmethod
    def _slip(recorded):
        return recorded['velocity'][..., 1] - recorded['velocity'][..., 2]

    def _work(self, torques, positions):
        inputs, shafts = self._ensemble.inputs, self._ensemble.shafts
        at = [(n, shafts.index(shaft)) for n, shaft in enumerate(inputs)
              if self._statistic == 'lost_energy' or shaft == self._column]
        for T, position in zip(torques, positions):
            turned = position - self._position
            for n, place in at:
                self._total += T[n] * turned[:, place]
            self._position = position

    def _speeds(self, velocity):
        return velocity[:, 0], velocity[:, 1] - velocity[:, 2]   # (w, s), see ``kinetic``


def function_named(name):
    """Return the function ``module:function``; raise ValueError where there is none."""
    module, _, function = name.partition(':')
    if os.getcwd() not in sys.path:
        sys.path.insert(0, os.getcwd())
    try:
        found = getattr(import_module(module), function)
    except Exception as error:   # of the module, too
        raise ValueError(f'--metric: {name}: {type(error).__name__}: {error}') from None
    if not callable(found):
        raise ValueError(f'--metric: {name}: it is no function')
    return found


def records(ensemble, torques, start, recorded):
    """Yield the ``Record`` of each set: a row for the start, then one for the end of each tick."""
    ticks = len(torques)
    time = np.arange(ticks + 1)[:, np.newaxis] * ensemble.dt
    torques = np.concatenate([np.zeros_like(torques[:1]), torques])
    whole = {name: np.concatenate([start[name][np.newaxis], recorded[name]])
             for name in QUANTITIES}
    for n in range(len(ensemble)):
        velocity, position, moment, flow, force = (whole[name][:, n] for name in QUANTITIES)
        yield Record(ensemble, np.hstack([time, velocity, position, torques, moment,
                                          flow[:, np.newaxis], force]), ensemble.variant)


def called(name, function, record):
    """Return what a function of the user makes of a ``Record``, ``{name: number}``."""
    try:
        found = function(record)
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        raise ValueError(f'--metric: {name}: {type(error).__name__}: {error}, in '
                         f'{place.filename}:{place.lineno}') from None
    named = found if hasattr(found, 'items') else {name.partition(':')[2]: found}
    for key, value in named.items():
        if not NAME.fullmatch(str(key)):
            raise ValueError(f'--metric: {name}: it returned the name {key!r}, which must not '
                             'have commas, quotes or line breaks')
        if not isinstance(value, (int, float, np.number, np.bool_)):
            raise ValueError(f'--metric: {name}: it returned {value!r}, a number is needed, or '
                             'numbers by name')
    return {str(key): float(value) for key, value in named.items()}
