# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The topics of a node: inputs and what its simulation reports."""

from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from dm_ros.motion.held_inputs import Joints
from dm_ros.ros.messages import (
    LATEST_QOS,
    LOCKSTEP_INPUT_QOS,
    LOCKSTEP_OUTPUT_QOS,
    never_called,
    OUTPUT_QOS,
    Polled,
    SHARED_QOS,
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
        self._single = [] if plant.lockstep else [
            (f'~/{topic}', port, subscription(Float64, f'~/{topic}', LATEST_QOS))
            for topic, port in plant.single_topics.items()]
        self._topic = f'~/{plant.grouped}'
        self.grouped = subscription(JointState, self._topic,
                                    LOCKSTEP_INPUT_QOS if plant.lockstep else SHARED_QOS)
        if plant.lockstep:   # in real time publishers of all kinds are heard
            node.neighbours.watch(self._topic, 'RELIABILITY')
        self.sources = Sources(plant.inputs.names, self._topic, {
            topic: (port, subscription) for topic, port, subscription in self._single},
            node.neighbours)

    def take(self):
        """Let the plant take what came since the last tick."""
        for topic, port, subscription in self._single:
            for message, _ in poll(subscription):
                if self._plant.take((port,), (message.data,), topic):
                    self.sources.note(self._plant.inputs.commanded, False, None)
        for message, info in poll(self.grouped):
            self.take_grouped(message, info)

    def take_grouped(self, message, info, stamp=0):
        """Let the plant take a message of many inputs; return whether it was taken."""
        joints = Joints(message.effort, message.velocity, message.position)
        taken = self._plant.take(message.name, joints, self._topic, stamp, sparse=True)
        if taken:
            self.sources.note(self._plant.inputs.commanded, True,
                              info['publication_sequence_number'])
        return taken

    def discard(self):
        """Drop all waiting messages of many inputs; return their number."""
        return sum(1 for _ in poll(self.grouped))


class Outputs:
    """
    The publishers of a node's snapshots.

    :param messages: has ``of_a_tick``, ``{topic: message}`` in the order of publication, the first
        a JointState, and ``fill(snapshot, seconds, nanoseconds)``.
    """

    def __init__(self, node, messages):
        self._node, self._messages, settings = node, messages, node.plant.settings
        qos = LOCKSTEP_OUTPUT_QOS if node.plant.lockstep else OUTPUT_QOS
        self.of_a_tick = [(node.publisher(type(message), f'~/{topic}', qos), message)
                          for topic, message in messages.of_a_tick.items()]
        _, self._joint_states = self.of_a_tick[0]
        self.clock = node.publisher(Clock, '/clock', qos) if settings.publish_clock else None
        self._simulated_stamps = node.plant.lockstep or settings.publish_clock

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
