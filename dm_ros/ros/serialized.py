# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The numbers of a JointState or an Odometry, read from its bytes.

To make a message of them takes ten times as long, which at 1 kHz is a tenth of a core.
"""

from math import atan2
import struct

from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

ALL = 'position', 'velocity', 'effort'   # in their order
HEAD = b'\0\1\0\0'                      # of CDR with the least significant byte first
STAMP = struct.Struct('<iI')
COUNT = struct.Struct('<I')
ODOMETRY = struct.Struct('<7d288x6d288x')   # pose, its covariance, twist, its covariance


class Bytes:
    """
    What bytes of messages have in common, told from the first to the last.

    They are the CDR of the OMG: text ends with 0, before each text and sequence stands its
    length, and each number is at a multiple of its size, counted from behind the head.
    """

    def __init__(self):
        self._same = [(slice(0, len(HEAD)), HEAD)]
        self.length = len(HEAD) + STAMP.size

    def align(self, size):
        """Go on at a multiple of a size."""
        self.length += -(self.length - len(HEAD)) % size

    def count(self, count):
        """Go on behind a length."""
        self._bytes(COUNT.pack(count))

    def text(self, text):
        """Go on behind a text."""
        data = text.encode() + b'\0'
        self._bytes(COUNT.pack(len(data)) + data)

    def numbers(self, numbers):
        """Return where these numbers, a ``Struct``, are, and go on behind them."""
        self.align(8)
        at, self.length = self.length, self.length + numbers.size
        return at

    def _bytes(self, data):
        self.align(COUNT.size)
        self._same.append((slice(self.length, self.length + len(data)), data))
        self.length += len(data)

    def are(self, data):
        """Return whether bytes have all of it, and this length."""
        return len(data) == self.length and not any(
            data[where] != same for where, same in self._same)

    @staticmethod
    def stamp(data):
        """Return the stamp in ns."""
        sec, nanosec = STAMP.unpack_from(data, len(HEAD))
        return sec * 10**9 + nanosec


class Layout:
    """
    Where the numbers of JointStates with certain names and arrays are in their bytes.

    Of bytes that differ in more than stamp and numbers a message is made, and refused if it has
    other names or arrays.
    """

    def __init__(self, frame, names, arrays):
        """:param frame: ``frame_id``; arrays: which of ``ALL`` are as long as the names."""
        self._names, self._arrays = list(names), arrays
        n = len(self._names)
        self._numbers = struct.Struct(f'<{n}d')
        self._bytes, self._at = Bytes(), []
        self._bytes.text(frame)
        self._bytes.count(n)
        for name in self._names:
            self._bytes.text(name)
        for name in ALL:
            self._bytes.count(n if name in arrays else 0)
            if name in arrays:
                self._at.append(self._bytes.numbers(self._numbers))

    @property
    def length(self):
        """How many bytes there are."""
        return self._bytes.length

    def read(self, data):
        """
        Return the stamp in ns and the arrays, each a tuple.

        :raises ValueError: for a message with other names or arrays.
        """
        if not self._bytes.are(data):
            return self.read_whole(data)
        return self._bytes.stamp(data), tuple(
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


class OdometryLayout:
    """Where the numbers of Odometry in a plane are in its bytes, as ``Layout`` has it."""

    def __init__(self, frame, child_frame):
        """:param frame: ``frame_id``; child_frame: ``child_frame_id``."""
        self._frames = frame, child_frame
        self._bytes = Bytes()
        for text in self._frames:
            self._bytes.text(text)
        self._at = self._bytes.numbers(ODOMETRY)

    def read(self, data):
        """
        Return the stamp in ns, and (x, y, yaw) and (v_x, v_y, yaw rate) as a tuple of both.

        :raises ValueError: for a message with other frames.
        """
        if not self._bytes.are(data):
            return self.read_whole(data)
        x, y, _, _, _, s, c, v_x, v_y, _, _, _, r = ODOMETRY.unpack_from(data, self._at)
        return self._bytes.stamp(data), ((x, y, 2.0 * atan2(s, c)), (v_x, v_y, r))

    def read_whole(self, data):
        """Return as ``read`` does, by a message."""
        message = deserialize_message(data, Odometry)
        frames = message.header.frame_id, message.child_frame_id
        if frames != self._frames:
            raise ValueError(f'the frames are {", ".join(frames)}')
        pose, twist, stamp = message.pose.pose, message.twist.twist, message.header.stamp
        return stamp.sec * 10**9 + stamp.nanosec, (
            (pose.position.x, pose.position.y,
             2.0 * atan2(pose.orientation.z, pose.orientation.w)),
            (twist.linear.x, twist.linear.y, twist.angular.z))
