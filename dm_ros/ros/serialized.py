# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The numbers of a JointState, read from its bytes.

To make a message of them takes ten times as long, which at 1 kHz is a tenth of a core.
"""

import struct

from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

ALL = 'position', 'velocity', 'effort'   # in their order
HEAD = b'\0\1\0\0'                      # of CDR with the least significant byte first
STAMP = struct.Struct('<iI')
COUNT = struct.Struct('<I')


class Layout:
    """
    Where the numbers of JointStates with certain names and arrays are in their bytes.

    They are the CDR of the OMG: text ends with 0, before each text and sequence stands its
    length, and each number is at a multiple of its size, counted from behind the head. Of bytes
    that differ in more than stamp and numbers a message is made, and refused if it has other
    names or arrays.
    """

    def __init__(self, frame, names, arrays):
        """:param frame: ``frame_id``; arrays: which of ``ALL`` are as long as the names."""
        self._names, self._arrays = list(names), arrays
        n = len(self._names)
        self._numbers = struct.Struct(f'<{n}d')
        self._same, self._at = [(slice(0, len(HEAD)), HEAD)], []
        self.length = len(HEAD) + STAMP.size
        self._text(frame)
        self._count(n)
        for name in self._names:
            self._text(name)
        for name in ALL:
            self._count(n if name in arrays else 0)
            if name in arrays:
                self._align(8)
                self._at.append(self.length)
                self.length += self._numbers.size

    def _align(self, size):
        self.length += -(self.length - len(HEAD)) % size

    def _bytes(self, data):
        self._align(COUNT.size)
        self._same.append((slice(self.length, self.length + len(data)), data))
        self.length += len(data)

    def _count(self, count):
        self._bytes(COUNT.pack(count))

    def _text(self, text):
        data = text.encode() + b'\0'
        self._bytes(COUNT.pack(len(data)) + data)

    def read(self, data):
        """
        Return the stamp in ns and the arrays, each a tuple.

        :raises ValueError: for a message with other names or arrays.
        """
        if (len(data) != self.length
                or any(data[where] != same for where, same in self._same)):
            return self.read_whole(data)
        sec, nanosec = STAMP.unpack_from(data, len(HEAD))
        return sec * 10**9 + nanosec, tuple(
            [self._numbers.unpack_from(data, at) for at in self._at])

    def read_whole(self, data):
        """Return as ``read`` does, by a message."""
        message = deserialize_message(data, JointState)
        arrays = tuple(tuple(getattr(message, name)) for name in self._arrays)
        if list(message.name) != self._names or any(
                len(array) != len(self._names) for array in arrays):
            raise ValueError(f'the names are {", ".join(message.name)}')
        stamp = message.header.stamp
        return stamp.sec * 10**9 + stamp.nanosec, arrays
