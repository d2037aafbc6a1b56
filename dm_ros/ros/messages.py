# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Snapshots as ROS messages, and the quality of service of topics."""

from array import array

from rclpy.callback_groups import CallbackGroup
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Int8

OUTPUT_QOS = QoSProfile(depth=10)   # reliable, so that every subscriber hears it
# best effort hears every publisher; several controllers may share ~/torques within a tick
LATEST_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
SHARED_QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)

# in lockstep nothing may be lost: not a tick, not its answer
LOCKSTEP_INPUT_QOS = QoSProfile(history=HistoryPolicy.KEEP_ALL)
LOCKSTEP_OUTPUT_QOS = QoSProfile(depth=10_000)


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
    """The messages of a tick, reused from tick to tick; ``clutches`` is None where none are."""

    def __init__(self, mechanism, prefix):
        """:param mechanism: its ``Mechanism``; prefix: before each name."""
        shafts, moments, clutches = mechanism.shafts, mechanism.moments, mechanism.actuators
        n = len(shafts)
        self.joint_states = JointState(
            name=[prefix + shaft for shaft in shafts],
            position=[0.0] * n, velocity=[0.0] * n, effort=[0.0] * n)
        self.internal_moments = JointState(
            name=[prefix + moment for moment in moments], effort=[0.0] * len(moments))
        self.clutches = JointState(
            name=[prefix + clutch.name for clutch in clutches], position=[0.0] * len(clutches),
            velocity=[0.0] * len(clutches), effort=[0.0] * len(clutches)) if clutches else None
        self.power_flow = Int8()
        self._no_torque = dict.fromkeys(shafts, 0.0)
        self._inputs = mechanism.inputs
        self._carrier = shafts.index('carrier')
        self._clutched = tuple(map(shafts.index, mechanism.clutches))

    def fill(self, snapshot, seconds, nanoseconds):
        """Put a snapshot and one stamp into the messages, in place."""
        joints, moments = self.joint_states, self.internal_moments
        torque = {**self._no_torque, **dict(zip(self._inputs, snapshot.torque))}
        joints.position[:] = array('d', snapshot.position)
        joints.velocity[:] = array('d', snapshot.velocity)
        joints.effort[:] = array('d', torque.values())
        moments.effort[:] = array('d', snapshot.moment)
        for stamp in (joints.header.stamp, moments.header.stamp):
            stamp.sec, stamp.nanosec = seconds, nanoseconds
        if clutches := self.clutches:
            clutches.position[:] = self._slip(snapshot.position)
            clutches.velocity[:] = self._slip(snapshot.velocity)
            clutches.effort[:] = array('d', snapshot.clutch_force)
            stamp = clutches.header.stamp
            stamp.sec, stamp.nanosec = seconds, nanoseconds
        self.power_flow.data = snapshot.power_flow

    def _slip(self, values):
        """Return how far the shafts with a clutch are ahead of the carrier."""
        carrier = values[self._carrier]
        return array('d', [values[i] - carrier for i in self._clutched])
