# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
What a tick of a driveline costs, beside one of ``lsd_ode``, in one run.

A drive of four seconds at 1 kHz from 15 m/s: a torque that swings, a wheel that comes on ice for a
second, a brake of half a second, and where the car is planar a steering that is renewed at 100 Hz.
Beside it ``lsd_ode`` under its reference load, in Python as the driveline is, and in C. All by the
clock of the thread, which leaves out what else the machine does.
"""

import argparse
from datetime import date
import gc
import math
import os
import platform
from time import thread_time
from unittest import mock

import numpy as np

from dm_ros import core, Driveline, Simulation
from dm_ros.mechanism.variants import CATALOGUE
from dm_ros.tools.progress import progress

DT, SPEED = 1e-3, 15.0   # s, m/s
ROWS = {   # what: arguments and parameters
    'fwd': ('fwd', False, {}), 'rwd': ('rwd', False, {}), 'awd': ('awd', False, {}),
    'fwd, planar': ('fwd', True, {}), 'rwd, planar': ('rwd', True, {}),
    'awd, planar': ('awd', True, {}),
    'awd, planar, jacobian_ticks 8': ('awd', True, {'driveline.jacobian_ticks': 8}),
    'awd, planar, max_parts 2': ('awd', True, {'driveline.max_parts': 2})}


def drive(ticks, planar):
    """Return the inputs of each tick, for ``Driveline.step``."""
    inputs = []
    for n in range(ticks):
        t = n * DT
        steer = 0.02 * math.sin(2.0 * math.pi * (n // 10) / 100.0) if planar else 0.0
        inputs.append({
            'torque': 150.0 + 100.0 * math.sin(3.0 * t), 'steer': steer,
            'grip': (0.2 if 1.0 <= t < 2.0 else 1.0, 1.0, 1.0, 1.0),
            'brakes': (400.0,) * 4 if 2.5 <= t < 3.0 else (0.0,) * 4})
    return inputs


def timed(step, inputs):
    """Return the time of each tick, us."""
    times = []
    for values in inputs:
        start = thread_time()
        step(values)
        times.append(1e6 * (thread_time() - start))
    return times


def of_driveline(layout, planar, parameters, ticks):
    car = Driveline(layout, planar, DT, parameters)
    car.reset(SPEED)
    return timed(lambda values: car.step(**values), drive(ticks, planar))


def of_differential(ticker, ticks):
    with mock.patch.object(core, 'Ticker', ticker):
        simulation = Simulation('lsd_ode', DT)
    load = CATALOGUE['lsd_ode'].mechanism.load
    return timed(simulation.step, [load(n * DT) for n in range(ticks)])


def main():
    parser = argparse.ArgumentParser(
        description='Print what a tick of a driveline costs, beside one of lsd_ode.')
    parser.add_argument('--ticks', type=int, default=4000, help='in a run (default: 4000)')
    parser.add_argument('--passes', type=int, default=3, help='passes (default: 3)')
    arguments = parser.parse_args()
    ticks, found = arguments.ticks, {}
    gc.collect()
    gc.freeze()   # as the node does
    for _ in progress(range(arguments.passes)):
        for language, ticker in {'in Python': None, 'in C': core.Ticker}.items():
            if ticker or language == 'in Python':
                found.setdefault(f'lsd_ode, {language}', []).append(
                    of_differential(ticker, ticks))
        for what, row in ROWS.items():
            found.setdefault(what, []).append(of_driveline(*row, ticks))
    print(f'{date.today()}, {platform.machine()}, {len(os.sched_getaffinity(0))} cores, '
          f'Python {platform.python_version()}, load average {os.getloadavg()[0]:.1f}\n\n'
          f'The worst tick is the largest of those that are the least of {arguments.passes} '
          'passes through the same drive.\n\n'
          '| a tick | median, us | p99, us | worst, us | median over lsd_ode in Python '
          '| worst over its worst |\n|---|---:|---:|---:|---:|---:|')
    base = np.min(found['lsd_ode, in Python'], axis=0)
    for what, runs in found.items():
        times = np.min(runs, axis=0)
        median, p99, worst = np.median(times), np.quantile(times, 0.99), times.max()
        print(f'| {what} | {median:.1f} | {p99:.0f} | {worst:.0f} | '
              f'{median / np.median(base):.1f} | {worst / base.max():.1f} |')


if __name__ == '__main__':
    main()
