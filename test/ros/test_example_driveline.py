# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The controllers of a driveline through topics: each against the same run without it."""

from functools import cache
from pathlib import Path
import sys

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / 'examples'))

import driveline_controllers as examples

from dm_ros.files.bag import has_rosbags

TRACTION, LIMITED_SLIP, CENTRE, VECTORING = examples.CASES


@cache
def driven(name, controlled, again=False):
    """Return the record of a case; again: of another run."""
    return examples.run(examples.CASES[name], controlled)


def difference(record, first, second):
    """Return how much faster a wheel is than another, rad/s."""
    return record.velocity[first] - record.velocity[second]


def test_traction_control_climbs_where_the_open_axle_rolls_back():
    without, with_it = driven(TRACTION, False), driven(TRACTION, True)
    assert without.x[-1] < -1.0 and without.longitudinal_speed[-1] < -1.0
    assert with_it.x[-1] > 1.5 and with_it.longitudinal_speed[-1] > 1.0
    assert difference(without, 'rear_left', 'rear_right').max() > 200.0
    slip = difference(with_it, 'rear_left', 'rear_right')
    assert slip.max() < 10.0 and abs(slip[with_it.time > 2.0]).max() < 2.5
    # the wheel on the road pulls more than twice what the one on ice lets an open axle have
    pull = with_it.longitudinal_force['rear_right'][with_it.time > 3.0].mean()
    assert pull > 2.5 * without.longitudinal_force['rear_right'][without.time > 3.0].mean() > 0.0


def test_the_pressed_clutches_hold_the_wheels_together():
    without, with_it = driven(LIMITED_SLIP, False), driven(LIMITED_SLIP, True)
    assert difference(without, 'rear_left', 'rear_right').max() > 100.0
    assert difference(with_it, 'rear_left', 'rear_right').max() < 3.0
    assert with_it.longitudinal_speed[-1] > 2.0 * without.longitudinal_speed[-1]
    force = with_it.clutch_force['rear_left']
    assert 1e3 < force[-1] < 12e3 and not without.clutch_force['rear_left'].any()


def test_the_centre_clutch_gives_the_torque_to_the_axle_that_has_grip():
    without, with_it = driven(CENTRE, False), driven(CENTRE, True)
    assert difference(without, 'front_left', 'rear_left').max() > 40.0
    assert difference(with_it, 'front_left', 'rear_left').max() < 2.0
    late = with_it.time > 2.0
    assert (with_it.torque['rear_propeller'][late].mean()
            > without.torque['rear_propeller'][late].mean() + 30.0)
    assert with_it.longitudinal_speed[-1] > 1.2 * without.longitudinal_speed[-1]


def test_torque_vectoring_turns_the_car_as_it_is_steered():
    records = driven(VECTORING, False), driven(VECTORING, True)
    after = records[0].time > 1.5
    far, near = (abs(record.yaw_rate - examples.wanted(record))[after].max()
                 for record in records)
    assert near < 0.02 < 0.1 < far   # rad/s
    assert records[1].yaw_rate[after].min() > records[0].yaw_rate[after].max()
    assert records[1].longitudinal_speed[-1] < records[0].longitudinal_speed[-1]   # its price


@pytest.mark.parametrize('name', [TRACTION, VECTORING])
def test_a_run_repeats_bit_for_bit(name):
    first, second = driven(name, True), driven(name, True, again=True)
    assert {column: values.tobytes() for column, values in first.columns.items()} == {
        column: values.tobytes() for column, values in second.columns.items()}


@pytest.mark.skipif(not has_rosbags(), reason='rosbags is not installed')
def test_the_bag_of_a_run_has_what_the_node_said(tmp_path):
    from rosbags.highlevel import AnyReader
    case = examples.CASES[TRACTION]._replace(seconds=0.1)
    record = examples.run(case, True, tmp_path / 'bag')
    with AnyReader([tmp_path / 'bag']) as reader:
        counts = {topic: info.msgcount for topic, info in reader.topics.items()}
        odometry = [reader.deserialize(data, connection.msgtype)
                    for connection, _, data in reader.messages()
                    if connection.topic == '/driveline/odometry']
    ticks = len(record)
    assert counts['/driveline/joint_states'] >= ticks and counts['/driveline/commands'] >= ticks
    assert {'/driveline/tyres', '/driveline/imu', '/driveline/internal_moments',
            '/driveline/power_flow/rear'} <= set(counts)
    speeds = [message.twist.twist.linear.x for message in odometry][-ticks:]
    assert np.array_equal(speeds, record.longitudinal_speed)
