# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The worked example through topics: what its controller does, and that topics change no bit."""

from functools import cache
import math
from pathlib import Path
import sys

import numpy as np
from processes import Forked
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / 'examples'))

import brake_lock

from dm_ros.testing import DirectDifferential, lockstep, LockstepDifferential

ROOT = Path(__file__).parents[2]
OPEN, BRAKE, LSD = brake_lock.CASES
SECONDS = {OPEN: 1.25, BRAKE: 1.25, LSD: 1.0}
COMMAND = f'import sys; sys.path.insert(0, {str(ROOT / "examples")!r})\n' + \
    'import brake_lock; sys.exit(brake_lock.main())'


@cache
def through_topics(case):
    """Return the ``Run`` of a case through topics; several tests look at it."""
    return brake_lock.run(case, SECONDS[case])


def grip_lost(run):
    """Return when the slip of the left tyre passes the peak of its curve, s."""
    p = brake_lock.CarParameters()
    _, left, *_ = run.record.velocity.values()
    speed = run.car['speed']
    slip = (p.wheel_radius * left - speed) / (speed + p.creep_speed)
    peak = math.tan(math.pi / (2 * p.tyre_shape)) / p.tyre_stiffness
    return run.record.time[np.argmax(slip > peak)]


def test_the_lock_stops_the_slip_of_a_wheel_that_lost_its_grip():
    free, locked = through_topics(OPEN), through_topics(BRAKE)
    lost = grip_lost(free)
    assert 0.1 < lost < 0.4
    slip, after = locked.record.slip, locked.record.time - grip_lost(locked)
    assert slip.max() < 6.0                     # rad/s
    assert abs(slip[after > 0.8]).max() < 3.5   # the lock allows 3
    slip, after = free.record.slip, free.record.time - lost
    assert (np.diff(slip[after > 0.0]) > 0.0).all()
    assert slip[after > 0.8].min() > 30.0
    assert locked.car['speed'][-1] > 5 * free.car['speed'][-1]


def test_the_self_locking_axle_pulls_better_than_the_open_one():
    free, lsd = through_topics(OPEN), through_topics(LSD)
    last = len(lsd.record) - 1
    assert lsd.car['speed'][last] > 4 * free.car['speed'][last]
    assert lsd.record.moment['rear_mesh'][last] > 1.3 * free.record.moment['right_mesh'][last]


@pytest.mark.parametrize('case', brake_lock.CASES, ids=[case.name for case in brake_lock.CASES])
def test_through_topics_and_direct_are_the_same_to_the_last_bit(case):
    topics, direct = through_topics(case), brake_lock.run(case, SECONDS[case], direct=True)
    for name, values in direct.record.columns.items():
        assert (topics.record.columns[name] == values).all(), name
    for name, values in direct.car.items():
        assert (topics.car[name] == values).all(), name


def test_a_reset_of_all_repeats_the_run(monkeypatch):
    monkeypatch.setattr(lockstep, 'LAST_ANSWER', 60.0)   # a slow machine may need it
    with LockstepDifferential(
            BRAKE.variant, brake_lock.RATE, brake_lock.parameters_of(BRAKE)) as vehicle:
        car = brake_lock.attach(vehicle, BRAKE)
        first = vehicle.run(0.4)
        vehicle.reset()
        for node in vehicle.executor.get_nodes():
            if hasattr(node, 'restart'):
                node.restart()
        again = vehicle.run(0.4)
    assert car.brakes[0] > 0.0
    for name, values in first.columns.items():
        assert (again.columns[name] == values).all(), name


def test_the_command_draws_the_picture(tmp_path):
    with Forked(COMMAND, '--seconds', 0.1, '--out', tmp_path / 'out') as command:
        assert command.ended() == 0, command.errors
        lines = command.output.splitlines()
    assert [line.split()[0] for line in lines[2:5]] == ['open', 'brake', 'lsd']
    assert (tmp_path / 'out' / 'example.png').read_bytes().startswith(b'\x89PNG')
    direct = DirectDifferential(LSD.variant, brake_lock.RATE,
                                parameters=brake_lock.parameters_of(LSD))
    direct.run(brake_lock.law_of(direct, LSD)[0], 0.1)
    direct.record.save_csv(tmp_path / 'direct.csv')
    assert (tmp_path / 'out' / 'lsd.csv').read_bytes() == (tmp_path / 'direct.csv').read_bytes()
