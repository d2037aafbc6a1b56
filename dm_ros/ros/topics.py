# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The topics of a node: torques and forces in, speeds and moments out."""

from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Int8

from dm_ros.files.published import input_topics
from dm_ros.motion.held_inputs import Joints
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
from dm_ros.ros.sources import Sources


class Inputs:
    """The subscriptions of a node, which its loop polls."""

    def __init__(self, node):
        self._plant = plant = node.plant
        polled = Polled()

        def subscription(message_type, topic, qos):
            package, kind = message_type.__module__.split('.')[:2]
            node.neighbours.heard[topic] = f'{package}/{kind}/{message_type.__name__}'
            return node.create_subscription(message_type, topic, never_called, qos,
                                            callback_group=polled)
        mechanism = plant.simulation.mechanism
        self._single = [] if plant.lockstep else [
            (f'~/{topic}', port, subscription(Float64, f'~/{topic}', LATEST_QOS))
            for topic, port in input_topics(mechanism).items()]
        self.torques = subscription(JointState, '~/torques',
                                    LOCKSTEP_INPUT_QOS if plant.lockstep else SHARED_QOS)
        if plant.lockstep:   # in real time publishers of all kinds are heard
            node.neighbours.watch('~/torques', 'RELIABILITY')
        self.sources = Sources(plant.inputs.names, {
            topic: (port, subscription) for topic, port, subscription in self._single},
            node.neighbours)

    def take(self):
        """Let the plant take what came since the last tick."""
        for topic, port, subscription in self._single:
            for message, _ in poll(subscription):
                if self._plant.take((port,), (message.data,), topic):
                    self.sources.note(self._plant.inputs.commanded, False, None)
        for message, info in poll(self.torques):
            self.take_grouped(message, info)

    def take_grouped(self, message, info, stamp=0):
        """Let the plant take a message of ``~/torques``; return whether it was taken."""
        taken = self._plant.take(message.name, Joints(message.effort, message.velocity, message.position),
                                 '~/torques', stamp, sparse=True)
        if taken:
            self.sources.note(self._plant.inputs.commanded, True,
                              info['publication_sequence_number'])
        return taken

    def discard(self):
        """Drop all waiting messages on ``~/torques``; return their number."""
        return sum(1 for _ in poll(self.torques))


class Outputs:
    """The publishers of a node's snapshots."""

    def __init__(self, node):
        self._node, plant = node, node.plant
        mechanism, settings = plant.simulation.mechanism, plant.settings
        qos = LOCKSTEP_OUTPUT_QOS if plant.lockstep else OUTPUT_QOS
        self._messages = messages = SnapshotMessages(mechanism, settings.joint_prefix)
        self.of_a_tick = [   # in the order of publication
            *((node.publisher(JointState, f'~/{topic}', qos), message)
              for topic, message in messages.joints.items()),
            (node.publisher(Int8, '~/power_flow', qos), messages.power_flow)]
        self.joint_states, self._joint_states = self.of_a_tick[0]
        self.clock = node.publisher(Clock, '/clock', qos) if settings.publish_clock else None
        self._simulated_stamps = plant.lockstep or settings.publish_clock

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
        self._messages.fill(snapshot, *stamp)
        if self.clock:
            self.clock.publish(Clock(clock=self._joint_states.header.stamp))
        for publisher, message in self.of_a_tick:
            publisher.publish(message)
