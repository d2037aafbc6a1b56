# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The worked example through topics: what its controller does, and that topics change no bit."""

from functools import cache
import math
from pathlib import Path
import signal
import sys

import numpy as np
from processes import Forked
import pytest
from sensor_msgs.msg import JointState

sys.path.insert(0, str(Path(__file__).parents[2] / 'examples'))

import brake_lock

from dm_ros.testing import lockstep

ROOT = Path(__file__).parents[2]
OPEN, BRAKE, PLATES, ELS = brake_lock.CASES
SECONDS = {OPEN: 1.25, BRAKE: 1.25, PLATES: 1.0, ELS: 1.25}
COMMAND = f'import sys; sys.path.insert(0, {str(ROOT / "examples")!r})\n' + \
    'import brake_lock; sys.exit(brake_lock.main())'
LIMITED_SLIP = COMMAND.replace('brake_lock', 'limited_slip')


@cache
def through_topics(case):
    """Return the ``Run`` of a case through topics; several tests look at it."""
    return brake_lock.run(case, SECONDS[case])


def grip_lost(run):
    """Return when the slip of the left tyre passes the peak of its curve, s."""
    p = brake_lock.CarParameters()
    speed = run.car['speed']
    slip = (p.wheel_radius * run.record.velocity['left'] - speed) / (speed + p.creep_speed)
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


def test_the_plates_pull_better_than_the_open_axle():
    free, plates = through_topics(OPEN), through_topics(PLATES)
    last = len(plates.record) - 1
    assert plates.car['speed'][last] > 6 * free.car['speed'][last]
    assert plates.record.torque['right'][last] < 3.5 * free.record.torque['right'][last] < 0.0


def test_the_limited_slip_holds_the_wheel_on_ice_without_a_brake():
    free, braked, run = through_topics(OPEN), through_topics(BRAKE), through_topics(ELS)
    slip, after = run.record.slip, run.record.time - grip_lost(run)
    assert slip.max() < 6.5                     # rad/s
    assert abs(slip[after > 0.8]).max() < 6.1
    assert run.car['speed'][-1] > 1.2 * braked.car['speed'][-1] > 5 * free.car['speed'][-1]
    assert run.heat['brakes'] == 0.0 < run.heat['clutches']
    # open before there is slip: the first message comes from a car at rest
    forces = np.array(list(run.record.clutch_force.values()))
    assert not forces[:, abs(slip) < 2.0].any()
    assert forces[:, after > 0.8].min() > 4000.0   # N


@pytest.mark.parametrize('case', brake_lock.CASES, ids=[case.name for case in brake_lock.CASES])
def test_through_topics_and_direct_are_the_same_to_the_last_bit(case):
    topics, direct = through_topics(case), brake_lock.run(case, SECONDS[case], direct=True)
    for name, values in direct.record.columns.items():
        assert (topics.record.columns[name] == values).all(), name
    for name, values in direct.car.items():
        assert (topics.car[name] == values).all(), name


@pytest.mark.parametrize('case', brake_lock.CASES, ids=[case.name for case in brake_lock.CASES])
def test_on_half_shafts_too_all_bits_are_the_same_through_topics(case):
    topics, direct = (brake_lock.run(case, 0.5, direct, coupling=brake_lock.SPEED)
                      for direct in (False, True))
    assert (topics.car['left_brake'][-1] > 0.0, 'left' in topics.record.clutch_force
            and topics.record.clutch_force['left'][-1] > 0.0) == (case is BRAKE, case is ELS)
    for name, values in direct.record.columns.items():
        assert (topics.record.columns[name] == values).all(), name
    for name, values in direct.car.items():
        assert (topics.car[name] == values).all(), name
    # the wheels are the car's: the other end of a twisted half-shaft turns otherwise
    assert topics.car['left_wheel'][-1] != topics.record.velocity['left'][-2]


@pytest.mark.parametrize('case, coupling', [
    (BRAKE, brake_lock.TORQUE), (ELS, brake_lock.TORQUE), (BRAKE, brake_lock.SPEED)])
def test_a_reset_of_all_repeats_the_run(monkeypatch, case, coupling):
    monkeypatch.setattr(lockstep, 'LAST_ANSWER', 60.0)   # a slow machine may need it
    with brake_lock.lockstep_differential(case, coupling=coupling) as vehicle:
        car = brake_lock.attach(vehicle, case, coupling=coupling)
        first = vehicle.run(0.5)
        vehicle.reset()
        for node in vehicle.executor.get_nodes():
            if hasattr(node, 'restart'):
                node.restart()
        again = vehicle.run(0.5)
    force = max((values[-1] for values in first.clutch_force.values()), default=0.0)
    assert (car.brakes[0] > 0.0, force > 0.0) == (case is BRAKE, case is ELS)
    for name, values in first.columns.items():
        assert (again.columns[name] == values).all(), name


def test_the_command_draws_the_picture(tmp_path):
    with Forked(COMMAND, '--seconds', 0.1, '--ice', 0.05, '--out', tmp_path / 'out') as command:
        assert command.ended() == 0, command.errors
        lines = command.output.splitlines()
    assert [line.split()[0] for line in lines[2:6]] == ['open', 'brake', 'plates', 'els']
    assert (tmp_path / 'out' / 'example.png').read_bytes().startswith(b'\x89PNG')
    direct = brake_lock.run(PLATES, 0.1, direct=True, p=brake_lock.CarParameters(
        grip=(0.05, brake_lock.ASPHALT)))
    direct.record.save_csv(tmp_path / 'direct.csv')
    assert (tmp_path / 'out' / 'plates.csv').read_bytes() == (tmp_path / 'direct.csv').read_bytes()


def test_the_command_runs_the_car_on_half_shafts(tmp_path):
    arguments = '--seconds', 0.1, '--direct', '--coupling', 'speed', '--out', tmp_path / 'out'
    with Forked(COMMAND, *arguments) as command:
        assert command.ended() == 0, command.errors
    brake_lock.run(PLATES, 0.1, True, coupling=brake_lock.SPEED).record.save_csv(
        tmp_path / 'direct.csv')
    assert (tmp_path / 'out' / 'plates.csv').read_bytes() == (tmp_path / 'direct.csv').read_bytes()


def test_the_limited_slip_runs_beside_a_node_in_real_time_and_its_end_opens_the_clutches(ros):
    node = ros.differential(brake_lock.VARIANT, rate=200.0, torque_timeout=0.5, **{
        name.replace('.', '__'): value for name, value in brake_lock.parameters_of(ELS).items()})
    clutches = ros.listen(JointState, '/differential/clutches')
    torques = ros.publisher(JointState, '/differential/torques')

    def force_with_torque():
        """Return the forces while the left wheel has no grip."""
        torques.publish(JointState(name=node.simulation.inputs, effort=[300.0, 0.0, -150.0]))
        return clutches[-1].effort if clutches else [0.0, 0.0]

    with Forked(LIMITED_SLIP, '--ros-args', '-p', 'limit:=500.0') as controller:
        ros.until(lambda: min(force_with_torque()) > 499.0)
        assert max(clutches[-1].effort) <= 500.0
        assert controller.ended(signal.SIGINT) == 0, controller.errors
        assert 'Traceback' not in controller.errors
    ros.until(lambda: max(force_with_torque()) < 1e-3)
