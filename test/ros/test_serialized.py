# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The numbers read from the bytes of a message are those of the message."""

from math import cos, sin

from hypothesis import given
from hypothesis import strategies as st
from nav_msgs.msg import Odometry
import pytest
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from dm_ros.ros.messages import never_called, Polled
from dm_ros.ros.privates import poll
from dm_ros.ros.serialized import ALL, Layout, OdometryLayout
from dm_ros.ros.watched import TOPICS
from dm_ros.watch.scene import Scene

NAMES = st.lists(st.text('abcdefgh_/.', min_size=1, max_size=12), min_size=1, max_size=6)


def message(frame, names, sec, nanosec, numbers):
    """Return a message whose arrays have the numbers by their name."""
    result = JointState(name=names, **numbers)
    result.header.frame_id = frame
    result.header.stamp.sec, result.header.stamp.nanosec = sec, nanosec
    return bytes(serialize_message(result))


def layout_alone(frame, names, arrays):
    """Return a Layout that makes no message."""
    layout = Layout(frame, names, arrays)
    layout.read_whole = None
    return layout


@given(st.text('abc_/', max_size=9), NAMES, st.integers(-2**31, 2**31 - 1),
       st.integers(0, 10**9 - 1), st.sets(st.sampled_from(ALL), min_size=1), st.data())
def test_the_bytes_have_the_numbers_of_the_message(frame, names, sec, nanosec, arrays, data):
    arrays = [name for name in ALL if name in arrays]
    numbers = {name: data.draw(st.lists(st.floats(), min_size=len(names), max_size=len(names)))
               for name in arrays}
    layout = layout_alone(frame, names, arrays)
    stamp, read = layout.read(
        message(frame, names, sec, nanosec, numbers)[:layout.length])   # a buffer is longer
    assert stamp == sec * 10**9 + nanosec
    assert list(map(repr, map(list, read))) == [repr(numbers[name]) for name in arrays]


def test_another_frame_is_read_as_a_whole_and_other_names_are_refused():
    layout = Layout('a', ['one', 'two'], ['effort'])
    other = message('longer', ['one', 'two'], 1, 2, {'effort': [3.0, 4.0]})
    assert layout.read(other) == (1_000_000_002, ((3.0, 4.0),))
    for names, numbers in ((['one', 'six'], {'effort': [3.0, 4.0]}), (['one'], {'effort': [3.0]}),
                           (['one', 'two'], {'velocity': [3.0, 4.0]}), (['one', 'two'], {})):
        with pytest.raises(ValueError, match='one'):
            layout.read(message('a', names, 1, 2, numbers))


@given(st.text('abc_/', max_size=9), st.text('abc_/', max_size=9), st.floats(-3.1, 3.1))
def test_the_bytes_have_the_motion_of_an_odometry(frame, child, yaw):
    odometry = Odometry(child_frame_id=child)
    odometry.header.frame_id, odometry.header.stamp.sec = frame, 7
    pose, twist = odometry.pose.pose, odometry.twist.twist
    pose.position.x, pose.position.y = 3.0, -4.0
    pose.orientation.z, pose.orientation.w = sin(0.5 * yaw), cos(0.5 * yaw)
    twist.linear.x, twist.linear.y, twist.angular.z = 1.0, -2.0, 0.5
    odometry.pose.covariance[:] = odometry.twist.covariance[:] = [9.0] * 36
    data = bytes(serialize_message(odometry))
    layout = OdometryLayout(frame, child)
    layout.read_whole = None
    stamp, (place, motion) = layout.read(data)
    assert stamp == 7_000_000_000 and motion == (1.0, -2.0, 0.5)
    assert place == (3.0, -4.0, pytest.approx(yaw, abs=1e-12))
    with pytest.raises(ValueError, match='the frames are'):
        OdometryLayout(frame, f'{child}x').read(data)


@pytest.mark.parametrize('variant', ['symmetric_ode', 'lsd_ode'])
def test_what_a_node_publishes_is_read_without_a_message(ros, variant):
    ros.differential(variant, joint_prefix='rear_')
    scene = Scene('/differential', {'variant': variant, 'joint_prefix': 'rear_'})
    assert set(scene.names) <= set(TOPICS)
    for topic, names in scene.names.items():
        layout = layout_alone(scene.frame, names, TOPICS[topic])
        heard = ros.listen(JointState, f'/differential/{topic}')
        polled = ros.node.create_subscription(
            JointState, f'/differential/{topic}', never_called, 1000, callback_group=Polled())
        read = {}

        def both():
            read.update(layout.read(data) for data, _ in poll(polled, raw=True))  # noqa: B023
            return [m for m in heard if stamp(m) in read]  # noqa: B023
        ros.until(both)
        message = both()[-1]
        assert read[stamp(message)] == tuple(
            tuple(getattr(message, name)) for name in TOPICS[topic])


def stamp(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
