# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The car and the lock of its differential as ordinary rclpy nodes: thin shells around ``car``.

    differential --- joint_states ---> brake_lock ----- brake_demands -----> car --- torques
         ^  |   or --- clutches ---> limited_slip  or  clutch_demands         ^         |
         |  +------------------------- joint_states --------------------------+         |
         +------------------------------------------------------------------------------+

In lockstep each message on ``~/torques`` is a tick, so exactly one node may publish it: the car.
It waits for the joint states and the demands of one stamp, in whichever order they come, and
answers them with one message of torques, and of forces on the clutches. So nothing depends on
timing.
"""

from collections import deque

from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile
from sensor_msgs.msg import JointState

# reliable, and nothing is dropped: in lockstep a lost message is a lost tick
EVERY_MESSAGE = QoSProfile(history=HistoryPolicy.KEEP_ALL)


class BrakeLockNode(Node):
    """
    Answers the speeds of the wheels with demands on their brakes.

    in   ``differential/joint_states``   out  ``brake_demands``: ``effort`` in N m, the stamp is
    that of the joint states

    :param law: a ``BrakeLock``; wheels: names of the left and the right shaft.
    """

    def __init__(self, law, wheels, **node_options):
        super().__init__('brake_lock', **node_options)
        self.law, self._wheels = law, wheels
        self._demands = self.create_publisher(JointState, 'brake_demands', EVERY_MESSAGE)
        self.create_subscription(
            JointState, 'differential/joint_states', self._answer, EVERY_MESSAGE)

    def restart(self):
        """Go back to the start, as after a reset of the differential."""
        self.law.restart()

    def _answer(self, joints):
        demands = self.law.brakes(speeds(joints, self._wheels))
        self._demands.publish(
            JointState(header=joints.header, name=self._wheels, effort=demands))


class CarNode(Node):
    """
    Answers the speeds of the shafts, and the demands of a controller, with torques on the shafts.

    A demand on a wheel is one on its brake, N m; any other goes on to the differential with the
    torques, such as the force on a clutch, N.

    in   ``differential/joint_states`` and the demands   out  ``differential/torques``

    :param car: a ``Car``; inputs: names of the pinion, the left and the right shaft.
    :param demands: the topic of a controller that is to be waited for, None without one.
    """

    def __init__(self, car, inputs, demands=None, **node_options):
        super().__init__('car', **node_options)
        self.car, self._inputs = car, inputs
        self._states, self._demands = deque(), deque()
        self._torques = self.create_publisher(JointState, 'differential/torques', EVERY_MESSAGE)
        self.create_subscription(
            JointState, 'differential/joint_states', self._on_state, EVERY_MESSAGE)
        self._controlled = demands is not None
        if self._controlled:
            self.create_subscription(JointState, demands, self._on_demand, EVERY_MESSAGE)

    def restart(self):
        """Go back to the start, as after a reset of the differential."""
        self.car.restart()
        self._states.clear()
        self._demands.clear()

    def _on_state(self, joints):
        self._states.append(joints)
        if not self._controlled:
            self._demands.append(JointState(header=joints.header))
        self._answer()

    def _on_demand(self, demands):
        self._demands.append(demands)
        self._answer()

    def _answer(self):
        while self._states and self._demands:
            joints, demands = self._states.popleft(), self._demands.popleft()
            if joints.header.stamp != demands.header.stamp:
                raise RuntimeError('the demands do not answer the joint states')
            demanded = dict(zip(demands.name, demands.effort))
            brakes = [demanded.pop(wheel, 0.0) for wheel in self._inputs[1:]]
            pinion, *wheels = speeds(joints, self._inputs)
            torques = self.car.torques(pinion, wheels, brakes)
            self._torques.publish(JointState(
                header=joints.header, name=[*self._inputs, *demanded],
                effort=[*torques, *demanded.values()]))


def speeds(joints, names):
    """Return the speeds of some shafts by name, rad/s, in the order of the names."""
    return tuple(joints.velocity[joints.name.index(name)] for name in names)
