# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
Many differentials at once: ``Ensemble`` steps one variant with many sets of parameters together.

Each member moves bit for bit like a ``Simulation`` of its own. In C they are stepped on all cores
with the interpreter free; where the core in C is not built Python does it, one after the other.
"""

from concurrent.futures import ThreadPoolExecutor
import os
import struct

import numpy as np

from dm_ros import core
from dm_ros.mechanism.sets import array_of_sets, has_clutches, named, table_of
from dm_ros.mechanism.variants import equipped, variant_named
from dm_ros.motion.checks import checked
from dm_ros.motion.models import no_solution, PASSIVE
from dm_ros.motion.packing import packed
from dm_ros.motion.simulation import Simulation

SMALL = 256        # members whose ticks are not worth a thread
COLUMNS = 20       # of what is reported of a member
# of each quantity its first column, and what gives the names of its columns
PLACES = {'velocity': (0, 'shafts'), 'position': (5, 'shafts'), 'moment': (10, 'moments'),
          'power_flow': (15, None), 'clutch_force': (16, 'clutches')}
DEADBAND = 6       # number of the dead band among those of a packed model
BLOCK = 1 << 24    # bytes of reports that a run holds while it records


class Ensemble:
    """
    Many differentials of one variant, which differ by their parameters.

    A member whose tick leads out of the range of floating point numbers has failed: all that is
    told of it is NaN until ``reset``; the others go on.

    :param variant: one of ``VARIANTS``; dt: length of a tick, s.
    :param parameters: a sequence of n mappings from full names to values that differ from the
        defaults, or of tables; or one mapping from full names to arrays (n,), or one value.
    :param initial_velocity: speeds of the two output shafts, rad/s, for all or (n, 2).
    :param threads: that step together; None for as many as there are cores for this process.
    :raises ValueError: names what is wrong, its value and what is allowed, and of which set it is.

    The others are those of ``Simulation``, for all members.
    """

    def __init__(self, variant, parameters, dt=0.001, *, loss_law=PASSIVE, substeps=1,
                 power_flow_deadband=0.0, initial_velocity=(0.0, 0.0), threads=None):
        self._variant = variant_named(variant)
        kind = self._variant.mechanism.parameters
        self._numbers = numbers = array_of_sets(kind, parameters)
        first = table_of(kind, numbers, 0)
        same = {'loss_law': loss_law, 'substeps': substeps,
                'power_flow_deadband': power_flow_deadband}
        Simulation(variant, dt, **same)   # what is the same for all is of no set
        with named(0):
            self._one = one = Simulation(variant, dt, first, **same)
        self._mechanism = equipped(self._variant.mechanism, first)
        self._check_clutches(kind, first.has_clutches)
        speeds = self._checked('initial_velocity', initial_velocity, one.outputs, -1e6, 1e6)
        self._velocity = np.ascontiguousarray(np.broadcast_to(speeds, (len(self), 2)))
        if threads is not None:
            threads = int(checked('threads', threads, lambda v: v >= 1 and v == int(v),
                                  'a positive integer'))
        self._members = (InC if core.Ticker else InPython)(self, threads)
        self.reset()

    def __len__(self):
        return len(self._numbers)

    def _check_clutches(self, kind, expected):
        """Refuse sets with clutches beside others without."""
        surfaces = has_clutches(kind, self._numbers)
        if (surfaces != expected).any():
            raise ValueError(
                f'parameters[{int((surfaces != expected).argmax())}]: {kind.prefix}.clutch: sets '
                'with friction surfaces and without any cannot be in one ensemble')

    @property
    def variant(self):
        """Name of the variant."""
        return self._variant.name

    @property
    def language(self):
        """What the ticks are made in, 'C' or 'Python', to the same bits."""
        return self._one.language

    @property
    def shafts(self):
        """Names of all shafts."""
        return self._mechanism.shafts

    @property
    def inputs(self):
        """Names of the shafts that take a torque."""
        return self._mechanism.inputs

    @property
    def outputs(self):
        """Names of the two output shafts."""
        return self._mechanism.outputs

    @property
    def clutches(self):
        """Names of the clutches that an axial force can press."""
        return self._mechanism.clutches

    @property
    def moments(self):
        """Names of the internal moments."""
        return self._mechanism.moments

    @property
    def parameters(self):
        """``{full name: array (n,)}`` of all parameters; the arrays are copies."""
        names = [name for name, _ in self._variant.mechanism.parameters.rows().values()]
        return dict(zip(names, self._numbers.T.copy()))

    @property
    def dt(self):
        """Length of a tick, s."""
        return self._one.dt

    @property
    def ticks(self):
        """Ticks since the start."""
        return self._ticks

    @property
    def time(self):
        """Simulated time, s."""
        return self._ticks * self.dt

    def reset(self):
        """Go back to the start, as ``Simulation.reset``."""
        self._ticks, self._reported = 0, None
        self._members.reset(self._velocity)

    def step(self, torques, clutch_forces=None):
        """
        Advance one tick.

        :param torques: N m, (inputs,) for all or (n, inputs).
        :param clutch_forces: N, (clutches,) for all or (n, clutches); None for none.
        :raises ValueError: for what are not as many finite numbers, or a force below 0.
        """
        T = self._checked('torques', torques, self.inputs)
        A = None if clutch_forces is None else [
            self._checked('clutch_forces', clutch_forces, self.clutches, 0.0)]
        self.run([T], A)

    def run(self, torques, clutch_forces=None, record=()):
        """
        Advance one tick for each row.

        :param torques: N m, (ticks, inputs) for all or (ticks, n, inputs).
        :param clutch_forces: N, (ticks, clutches) for all or (ticks, n, clutches).
        :param record: names of what is to be recorded, such as ``('velocity', 'moment')``.
        :return: ``{name: array}`` of these, at the end of each tick, (ticks, n, ...).
        :raises ValueError: as ``step``; nothing has moved then.
        """
        record = (record,) if isinstance(record, str) else record
        for name in record:
            if name not in PLACES:
                raise ValueError(f'record: {name!r} is not one of {", ".join(PLACES)}')
        T = self._run_of('torques', torques, self.inputs)
        A = None
        if self.clutches or clutch_forces is not None:
            none = [(0.0,) * len(self.clutches)]
            A = self._run_of('clutch_forces', none if clutch_forces is None else clutch_forces,
                             self.clutches, 0.0)
            if len(A) not in (1, len(T)):
                raise ValueError(f'clutch_forces: {len(A)} ticks, but {len(T)} of torques')
            shape = np.broadcast_shapes(T.shape[:2], A.shape[:2])
            T, A = (np.ascontiguousarray(np.broadcast_to(rows, (*shape, rows.shape[2])))
                    for rows in (T, A))
        kept = {name: [] for name in record}
        at_once = max(1, BLOCK // (8 * COLUMNS * len(self))) if record else max(1, len(T))
        for first in range(0, max(1, len(T)), at_once):   # the reports need room
            part = slice(first, first + at_once)
            told = np.empty((len(T[part]), len(self), COLUMNS)) if record else None
            self._members.step(T[part], A[part] if self.clutches else None, told)
            for name in record:
                kept[name].append(self._columns(name, blanked(told)).copy())
        self._ticks += len(T)
        self._reported = None
        return {name: np.concatenate(parts) for name, parts in kept.items()}

    def _run_of(self, what, values, names, low=-np.inf):
        """Return values over time as (ticks, 1 or n, names)."""
        rows = self._checked(what, values, names, low, is_run=True)
        if rows.ndim < 3:
            rows = rows.reshape(-1, 1, len(names))
        return rows

    def _checked(self, what, values, names, low=-np.inf, high=np.inf, is_run=False):
        """Return values as floats, one for each name last; raise ValueError for others."""
        n, wide = len(self), len(names)
        try:
            rows = np.ascontiguousarray(values, float)
        except (TypeError, ValueError):
            raise ValueError(f'{what}: they must be numbers, for {", ".join(names)}') from None
        if rows.shape[is_run:] not in ((wide,), (n, wide)):
            ticks = 'ticks, ' * is_run
            raise ValueError(
                f'{what}: they have the shape {rows.shape}, it must be ({ticks}{wide}'
                f'{"" if is_run else ","}) or ({ticks}{n}, {wide}), for '
                f'{", ".join(names) or "no clutch"}')
        bad = ~(np.isfinite(rows) & (rows >= low) & (rows <= high))
        if bad.any():
            *place, column = np.argwhere(bad)[0].tolist()
            allowed = ('finite' if low == -np.inf else f'finite and at least {low:g}'
                       if high == np.inf else f'in [{low:g}, {high:g}]')
            raise ValueError(f'{what}{place or ""}: {names[column]}: {rows[bad][0]} is not '
                             f'allowed, it must be {allowed}')
        return rows

    def _report(self):
        if self._reported is None:
            self._reported = blanked(self._members.report())
            self._reported.flags.writeable = False
        return self._reported

    def _columns(self, name, table):
        """Return what a table of reports has of a quantity."""
        first, names = PLACES[name]
        return table[..., first:first + len(getattr(self, names))] if names else table[..., first]

    @property
    def velocity(self):
        """Speeds, rad/s, (n, shafts)."""
        return self._columns('velocity', self._report())

    @property
    def position(self):
        """Angles, rad, (n, shafts)."""
        return self._columns('position', self._report())

    @property
    def moment(self):
        """Internal moments, N m, (n, moments)."""
        return self._columns('moment', self._report())

    @property
    def power_flow(self):
        """The power-flow index, (n,)."""
        return self._columns('power_flow', self._report())

    @property
    def clutch_force(self):
        """Forces on the clutches, N, (n, clutches)."""
        return self._columns('clutch_force', self._report())

    @property
    def coarse_steps(self):
        """Solver steps since the start that reached the bound of work, (n,)."""
        return self._report()[:, -2].astype(int)

    @property
    def failed(self):
        """Whether a tick led out of the range of floating point numbers, (n,)."""
        return self._report()[:, -1] > 0.0


def blanked(table):
    """Return a table of reports in which those of failed members are NaN."""
    table[table[..., -1] > 0.0, :-2] = np.nan
    return table


def lanes_of(core_in_c):
    """Return how many members share the registers of a thread, which changes no bit."""
    return max(core_in_c.LANES)


class InC:
    """The members of an ensemble in C."""

    def __init__(self, ensemble, threads):
        self._core = core._chosen('')
        self._n = n = len(ensemble)
        self._lanes = lanes_of(self._core)
        self._threads = max(1, min(threads or len(os.sched_getaffinity(0)), n // SMALL or 1))
        self._pool = ThreadPoolExecutor(self._threads) if self._threads > 1 else None
        self._models = np.zeros((n, self._core.MODEL), np.uint8)
        self._state = np.zeros((n, self._core.MEMBER), np.uint8)
        one = ensemble._one
        if one.loss_law == PASSIVE:
            self._make(ensemble)
        else:
            self._pack(ensemble)
        self._models.view(float)[:, DEADBAND] = one.power_flow_deadband

    def _make(self, ensemble):
        """Make the models in C; Python has the words for one that cannot be made."""
        one, numbers = ensemble._one, ensemble._numbers
        run = one._ticker.run
        kind = ensemble._variant.mechanism.parameters
        setup = struct.pack('7d', len(one.mechanism.gears) == 3, True,
                            one._ticker.model.lagged, bool(one.clutches), run.substeps, run.dt,
                            0.0)
        bad = min(self._all(lambda first, last: self._refused(setup, numbers, first, last)))
        if bad < self._n:
            table = table_of(kind, numbers, bad)
            with named(bad):
                raise no_solution(table)

    def _refused(self, setup, numbers, first, last):
        made = self._core.make_all(setup, numbers, self._models, first, last)
        return made if made < last else self._n

    def _pack(self, ensemble):
        """Make the models by the formulations of the paper."""
        one = ensemble._one
        kind = ensemble._variant.mechanism.parameters
        for n in range(self._n):
            table = table_of(kind, ensemble._numbers, n)
            with named(n):
                ticker = one.prepare(table)
            self._models[n] = np.frombuffer(packed(ticker.model, ticker.run), np.uint8)

    def _all(self, function):
        """Return what a function (first, last) of slices of the members returns, of all."""
        edges = [self._n * i // self._threads for i in range(self._threads + 1)]
        slices = zip(edges, edges[1:])
        if self._pool:
            return list(self._pool.map(lambda ends: function(*ends), slices))
        return [function(*ends) for ends in slices]

    def reset(self, velocity):
        self._all(lambda first, last: self._core.reset_all(
            self._models, self._state, velocity, first, last))

    def step(self, torques, forces, told):
        ticks, wide, _ = torques.shape
        self._all(lambda first, last: self._core.step_all(
            self._models, self._state, torques, forces, told, ticks, wide, int(wide > 1), first,
            last, self._lanes))

    def report(self):
        out = np.empty((self._n, COLUMNS))
        self._all(lambda first, last: self._core.report_all(
            self._models, self._state, out, first, last))
        return out


class InPython:
    """The same in Python, one after the other."""

    def __init__(self, ensemble, threads):
        one = ensemble._one
        kind = ensemble._variant.mechanism.parameters
        self._tickers = []
        for n in range(len(ensemble)):
            table = table_of(kind, ensemble._numbers, n)
            with named(n):
                self._tickers.append(one.prepare(table))
            self._tickers[-1].deadband = one.power_flow_deadband

    def reset(self, velocity):
        self._failed = [False] * len(self._tickers)
        for ticker, speeds in zip(self._tickers, velocity.tolist()):
            ticker.reset(tuple(speeds))

    def step(self, torques, forces, told):
        for n, ticker in enumerate(self._tickers):
            i = n if torques.shape[1] > 1 else 0
            commands = ([()] * len(torques) if forces is None
                        else map(tuple, forces[:, i].tolist()))
            for t, (T, A) in enumerate(zip(map(tuple, torques[:, i].tolist()), commands)):
                if not self._failed[n]:
                    self._tick(n, ticker, T, A)
                if told is not None:
                    self._tell(n, told[t, n])

    def _tick(self, n, ticker, T, A):
        try:
            ticker.tick(T, A)
        except ArithmeticError:
            self._failed[n] = True

    def report(self):
        out = np.empty((len(self._tickers), COLUMNS))
        for n, row in enumerate(out):
            self._tell(n, row)
        return out

    def _tell(self, n, row):
        """Put what member n reports into a row."""
        ticker = self._tickers[n]
        row[:] = 0.0
        _, velocity, position, _, moment, flow, force = ticker.report()
        row[:len(velocity)], row[5:5 + len(position)] = velocity, position
        row[10:10 + len(moment)], row[15], row[16:16 + len(force)] = moment, flow, force
        row[-2:] = ticker.coarse_steps, self._failed[n]
