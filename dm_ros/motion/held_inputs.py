# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The torques in force: what was demanded, what of it is refused, clamped or too old."""

import math


class TorqueInputs:
    """
    The last demanded torque of each input shaft and when it came, counted in ticks.

    A demand is taken whole or not at all. Ages are counted in simulated time, so a paused
    mechanism does not lose its torques.
    """

    def __init__(self, shafts, limit, timeout):
        """
        Start without any demand.

        :param shafts: names of the input shafts; the torques in force follow their order.
        :param limit: N m, larger demands are clamped to it.
        :param timeout: ticks, an older demand counts as zero; 0 for never.
        """
        self.shafts = shafts
        self.limit = limit
        self.timeout = timeout
        self.received = self.refused = self.clamped = 0
        self._index = {name: i for i, name in enumerate(shafts)}
        self.forget()

    def forget(self):
        """Drop all demands: every shaft waits for its first one."""
        self._demand = [0.0] * len(self.shafts)
        self._arrival = [None] * len(self.shafts)

    def demand(self, names, torques, tick):
        """
        Take a demand for some shafts at a tick; return whether any of it was clamped.

        :raises ValueError: says why the demand is refused; the older one stays.
        """
        try:
            clamped = self._take(names, torques, tick)
        except ValueError:
            self.refused += 1
            raise
        self.received += 1
        self.clamped += clamped
        return clamped

    def in_force(self, tick):
        """Return the torques that hold in a tick, in N m, as a tuple."""
        if not self.timeout:
            return tuple(self._demand)
        oldest = tick - self.timeout
        return tuple([0.0 if arrival is None or arrival < oldest else torque
                      for torque, arrival in zip(self._demand, self._arrival)])

    def stale(self, tick):
        """Return the names of the shafts whose demand is too old."""
        return [name for name, arrival in zip(self.shafts, self._arrival)
                if self.timeout and arrival is not None and arrival < tick - self.timeout]

    def silent(self):
        """Return the names of the shafts that never had a demand."""
        return [name for name, arrival in zip(self.shafts, self._arrival) if arrival is None]

    def _take(self, names, torques, tick):
        if len(names) != len(torques):
            raise ValueError(f'{len(names)} names but {len(torques)} torques')
        if len(set(names)) != len(names):
            raise ValueError(f'a shaft is named twice in {", ".join(names)}')
        for name, torque in zip(names, torques):
            if name not in self._index:
                raise ValueError(f'{name!r} is not one of {", ".join(self.shafts)}')
            if not math.isfinite(torque):
                raise ValueError(f'the torque on {name} is {torque}')
        clamped = False
        for name, torque in zip(names, torques):
            i = self._index[name]
            self._demand[i] = min(max(torque, -self.limit), self.limit)
            self._arrival[i] = tick
            clamped = clamped or abs(torque) > self.limit
        return clamped
