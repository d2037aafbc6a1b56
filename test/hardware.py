# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
A stand-in for ros2_control: what ``JointStateTopicSystem`` does with messages, and controllers.

It follows what version 1.1.0 of ``joint_state_topic_hardware_interface`` does, so that what the
node hears is what it would hear from the plugin. All values are NaN until somebody sets them.
"""

from math import isfinite, nan
from xml.etree import ElementTree

KINDS = 'position', 'velocity', 'effort'


class Component:
    """One ``<ros2_control>`` tag of a description."""

    def __init__(self, tag):
        self.name, self.type = tag.get('name'), tag.get('type')
        self.plugin = tag.findtext('hardware/plugin')
        self.parameters = {e.get('name'): e.text for e in tag.findall('hardware/param')}
        self.threshold = float(self.parameters.get('trigger_joint_command_threshold', '1e-5'))
        self.commanded, self.states, self.commands = {}, {}, {}
        for joint in tag.findall('joint'):
            name = joint.get('name')
            interfaces = [e.get('name') for e in joint.findall('command_interface')]
            self.commanded[name] = interfaces
            self.commands.update(dict.fromkeys([(name, kind) for kind in interfaces], nan))
            self.states.update({(name, e.get('name')): nan
                                for e in joint.findall('state_interface')})

    def read(self, message):
        """
        Take the states of a message.

        :raises KeyError: for what is in the message and not declared, as the plugin throws.
        """
        for i, name in enumerate(message.name):
            if name not in self.commanded:
                continue
            for kind in KINDS:
                values = getattr(message, kind)
                if len(values) and isfinite(values[i]):
                    self.states[name, kind]   # a KeyError, where the plugin throws
                    self.states[name, kind] = values[i]

    def write(self, message_type, now):
        """Return the message that a cycle publishes, None where it publishes none."""
        away = sum(abs(self.states[key] - command) for key, command in self.commands.items())
        if away <= self.threshold:   # never where one of them is NaN
            return None
        message = message_type()
        message.header.stamp = now
        for name, interfaces in self.commanded.items():
            message.name.append(name)
            for kind in interfaces:
                getattr(message, kind).append(self.commands[name, kind])
        return message


class GroupEffortController:
    """``effort_controllers/JointGroupEffortController``: keeps its last command for ever."""

    def __init__(self, component, joints):
        self._component, self._joints = component, joints
        self._command = None

    def command(self, *efforts):
        """Take what comes on ``~/commands``."""
        self._command = efforts

    def update(self):
        """Write the command, once there was one, in each cycle."""
        if self._command:
            for joint, effort in zip(self._joints, self._command, strict=True):
                self._component.commands[joint, 'effort'] = effort

    def deactivate(self):
        """Leave zeros behind."""
        self.command(*[0.0] * len(self._joints))
        self.update()
        self._command = None


def components(description):
    """Return the ``Component`` s of a URDF, by the ends of their names."""
    found = map(Component, ElementTree.fromstring(description).findall('ros2_control'))
    return {component.name.rpartition('differential')[2]: component for component in found}
