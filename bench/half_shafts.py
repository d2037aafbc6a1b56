# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
What a tick with half-shafts costs, beside one of torque ports, in one run.

Two wheels by speed, on half-shafts of 1e4 N m/rad and 100 N m s/rad, at 1 kHz: calm, with speeds
that change as those of a car do, and wild, with speeds that jump by 1 rad/s in every tick. Beside
them the same differential under the mean torques of the calm run. All by the clock of the thread,
which leaves out what else the machine does.
"""

import argparse
import math
from statistics import median
from time import thread_time
from unittest import mock

import numpy as np

from dm_ros import core, Simulation, VARIANTS
from dm_ros.energy import AuditedSimulation
from dm_ros.mechanism.variants import SELF_LOCKING, SYMMETRIC, variant_named
from dm_ros.motion.models import LOSS_LAWS

DT, START = 1e-3, (50.0, 49.0)
SHAFT = 1e4, 100.0   # N m/rad, N m s/rad
DRIVING = {SYMMETRIC.name: 30.0, SELF_LOCKING.name: 200.0}   # N m


def loads(ticks, driving):
    """Return the inputs of each tick, calm and wild."""
    calm = [(driving + 10.0 * math.sin(n / 50), 50.0 + 2e-3 * n,
             49.0 + 2e-3 * n + 0.3 * math.sin(n / 40)) for n in range(ticks)]
    rng = np.random.default_rng(1)
    jumps = rng.uniform(-1.0, 1.0, (ticks, 2))
    wild = [(T, a + x, b + y) for (T, a, b), (x, y) in zip(calm, jumps.tolist())]
    return {'calm': calm, 'wild': wild}


def timed(simulation, inputs):
    """Return the time of each tick, us."""
    times = []
    for values in inputs:
        start = thread_time()
        simulation.step(values)
        times.append(1e6 * (thread_time() - start))
    return times


def row(kind, variant, law, ticks, passes):
    """Return the numbers of a row."""
    options = {'loss_law': law, 'initial_velocity': START}
    ports = dict.fromkeys(kind(variant).outputs, SHAFT)
    inputs = loads(ticks, DRIVING[variant_named(variant).mechanism.name])
    recorded = kind(variant, DT, ports=ports, **options)
    torques = [recorded.step(values).torque for values in inputs['calm']]
    times = {'torque': [], 'calm': [], 'wild': []}
    for _ in range(passes):
        times['torque'].append(timed(kind(variant, DT, **options), torques))
        for name, values in inputs.items():
            times[name].append(timed(kind(variant, DT, ports=ports, **options), values))
    mean = {name: median(map(np.mean, runs)) for name, runs in times.items()}
    late = {name: median(float(np.percentile(run, 99)) for run in runs)
            for name, runs in times.items()}
    worst = float(np.median(times['wild'], axis=0).max())
    return (mean['torque'], mean['calm'], mean['wild'], late['calm'], late['wild'], worst,
            mean['calm'] / mean['torque'])


def main():
    parser = argparse.ArgumentParser(
        description='Print what a tick with half-shafts costs, beside one of torque ports.')
    parser.add_argument('--ticks', type=int, default=1000, help='in a run (default: 1000)')
    parser.add_argument('--passes', type=int, default=3, help='passes (default: 3)')
    arguments = parser.parse_args()
    print('| a tick | torque ports, us | calm, us | wild, us | calm, p99 | wild, p99 | worst tick '
          '| calm over torque ports |\n|---|---:|---:|---:|---:|---:|---:|---:|')
    in_c = core.Ticker, core.coupled_step
    languages = [('', in_c, VARIANTS), (', in Python', (None, None), ('symmetric_ode', 'lsd_ode'))]
    for language, (ticker, coupled_step), variants in languages[not core.Ticker:]:
        with (mock.patch.object(core, 'Ticker', ticker),
              mock.patch.object(core, 'coupled_step', coupled_step)):
            for kind, word in ((Simulation, 'step'), (AuditedSimulation, 'step with books')):
                for law in LOSS_LAWS:
                    for variant in variants:
                        numbers = row(kind, variant, law, arguments.ticks, arguments.passes)
                        print(f'| {variant} {law}, {word}{language} | '
                              + ' | '.join(f'{number:.0f}' for number in numbers) + ' |',
                              flush=True)


if __name__ == '__main__':
    main()
