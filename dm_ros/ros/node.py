# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The node ``differential``: the simulation at a fixed rate, torques in, speeds out."""

import sys

from dm_ros.plant import Plant
from dm_ros.ros.driven_node import DrivenNode, main_of
from dm_ros.ros.messages import SnapshotMessages
from dm_ros.ros.parameters import declare_all

HELP = """\
A vehicle differential in real time: torques in as topics, speeds and internal moments out.
Where it has clutches (lsd_*, and symmetric_* with friction surfaces) axial forces press them.

  in   ~/torque/<shaft>     std_msgs/Float64          N m, one shaft
       ~/speed/<shaft>      std_msgs/Float64          rad/s, outside one with a speed port
       ~/clutch/<clutch>    std_msgs/Float64          N, axial force on one clutch
       ~/torques            sensor_msgs/JointState    N m and N as effort, any shafts and
                                                      clutches (<clutch>_clutch) by name;
                                                      velocity of speed ports
  out  ~/joint_states       sensor_msgs/JointState    all shafts: rad, rad/s, N m
       ~/internal_moments   sensor_msgs/JointState    N m as effort
       ~/clutches           sensor_msgs/JointState    slip in rad and rad/s, force in N
       ~/power_flow         std_msgs/Int8             +1 direct, -1 reverse
       ~/power_flow_stamped sensor_msgs/JointState    the same as position, with its stamp
       /diagnostics         diagnostic_msgs/DiagnosticArray
  srv  ~/reset ~/step       std_srvs/Trigger
       ~/pause              std_srvs/SetBool

  --ros-args -p variant:=lsd_ode -p rate:=500.0
  --ros-args -p port.left.kind:=speed
  --ros-args --params-file lsd.yaml -p variant:=lsd_dae

ros2 param list /differential names all parameters, ros2 param describe tells of each.
"""


class DifferentialNode(DrivenNode):
    """A differential in real time or in lockstep, see ``DrivenNode``."""

    name, help = 'differential', HELP
    input_topics = '~/torques/', '~/torque/', '~/speed/', '~/clutch/'

    def declared(self):
        """Declare all parameters; return the ``Plant``."""
        return Plant(declare_all(self), self.get_logger())

    def messages(self):
        """Return the messages of a tick."""
        return SnapshotMessages(self.simulation.mechanism, self.plant.settings.joint_prefix)


def main(args=None):
    """Run the node until SIGINT or SIGTERM; return the exit code."""
    return main_of(DifferentialNode, args)


if __name__ == '__main__':
    sys.exit(main())
