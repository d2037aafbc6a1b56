# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Records what a node ``differential`` publishes."""

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
import rclpy
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

from dm_ros.files.record import Record
from dm_ros.ros.messages import never_called, Polled
from dm_ros.ros.privates import poll

DEEP_QOS = QoSProfile(depth=5000)


class Recorder:
    """
    A recorder in a ROS context of its own; call ``poll`` more often than ``DEEP_QOS`` overflows.

    A row is a tick: the messages with its stamp.
    """

    def __init__(self, node, mechanism):
        """:param node: full name of the node to record; mechanism: the ``Mechanism`` it runs."""
        self._name, self._mechanism = node, mechanism
        self._context = rclpy.Context()
        rclpy.init(context=self._context,
                   signal_handler_options=rclpy.SignalHandlerOptions.NO)
        self._node = rclpy.create_node('recorder', context=self._context)
        group = Polled()

        def subscribe(message_type, topic):
            return self._node.create_subscription(message_type, topic, never_called, DEEP_QOS,
                                                  callback_group=group)
        self._joint_states = subscribe(JointState, f'{node}/joint_states')
        self._internal_moments = subscribe(JointState, f'{node}/internal_moments')
        self._clutches = (subscribe(JointState, f'{node}/clutches')
                          if self._mechanism.actuators else None)
        self._power_flow = subscribe(JointState, f'{node}/power_flow_stamped')
        self._diagnostics = subscribe(DiagnosticArray, '/diagnostics')
        self.loaded = False      # has any shaft had a torque?
        self.reports = 0         # of /diagnostics
        self._missed_before = self._missed = 0
        self.clear()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)

    def clear(self):
        """Forget what was recorded."""
        self._joints, self._moments, self._forces, self._flows = [], {}, {}, {}
        self._missed_before = self._missed

    def poll(self):
        """Take all messages that came; return how many ticks they bring."""
        before = len(self._joints)
        for message, _ in poll(self._joint_states):
            self._joints.append(message)
            self.loaded = self.loaded or any(message.effort)
        for message, _ in poll(self._internal_moments):
            self._moments[stamp(message)] = message.effort
        for message, _ in poll(self._clutches) if self._clutches else ():
            self._forces[stamp(message)] = message.effort
        for message, _ in poll(self._power_flow):
            self._flows[stamp(message)] = message.position
        for message, _ in poll(self._diagnostics):
            mine = [s for s in message.status if s.hardware_id == self._name]
            self.reports += bool(mine)
            for pair in (pair for s in mine for pair in s.values):
                if pair.key == 'missed ticks':
                    self._missed = int(pair.value)
        return len(self._joints) - before

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
            forces = self._forces.get(stamp(joints)) if self._clutches else ()
            if None not in (moments, flow, forces):
                sec, nanosec = stamp(joints)
                yield (sec + nanosec * 1e-9, *joints.velocity, *joints.position,
                       *(joints.effort[i] for i in inputs), *moments, *flow, *forces)


def stamp(message):
    """Return the stamp of a message as (seconds, nanoseconds)."""
    return message.header.stamp.sec, message.header.stamp.nanosec
