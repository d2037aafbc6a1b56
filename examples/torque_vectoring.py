# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Torque vectoring by brakes: the wheels of one side are braked, so that the car turns."""


class TorqueVectoring:
    """
    Brakes the wheels on the inner side of a bend while the car yaws less than it is steered.

    The reference is the yaw rate of a neutral car, ``v steer/L``, but no more than the road can
    give. It measures the yaw rate, the steering, and the speed of the body, which in a car is an
    estimate.

    :param dt: of a tick, s; grip: of the road, by which the reference is limited.
    """

    WHEELBASE, TRACK, RADIUS = 2.65, 1.55, 0.32   # m
    GAIN, RATE = 30e3, 60e3    # N m s/rad, N m/rad of yaw moment
    LIMIT = 900.0              # N m of brake on one side
    FRONT = 0.4                # its share on the front wheel

    def __init__(self, dt, grip=1.0):
        self._dt, self._most, self._integral = dt, 0.85 * 9.81 * grip, 0.0

    def reference(self, speed, steer):
        """Return the yaw rate that is wanted, rad/s."""
        most = self._most / max(speed, 1.0)
        return max(-most, min(most, speed * steer / self.WHEELBASE))

    def commands(self, measured, driver):
        """Return the capacities of all brakes, N m, beside those of the driver."""
        error = self.reference(measured.speed, driver.get('steer', 0.0)) - measured.yaw_rate
        most = self.LIMIT * self.TRACK / (2.0 * self.RADIUS)   # N m of yaw moment
        moment = max(-most, min(most, self.GAIN * error + self._integral))
        if abs(moment) < most:
            self._integral += self.RATE * self._dt * error
        torque = 2.0 * moment * self.RADIUS / self.TRACK   # the left side turns it left
        found = {}
        for side, own in (('left', torque), ('right', -torque)):
            for axle, share in (('front', self.FRONT), ('rear', 1.0 - self.FRONT)):
                name = f'{axle}_{side}_brake'
                found[name] = driver.get(name, 0.0) + share * max(0.0, own)
        return found
