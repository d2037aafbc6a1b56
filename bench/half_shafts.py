# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
What a tick with half-shafts costs, beside one of torque ports, in one run.

Two wheels by speed, on half-shafts of 1e4 N m/rad and 100 N m s/rad, at 1 kHz: calm, with speeds
that change as those of a car do, and wild, with speeds that jump by 1 rad/s in every tick. Beside
them the same differential under the mean torques of the calm run.
"""

import argparse
import math
from statistics import median
from time import perf_counter

import numpy as np

from dm_ros import Simulation, VARIANTS
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
        start = perf_counter()
        simulation.step(values)
        times.append(1e6 * (perf_counter() - start))
    return times


def main():
    parser = argparse.ArgumentParser(
        description='Print what a tick with half-shafts costs, beside one of torque ports.')
    parser.add_argument('--ticks', type=int, default=1000, help='in a run (default: 1000)')
    parser.add_argument('--passes', type=int, default=3, help='passes (default: 3)')
    arguments = parser.parse_args()
    print('| a tick | torque ports, us | calm, us | wild, us | calm, p99 | wild, p99 '
          '| calm over torque ports |\n|---|---:|---:|---:|---:|---:|---:|')
    for kind, word in ((Simulation, 'step'), (AuditedSimulation, 'step with books')):
        for law in LOSS_LAWS:
            for variant in VARIANTS:
                driving = DRIVING[variant_named(variant).mechanism.name]
                options = {'loss_law': law, 'initial_velocity': START}
                ports = dict.fromkeys(kind(variant).outputs, SHAFT)
                inputs = loads(arguments.ticks, driving)
                recorded = kind(variant, DT, ports=ports, **options)
                torques = [recorded.step(values).torque for values in inputs['calm']]
                times = {'torque': [], 'calm': [], 'wild': []}
                for _ in range(arguments.passes):
                    times['torque'].append(timed(kind(variant, DT, **options), torques))
                    for name, values in inputs.items():
                        times[name].append(timed(kind(variant, DT, ports=ports, **options),
                                                 values))
                mean = {name: median(map(np.mean, runs)) for name, runs in times.items()}
                late = {name: median(float(np.percentile(run, 99)) for run in runs)
                        for name, runs in times.items()}
                print(f'| {variant} {law}, {word} | {mean["torque"]:.0f} | {mean["calm"]:.0f} '
                      f'| {mean["wild"]:.0f} | {late["calm"]:.0f} | {late["wild"]:.0f} '
                      f'| {mean["calm"] / mean["torque"]:.0f} |', flush=True)


if __name__ == '__main__':
    main()
