# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The books of the ticks of a differential: what its meter reads, added up."""

from operator import add
from typing import NamedTuple

AT_REST = 1e-6    # of the stored energy: with less turned over, its rounding is all there is
NO_LOSS = 1e-12   # of the energy turned over in a tick: less than that, given back, is rounding


class Layout(NamedTuple):
    """Where the entries of a mechanism's books stand, as the meters make them."""

    work: slice
    stored: int
    viscous: int
    gears: slice
    bearings: slice
    clutches: slice
    half_shafts: slice
    numerical: int
    scale: int

    @classmethod
    def of(cls, mechanism):
        """Return the layout for a ``Mechanism``."""
        stored = len(mechanism.ports)
        gears = stored + 2
        bearings = gears + len(mechanism.gears)
        clutches = bearings + len(mechanism.bearings)
        half_shafts = clutches + len(mechanism.clutches)
        numerical = half_shafts + len(mechanism.half_shafts)
        return cls(slice(0, stored), stored, stored + 1, slice(gears, bearings),
                   slice(bearings, clutches), slice(clutches, half_shafts),
                   slice(half_shafts, numerical), numerical, numerical + 1)

    @property
    def losses(self):
        """Where all losses of the mechanism stand."""
        return slice(self.viscous, self.numerical)

    @property
    def gears_and_bearings(self):
        """Where those losses stand that may give energy back."""
        return slice(self.gears.start, self.bearings.stop)


class Booked(NamedTuple):
    """What the books say, J."""

    tick: tuple              # the entries of the last tick
    total: tuple             # their sums since the start
    stored: float            # the energy now
    changes: float           # of it, by changes of parameters or state
    worst: float             # the largest residual of a tick over its scale
    returned_ticks: tuple    # of each gear and bearing: in how many ticks it gave energy back
    returned: tuple          # and how much


class Books:
    """
    The books of a run, tick by tick.

    :param meter: of the model, see ``meters``; layout: where its entries stand.
    """

    def __init__(self, meter, layout):
        self.meter, self._layout = meter, layout

    def start(self, x):
        """Begin at the speeds x."""
        layout = self._layout
        self.stored, self._changes, self.worst = self.meter.stored_energy(x), 0.0, 0.0
        self.tick = self._total = (0.0,) * (layout.scale + 1)
        may_return = layout.bearings.stop - layout.gears.start
        self._returned_ticks, self._returned = [0] * may_return, [0.0] * may_return

    def follow(self, other, x):
        """Go on from other books, under another meter, at the speeds x."""
        self.tick, self._total, self.worst = other.tick, other._total, other.worst
        self._returned_ticks, self._returned = other._returned_ticks, other._returned
        self.stored, self._changes = other.stored, other._changes
        self.change(x)

    def change(self, x):
        """Note that the speeds are x now, without any work."""
        before, self.stored = self.stored, self.meter.stored_energy(x)
        self._changes += self.stored - before

    def note(self, steps, inputs, x):
        """Book the solver steps of a tick, which ends at the speeds x."""
        meter, layout = self.meter, self._layout
        if layout.half_shafts.start < layout.half_shafts.stop:   # a twist may be forgotten
            self._changes += meter.stored_energy(steps[0][0]) - self.stored
        tick = meter.book(steps[0], inputs)
        for step in steps[1:]:
            tick = tuple(map(add, tick, meter.book(step, inputs)))
        self.stored = stored = meter.stored_energy(x)
        work = scale = whole = 0.0
        for entry in tick[layout.work]:
            work += entry
        for entry in tick:
            whole += entry
            scale += abs(entry)
        scale = max(scale, AT_REST * stored)
        residual = abs(work + work - whole)   # work less all others
        if residual > self.worst * scale:
            self.worst = residual / scale
        rounding = NO_LOSS * scale
        for n, loss in enumerate(tick[layout.gears_and_bearings]):
            if loss < -rounding:
                self._returned_ticks[n] += 1
                self._returned[n] -= loss
        self.tick = (*tick, scale)
        self._total = tuple(map(add, self._total, self.tick))

    def booked(self):
        """Return what is ``Booked``."""
        return Booked(self.tick, self._total, self.stored, self._changes, self.worst,
                      tuple(self._returned_ticks), tuple(self._returned))
