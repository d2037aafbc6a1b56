# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""An electronic limited-slip differential: clutches in the axle are pressed as its wheels part."""


class ElectronicLimitedSlip:
    """
    Presses both clutches of an axle by the difference of its wheel speeds beyond that of a bend.

    It measures wheel speeds and the steering, which tells how far the wheels part in a bend.

    :param axle: ``front`` or ``rear``, whose differential has clutches.
    """

    ALLOWED = 0.5     # rad/s beyond the bend
    GAIN = 2500.0     # N s/rad
    LIMIT = 12e3      # N
    TRACK_OVER_WHEELBASE = 1.55 / 2.65

    def __init__(self, axle):
        self._axle = axle

    def commands(self, measured, driver):
        """Return the axial forces on the clutches of the axle, N."""
        left, right = (measured.wheels[f'{self._axle}_{side}'] for side in ('left', 'right'))
        in_bend = -self.TRACK_OVER_WHEELBASE * driver.get('steer', 0.0) * (left + right) / 2.0
        excess = max(0.0, abs(left - right - in_bend) - self.ALLOWED)
        force = min(self.LIMIT, self.GAIN * excess)
        return {f'{self._axle}_{side}_clutch': force for side in ('left', 'right')}
