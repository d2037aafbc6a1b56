# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Traction control by brakes: the faster wheel of an axle is braked, so the other one pulls."""


class TractionControl:
    """
    Brakes the faster wheel of each driven axle, by a PI law on the difference of wheel speeds.

    An open differential gives both wheels the torque of the one that slips, and the torque of the
    brake adds to it. It measures wheel speeds alone.

    :param axles: ``front``, ``rear``, or both; dt: of a tick, s.
    """

    ALLOWED = 1.0            # rad/s of difference, as in a bend
    GAIN, RATE = 60.0, 400.0   # N m s/rad, N m/rad
    LIMIT = 1500.0           # N m

    def __init__(self, axles, dt):
        self._dt, self._integral = dt, dict.fromkeys(axles, 0.0)

    def commands(self, measured, driver):
        """Return the capacities of all brakes, N m, beside those of the driver."""
        found = {}
        for axle in self._integral:
            left, right = measured.wheels[f'{axle}_left'], measured.wheels[f'{axle}_right']
            error = left - right   # the left one is braked where it is positive
            excess = max(0.0, abs(error) - self.ALLOWED) * (1.0 if error > 0.0 else -1.0)
            integral = self._integral[axle] + self.RATE * self._dt * (excess or -error)
            self._integral[axle] = max(-self.LIMIT, min(self.LIMIT, integral))
            torque = max(-self.LIMIT, min(self.LIMIT, self.GAIN * excess + self._integral[axle]))
            for side, own in (('left', torque), ('right', -torque)):
                name = f'{axle}_{side}_brake'
                found[name] = driver.get(name, 0.0) + max(0.0, own)
        return found
