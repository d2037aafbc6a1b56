# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The topics of a node: torques in, speeds and moments out."""

from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Int8

from dm_ros.ros.messages import (
    LATEST_QOS,
    LOCKSTEP_INPUT_QOS,
    LOCKSTEP_OUTPUT_QOS,
    never_called,
    OUTPUT_QOS,
    Polled,
    SHARED_QOS,
    SnapshotMessages,
)
from dm_ros.ros.privates import poll


class Inputs:
    """The subscriptions of a node, which its loop polls."""

    def __init__(self, node):
        self._plant = plant = node.plant
        polled = Polled()

        def subscription(message_type, topic, qos):
            return node.create_subscription(message_type, topic, never_called, qos,
                                            callback_group=polled)
        self._shafts = [] if plant.lockstep else [
            (f'~/torque/{shaft}', shaft, subscription(Float64, f'~/torque/{shaft}', LATEST_QOS))
            for shaft in plant.simulation.inputs]
        self.torques = subscription(JointState, '~/torques',
                                    LOCKSTEP_INPUT_QOS if plant.lockstep else SHARED_QOS)
        if plant.lockstep:   # in real time publishers of all kinds are heard
            node.neighbours.watch('~/torques', 'RELIABILITY')

    def take(self):
        """Let the plant take what came since the last tick."""
        for topic, shaft, subscription in self._shafts:
            for message, _ in poll(subscription):
                self._plant.take((shaft,), (message.data,), topic)
        for message, _ in poll(self.torques):
            self._plant.take(message.name, message.effort, '~/torques')

    def discard(self):
        """Drop all waiting messages on ``~/torques``; return their number."""
        return sum(1 for _ in poll(self.torques))


class Outputs:
    """The publishers of a node's snapshots."""

    def __init__(self, node):
        self._node, plant = node, node.plant
        simulation, settings = plant.simulation, plant.settings
        qos = LOCKSTEP_OUTPUT_QOS if plant.lockstep else OUTPUT_QOS
        self.joint_states = node.publisher(JointState, '~/joint_states', qos)
        self.internal_moments = node.publisher(JointState, '~/internal_moments', qos)
        self.power_flow = node.publisher(Int8, '~/power_flow', qos)
        self.clock = node.publisher(Clock, '/clock', qos) if settings.publish_clock else None
        self._simulated_stamps = plant.lockstep or settings.publish_clock
        self._messages = SnapshotMessages(
            simulation.shafts, simulation.inputs, simulation.moments)

    def publish(self, snapshot, stamp=None):
        """
        Publish a snapshot of the plant.

        :param stamp: seconds and nanoseconds, None for those of now; in lockstep, and where the
            node drives the clock, simulated time counts.
        """
        if self._simulated_stamps:
            plant = self._node.plant
            stamp = divmod(round(plant.simulation.ticks * 1e9 / plant.settings.rate), 10**9)
        elif stamp is None:
            stamp = self._node.get_clock().now().seconds_nanoseconds()
        messages = self._messages
        messages.fill(snapshot, *stamp)
        if self.clock:
            self.clock.publish(Clock(clock=messages.joint_states.header.stamp))
        self.joint_states.publish(messages.joint_states)
        self.internal_moments.publish(messages.internal_moments)
        self.power_flow.publish(messages.power_flow)
