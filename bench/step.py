# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The benchmark: what a step costs, beside other tools, and how exact it is.

It prints Markdown tables. Run ``make bench``; ``python bench/step.py --help`` has the options.
"""

import argparse
from datetime import date
import gc
from importlib.metadata import PackageNotFoundError, version
import os
import platform
from time import perf_counter
from typing import Callable, NamedTuple
from unittest import mock

import numpy as np
import peers
from peers import AllHinges, Control, lossless, MatrixPair, SolveIvp, TwoHinges, TwoHingesRead
from reference import (
    clutch_trajectory,
    largest_error,
    passive_trajectory,
    symmetric_trajectory,
    trajectory_of,
)

from dm_ros import core, SelfLockingParameters, Simulation, SymmetricParameters
from dm_ros.energy import AuditedSimulation
from dm_ros.mechanism.variants import CATALOGUE, MECHANISMS, SYMMETRIC
from dm_ros.motion.models import PAPER, PASSIVE
from dm_ros.tools.progress import progress

DT = 1e-3            # s, of the cost table
SLOW_PASSES = 3      # of the rows with solve_ivp
RIGHT = 1e-3         # rad/s: a peer with a larger error is fast but wrong
NOTHING = '-'
LAWS = PAPER, PASSIVE   # of losses; ratios are to the first
# the heads of the tables, as doc/performance.md has them
COSTS = ['cost of a tick', 'mean, us', 'ratio', 'p99.9, us', 'worst tick, us', 'max, us',
         'error, rad/s', 'slip error, rad/s']
TARGETS = ['target', 'measured', 'holds']
REFERENCE_LOAD = ['accuracy, 10,000 ticks of the reference load', 'rate', 'speeds, relative',
                  'angles, relative', 'ticks of other index', 'within 1e-10']
HARD_LOAD = ['accuracy, 2.5 s of hard load to 1,000 N m', 'rate', 'steepness, s/rad',
             'speeds, rad/s', 'slip, rad/s', 'ticks of other index', 'coarse steps',
             'within 1e-3 and 1e-2']
LEGEND = """\
All rows step the reference load of the scenarios at 1 kHz in one run, with torques made
beforehand: {passes} passes over {ticks} ticks, each through all rows in turn (solve_ivp: {slow}
passes). `mean` is the time of a pass over its ticks, median over the passes; `ratio` is to the
first row in the same pass, median. Each tick is timed in passes of their own: `p99.9` and `max`
are medians over the passes and contain what else the machine does; `worst tick` is the largest,
over the ticks, of the median over the passes of one and the same tick. `error` is the largest
at any tick, of the carrier's and the outputs' speeds and of the slip omega_1 - omega_2, beside
the exact solution under held torques.

- step: `Simulation.step`, with the snapshot. bare: `Simulation.advance`, without. With books:
  `AuditedSimulation.step`, which tells where the energy of the tick went.
- in Python: without the core in C, which makes the ticks where it is built.
- passive, paper: the law of losses; where none is named, it is the paper's.
- lossless: the numpy pair and MuJoCo know no efficiencies; in their yardstick all are 1.
- numpy matvec pair: Phi x + Gamma u and no more, without the index of power flow.
- python-control: `dynamics` and `output` of a discrete system for each direction, with the index.
- solve_ivp: LSODA, rtol and atol {tolerance:g}, begun anew in each tick, with the index.
- MuJoCo two hinges: minimal coordinates, carrier and slip, torques on them made beforehand,
  constraints off. MuJoCo five or four hinges: one for each shaft, tied by tendon equalities as
  stiff as MuJoCo allows. Viscous drag is the damping of joints and tendons; contacts and gravity
  are off. Timed are the torques into `qfrc_applied` and `mj_step`; "and read" also reads
  time, speeds and angles of the hinges into Python. Clutch before: the friction is computed in
  Python before each step; clutch callback: in `mjcb_passive`, at each stage.
