# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
A process that owns the wheels: half-shafts couple them to a differential over topics.

In real time, beside a node ``differential`` with speed ports and whoever drives the pinion::

    ros2 run dm_ros differential --ros-args -p port.left.kind:=speed -p port.right.kind:=speed
    python examples/wheel_node.py
    ros2 topic pub -r 50 /differential/torque/pinion std_msgs/msg/Float64 '{data: 250.0}'

It may be started and stopped at any time: without it the speeds grow stale, and the shafts turn
freely.
"""

import sys

from car_nodes import EVERY_MESSAGE
from rclpy.node import Node
from run_node import run
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from wheel import Wheel


class WheelNode(Node):
    """
    Answers the torques of half-shafts with the speeds of its wheels, a tick for each message.

    in   ``differential/joint_states``: ``effort`` of a half-shaft, N m   out
    ``differential/speed/<shaft>``, rad/s; in lockstep, where one message is a tick,
    ``differential/torques`` with ``velocity``
    """

    def __init__(self, **node_options):
        super().__init__('wheels', **node_options)

        def parameter(name, default):
            return self.declare_parameter(name, default).value
        self._dt = 1.0 / parameter('rate', 200.0)   # Hz, that of the differential
        options = {name: parameter(name, default) for name, default in (
            ('inertia', 1.0), ('slope', 1400.0), ('road', 0.0), ('speed', 0.0))}
        self.wheels = {name: Wheel(**options)
                       for name in parameter('shafts', ['left', 'right'])}
        if parameter('lockstep', False):
            self._together = self.create_publisher(
                JointState, 'differential/torques', EVERY_MESSAGE)
        else:
            self._together = None
            self._single = {name: self.create_publisher(
                Float64, f'differential/speed/{name}', EVERY_MESSAGE) for name in self.wheels}
        self.create_subscription(
            JointState, 'differential/joint_states', self._answer, EVERY_MESSAGE)

    def _answer(self, joints):
        torques = dict(zip(joints.name, joints.effort))
        speeds = {name: wheel.turn(-torques[name], self._dt)
                  for name, wheel in self.wheels.items()}
        if self._together:
            self._together.publish(JointState(
                header=joints.header, name=list(speeds), velocity=list(speeds.values())))
        else:
            for name, speed in speeds.items():
                self._single[name].publish(Float64(data=speed))


def main(args=None):
    """Run the node until SIGINT or SIGTERM; return the exit code."""
    return run(WheelNode, args)


if __name__ == '__main__':
    sys.exit(main())
