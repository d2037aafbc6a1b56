# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The node ``driveline``: a car from the gearbox output to the road, at a fixed rate."""

import sys

from dm_ros.driveline_plant import all_rows, DrivelinePlant, passed_over
from dm_ros.ros.driveline_messages import DrivelineMessages
from dm_ros.ros.driven_node import DrivenNode, main_of
from dm_ros.ros.parameters import declare_rows
from dm_ros.ros.privates import given_parameters

HELP = """\
A car in real time, from the gearbox output to the road: torque, brakes, clutches, steering and
the road in as topics, speeds, tyres and the motion of the body out.

  in   ~/torque/input       std_msgs/Float64          N m, of the gearbox
       ~/brake/<wheel>      std_msgs/Float64          N m, what the brake can hold
       ~/clutch/<clutch>    std_msgs/Float64          N, axial force on one clutch
       ~/steer              std_msgs/Float64          rad, of the front wheels, left positive
       ~/grade              std_msgs/Float64          tangent of the slope, uphill positive
       ~/grip/<wheel>       std_msgs/Float64          friction of the road below a wheel
       ~/contact/<wheel>    std_msgs/Float64          share of its load that a wheel has
       ~/commands           sensor_msgs/JointState    all of them by name: input, <wheel>_brake,
                                                      <clutch>_clutch as effort; steer, grade,
                                                      <wheel>_grip, <wheel>_contact as position
  out  ~/joint_states       sensor_msgs/JointState    all shafts: rad, rad/s, N m
       ~/internal_moments   sensor_msgs/JointState    N m as effort
       ~/clutches           sensor_msgs/JointState    slip in rad and rad/s, force in N
       ~/tyres              sensor_msgs/JointState    slip, slip speed in m/s, force in N
       ~/odometry           nav_msgs/Odometry         in the plane of the road
       ~/imu                sensor_msgs/Imu
       ~/power_flow/<differential> std_msgs/Int8      +1 the input drives, -1 the wheels do
       /diagnostics         diagnostic_msgs/DiagnosticArray
  srv  ~/reset ~/step       std_srvs/Trigger
       ~/pause              std_srvs/SetBool

Wheels: front_left, front_right, rear_left, rear_right.

  --ros-args -p layout:=rwd -p rate:=500.0
  --ros-args -p planar:=true -p initial_speed:=20.0
  --ros-args --params-file driveline_awd.yaml

ros2 param list /driveline names all parameters, ros2 param describe tells of each.
"""


class DrivelineNode(DrivenNode):
    """A driveline in real time or in lockstep, see ``DrivenNode``."""

    name, help = 'driveline', HELP
    input_topics = ('~/commands/', '~/torque/', '~/brake/', '~/clutch/', '~/steer/', '~/grade/',
                    '~/grip/', '~/contact/')

    def declared(self):
        """Declare all parameters; return the ``DrivelinePlant``."""
        given, known = given_parameters(self), all_rows()
        for name in given:
            if name not in known and not self.has_parameter(name):
                raise ValueError(f'{name}: there is no such parameter')
        started = {name: known[name].strictly_checked(name, value)
                   for name, value in given.items() if name in known}
        plant = DrivelinePlant(started, self.get_logger())
        if others := passed_over(started):
            self.get_logger().warning(others)
        declare_rows(self, plant.rows, plant.values)
        return plant

    def messages(self):
        """Return the messages of a tick."""
        return DrivelineMessages(self.plant)


def main(args=None):
    """Run the node until SIGINT or SIGTERM; return the exit code."""
    return main_of(DrivelineNode, args)


if __name__ == '__main__':
    sys.exit(main())
