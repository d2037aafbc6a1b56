# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Snapshots of a driveline as ROS messages."""

from math import atan, cos, sin

from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Int8

from dm_ros.driveline.body import G, slope
from dm_ros.files.published_driveline import PublishedDriveline


class DrivelineMessages:
    """
    The messages of a tick, reused from tick to tick.

    ``of_a_tick`` maps the last word of each topic, in the order of publication, to its message.

    :param plant: a ``DrivelinePlant``.
    """

    def __init__(self, plant):
        self._plant, settings = plant, plant.settings
        car = plant.simulation
        self._published = published = PublishedDriveline(
            car, settings.joint_prefix, settings.base_frame_id)
        self._joints = [JointState(name=names) for names in published.names.values()]
        self._odometry, self._imu = Odometry(), Imu()
        self._flows = [Int8() for _ in car.differentials]
        self._odometry.child_frame_id = settings.base_frame_id
        self._stamped = [*self._joints, self._odometry, self._imu]
        for message in self._stamped:
            message.header.frame_id = settings.base_frame_id
        self._odometry.header.frame_id = settings.odom_frame_id
        self.of_a_tick = {
            **dict(zip(published.names, self._joints)), 'odometry': self._odometry,
            'imu': self._imu, **{f'power_flow/{name}': message for name, message
                                 in zip(car.differentials, self._flows)}}

    def fill(self, snapshot, seconds, nanoseconds):
        """Put the last snapshot of the plant and one stamp into the messages, in place."""
        car = self._plant.simulation
        arrays = self._published.arrays(snapshot, car.torque, car.slip_speed, car.clutch_force)
        for message, (position, velocity, effort) in zip(self._joints, arrays):
            message.position[:] = position
            message.velocity[:] = velocity
            message.effort[:] = effort
        for message in self._stamped:
            message.header.stamp.sec, message.header.stamp.nanosec = seconds, nanoseconds
        x, y, yaw = snapshot.pose
        v_x, v_y, r = snapshot.twist_body
        turned_s, turned_c = sin(0.5 * yaw), cos(0.5 * yaw)
        pose, twist, imu = self._odometry.pose.pose, self._odometry.twist.twist, self._imu
        pose.position.x, pose.position.y = x, y
        pose.orientation.z, pose.orientation.w = turned_s, turned_c
        twist.linear.x, twist.linear.y, twist.angular.z = v_x, v_y, r
        # Rz(yaw) Ry(-atan grade): uphill the nose points up
        half = -0.5 * atan(car.grade)
        s, c = sin(half), cos(half)
        of_imu, force = imu.orientation, imu.linear_acceleration
        of_imu.x, of_imu.y = -turned_s * s, turned_c * s
        of_imu.z, of_imu.w = turned_s * c, turned_c * c
        imu.angular_velocity.z = r
        (force.x, force.y), force.z = snapshot.acceleration, G * slope(car.grade)[1]
        for message, flow in zip(self._flows, snapshot.power_flow):
            message.data = flow
