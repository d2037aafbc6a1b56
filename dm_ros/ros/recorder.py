# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Records what a node ``differential`` publishes, and on request what it is commanded."""

from operator import itemgetter

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
import rclpy
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Int8

from dm_ros.files.bag import quality
from dm_ros.files.published import input_topics, Published
from dm_ros.files.record import Record
from dm_ros.ros.messages import never_called, Polled
from dm_ros.ros.privates import poll

DEPTH = 5000
DEEP_QOS = QoSProfile(depth=DEPTH)
# reliable, but where a publisher is there that is not
HEARING_QOS = QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.BEST_AVAILABLE)


class Taps:
    """Subscriptions to the topics of a differential; poll them before ``DEPTH`` overflows."""

    def __init__(self, node, target, mechanism):
        """:param node: that subscribes; target: full name of the differential."""
        self._node, self._target, self._mechanism = node, target, mechanism
        self._group = Polled()
        self._taps = {}
        self._bag = None
        for topic in Published(mechanism).names:
            self._add(JointState, f'{target}/{topic}', DEEP_QOS)
        self._add(DiagnosticArray, '/diagnostics', DEEP_QOS)

    def record(self, bag, name=None):
        """
        Hear the inputs as well, and put all that comes from now on into a bag.

        :param bag: an open ``Bag``; name: the full name of the differential in it.
        """
        self._bag, self._name, self._topics = bag, name or self._target, {}
        self._add(Int8, f'{self._target}/power_flow', DEEP_QOS)
        self._add(JointState, f'{self._target}/torques', HEARING_QOS)
        for topic in input_topics(self._mechanism):
            self._add(Float64, f'{self._target}/{topic}', HEARING_QOS)

    def _add(self, message_type, topic, qos):
        self._taps[topic] = self._node.create_subscription(
            message_type, topic, never_called, qos, callback_group=self._group)

    def is_connected(self):
        """Return whether the differential is there to be heard."""
        return self._taps[f'{self._target}/joint_states'].get_publisher_count() > 0

    def poll(self):
        """Yield ``(topic, message)`` for all that came."""
        came = [(info['received_timestamp'], topic, subscription.msg_type, data)
                for topic, subscription in self._taps.items()
                for data, info in poll(subscription, raw=True)]
        for time, topic, message_type, data in sorted(came, key=itemgetter(0)):
            if self._bag:
                if topic not in self._topics:
                    self._topics[topic] = self._in_bag(topic, message_type)
                self._bag.write(self._topics[topic], time, data)
            yield topic, deserialize_message(data, message_type)

    def _in_bag(self, topic, message_type):
        offered = {quality(qos.depth, qos.history.name, qos.reliability.name, qos.durability.name)
                   for qos in (publisher.qos_profile for publisher in
                               self._node.get_publishers_info_by_topic(topic))}
        package, kind = message_type.__module__.split('.')[:2]
        if topic.startswith(f'{self._target}/'):
            topic = self._name + topic.removeprefix(self._target)
        return self._bag.topic(topic, f'{package}/{kind}/{message_type.__name__}', *offered)


class Recorder:
    """
    A recorder in a ROS context of its own; call ``poll`` more often than ``DEPTH`` overflows.

    A row is a tick: the messages with its stamp.
    """

    def __init__(self, node, mechanism):
        """:param node: full name of the node to record; mechanism: the ``Mechanism`` it runs."""
        self._name, self._mechanism = node, mechanism
        self._context = rclpy.Context()
        rclpy.init(context=self._context,
                   signal_handler_options=rclpy.SignalHandlerOptions.NO)
        self._node = rclpy.create_node('recorder', context=self._context)
        self._taps = Taps(self._node, node, mechanism)
        self.loaded = False      # has any shaft had a torque?
        self.reports = 0         # of /diagnostics
        self._missed_before = self._missed = 0
        self.clear()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)

    def record_in(self, bag, name):
        """Put all that comes from now on into a bag; bag, name: as for ``Taps.record``."""
        self._taps.record(bag, name)

    def clear(self):
        """Forget what was recorded."""
        self._joints, self._moments, self._forces, self._flows = [], {}, {}, {}
        self._missed_before = self._missed

    def poll(self):
        """Take all messages that came; return how many ticks they bring."""
        before = len(self._joints)
        for topic, message in self._taps.poll():
            what = topic.removeprefix(f'{self._name}/')
            if what == 'joint_states':
                self._joints.append(message)
                self.loaded = self.loaded or any(message.effort)
            elif what == 'internal_moments':
                self._moments[stamp(message)] = message.effort
            elif what == 'clutches':
                self._forces[stamp(message)] = message.effort
            elif what == 'power_flow_stamped':
                self._flows[stamp(message)] = message.position
            elif what == '/diagnostics':
                self._note(message)
        return len(self._joints) - before

    def _note(self, message):
        mine = [status for status in message.status if status.hardware_id == self._name]
        self.reports += bool(mine)
        for pair in (pair for status in mine for pair in status.values):
            if pair.key == 'missed ticks':
                self._missed = int(pair.value)

    @property
    def missed(self):
        """Ticks that the node reported as missed during the record."""
        return self._missed - self._missed_before

    def record(self, duration, title):
        """
        Return the ``Record``, whose time begins with the last tick before the first torque.

        :param duration: s, what came later is left out; title: of the record.
        :raises RuntimeError: for a record without two whole ticks.
        """
        table = np.array(list(self._rows()))
        if len(table) < 2:
            raise RuntimeError('the record is empty')
        shafts = len(self._mechanism.shafts)
        torques = table[:, 1 + 2 * shafts:][:, :len(self._mechanism.inputs)]
        table = table[max(0, int(torques.any(axis=1).argmax()) - 1):]
        table[:, 0] -= table[0, 0]
        return Record(self._mechanism, table[table[:, 0] <= duration], title)

    def _rows(self):
        inputs = [self._mechanism.shafts.index(name) for name in self._mechanism.inputs]
        for joints in self._joints:
            moments = self._moments.get(stamp(joints))
            flow = self._flows.get(stamp(joints))
            forces = self._forces.get(stamp(joints)) if self._mechanism.actuators else ()
            if None not in (moments, flow, forces):
                sec, nanosec = stamp(joints)
                yield (sec + nanosec * 1e-9, *joints.velocity, *joints.position,
                       *(joints.effort[i] for i in inputs), *moments, *flow, *forces)


def stamp(message):
    """Return the stamp of a message as (seconds, nanoseconds)."""
    return message.header.stamp.sec, message.header.stamp.nanosec
