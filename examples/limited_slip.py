# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

r"""
A controller node: an electronic limited slip for any differential with clutches.

In real time, beside a node ``differential`` and whoever gives the torques::

    ros2 run dm_ros differential --ros-args -p symmetric.pressure_angle:=0.0 \
      -p symmetric.clutch.left.friction_surfaces:=4 -p symmetric.clutch.right.friction_surfaces:=4
    python examples/limited_slip.py --ros-args -p gain:=8000.0 -p threshold:=1.5

It may be started and stopped at any time: without it the forces grow stale, and the clutches open.
"""

from dataclasses import fields
import sys

from car import LimitedSlip
from car_nodes import EVERY_MESSAGE
from rclpy.node import Node
from run_node import run
from sensor_msgs.msg import JointState


class LimitedSlipNode(Node):
    """
    Answers the slip of all clutches with the forces on them.

    in   ``differential/clutches``   out   ``differential/torques``: names of the clutches alone,
    ``effort`` in N; the stamp is that of the slip

    :param demands: another topic for the forces: in lockstep only one node may give torques.
    """

    def __init__(self, demands='differential/torques', **node_options):
        super().__init__('limited_slip', **node_options)
        self.law = LimitedSlip(**{
            field.name: self.declare_parameter(field.name, field.default).value
            for field in fields(LimitedSlip)})
        self._forces = self.create_publisher(JointState, demands, EVERY_MESSAGE)
        self.create_subscription(
            JointState, 'differential/clutches', self._answer, EVERY_MESSAGE)

    def _answer(self, clutches):
        forces = [self.law.force(slip) for slip in clutches.velocity]
        self._forces.publish(
            JointState(header=clutches.header, name=clutches.name, effort=forces))


def main(args=None):
    """Run the node until SIGINT or SIGTERM; return the exit code."""
    return run(LimitedSlipNode, args)


if __name__ == '__main__':
    sys.exit(main())
