# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The body on its wheels: loads, the way from the wheels' frames to the body's, drag.

Axes as ISO 8855: x forward, y left, yaw to the left; the slope is along x, uphill positive::

    m (dv_x/dt - r v_y) = sum F_bx - m g sin - drag
    m (dv_y/dt + r v_x) = sum F_by
    I_z dr/dt           = sum (x F_by - y F_bx)

The front axle has ``m (g cos b - A_x h)/L``, within [0, m g cos], the rear the rest; from left to
right goes ``m A_y h/track``, its front share ``roll_share``, within half of the axle. A is the
specific force, with a lag. The drag acts at the height of the road: it moves no load.
"""

from math import atan, cos, hypot, sin, tan
from typing import NamedTuple

G = 9.81   # m/s^2


class Wheel(NamedTuple):
    """One wheel in its place."""

    name: str
    x: float           # m, of its contact: forward
    y: float           # m, to the left
    is_front: bool     # whether it carries the front of the body
    is_steered: bool


class Frame(NamedTuple):
    """
    How a wheel stands in the body.

    ``V_x = c v_x + s v_y + X r``, ``V_y = -s v_x + c v_y + Y r``, and the forces likewise.
    """

    c: float
    s: float
    X: float   # m
    Y: float   # m


def slope(grade):
    """Return sine and cosine of the slope with the tangent ``grade``."""
    length = hypot(1.0, grade)
    return grade / length, 1.0 / length


class Body:
    """
    The body of a vehicle.

    :param p: ``VehicleParameters``; wheels: of ``Wheel``.
    """

    def __init__(self, p, wheels):
        self._p, self._wheels = p, wheels
        ends = [wheel.is_front for wheel in wheels]
        # of each wheel: its part of its side, and which: rear left and right, front left and right
        self._parts = [(2.0 / ends.count(wheel.is_front), 2 * wheel.is_front + (wheel.y < 0.0))
                       for wheel in wheels]

    def frames(self, steer):
        """Return the ``Frame`` of each wheel; tan delta = tan(steer)/(1 - y tan(steer)/L)."""
        p, t = self._p, tan(steer)
        result = []
        for wheel in self._wheels:
            delta = atan(t / (1.0 - wheel.y * t / p.L)) if wheel.is_steered else 0.0
            c, s = cos(delta), sin(delta)
            result.append(Frame(c, s, s * wheel.x - c * wheel.y, c * wheel.x + s * wheel.y))
        return result

    def loads(self, A_x, A_y, cosine, contact):
        """Return the load of each wheel, N, at the lagged specific force, m/s^2."""
        p = self._p
        weight = p.m * G * cosine
        front = min(max(p.m * (G * cosine * p.b - A_x * p.h) / p.L, 0.0), weight)
        rear = weight - front
        lateral = p.m * A_y * p.h / p.track
        to_front = min(max(lateral * p.roll_share, -0.5 * front), 0.5 * front)
        to_rear = min(max(lateral * (1.0 - p.roll_share), -0.5 * rear), 0.5 * rear)
        loads = (0.5 * rear - to_rear, 0.5 * rear + to_rear,
                 0.5 * front - to_front, 0.5 * front + to_front)
        return [share * part * loads[place]
                for share, (part, place) in zip(contact, self._parts)]

    def load_rates(self, A_x, A_y, rate_x, rate_y, cosine, contact):
        """Return what ``loads`` change by in time, N/s, with the rates of A, m/s^3."""
        p = self._p
        weight = p.m * G * cosine
        front = p.m * (G * cosine * p.b - A_x * p.h) / p.L
        front_rate = -p.m * rate_x * p.h / p.L if 0.0 < front < weight else 0.0
        front = min(max(front, 0.0), weight)
        rates = []
        for axle, axle_rate, roll in ((weight - front, -front_rate, 1.0 - p.roll_share),
                                      (front, front_rate, p.roll_share)):
            lateral = p.m * A_y * p.h / p.track * roll
            to_right = p.m * rate_y * p.h / p.track * roll
            if abs(lateral) > 0.5 * axle:
                to_right = 0.5 * axle_rate if lateral > 0.0 else -0.5 * axle_rate
            rates += (0.5 * axle_rate - to_right, 0.5 * axle_rate + to_right)
        return [share * part * rates[place]
                for share, (part, place) in zip(contact, self._parts)]

    def drag(self, v_x, wind):
        """Return the drag, N, and what it grows with per v_x, N s/m."""
        p = self._p
        v = v_x + wind
        half = 0.5 * p.air * p.drag_area
        return half * v * abs(v), 2.0 * half * abs(v)
