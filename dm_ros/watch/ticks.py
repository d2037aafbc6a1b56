# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The ticks of a node, put together from its topics and made few enough to be drawn."""

from collections import deque
from math import isfinite
from typing import NamedTuple

import numpy as np

BUCKET = 40_000_000   # ns, whose extremes are drawn
SPAN = 30.0           # s that are drawn
LONGEST_GAP = 0.25    # s between two ticks that a line goes across, or GAP_TICKS of them
GAP_TICKS = 5


class Tick(NamedTuple):
    """What the topics of one tick have: a tuple of numbers from each."""

    stamp: int   # ns
    parts: tuple


class Joined:
    """
    Joins the messages of a tick, which come on several topics, by their stamp.

    Each topic keeps its order, so what is still without a part when a later tick is whole has
    lost it.
    """

    def __init__(self, topics):
        """:param topics: number of topics."""
        self._topics = topics
        self._waiting = {}   # {stamp: [part or None]} in the order in which they came
        self.lost = 0        # ticks without all parts, but for those at the begin
        self._begun = False

    def put(self, topic, stamp, values):
        """Take a message; topic: by number; stamp: ns; values: tuple of numbers."""
        self._waiting.setdefault(stamp, [None] * self._topics)[topic] = values

    def take(self):
        """Return the ``Tick`` s that have become whole, in their order."""
        whole = [n for n, parts in enumerate(self._waiting.values()) if None not in parts]
        if not whole:
            return []
        taken = [Tick(stamp, tuple(self._waiting.pop(stamp)))
                 for stamp in list(self._waiting)[:whole[-1] + 1]]
        begin = 0 if self._begun else whole[0]
        self._begun = True
        self.lost += len(taken) - begin - len(whole)
        return [tick for tick in taken if None not in tick.parts]


def extremes(rows):
    """
    Return the one or two rows that stand for some: in each column the least and the greatest.

    The one that came first is in the first row, so a line through both goes as the values went.

    :param rows: (n, columns), n > 0.
    """
    rows = np.asarray(rows)
    if len(rows) == 1:
        return rows
    least, greatest = rows.min(axis=0), rows.max(axis=0)
    rises = rows.argmin(axis=0) <= rows.argmax(axis=0)
    return np.array([np.where(rises, least, greatest), np.where(rises, greatest, least)])


def as_text(number):
    """Return a number as JSON with as many digits as an eye sees."""
    return f'{number:.6g}' if isfinite(number) else 'null'


class Strips:
    """
    The last ``SPAN`` s of some columns, as rows that are drawn, each as JSON.

    ``take`` returns what is new. A row is ``[time, number, ...]`` with the time in s since the
    first one, or ``null`` where no line goes across: after a pause, or at a reset. The time stands
    in a pause but for ``gap`` s, so that a long one does not push the rows out. A stamp that goes
    back empties all.
    """

    def __init__(self, period=0.0):
        """:param period: s from tick to tick, as far as it is known."""
        self.gap = max(LONGEST_GAP, GAP_TICKS * period)
        self._kept = deque()   # (s, JSON)
        self._new, self._emptied = [], False
        self._bucket, self._begin = [], 0   # (ns, values), ns
        self._origin = self._last = None    # ns

    def add(self, stamp, values, is_reset=False):
        """Take the values of a tick; stamp: ns; is_reset: whether the node has just been reset."""
        if self._last is not None and stamp < self._last:
            self._bucket, self._new, self._origin = [], [], None
            self._kept.clear()
            self._emptied = True
        if self._origin is None:
            self._origin = stamp
        elif is_reset or stamp - self._last > self.gap * 1e9:
            self.close()
            self._origin += max(0, stamp - self._last - int(self.gap * 1e9))
            self._keep((stamp - self._origin) * 1e-9, 'null')
        elif stamp - self._begin >= BUCKET:
            self.close()
        if not self._bucket:
            self._begin = stamp
        self._bucket.append((stamp, values))
        self._last = stamp

    def close(self):
        """Make rows of the last ticks, though more may come within the bucket."""
        if not self._bucket:
            return
        rows = extremes([values for _, values in self._bucket])
        stamps = self._begin, self._last
        for stamp, row in zip(stamps, rows):
            time = (stamp - self._origin) * 1e-9
            self._keep(time, f'[{time:.4f},{",".join(map(as_text, row))}]')
        self._bucket = []

    def take(self):
        """Return whether all was emptied since the last call, and what is new since."""
        result = self._emptied, f'[{",".join(self._new)}]'
        self._emptied, self._new = False, []
        return result

    def all(self):
        """Return all rows."""
        return f'[{",".join(row for _, row in self._kept)}]'

    def _keep(self, time, row):
        self._kept.append((time, row))
        self._new.append(row)
        while self._kept[0][0] < time - SPAN:
            self._kept.popleft()


class Travel:
    """How far the shafts have turned since the first tick, which a reset does not take back."""

    def __init__(self):
        self._before = None
        self._offsets = None
        self.total = ()

    def add(self, positions):
        """Take the angles of a tick, rad; return whether they tell a reset."""
        if self._before is None:
            self._offsets = [-position for position in positions]
        # only a reset brings all shafts back to just zero
        is_reset = bool(self._before and any(self._before) and not any(positions))
        if is_reset:
            self._offsets = [offset + before
                             for offset, before in zip(self._offsets, self._before)]
        self._before = positions
        self.total = tuple(map(sum, zip(positions, self._offsets)))
        return is_reset
