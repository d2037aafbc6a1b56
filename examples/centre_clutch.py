# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""All-wheel drive on demand: the centre clutches hold the axles together as one of them slips."""


class CentreClutch:
    """
    Presses the clutches of the centre differential by the difference of the speeds of the axles.

    The force rises at once and falls slowly, so that an axle that has just slipped does not at
    once slip again. It measures wheel speeds alone.

    :param dt: of a tick, s.
    """

    ALLOWED = 0.5     # rad/s
    GAIN = 3000.0     # N s/rad
    LIMIT = 12e3      # N
    RELEASE = 0.5     # s, in which the force falls to a third

    def __init__(self, dt):
        self._kept, self._force = 1.0 - dt / self.RELEASE, 0.0

    def commands(self, measured, driver):
        """Return the axial forces on the clutches of the centre, N."""
        front, rear = (sum(measured.wheels[f'{axle}_{side}'] for side in ('left', 'right')) / 2.0
                       for axle in ('front', 'rear'))
        wanted = self.GAIN * max(0.0, abs(front - rear) - self.ALLOWED)
        self._force = min(self.LIMIT, max(wanted, self._kept * self._force))
        return {'centre_front_clutch': self._force, 'centre_rear_clutch': self._force}
