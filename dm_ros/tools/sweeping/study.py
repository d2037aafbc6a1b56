# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
A study: what is the same for all sets, and how the metrics of some sets are computed.

It is plain data, which goes to other machines as it is. Nothing in a result depends on how many
sets are computed together, or where.
"""

from concurrent.futures import CancelledError
from dataclasses import dataclass, replace
from functools import cached_property
from hashlib import sha256
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version

import numpy as np

from dm_ros.ensemble import Ensemble
from dm_ros.mechanism.sets import array_of_sets, by_symbol, has_clutches, possible
from dm_ros.mechanism.variants import variant_named
from dm_ros.tools.sweeping.metrics import called, function_named, Metric, QUANTITIES, records

OK, FAILED, IMPOSSIBLE = STATUS = 'ok', 'failed', 'impossible'
AT_ONCE = 64        # ticks of a block
WORK = 2 * 10**7    # ticks of sets in a chunk, about
MOST_SETS = 8192    # of a chunk
ROOM = 1 << 26      # bytes of whole runs that are held for a function of the user


def own_version():
    """Return the version of the package, '' where it is not installed."""
    try:
        return version('dm_ros')
    except PackageNotFoundError:
        return ''


@dataclass(frozen=True, eq=False)
class Study:
    """What is the same for all sets."""

    variant: str
    dt: float          # s
    options: dict      # of ``Ensemble``: loss_law, substeps, power_flow_deadband
    base: dict         # parameters that all have, by full name
    start: dict        # likewise, speeds of the output shafts, ``initial_velocity.<shaft>``
    torques: np.ndarray   # (ticks, inputs), N m
    forces: np.ndarray | None   # (ticks, clutches), N
    metrics: tuple     # by name
    function: str      # ``module:function``, or ''
    names: tuple       # of all metrics, those of the function too
    version: str = own_version()

    @property
    def chunk(self):
        """How many sets are computed and saved together, unless the user says."""
        return max(16, min(MOST_SETS, WORK // len(self.torques)))

    @property
    def kind(self):
        """The table of the parameters."""
        return variant_named(self.variant).mechanism.parameters

    def description(self):
        """Return what makes it this study, as plain data."""
        content = {'variant': self.variant, 'dt': self.dt, **self.options,
                   'parameters': self.base, 'initial_velocity': self.start,
                   'torques': digest(self.torques), 'metrics': list(self.names),
                   'dm_ros': self.version}
        if self.forces is not None:
            content['forces'] = digest(self.forces)
        if self.function:
            content['function'] = self.function
            path = getattr(import_module(self.function.partition(':')[0]), '__file__', None)
            if path:
                with open(path, 'rb') as file:
                    content['module of the function'] = sha256(file.read()).hexdigest()
        return content


def digest(array):
    """Return what tells an array from others."""
    array = np.ascontiguousarray(array, float)
    return sha256(repr(array.shape).encode() + array.tobytes()).hexdigest()


class Computation:
    """The metrics of some sets; ``table`` is (sets, metrics and place in ``STATUS``)."""

    def __init__(self, study, columns, threads=None, stop=None):
        """
        Compute it.

        :param columns: ``{full name: (sets,)}`` of what is varied; threads: of ``Ensemble``.
        :param stop: an ``Event`` that ends the work by ``CancelledError``, or None.
        """
        if study.version != own_version():
            raise ValueError(f'dm_ros is {own_version()} here and {study.version} where the sweep '
                             'began')
        self._study, self._threads, self._stop = study, threads, stop
        count = len(next(iter(columns.values())))
        self._start = np.stack([np.broadcast_to(columns.get(name, speed), count)
                                for name, speed in study.start.items()], axis=1)
        self._columns = {**{name: np.full(count, value) for name, value in study.base.items()},
                         **{name: values for name, values in columns.items()
                            if name not in study.start}}
        self.table = np.full((count, len(study.names) + 1), np.nan)
        self.table[:, -1] = STATUS.index(IMPOSSIBLE)
        numbers = self._numbers = array_of_sets(study.kind, self._columns)
        good, clutched = possible(study.kind, numbers), has_clutches(study.kind, numbers)
        for group in (np.flatnonzero(good & clutched), np.flatnonzero(good & ~clutched)):
            size = max(1, ROOM // (160 * len(study.torques))) if study.function else count
            for first in range(0, len(group), size):
                self._compute(group[first:first + size])

    @cached_property
    def _function(self):
        return self._study.function and function_named(self._study.function)

    def _ensemble(self, some):
        study = self._study
        return Ensemble(study.variant, {name: values[some] for name, values
                                        in self._columns.items()},
                        study.dt, initial_velocity=self._start[some], threads=self._threads,
                        **study.options)

    def _compute(self, some):
        try:
            ensemble = self._ensemble(some)
        except ValueError:   # some are beyond floating point numbers
            some = [n for n in some if self._is_one(n)]
            if not some:
                return
            ensemble = self._ensemble(some)
        study, p = self._study, by_symbol(self._study.kind, self._numbers[some])
        metrics = [Metric(name, ensemble, p) for name in study.metrics]
        needed = set().union(*(Metric.needs(name, ensemble) for name in study.metrics))
        record = QUANTITIES if study.function else sorted(needed)
        start, kept = {name: getattr(ensemble, name) for name in record}, []
        forces = study.forces if ensemble.clutches else None
        for first in range(0, len(study.torques), AT_ONCE):
            if self._stop and self._stop.is_set():
                raise CancelledError
            part = slice(first, first + AT_ONCE)
            recorded = ensemble.run(study.torques[part],
                                    None if forces is None else forces[part], record)
            for metric in metrics:
                metric.take(study.torques[part], recorded)
            if study.function:
                kept.append(recorded)
        failed = ensemble.failed
        self.table[some, -1] = np.where(failed, STATUS.index(FAILED), STATUS.index(OK))
        for place, metric in enumerate(metrics):
            self.table[some, place] = metric.value()
        if study.function:
            whole = {name: np.concatenate([part[name] for part in kept]) for name in record}
            self._call(ensemble, np.asarray(some)[~failed], ~failed, start, whole)

    def _is_one(self, n):
        try:
            self._ensemble([n])
        except ValueError:
            return False
        return True

    def _call(self, ensemble, some, good, start, whole):
        """Put what the function of the user returns into the table."""
        names = self._study.names[len(self._study.metrics):]
        everything = records(ensemble, self._study.torques, start, whole)
        runs = (record for record, is_good in zip(everything, good) if is_good)
        for n, record in zip(some, runs):
            found = called(self._study.function, self._function, record)
            if tuple(found) != names:
                raise ValueError(f'--metric: {self._study.function}: it returned '
                                 f'{", ".join(found)} and for the first run {", ".join(names)}')
            self.table[n, len(self._study.metrics):-1] = list(found.values())


def names_of(function, study):
    """Return the names of what a function of the user returns, of a run of the base."""
    one = {name: np.array([value]) for name, value in study.start.items()}
    computation = _First(replace(study, function=function, names=study.metrics), one, 1)
    return computation.names


class _First(Computation):
    names = ()

    def _call(self, ensemble, some, good, start, whole):
        for record in records(ensemble, self._study.torques, start, whole):
            self.names = tuple(called(self._study.function, self._function, record))
