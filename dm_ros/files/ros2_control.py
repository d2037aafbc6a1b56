# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The ``<ros2_control>`` tags of a URDF, by which controllers drive the node over its topics."""

from xml.etree.ElementTree import Comment, SubElement

from dm_ros.mechanism.variants import MECHANISMS

PLUGIN = 'joint_state_topic_hardware_interface/JointStateTopicSystem'
STATES = 'position', 'velocity', 'effort'   # all that a message has must be declared
ALWAYS = '-1'   # threshold; by default a torque that is in force is not sent again: it grows stale


def controllers_file(mechanism, prefix='', lockstep=False):
    """
    Return the name of the installed parameter file with controllers for a node.

    :param mechanism: its equipped ``Mechanism`` with its ports; prefix: before names of joints.
    :param lockstep: whether its description has no clutches, for each message is a tick.
    :raises ValueError: says why none of them fits, and what to do.
    """
    if prefix:
        raise ValueError('ros2_control: with a joint_prefix it must be a file with such joints')
    if mechanism.half_shafts:   # once claimed, an effort is never NaN again: all is refused
        raise ValueError(f'ros2_control: with a speed port ({", ".join(mechanism.half_shafts)}) '
                         'it must be a file in which no controller claims the effort of its joint')
    added = mechanism.actuators and not MECHANISMS[mechanism.name].actuators and not lockstep
    return f'{mechanism.name}{"_clutches" if added else ""}_controllers.yaml'


def system(robot, name, joints, commands, **parameters):
    """Add a hardware component whose joints all have the same command interfaces."""
    component = SubElement(robot, 'ros2_control', name=name, type='system')
    hardware = SubElement(component, 'hardware')
    SubElement(hardware, 'plugin').text = PLUGIN
    for key, value in parameters.items():
        SubElement(hardware, 'param', name=key).text = value
    for name in joints:
        joint = SubElement(component, 'joint', name=name)
        for kind, interfaces in (('command', commands), ('state', STATES)):
            for interface in interfaces:
                SubElement(joint, f'{kind}_interface', name=interface)


def add_ros2_control(robot, mechanism, prefix, node, clutches):
    """
    Add hardware components that send commands to a node and take its states.

    A command has a value for each joint of its component, so joints without a command, and those
    whose states come on another topic, have a component of their own.

    :param robot: the root element of a URDF; mechanism: a ``Mechanism`` with its ports.
    :param prefix: before the names of joints, as in ``joint_states``.
    :param node: the full name of the node, such as ``/differential``.
    :param clutches: whether there are joints of its clutches.
    """
    shafts, commands = mechanism.inputs, ['effort']
    if mechanism.half_shafts:   # then both arrays of their messages are as long as the names
        commands.append('velocity')
    sent = {'joint_commands_topic': f'{node}/torques', 'trigger_joint_command_threshold': ALWAYS}
    robot.append(Comment(' Each cycle sends a command, whatever is in force: see '
                         'doc/ros2_control.md of dm_ros. '))
    system(robot, f'{prefix}differential', [prefix + shaft for shaft in shafts], commands,
           joint_states_topic=f'{node}/joint_states', **sent)
    system(robot, f'{prefix}differential_states',
           [prefix + shaft for shaft in mechanism.shafts if shaft not in shafts], (),
           joint_states_topic=f'{node}/joint_states')
    if clutches:
        system(robot, f'{prefix}differential_clutches',
               [prefix + clutch.name for clutch in mechanism.actuators], ['effort'],
               joint_states_topic=f'{node}/clutches', **sent)
