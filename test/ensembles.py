# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Random members of ensembles, and the bytes of all that they tell, however many go at once."""

from unittest import mock

import numpy as np
from properties import random_case

from dm_ros import core, Ensemble

ALL = ('velocity', 'position', 'moment', 'power_flow', 'clutch_force')
CORE = core._chosen('')
LANES = CORE.LANES if CORE else []   # how many members can share a register
COUNT, TICKS = 67, 150


def sets_of(variant, count, clutched=False, first=0):
    """Return random tables of one variant, of the cases from a number on."""
    n, found = first, []
    while len(found) < count:
        case = random_case(n, clutched)
        if case.variant == variant:
            table = case.arguments['parameters']
            if table.has_clutches or not clutched:   # they cannot be mixed
                found.append(table)
        n += 1
    return found


def runs_by_lanes(variant, clutched, loss_law, seed):
    """Return all that random members tell in random runs, as bytes, for each number of LANES."""
    sets, rng = sets_of(variant, COUNT, clutched, 1000 * seed), np.random.default_rng(seed)
    # from a creep to full speed, under torques that jump, stay, balance each other or are none
    start = rng.normal(0, 1, (COUNT, 2)) * 10 ** rng.uniform(-2, 2.5, (COUNT, 1))
    T = rng.normal(0, 1, (TICKS, COUNT, 3)) * 10 ** rng.uniform(-1, 3.5, (COUNT, 1))
    T[30:] = np.repeat(T[30::20], 20, axis=0)
    T[:, ::3, 1] = T[:, ::3, 2] = -T[:, ::3, 0] / 2
    T[80:110] = 0.0
    T[120:, 5:12] = 1e308
    runs = []
    for lanes in LANES:
        with mock.patch('dm_ros.ensemble.lanes_of', lambda _, lanes=lanes: lanes):
            ensemble = Ensemble(variant, sets, 0.002, initial_velocity=start, loss_law=loss_law,
                                substeps=1 + seed % 2, power_flow_deadband=3.0 * (seed % 3))
        wide = TICKS, COUNT, len(ensemble.clutches)
        A = np.maximum(np.random.default_rng(seed).uniform(-500, 500, wide), 0.0)
        told = ensemble.run(T[:100], A[:100], record=ALL)
        for n in range(100, 105):
            ensemble.step(T[n], A[n])
        ensemble.run(T[105:], A[105:])
        runs.append([told[name].tobytes() for name in ALL] + [
            getattr(ensemble, name).tobytes() for name in (*ALL, 'coarse_steps', 'failed')])
    return runs
