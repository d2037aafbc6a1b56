# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""When a tick is due and what was missed; no clock and no sleep, the time is given."""


class Pacer:
    """
    Absolute deadlines at a fixed period.

    Deadline k is start + k period, so nothing adds up. A tick that comes late runs at once,
    and whole periods that went by without a tick are skipped and counted: there is never a
    burst. All times are nanoseconds of one clock.
    """

    def __init__(self, period, patience=0):
        """
        Begin at time 0.

        :param period: ns, not necessarily whole.
        :param patience: periods by which a tick may be late without any being skipped; for a
            clock that advances in leaps of several periods.
        """
        self.period = period
        self.patience = patience
        self.ticks = 0
        self.missed = 0
        self._lateness = []
        self._start = self._count = 0

    def restart(self, now):
        """Let the next tick be due one period from now; nothing counts as missed."""
        self._start = now
        self._count = 1

    @property
    def due(self):
        """When the next tick is due."""
        return self._start + int(self._count * self.period)

    @property
    def begun(self):
        """When the tick that was begun last was due, ns."""
        return self._start + int((self._count - 1) * self.period)

    def begin(self, now):
        """Begin the tick that is due, at ``now`` or earlier; note its lateness."""
        lateness = now - self.due
        skipped = max(0, int(lateness // self.period))
        if skipped <= self.patience:
            skipped = 0
        self._lateness.append(lateness)
        self._count += 1 + skipped
        self.missed += skipped
        self.ticks += 1

    def take_lateness(self):
        """Return the lateness of the ticks since the last call, in ns, sorted."""
        window, self._lateness = self._lateness, []
        return sorted(window)
