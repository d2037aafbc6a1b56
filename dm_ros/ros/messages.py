# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Snapshots as ROS messages, and the quality of service of topics."""

from rclpy.callback_groups import CallbackGroup
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Int8

from dm_ros.files.bag import OUTPUT_DEPTH
from dm_ros.files.published import Published

OUTPUT_QOS = QoSProfile(depth=10)   # reliable, so that every subscriber hears it
# best effort hears every publisher; several controllers may share ~/torques within a tick
LATEST_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
SHARED_QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)

# in lockstep nothing may be lost: not a tick, not its answer
LOCKSTEP_INPUT_QOS = QoSProfile(history=HistoryPolicy.KEEP_ALL)
LOCKSTEP_OUTPUT_QOS = QoSProfile(depth=OUTPUT_DEPTH)


class Polled(CallbackGroup):
    """A group for subscriptions that no executor serves, see ``poll`` of ``privates``."""

    def can_execute(self, entity):
        return False

    def beginning_execution(self, entity):
        return False

    def ending_execution(self, entity):
        pass


def never_called(message):
    """Stand in for the callback of a polled subscription."""


class SnapshotMessages:
    """
    The messages of a tick, reused from tick to tick.

    ``of_a_tick`` maps the last word of each topic, in the order of publication, to its message.
    """

    def __init__(self, mechanism, prefix):
        """:param mechanism: its ``Mechanism``; prefix: before each name."""
        self._published = published = Published(mechanism, prefix)
        self._joints = {topic: JointState(name=names) for topic, names in published.names.items()}
        self._power_flow = Int8()
        self.of_a_tick = {**self._joints, 'power_flow': self._power_flow}
        for message in self._joints.values():
            message.header.frame_id = published.frame

    def fill(self, snapshot, seconds, nanoseconds):
        """Put a snapshot and one stamp into the messages, in place."""
        arrays = self._published.arrays(snapshot)
        for message, (position, velocity, effort) in zip(self._joints.values(), arrays):
            message.position[:] = position
            message.velocity[:] = velocity
            message.effort[:] = effort
            stamp = message.header.stamp
            stamp.sec, stamp.nanosec = seconds, nanoseconds
        self._power_flow.data = snapshot.power_flow
