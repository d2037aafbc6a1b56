# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The runs of the comparison: all variants of a mechanism on one load, and what a step costs."""

from array import array
import gc
from itertools import islice
from time import perf_counter
from typing import NamedTuple

import numpy as np

from dm_ros.files.columns import as_row
from dm_ros.files.record import Record
from dm_ros.mechanism.variants import Mechanism, SELF_LOCKING, SYMMETRIC, variants_of
from dm_ros.motion.models import PAPER
from dm_ros.settings import make_simulation, NodeParameters
from dm_ros.tools.comparison.reference import exact_self_locking, exact_symmetric

RATES = (100, 1000, 10000)   # Hz, at which the variants are measured
RATE = 1000                  # Hz, of figures, claims and timings
BUILT_IN_SECONDS = 10.0      # length of a built-in load
TIMED_TICKS, PASSES = 5000, 7


class Load:
    """A load, built-in or from a table, that can be held in ticks of any length."""

    def __init__(self, mechanism, seconds, table=None):
        """Take ``seconds`` of a ``TorqueTable``, or of the reference load of a ``Mechanism``."""
        self.mechanism, self.seconds, self._table = mechanism, seconds, table

    def held(self, rate):
        """Return the torques of each tick, N m; raise ValueError where there is no tick."""
        ticks = round(self.seconds * rate)
        if ticks < 2:
            raise ValueError(f'duration: {self.seconds:g} s make no run at {rate} Hz')
        if self._table is None:
            return [self.mechanism.load(n / rate) for n in range(ticks)]
        return list(islice(self._table.held(1 / rate), ticks))


def record(simulation, torques, tick):
    """Run a simulation and return its ``Record``, without the start."""
    rows = array('d')
    for T in torques:
        rows.extend(as_row(simulation.step(T)))
        tick()
    return Record(simulation, np.frombuffer(rows), simulation.variant)


class Cost(NamedTuple):
    """What ``Simulation.step`` costs: medians over interleaved passes."""

    seconds: float   # a step
    ratio: float     # to the first variant in the same pass


class Runs(NamedTuple):
    """All runs of one mechanism."""

    mechanism: Mechanism
    parameters: object   # of the mechanism
    load: Load
    records: dict        # Record by (variant, rate)
    exact: dict          # Exact by rate
    frozen: dict         # Exact by rate, with |M| of the preceding tick; lsd alone
    without: Record      # lsd_ode without proportional friction; None for symmetric
    costs: dict          # Cost by variant


def exact_of(simulation, torques, deadband, tick, frozen=False):
    """Return the ``Exact`` solution of what a simulation at its start will do."""
    first = simulation.snapshot()
    common = simulation.parameters, torques, simulation.dt, first.velocity[1:3], deadband, tick
    if simulation.mechanism is SYMMETRIC:
        return exact_symmetric(*common)
    at_start = tuple(map(abs, first.moment[:2]))
    return exact_self_locking(*common, frozen=at_start if frozen else None)


def ticks_of(mechanism, load):
    """Return how many ticks ``run`` takes in all."""
    recorded = len(variants_of(mechanism)) + (2 if mechanism is SELF_LOCKING else 1)
    timed = min(TIMED_TICKS, round(load.seconds * RATE)) * PASSES * len(variants_of(mechanism))
    return (sum(round(load.seconds * rate) * recorded for rate in RATES) + timed
            + round(load.seconds * RATE) * (mechanism is SELF_LOCKING))


def run(mechanism, load, values, tick):
    """
    Run everything about one mechanism, under the paper's law of losses.

    :param values: ``{full name: value}``, as ``read_parameter_file`` returns them.
    :param tick: called with a number of ticks done.
    :raises ValueError: for a load that cannot be run.
    """
    values = {**values, 'loss_law': PAPER, 'substeps': 1}
    deadband = NodeParameters().changed(NodeParameters.part_of(values)).deadband
    first, *_ = variants = variants_of(mechanism)
    lsd = mechanism is SELF_LOCKING
    records, exact, frozen = {}, {}, {}
    for rate in RATES:
        torques = load.held(rate)
        for variant in variants:
            records[variant, rate] = record(make_simulation(variant, values, 1 / rate),
                                            torques, tick)
        simulation = make_simulation(first, values, 1 / rate)
        exact[rate] = exact_of(simulation, torques, deadband, tick)
        if lsd:
            frozen[rate] = exact_of(simulation, torques, deadband, tick, frozen=True)
    torques = load.held(RATE)
    without = lsd and record(
        make_simulation('lsd_ode', {**values, 'lsd.pressure_angle': 0.0}, 1 / RATE), torques, tick)
    costs = timed({v: make_simulation(v, values, 1 / RATE) for v in variants}, torques, tick)
    return Runs(mechanism, simulation.parameters, load, records, exact, frozen, without or None,
                costs)


def timed(simulations, torques, tick):
    """Return the ``Cost`` of each variant's step under the first of the torques."""
    torques = torques[:TIMED_TICKS]
    passes = {variant: [] for variant in simulations}
    gc.collect()
    for _ in range(PASSES):
        for variant, simulation in simulations.items():
            simulation.reset()
            step = simulation.step
            start = perf_counter()
            for T in torques:
                step(T)
            passes[variant].append((perf_counter() - start) / len(torques))
            tick(len(torques))
    first = next(iter(passes.values()))
    return {variant: Cost(float(np.median(times)),
                          float(np.median([a / b for a, b in zip(times, first, strict=True)])))
            for variant, times in passes.items()}

