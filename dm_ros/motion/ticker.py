# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
A model in motion, tick by tick: ``Ticker`` in Python, and what takes its place in C.

It is what a ``Simulation`` has inside: the state, what a tick does to it, what is reported of it.
Nothing here depends on measured time.
"""

from functools import cache
import math
from operator import add
from typing import NamedTuple

from dm_ros import core
from dm_ros.mechanism.power_flow import DIRECT
from dm_ros.motion.books import Booked
from dm_ros.motion.packing import packed
from dm_ros.motion.state import State


class Run(NamedTuple):
    """What the ticks of a model are beside the model itself."""

    substeps: int        # solver steps in a tick
    dt: float            # length of a tick, s
    actuators: tuple     # of the clutches
    shafts: tuple        # names of all shafts
    outputs: tuple       # names of the two output shafts
    idle: tuple          # what holds on each port while nothing comes in


class Ticker:
    """
    A model in motion, in Python.

    :param model: see ``models``; run: a ``Run``; books: ``Books``, or None.
    """

    def __init__(self, model, run, books=None):
        self.model, self.run, self.books = model, run, books
        self.deadband = 0.0   # W
        self.ticks = self.coarse_steps = 0

    @property
    def language(self):
        """What the steps are made in."""
        return self.model.language

    def reset(self, velocity):
        """Go back to the start, at speeds of the output shafts, rad/s."""
        self.ticks = self.coarse_steps = 0
        model, run = self.model, self.run
        twists = (0.0,) * len(model.half_shafts)
        self._set(State(
            x=(*model.independent(*velocity), *twists), turned=(0.0, 0.0),
            origin=(0.0,) * len(run.shafts), torque=(0.0,) * len(run.idle), power_flow=DIRECT,
            memory=(0.0, 0.0) if model.lagged else (), force=(0.0,) * len(run.actuators),
            held=run.idle))
        if self.books:
            self.books.start(self._x)

    def follow(self, other):
        """Go on where another ticker is; speeds of the outputs and all angles stay."""
        state = other.state
        velocity = dict(zip(self.run.shafts, other.all_shafts(state.x)))
        outputs = (velocity[shaft] for shaft in self.run.outputs)
        self._set(state._replace(
            x=(*self.model.independent(*outputs), *state.x[2:]), turned=(0.0, 0.0),
            origin=other.positions()))
        self.ticks, self.coarse_steps = other.ticks, other.coarse_steps
        self.deadband = other.deadband
        if self.books:
            self.books.follow(other.books, self._x)

    @property
    def state(self):
        """The ``State``; it may be set."""
        return State(self._x, self._turned, self._origin, self._torque, self._flow,
                     self._memory, self._force, self._held)

    @state.setter
    def state(self, state):
        self._set(state)
        if self.books:
            self.books.change(self._x)

    def _set(self, state):
        (self._x, self._turned, self._origin, self._torque, self._flow,
         self._memory, self._force, self._held) = state
        self._point = None

    def quick(self, torques, forces, is_told):
        """
        Advance one tick, if what comes in needs no check.

        :return: what is reported of it, or () if it shall not be told; None, and nothing is done,
            where what comes in is to be checked, as always in Python.
        """

    def tick(self, T, commands):
        """
        Advance one tick.

        :param T: what comes in on the ports; commands: the forces that the actuators are told.
            Both have been checked.
        :raises ArithmeticError: where that leads out of the range of floating point numbers; the
            state stays what it was.
        """
        model, deadband, run = self.model, self.deadband, self.run
        x, memory, flow = self._x, self._memory, self._flow
        force = tuple([actuator.follow(force, command) for actuator, force, command
                       in zip(run.actuators, self._force, commands)])
        lagged, point = model.lagged, self._point
        if lagged and point is None:
            point = self._found()
        S = model.friction(memory, force)
        turned_1, turned_2 = self._turned
        coarse_steps = 0
        steps = []
        for _ in range(run.substeps):
            was, flow = flow, model.flow(x, T, deadband, flow)
            if lagged:
                memory = model.remembered(point, was)
                S = model.friction(memory, force)
            step = model.step(x, S, T, flow)
            _, _, x, integral, point, coarse, _ = step
            turned_1 += integral[0]
            turned_2 += integral[1]
            coarse_steps += coarse
            steps.append(step)
        if not math.isfinite(sum(x) + turned_1 + turned_2):
            raise ArithmeticError('beyond the range of floating point numbers')
        self._x, self._turned, self._held = x, (turned_1, turned_2), T
        self._torque = model.mean_torques(T, steps) if model.half_shafts else T
        self._flow, self._memory, self._point, self._force = flow, memory, point, force
        self.coarse_steps += coarse_steps
        self.ticks += 1
        if self.books:
            self.books.note(steps, T, x)

    def report(self):
        """Return what a ``Snapshot`` holds: of the last tick, or of the start at zero torque."""
        model, x, T, flow = self.model, self._x, self._held, self._flow
        if self._point is None:
            self._point = self._found()
        return (self.ticks * self.run.dt, model.all_shafts(x), self.positions(), self._torque,
                model.internal_moments(x, T, flow, self._point), flow, self._force)

    def _found(self):
        """Return the point at the end of the last tick."""
        model = self.model
        return model.point(self._x, model.friction(self._memory, self._force), self._held,
                           self._flow)

    def all_shafts(self, x):
        """Return the speeds of all shafts from x, or their angles from its integral."""
        return self.model.all_shafts(x)

    def positions(self):
        """Return the angles of all shafts, rad."""
        return tuple(map(add, self._origin, self.model.all_shafts(self._turned)))

    def booked(self):
        """Return what is ``Booked``."""
        return self.books.booked()

    def energy(self):
        """Return the entries of the books of the last tick, and the stored energy, J."""
        return self.books.tick, self.books.stored

    @property
    def worst(self):
        """The largest residual of a tick over its scale; it may be set."""
        return self.books.worst

    @worst.setter
    def worst(self, value):
        self.books.worst = value


@cache
def ticker_in_c(kind):
    """Return the class that is a ``Ticker`` in C, to the same bits, made of what is built."""
    class CoreTicker(kind):
        language = 'C'

        def __new__(cls, model, run, books=None):
            return super().__new__(cls, packed(model, run), books is not None)

        def __init__(self, model, run, books=None):
            self.model, self.run = model, run

        @property
        def state(self):
            return State(*super().state)

        @state.setter
        def state(self, state):
            kind.state.__set__(self, tuple(state))

        def booked(self):
            return Booked(*super().booked())
    return CoreTicker


def ticker_of(model, run, books=None):
    """Return a model in motion, in C where that is in use and can do it."""
    in_c = core.Ticker and not model.half_shafts
    return (ticker_in_c(core.Ticker) if in_c else Ticker)(model, run, books)
