# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A wheel with a tyre, at the outer end of a half-shaft; nothing here knows ROS."""

from dataclasses import dataclass
import math


@dataclass
class Wheel:
    """A wheel on a tyre whose torque is proportional to its slip on the road."""

    inertia: float = 1.0   # kg m^2
    slope: float = 0.0     # N m s/rad of the tyre; 0 is a wheel in the air
    road: float = 0.0      # rad/s at which it rolls without slip
    speed: float = 0.0     # rad/s

    def turn(self, torque, dt):
        """
        Advance by a tick and return the speed at its end, rad/s; exact, however stiff the tyre.

        :param torque: N m on the wheel, held in the tick: minus what its half-shaft reports.
        """
        rate = self.slope / self.inertia
        reached = -math.expm1(-rate * dt) / rate if rate else dt   # s
        self.speed += reached * (torque / self.inertia - rate * (self.speed - self.road))
        return self.speed