"""


class Row(NamedTuple):
    """One row of the cost table."""

    name: str
    mechanism: str        # symmetric or lsd
    yardstick: str        # key into the yardsticks
    make: Callable        # returns what has rows, run and record
    missing: str = ''     # why it cannot be made
    per_tick: bool = False
    slow: bool = False
    hinges: str = ''      # of a model in MuJoCo: how many


class Ours:
    """A ``Simulation`` with the interface of the peers."""

    def __init__(self, simulation, method):
        self.simulation = simulation
        self._step = getattr(simulation, method)

    def rows(self, load):
        return load

    def run(self, rows):
        step = self._step
        for T in rows:
            step(T)

    def run_ticks(self, rows):
        """Return the time of each tick, s."""
        step, times = self._step, np.empty(len(rows))
        for n, T in enumerate(rows):
            start = perf_counter()
            step(T)
            times[n] = perf_counter() - start
        return times

    def record(self, rows):
        return trajectory_of(self.simulation, rows).speeds


def in_python(kind, variant, law):
    """Return a simulation whose steps are not made in C."""
    with mock.patch.object(core, 'Ticker', None):
        return kind(variant, DT, loss_law=law)


def all_rows():
    """Return the rows of the cost table."""
    p, q = SymmetricParameters(), SelfLockingParameters()
    rows = []
    for kind, method, word in ((Simulation, 'step', 'step'), (Simulation, 'advance', 'bare'),
                               (AuditedSimulation, 'step', 'step with books')):
        for law in LAWS:
            for variant in CATALOGUE.values():
                name, mechanism = variant.name, variant.mechanism.name
                rows.append(Row(
                    f'{name} {law}, {word}', mechanism,
                    f'{name if name == "lsd_lagged" else mechanism} {law}',
                    lambda v=name, w=law, m=method, k=kind: Ours(k(v, DT, loss_law=w), m),
                    per_tick=method == 'step'))
    for kind, word in ((Simulation, 'step'), (AuditedSimulation, 'step with books')):
        for law, name in (('paper', 'lsd_ode'), ('passive', 'symmetric_ode'),
                          ('passive', 'lsd_ode')):
            mechanism = CATALOGUE[name].mechanism.name
            rows.append(Row(
                f'{name} {law}, {word}, in Python', mechanism, f'{mechanism} {law}',
                lambda v=name, w=law, k=kind: Ours(in_python(k, v, w), 'step'), per_tick=True))
    rows.append(Row('symmetric: numpy matvec pair, lossless', 'symmetric', 'symmetric lossless',
                    lambda: MatrixPair(p, DT)))
    rows.append(Row('symmetric: python-control, discrete', 'symmetric', 'symmetric paper',
                    lambda: Control(p, DT), Control.missing))
    rows.append(Row('symmetric: solve_ivp', 'symmetric', 'symmetric paper',
                    lambda: SolveIvp(p, DT), slow=True))
    rows.append(Row('lsd: solve_ivp', 'lsd', 'lsd paper', lambda: SolveIvp(q, DT), slow=True))

    def mujoco(mechanism, parameters, name, kind, integrator, clutch=None):
        words = f', clutch {clutch}' if clutch else ''
        rows.append(Row(
            f'{mechanism}: MuJoCo {name}, {integrator}{words}, lossless', mechanism,
            f'{mechanism} lossless', lambda: kind(parameters, DT, integrator, clutch),
            kind.missing, hinges=name))

    for kind, name in ((TwoHinges, 'two hinges'), (AllHinges, 'five hinges')):
        for integrator in ('Euler', 'implicitfast', 'RK4'):
            mujoco('symmetric', p, name, kind, integrator)
    mujoco('symmetric', p, 'two hinges and read', TwoHingesRead, 'implicitfast')
    for kind, name in ((TwoHinges, 'two hinges'), (AllHinges, 'four hinges')):
        mujoco('lsd', q, name, kind, 'implicitfast', 'before')
        mujoco('lsd', q, name, kind, 'RK4', 'callback')
    return rows


def yardsticks(loads, bar):
    """Return the exact speeds over the reference loads, by the key of the rows."""
    p, q = SymmetricParameters(), SelfLockingParameters()
    makers = {   # and the load of which mechanism
        'symmetric paper': ('symmetric', lambda load: symmetric_trajectory(p, load, DT)),
        'symmetric passive': ('symmetric', lambda load: passive_trajectory(p, load, DT)),
        'symmetric lossless': ('symmetric', lambda load: symmetric_trajectory(
            lossless(p), load, DT)),
        'lsd paper': ('lsd', lambda load: clutch_trajectory(q, load, DT)),
        'lsd passive': ('lsd', lambda load: passive_trajectory(q, load, DT)),
        'lsd lossless': ('lsd', lambda load: clutch_trajectory(lossless(q), load, DT)),
        'lsd_lagged paper': ('lsd', lambda load: clutch_trajectory(q, load, DT, lagged=True)),
        'lsd_lagged passive': ('lsd', lambda load: passive_trajectory(q, load, DT, lagged=True))}
    exact = {}
    for key, (mechanism, make) in makers.items():
        exact[key] = make(loads[mechanism]).speeds
        bar.update()
    return exact


def timed(row, load):
    """Return the time of one pass, s a tick."""
    what = row.make()
    rows = what.rows(load)
    gc.collect()
    start = perf_counter()
    what.run(rows)
    return (perf_counter() - start) / len(load)


def measure(rows, loads, passes, bar):
    """Return ``{name: [s a tick, ...]}`` and ``{name: array (passes, ticks)}``, interleaved."""
    means, ticks = {row.name: [] for row in rows}, {}
    for row in rows:   # warm up
        if not row.missing:
            timed(row, loads[row.mechanism][:200])
    for n in range(passes):
        for row in rows:
            if row.missing or row.slow and n >= SLOW_PASSES:
                continue
            means[row.name].append(timed(row, loads[row.mechanism]))
            if row.per_tick:
                gc.collect()
                times = row.make().run_ticks(loads[row.mechanism])
                ticks.setdefault(row.name, []).append(times)
        bar.update()
    return means, {name: np.array(times) for name, times in ticks.items()}


def table(head, rows):
    """Print a Markdown table."""
    print('|', ' | '.join(head), '|')
    print('|---' + '|---:' * (len(head) - 1) + '|')
    for row in rows:
        print('|', ' | '.join(row), '|')
    print()


def error_text(value):
    return f'{value:.1e}'


def microseconds(seconds):
    return f'{seconds * 1e6:.2f}' if seconds < 1e-4 else f'{seconds * 1e6:.0f}'


class Cost(NamedTuple):
    """What was measured of one row."""

    mean: float
    ratio: float
    percentile: float   # 99.9, of the ticks
    worst: float
    most: float
    error: tuple        # of speed and slip, rad/s


def costs_of(rows, means, ticks, errors):
    """Return ``{name: Cost}`` of the rows that could be measured."""
    costs = {}
    for row in rows:
        if row.missing:
            continue
        times, first = means[row.name], means[rows[0].name]
        percentile = worst = most = None
        if row.name in ticks:
            each = ticks[row.name]
            percentile = np.median(np.percentile(each, 99.9, axis=1))
            worst = np.median(each, axis=0).max()
            most = np.median(each.max(axis=1))
        costs[row.name] = Cost(np.median(times), np.median([a / b for a, b in zip(times, first)]),
                               percentile, worst, most, errors[row.name])
    return costs


def print_costs(rows, costs):
    lines = []
    for row in rows:
        if row.missing:
            lines.append([row.name, row.missing] + [NOTHING] * 6)
            continue
        cost = costs[row.name]
        lines.append([
            row.name, microseconds(cost.mean), f'{cost.ratio:.2f}',
            *(NOTHING if t is None else microseconds(t)
              for t in (cost.percentile, cost.worst, cost.most)),
            *(error_text(e) for e in cost.error)])
    table(COSTS, lines)


def print_targets(rows, costs):
    """Print what is to be reached beside what was measured."""
    lines = []

    def target(words, measured, holds):
        lines.append([words, measured, 'yes' if holds else 'no'])

    def beside_mujoco(law, words, names):
        if not names:
            lines.append([f'symmetric_ode {law} beside {words}', NOTHING, NOTHING])
            return
        name = min(names, key=lambda n: costs[n].mean)
        peer = costs[name]
        short = name.removeprefix('symmetric: ').removesuffix(', lossless')
        short = f'({short}, error {error_text(peer.error[0])} rad/s)'
        for ours, share, said in (('step', 1, '<= '), ('bare', 1 / 3, '<= a third of ')):
            own = costs[f'symmetric_ode {law}, {ours}'].mean
            target(f'symmetric_ode {law}, {ours} {said}{words} {short}',
                   f'{microseconds(own)} of {microseconds(peer.mean)} us',
                   own <= share * peer.mean)

    def at_most(times, ours, theirs, words):
        ratio = costs[ours].mean / costs[theirs].mean
        target(f'{ours} <= {times:g} times {words}', f'{ratio:.2f} times', ratio <= times)

    found = {row.name: row.hinges for row in rows
             if row.name in costs and row.mechanism == SYMMETRIC.name
             and row.hinges in ('two hinges', 'five hinges')}
    for law in LAWS:
        beside_mujoco(law, 'the cheapest mj_step', found)
        beside_mujoco(law, 'the cheapest mj_step of five hinges',
                      [n for n, hinges in found.items() if hinges == 'five hinges'])
        beside_mujoco(law, f'the cheapest mj_step right to {RIGHT:g} rad/s',
                      [n for n in found if costs[n].error[0] < RIGHT])
        own = costs[f'lsd_ode {law}, step']
        target(f'lsd_ode {law}, step: mean <= 15 us', f'{microseconds(own.mean)} us',
               own.mean <= 15e-6)
        target(f'lsd_ode {law}, step: worst tick < 300 us', f'{microseconds(own.worst)} us',
               own.worst < 300e-6)
        target(f'lsd_ode {law}, step: max < 300 us, whatever else the machine does',
               f'{microseconds(own.most)} us', own.most < 300e-6)
        for variant, most in (('symmetric_ode', 2.0), ('lsd_ode', 1.6)):
            at_most(most, f'{variant} {law}, step with books', f'{variant} {law}, step',
                    'without')
        for kind in ('step', 'bare'):
            for dae, ode in (('symmetric_dae', 'symmetric_ode'), ('lsd_dae', 'lsd_ode')):
                at_most(2, f'{dae} {law}, {kind}', f'{ode} {law}, {kind}', ode)
    for variant, most in (('symmetric_ode', 3.0), ('lsd_ode', 2.0)):
        at_most(most, f'{variant} {PASSIVE}, step', f'{variant} {PAPER}, step', PAPER)
    table(TARGETS, lines)


def hard_load(rate):
    """
    Return torques on carrier, front and rear to 1,000 N m that are hard on the clutches.

    Half a second each: steps whose sides change, locked and slipping; slip that reverses over
    the locked stretch; locked under a load that changes; bursts and rests; noise.
    """
    rng = np.random.default_rng(7)
    load, count, hold = [], rate // 2, max(1, rate // 40)
    for n in range(count):
        if n % hold == 0:
            carrier, front = rng.uniform(-1000, 1000), rng.uniform(0.1, 0.7)
            both = -carrier * rng.uniform(0.9, 1.1)
        load.append((carrier, both * front, both * (1 - front)))
    for n in range(count):
        front = 0.4 + 0.6 * np.sin(2 * np.pi * 12.3 * n / rate)
        carrier = 700 * np.cos(2 * np.pi * 3.1 * n / rate)
        load.append((carrier, 5 - carrier * front, -3 - carrier * (1 - front)))
    for n in range(count):
        carrier = 1000 * np.sin(2 * np.pi * 4 * n / rate)
        load.append((carrier, -0.41 * carrier, -0.6 * carrier))
    for n in range(count):
        if n % hold == 0:
            burst = rng.normal(0, 200, 3) * (n // hold % 2)
        load.append(burst)
    load += list(rng.uniform(-1000, 1000, (count, 3)))
    return [tuple(float(t) for t in torques) for torques in load]


def hard_row(simulation, load, exact, rate, steepness):
    """Return a row of the table of the hard load."""
    got = trajectory_of(simulation, load)
    speed, slip = largest_error(got.speeds, exact.speeds)
    return [f'{simulation.variant} {simulation.loss_law}', f'{rate} Hz', steepness,
            error_text(speed), error_text(slip), str((got.index != exact.index).sum()),
            f'{simulation.coarse_steps} of {len(load)}',
            'yes' if speed <= 1e-3 and slip <= 1e-2 else 'no']


def print_accuracy(bar):
    """Print how exact all variants are."""
    symmetric, hard = [], []
    for rate in (1000, 100):
        load = [SYMMETRIC.load(n / rate) for n in range(10_000)]
        exact = symmetric_trajectory(SymmetricParameters(), load, 1 / rate)
        for variant in ('symmetric_ode', 'symmetric_dae'):
            got = trajectory_of(Simulation(variant, 1 / rate, loss_law=PAPER), load)
            speeds, angles = (float(np.abs(a - b).max() / np.abs(b).max()) for a, b in
                              ((got.speeds, exact.speeds), (got.angles, exact.angles)))
            symmetric.append([f'{variant} {PAPER}', f'{rate} Hz', error_text(speeds),
                              error_text(angles), str((got.index != exact.index).sum()),
                              'yes' if max(speeds, angles) <= 1e-10 else 'no'])
        bar.update()
    for rate in (1000, 200):
        load = hard_load(rate)
        for steepness in (2.0, 4.0, 50.0):
            p = SelfLockingParameters(c_f1=steepness, c_f2=steepness)
            for law, trajectory in ((PAPER, clutch_trajectory), (PASSIVE, passive_trajectory)):
                exact = {lagged: trajectory(p, load, 1 / rate, lagged)
                         for lagged in (False, True)}
                for variant in ('lsd_ode', 'lsd_dae', 'lsd_lagged'):
                    simulation = Simulation(variant, 1 / rate, p, loss_law=law)
                    hard.append(hard_row(simulation, load, exact[variant == 'lsd_lagged'], rate,
                                         f'{steepness:g}'))
            bar.update()
        load = [(T_0 / SymmetricParameters().g_F, T_1, T_2) for T_0, T_1, T_2 in load]
        exact = passive_trajectory(SymmetricParameters(), load, 1 / rate)
        for variant in ('symmetric_ode', 'symmetric_dae'):
            simulation = Simulation(variant, 1 / rate, loss_law=PASSIVE)
            hard.append(hard_row(simulation, load, exact, rate, NOTHING))
        bar.update()
    bar.close()
    table(REFERENCE_LOAD, symmetric)
    table(HARD_LOAD, hard)


def machine():
    """Return date, machine and versions in words."""
    try:
        with open('/proc/cpuinfo') as lines:
            cpu = next(line.split(':')[1].strip() for line in lines if 'model name' in line)
    except (OSError, StopIteration):
        cpu = platform.processor() or platform.machine()
    try:
        cores = len(os.sched_getaffinity(0))
    except AttributeError:
        cores = os.cpu_count()
    versions = []
    for package in ('numpy', 'scipy', 'mujoco', 'control'):
        try:
            versions.append(f'{package} {version(package)}')
        except PackageNotFoundError:
            versions.append(f'no {package}')
    return (f'{date.today().isoformat()}, {cpu}, {cores} cores, {platform.system()}, '
            f'Python {platform.python_version()}, {", ".join(versions)}')


def positive(text):
    number = int(text)
    if number < 1:
        raise ValueError
    return number


def main():
    parser = argparse.ArgumentParser(
        description='Print what a step costs, beside other tools, and how exact it is.')
    parser.add_argument('--passes', type=positive, default=15, help='passes (default: 15)')
    parser.add_argument('--ticks', type=positive, default=10_000,
                        help='ticks of the reference load in a pass (default: 10000)')
    arguments = parser.parse_args()
    rows = all_rows()
    loads = {name: [mechanism.load(n * DT) for n in range(arguments.ticks)]
             for name, mechanism in MECHANISMS.items()}
    peers.silence()
    bar = progress(total=arguments.passes + 8 + 1 + 10, unit='run')
    exact = yardsticks(loads, bar)
    errors = {}
    for row in rows:
        if not row.missing:
            what, load = row.make(), loads[row.mechanism]
            errors[row.name] = largest_error(what.record(what.rows(load)), exact[row.yardstick])
    bar.update()
    means, ticks = measure(rows, loads, arguments.passes, bar)
    costs = costs_of(rows, means, ticks, errors)

    print(machine() + '\n')
    print(LEGEND.format(passes=arguments.passes, ticks=arguments.ticks, tolerance=SolveIvp.RTOL,
                        slow=min(SLOW_PASSES, arguments.passes)))
    print_costs(rows, costs)
    print_targets(rows, costs)
    print_accuracy(bar)


if __name__ == '__main__':
    main()
