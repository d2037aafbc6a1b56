# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A bag of rosbag2: a folder of an MCAP file and its metadata, written without ROS."""

from pathlib import Path
import re
import shutil

import numpy as np

from dm_ros.files.published import CommandMessage, Published

JOINT_STATE, INT8 = 'sensor_msgs/msg/JointState', 'std_msgs/msg/Int8'
OF_A_BAG = re.compile(r'metadata\.yaml|.*\.mcap')
OUTPUT_DEPTH, INPUT_DEPTH = 10_000, 10   # of a node in lockstep, and of who commands it


def require_rosbags():
    """Raise ValueError where rosbags is missing; only bags need it."""
    try:
        import rosbags  # noqa: F401
    except ImportError:
        raise ValueError('a bag needs rosbags: pip install "dm_ros[bag]"') from None


def has_rosbags():
    """Return whether bags can be written and read."""
    try:
        require_rosbags()
    except ValueError:
        return False
    return True


def quality(depth, history='KEEP_LAST', reliability='RELIABLE', durability='VOLATILE'):
    """Return the quality of service that a publisher offers; words: as ``QoSProfile`` has them."""
    from rosbags import interfaces
    never = interfaces.QosTime(9223372036, 854775807)
    return interfaces.Qos(
        interfaces.QosHistory[history], depth, interfaces.QosReliability[reliability],
        interfaces.QosDurability[durability], never, never,
        interfaces.QosLiveliness.AUTOMATIC, never, False)


class Bag:
    """
    A new bag; use it as a context manager.

    :param path: a folder that is not there yet; instead: or else a bag, whose place it takes.
    :param whole: whether it is taken away where an exception ends it, else it has what came.
    :raises ValueError: where something else is there already, or rosbags is missing.
    """

    def __init__(self, path, instead=False, whole=True):
        require_rosbags()
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import get_typestore, Stores
        self.path, self._whole = Path(path), whole
        self._has_messages = False
        if self.path.exists():
            if not instead or not self.path.is_dir() or any(
                    not OF_A_BAG.fullmatch(file.name) for file in self.path.iterdir()):
                raise ValueError(f'{path}: it is there already, and a bag needs a new folder')
            shutil.rmtree(self.path)
        self.types = get_typestore(Stores.ROS2_JAZZY)
        self._writer = Writer(self.path, version=9, storage_plugin=StoragePlugin.MCAP)

    def __enter__(self):
        self._writer.open()
        return self

    def __exit__(self, kind, *_):
        kept = self._has_messages and not (kind and self._whole)
        try:
            self._writer.close()
        except BaseException:   # as of a full disk
            kept = False
            raise
        finally:
            if not kept:
                shutil.rmtree(self.path, ignore_errors=True)

    def topic(self, name, kind, *qualities):
        """Return a topic for ``write``, of a kind such as ``std_msgs/msg/Int8``."""
        return self._writer.add_connection(
            name, kind, typestore=self.types, offered_qos_profiles=qualities)

    def write(self, topic, time, data):
        """Write a message; time: when it came, ns; data: as CDR."""
        self._writer.write(topic, time, data)
        self._has_messages = True


class TickBag:
    """
    A bag of ticks, as from a node in lockstep: its stamps, topics and quality of service.

    Use it as a context manager. It is whole or not there.

    :param path, instead: as for ``Bag``; mechanism: a ``Mechanism``; rate: ticks in 1 s.
    :param prefix: before the names in messages; node: full name of the node.
    """

    def __init__(self, path, mechanism, rate, prefix='', node='/differential', instead=False):
        self._bag, self._rate, self._ticks = Bag(path, instead), rate, 0
        self._published, self._mechanism = Published(mechanism, prefix), mechanism
        self._prefix, self._node = prefix, node
        types = self._bag.types
        self._joints, self._int8, self._header, self._time = (
            types.types[kind] for kind in (
                JOINT_STATE, INT8, 'std_msgs/msg/Header', 'builtin_interfaces/msg/Time'))
        self._serialize = types.serialize_cdr

    def __enter__(self):
        bag, node = self._bag.__enter__(), self._node
        commands, outputs = quality(INPUT_DEPTH), quality(OUTPUT_DEPTH)
        ports = self._mechanism.ports
        # with the forces of clutches where any come
        self._commands = [CommandMessage(ports, self._prefix),
                          CommandMessage(ports + self._mechanism.actuators, self._prefix)]
        self._torques = bag.topic(f'{node}/torques', JOINT_STATE, commands)
        self._topics = [(bag.topic(f'{node}/{topic}', JOINT_STATE, outputs), names)
                        for topic, names in self._published.names.items()]
        self._power_flow = bag.topic(f'{node}/power_flow', INT8, outputs)
        return self

    def __exit__(self, *error):
        self._bag.__exit__(*error)

    def start(self, snapshot):
        """Write the state before the first tick."""
        self._report(snapshot, 0)

    def tick(self, command, snapshot):
        """
        Write a tick: what was commanded for it and came before it, and what came out of it.

        :param command: a value for each port, None for no speed, and for each clutch, if any.
        """
        before, self._ticks = self._now(), self._ticks + 1
        commands = self._commands[len(command) > len(self._mechanism.ports)]
        self._write_joints(self._torques, commands.names, commands.arrays(command), before, '')
        self._report(snapshot, self._now())

    def _now(self):
        return round(self._ticks * 1e9 / self._rate)

    def _report(self, snapshot, now):
        frame = self._published.frame
        for (topic, names), arrays in zip(self._topics, self._published.arrays(snapshot)):
            self._write_joints(topic, names, arrays, now, frame)
        self._bag.write(self._power_flow, now,
                        self._serialize(self._int8(snapshot.power_flow), INT8))

    def _write_joints(self, topic, names, arrays, now, frame):
        message = self._joints(self._header(self._time(*divmod(now, 10**9)), frame), names,
                               *map(np.asarray, arrays))
        self._bag.write(topic, now, self._serialize(message, JOINT_STATE))
