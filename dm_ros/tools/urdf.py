# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Print a URDF of a differential or a car, from its parameters, for robot_state_publisher."""

import argparse
import re
import sys

from dm_ros.driveline_plant import DrivelineNodeParameters, make_driveline
from dm_ros.ending import run_command
from dm_ros.files.driveline_urdf import driveline_urdf
from dm_ros.files.output import replacing
from dm_ros.files.parameter_file import read_parameter_file
from dm_ros.files.urdf import urdf
from dm_ros.mechanism.variants import equipped, variant_named, VARIANTS
from dm_ros.settings import NodeParameters, port_parameters, speed_ports
from dm_ros.tools.bias import mechanism_of
from dm_ros.tools.driveline_option import (
    add_driveline,
    driveline_values,
    NOT_A_DRIVELINE,
    refuse,
    SEVERAL,
)
from dm_ros.tools.passed_over import warn

EPILOG = """\
Its joints are named as those in ~/joint_states, by which gears that are drawn mesh. Sizes follow
the radii of the parameters, plates are drawn where there are clutches. doc/looking.md tells how to
look at it in RViz and Foxglove.

With --ros2-control it has what lets controllers of ros2_control drive the node, as
doc/ros2_control.md tells; kinds of ports, and mode, are then those of FILE.

The mechanism is that of the variant, or else the only one with parameters in FILE, or that of the
default variant of the node.

With --driveline it is the whole car, whose joints are those in ~/joint_states of the node
driveline; its root is base_frame_id of FILE, else base_link, on the ground below the centre of
mass. It has a box for the body, which has no mass in it, and front wheels that are not steered.
"""


def parser():
    """Return the parser of the command line."""
    result = argparse.ArgumentParser('urdf', description=__doc__, epilog=EPILOG,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument('--variant', choices=VARIANTS,
                        help='the mechanism and its formulation; default: variant of FILE')
    add_driveline(result)
    result.add_argument('--params', metavar='FILE', help='a ROS 2 parameter file')
    result.add_argument('--joint-prefix', '--prefix', metavar='PREFIX',
                        help='before all names; default: joint_prefix of FILE')
    result.add_argument('--ros2-control', metavar='NODE', nargs='?', const='/differential',
                        help='with the tags of ros2_control for a node of this full name; '
                             'default: %(const)s')
    result.add_argument('--out', metavar='OUT.urdf', help='where it goes; default: stdout')
    return result


def node_name(words, option):
    """Return the full name of a node; raise ValueError where an option has none."""
    if not re.fullmatch(r'(/[A-Za-z_][A-Za-z0-9_]*)+', words):
        raise ValueError(f'{option}: {words!r} is not the full name of a node, '
                         'such as /rear/differential')
    return words


def described(values):
    """
    Return the ``NodeParameters`` of a node, its ``Mechanism`` and the table of its parameters.

    :param values: ``{full name: value}``, as ``read_parameter_file`` returns them.
    :raises ValueError: names what is not allowed.
    """
    node = NodeParameters().changed(NodeParameters.part_of(values))
    mechanism = mechanism_of(values, variant_named(node.variant).mechanism)
    p = mechanism.parameters().changed(mechanism.parameters.part_of(values))
    return node, equipped(mechanism, p, speed_ports(port_parameters(mechanism.inputs, values))), p


def text_of(arguments):
    """Return the URDF of a differential; raise ValueError where it cannot be made."""
    refuse(arguments, {'--planar': NOT_A_DRIVELINE})
    values = read_parameter_file(arguments.params) if arguments.params else {}
    if arguments.variant:
        values['variant'] = arguments.variant
    if arguments.joint_prefix is not None:
        values['joint_prefix'] = arguments.joint_prefix
    node, mechanism, p = described(values)
    warn('urdf', arguments.params, values, mechanism)
    controlled = (None if arguments.ros2_control is None
                  else node_name(arguments.ros2_control, '--ros2-control'))
    return urdf(mechanism, p, node.joint_prefix, controlled, node.mode == 'lockstep')


def text_of_driveline(arguments):
    """Return the URDF of a car; raise ValueError where it cannot be made."""
    refuse(arguments, {'--variant': SEVERAL,
                       '--ros2-control': 'it drives the node differential alone'})
    values = driveline_values('urdf', arguments, joint_prefix=arguments.joint_prefix)
    node = DrivelineNodeParameters().changed(DrivelineNodeParameters.part_of(values))
    return driveline_urdf(make_driveline(values), node.joint_prefix, node.base_frame_id)


def run(arguments):
    """Do what the command line says; raise ValueError or OSError where it cannot be done."""
    text = (text_of if arguments.driveline is None else text_of_driveline)(arguments)
    if arguments.out:
        with replacing(arguments.out, 'w') as file:
            file.write(text)
    else:
        print(text, end='', flush=True)


def main(args=None):
    """Run the tool ``urdf`` and return its exit code."""
    arguments = parser().parse_args(args)
    return run_command('urdf', lambda: run(arguments), arguments.out or 'stdout')


if __name__ == '__main__':
    sys.exit(main())
