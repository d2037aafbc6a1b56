# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The loop around a controller of a driveline: what it measures, what the driver does, who answers.

A driver is a function of the time, a law a function of what is ``Measured``. Both return commands
for the node ``driveline`` by name: ``input``, ``<wheel>_brake``, ``<clutch>_clutch``, ``steer``,
``grade``, ``<wheel>_grip``, ``<wheel>_contact``.
"""

from math import nan
from typing import NamedTuple

from nav_msgs.msg import Odometry
from rclpy.node import Node
from sensor_msgs.msg import Imu, JointState

WHEELS = 'front_left', 'front_right', 'rear_left', 'rear_right'
RADIUS = 0.32   # m
EFFORTS = 'input', '_brake', '_clutch'   # how names end whose commands are efforts
TOPICS = {'joint_states': JointState, 'odometry': Odometry, 'imu': Imu}


class Measured(NamedTuple):
    """What a car measures, at the end of a tick."""

    time: float      # s
    wheels: dict     # rad/s, of each wheel
    speed: float     # m/s, of the body: in a car an estimate, here the odometry
    yaw_rate: float  # rad/s


def ramp(time, begin, end, last, first=0.0):
    """Return a value that goes from the first to the last while time goes from begin to end."""
    share = min(1.0, max(0.0, (time - begin) / (end - begin)))
    return first + (last - first) * share


def brakes(capacity):
    """Return the commands that give all brakes a capacity, N m."""
    return {f'{wheel}_brake': capacity for wheel in WHEELS}


class Controller(Node):
    """
    Answers each state of the node ``driveline`` with one message of commands.

    :param driver: what is commanded at a time; law: what is added or put in its place, if any.
    """

    def __init__(self, driver, law=None, **options):
        super().__init__('controller', **options)
        self._driver, self._law, self._heard = driver, law, {}
        self._commands = self.create_publisher(JointState, 'driveline/commands', 10)
        for topic, kind in TOPICS.items():
            self.create_subscription(
                kind, f'driveline/{topic}',
                lambda message, topic=topic: self._hear(topic, message), 10)

    def _hear(self, topic, message):
        """Answer when all that is of one tick has come."""
        self._heard[topic] = message
        if len(self._heard) == len(TOPICS) and len(
                {(m.header.stamp.sec, m.header.stamp.nanosec)
                 for m in self._heard.values()}) == 1:
            self._answer(*[self._heard[topic] for topic in TOPICS])

    def _answer(self, joints, odometry, imu):
        stamp = joints.header.stamp
        speeds = dict(zip(joints.name, joints.velocity))
        measured = Measured(
            stamp.sec + 1e-9 * stamp.nanosec, {wheel: speeds[wheel] for wheel in WHEELS},
            odometry.twist.twist.linear.x, imu.angular_velocity.z)
        commands = self._driver(measured.time)
        if self._law:
            commands = {**commands, **self._law.commands(measured, commands)}
        by_effort = [name.endswith(EFFORTS) for name in commands]
        self._commands.publish(JointState(
            name=list(commands),
            effort=[value if is_effort else nan
                    for value, is_effort in zip(commands.values(), by_effort)],
            position=[nan if is_effort else value
                      for value, is_effort in zip(commands.values(), by_effort)]))
