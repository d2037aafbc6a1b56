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

A car that owns its wheels gives their speeds in the same message, and the lock gets them from it::

    differential --- joint_states --->  car  --- wheel_states ---> brake_lock
         ^                             |   ^                           |
         +---------- torques ----------+   +------ brake_demands ------+
"""

from collections import deque
import math

from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile
from sensor_msgs.msg import JointState

# reliable, and nothing is dropped: in lockstep a lost message is a lost tick
EVERY_MESSAGE = QoSProfile(history=HistoryPolicy.KEEP_ALL)
JOINT_STATES = 'differential/joint_states'
WHEEL_STATES = 'wheel_states'   # of a car that owns its wheels


class BrakeLockNode(Node):
    """
    Answers the speeds of the wheels with demands on their brakes.

    in   ``differential/joint_states``   out  ``brake_demands``: ``effort`` in N m, the stamp is
    that of the joint states

    :param law: a ``BrakeLock``; wheels: names of the left and the right shaft.
    :param states: another topic that tells the speeds of the wheels.
    """

    def __init__(self, law, wheels, states=JOINT_STATES, **node_options):
        super().__init__('brake_lock', **node_options)
        self.law, self._wheels = law, wheels
        self._demands = self.create_publisher(JointState, 'brake_demands', EVERY_MESSAGE)
        self.create_subscription(JointState, states, self._answer, EVERY_MESSAGE)

    def restart(self):
        """Go back to the start, as after a reset of the differential."""
        self.law.restart()

    def _answer(self, joints):
        demands = self.law.brakes(speeds(joints, self._wheels))
        self._demands.publish(
            JointState(header=joints.header, name=self._wheels, effort=demands))


class CarNode(Node):
    """
    Answers the state of the differential, and the demands of a controller, with what goes in next.

    A demand on a wheel is one on its brake, N m; any other goes on to the differential with the
    torques, such as the force on a clutch, N.

    in   ``differential/joint_states`` and the demands   out  ``differential/torques`` and, of a
    car that owns its wheels, ``wheel_states``: their speeds, the stamp is that of the joint states

    :param car: a ``Car``; inputs: names of the pinion, the left and the right shaft.
    :param demands: the topic of a controller that is to be waited for, None without one.
    """

    def __init__(self, car, inputs, demands=None, **node_options):
        super().__init__('car', **node_options)
        self.car, self._inputs = car, inputs
        self._states, self._demands = deque(), deque()
        self._torques = self.create_publisher(JointState, 'differential/torques', EVERY_MESSAGE)
        self._wheels = self.create_publisher(
            JointState, WHEEL_STATES, EVERY_MESSAGE) if car.gives_speeds else None
        self.create_subscription(JointState, JOINT_STATES, self._on_state, EVERY_MESSAGE)
        self._controlled = demands is not None
        if self._controlled:
            self.create_subscription(JointState, demands, self._on_demand, EVERY_MESSAGE)

    def restart(self):
        """Go back to the start, as after a reset of the differential."""
        self.car.restart()
        self._states.clear()
        self._demands.clear()

    def _on_state(self, joints):
        self.car.see(speeds(joints, self._inputs), of(joints.effort, joints, self._inputs))
        if self._wheels:
            self._wheels.publish(JointState(
                header=joints.header, name=self._inputs[1:], velocity=self.car.wheels))
        self._states.append(joints.header.stamp)
        if not self._controlled:
            self._demands.append(JointState(header=joints.header))
        self._answer()

    def _on_demand(self, demands):
        self._demands.append(demands)
        self._answer()

    def _answer(self):
        while self._states and self._demands:
            stamp, demands = self._states.popleft(), self._demands.popleft()
            if stamp != demands.header.stamp:
                raise RuntimeError('the demands do not answer the joint states')
            demanded = dict(zip(demands.name, demands.effort))
            pinion, *wheels = self.car.answer(
                [demanded.pop(wheel, 0.0) for wheel in self._inputs[1:]])
            answer = JointState(header=demands.header, name=[*self._inputs, *demanded])
            none = [math.nan] * 2
            answer.effort = [pinion, *(none if self._wheels else wheels), *demanded.values()]
            if self._wheels:
                answer.velocity = [math.nan, *wheels, *[math.nan] * len(demanded)]
            self._torques.publish(answer)


def speeds(joints, names):
    """Return the speeds of some shafts by name, rad/s, in the order of the names."""
    return of(joints.velocity, joints, names)


def of(values, joints, names):
    """Return the values of some joints by name, in the order of the names."""
    return tuple(values[joints.name.index(name)] for name in names)
