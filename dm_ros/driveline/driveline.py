# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
A whole driveline in time, from the gearbox output to the road: ``Driveline``.

Nothing here depends on measured time: equal inputs give equal bits.
"""

from collections.abc import Mapping
from math import cos, sin
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from dm_ros import core
from dm_ros.driveline.assembly import Assembly
from dm_ros.driveline.books import Books
from dm_ros.driveline.equations import Equations
from dm_ros.driveline.inputs import Inputs, STEEPEST
from dm_ros.driveline.layouts import LAYOUTS
from dm_ros.driveline.stepper import Stepper
from dm_ros.mechanism.power_flow import DIRECT, who_drives
from dm_ros.motion.checks import checked

FASTEST = 1e3   # m/s, at the start


class Snapshot(NamedTuple):
    """What a driveline reports at the end of a tick, in plain floats; SI, axes as ISO 8855."""

    time: float            # s, the number of ticks times their length
    velocity: tuple        # rad/s, in the order of ``Driveline.shafts``
    position: tuple        # rad, the integral of velocity
    torque: tuple          # N m, of each of ``Driveline.connections``, on its end at the wheels
    twist: tuple           # rad, of each connection
    moment: tuple          # N m, in the order of ``Driveline.moments``
    power_flow: tuple      # +1 or -1, of each differential, as it was in force
    slip: tuple            # (kappa, alpha) of each wheel
    wheel_force: tuple     # N, (F_x, F_y) of the road on each wheel, in its frame
    wheel_load: tuple      # N
    pose: tuple            # m, m, rad: (x, y, yaw) in the plane of the road
    twist_body: tuple      # m/s, m/s, rad/s: (v_x, v_y, r)
    acceleration: tuple    # m/s^2, the specific force (f_x, f_y)


class Driveline:
    """
    A driveline on its wheels, in simulated time.

    Inputs are held in a tick; what is reported holds at its end, under them.

    :param layout: 'fwd', 'rwd' or 'awd', or a function that builds another, see ``layouts``.
    :param planar: whether the body moves sideways and yaws too, and can be steered.
    :param dt: length of a tick, s.
    :param parameters: mapping from full names, ``driveline.*``, to values that differ from the
        defaults.
    :raises ValueError: names what is wrong, its value and what is allowed.
    """

    def __init__(self, layout='awd', planar=False, dt=0.001, parameters=None):
        if not callable(layout):
            if layout not in LAYOUTS:
                raise ValueError(f'layout: {layout!r} is not one of {", ".join(LAYOUTS)}')
            layout = LAYOUTS[layout]
        if not isinstance(planar, bool):
            raise ValueError(f'planar: {planar!r} is not allowed, it must be True or False')
        self.planar = planar
        self.dt = checked('dt', dt, lambda v: v > 0.0, 'a positive number of seconds')
        if not isinstance(parameters, Mapping | None):
            raise ValueError(f'parameters: {type(parameters).__name__} is not a mapping')
        assembly = Assembly(parameters or {}, self.dt)
        layout(assembly)
        assembly.finish()
        self._assembly, self._differentials = assembly, tuple(assembly.differentials)
        self._actuators = tuple([a for d in self._differentials for a in d.actuators])
        self._equations = Equations(assembly, planar)
        self._stepper = Stepper(self._equations, self.dt, assembly.numerics)
        self._books = Books(self._equations, assembly)
        self._inputs = Inputs(assembly.vehicle, self.wheels, self._differentials, planar)
        self.reset()

    @property
    def shafts(self):
        """Names of all shafts: input, all of each differential, wheels."""
        return (*self._assembly.inertias, *[s for d in self._differentials for s in d.shafts],
                *self.wheels)

    @property
    def wheels(self):
        """Names of the wheels."""
        return tuple([wheel.name for wheel in self._assembly.wheels])

    @property
    def connections(self):
        """Names of the elastic shafts."""
        return tuple([connection.name for connection in self._assembly.connections])

    @property
    def differentials(self):
        """Names of the differentials."""
        return tuple([differential.name for differential in self._differentials])

    @property
    def moments(self):
        """Names of the internal moments of all differentials."""
        return tuple([moment for d in self._differentials for moment in d.moments])

    @property
    def clutches(self):
        """Names of the clutches that an axial force can press."""
        return self._inputs.clutches

    @property
    def ports(self):
        """All inputs as ``Port``: what may come in, in which unit and range."""
        return self._inputs.ports

    @property
    def inputs(self):
        """Names of all inputs."""
        return tuple([port.name for port in self.ports])

    @property
    def parameters(self):
        """``{full name: value}`` of all parameters in force; they cannot be changed."""
        return MappingProxyType(self._assembly.parameters())

    @property
    def parameter_rows(self):
        """``{full name: Row}`` of all parameters: unit, range, description."""
        return self._assembly.rows()

    @property
    def time(self):
        """Simulated time, s."""
        return self.ticks * self.dt

    @property
    def torque(self):
        """The torque on the input in the last tick, N m."""
        return self._given.torque

    @property
    def grade(self):
        """The tangent of the slope in the last tick, or at the start."""
        return self._given.grade

    @property
    def clutch_force(self):
        """Axial force on each clutch in the last tick, N, in the order of ``clutches``."""
        return self._forces

    @property
    def force_limits(self):
        """What a larger force on each clutch is clamped to, N."""
        return tuple([actuator.limit for actuator in self._actuators])

    @property
    def language(self):
        """What the ticks are made in, to the same bits."""
        return 'Python, differentials in C' if core.passive_point else 'Python'

    @property
    def slip_speed(self):
        """Speed of the tread of each wheel over the road, m/s, (V_sx, V_sy) in its frame."""
        return tuple([contact[4:6] for _, _, contact in self._point.road.tyres])

    @property
    def clutched_shafts(self):
        """(shaft, carrier) of each of ``clutches``."""
        return tuple([(d.shaft_of[port], d.shafts[0]) for d in self._differentials if d.clutches
                      for port in d.ports[-2:]])

    @property
    def inertias(self):
        """``{shaft: kg m^2}`` of what is neither a wheel nor in a differential; input first."""
        return MappingProxyType(self._assembly.inertias)

    @property
    def mechanisms(self):
        """``{differential: Differential}``: the mechanism, parameters and shafts of each."""
        return {differential.name: differential for differential in self._differentials}

    @property
    def wheel_places(self):
        """``{wheel: (x, y)}`` of its contact, m before and to the left of the centre of mass."""
        return {wheel.name: (wheel.x, wheel.y) for wheel in self._assembly.wheels}

    @property
    def ends(self):
        """``{connection: (shaft, shaft)}`` at its ends a and b, of which b is at the wheels."""
        places = {(d.name, port): shaft for d in self._differentials
                  for port, shaft in d.shaft_of.items()}
        return {c.name: tuple([places.get((flange.element, flange.port), flange.element)
                               for flange in (c.a, c.b)]) for c in self._assembly.connections}

    @property
    def driven_by(self):
        """``{shaft: connection}`` of those at whose end b a connection is."""
        return {b: connection for connection, (_, b) in self.ends.items()}

    @property
    def parts(self):
        """Equal parts in which the last tick was made."""
        return self._parts

    @property
    def energy(self):
        """The ``Energy`` of all ticks since the start, J."""
        return self._books.total

    @property
    def stored_energy(self):
        """The energy of all motion, twist, pads and carcasses now, J."""
        return self._books.stored

    @property
    def losses(self):
        """``{name: J}`` of all losses since the start, each of them never negative."""
        return self._books.losses

    @property
    def kinds_of_loss(self):
        """``{kind: names}`` of the losses: of each differential, shafts, tyres, brakes, air."""
        return self._books.kinds

    def reset(self, speed=0.0, grade=0.0):
        """
        Go back to the start: time, angles, pose and forces zero, rolling freely.

        :param speed: of the body, forward, m/s; the shafts turn with it.
        :param grade: tangent of the slope on which it rolls.
        :raises ValueError: names what is wrong; the state stays what it was.
        """
        speed = checked('speed', speed, lambda v: abs(v) <= FASTEST,
                        f'a number of m/s in [-{FASTEST:g}, {FASTEST:g}]')
        grade = checked('grade', grade, lambda v: abs(v) <= STEEPEST,
                        f'a tangent in [-{STEEPEST:g}, {STEEPEST:g}]')
        self.ticks, self._parts, self.coarse_steps = 0, 1, 0
        self._given = self._inputs.idle(grade)
        self._forces = (0.0,) * len(self.clutches)
        self._friction = self._friction_under(self._forces)
        self._flows = (DIRECT,) * len(self._differentials)
        x = self._equations.rolling(speed, grade)
        self._turned = [0.0] * self._equations.layout.speeds.stop
        self._pose = 0.0, 0.0, 0.0
        self._point = self._equations.at(x, self._friction, self._given)
        self._stepper.reset()
        self._books.start(self._point, self._given)

    def follow(self, other):
        """
        Go on where another driveline is, as it moves, under the parameters of this one.

        What its energy changes by counts among the jumps.

        :raises ValueError: where the other has another layout.
        """
        if (other.planar, other.shafts, other.connections, other.inputs) != (
                self.planar, self.shafts, self.connections, self.inputs):
            raise ValueError('follow: the other driveline has another layout')
        self.ticks, self.coarse_steps = other.ticks, other.coarse_steps
        self._parts, self._given, self._forces = other._parts, other._given, other._forces
        self._flows, self._turned, self._pose = other._flows, other._turned, other._pose
        self._friction = self._friction_under(self._forces)
        self._point = self._equations.at(other._point.array, self._friction, self._given)
        self._stepper.reset()
        self._books.follow(other._books, self._point, self._given)

    def step(self, torque=0.0, brakes=None, clutch_forces=MappingProxyType({}), steer=0.0,
             grade=0.0, grip=None, contact=None, wind=0.0):
        """
        Advance one tick under what is given, which is held in it, and return its ``Snapshot``.

        :param torque: of the gearbox on the input, N m.
        :param brakes: capacity of the brake of each wheel, N m; none by default.
        :param clutch_forces: ``{clutch: axial force}``, N; a clutch left out has none.
        :param steer: angle of the front wheels, rad, to the left positive; 0 unless planar.
        :param grade: tangent of the slope, uphill positive.
        :param grip: of the road below each wheel, the friction at the reference load; 1 by
            default.
        :param contact: share of its load that each wheel has, 0 for one in the air; 1 by
            default.
        :param wind: head wind, m/s.
        :raises ValueError: names what is wrong, its value and what is allowed, or tells that it
            leads out of the range of floating point numbers; the state stays what it was.
        """
        given, commands = self._inputs.checked(
            torque, brakes, clutch_forces, steer, grade, grip, contact, wind)
        try:
            with np.errstate(all='ignore'):
                self._tick(given, commands)
        except (ArithmeticError, ValueError):   # a LinAlgError is one
            raise ValueError(f'inputs: {given} lead out of the range of floating point '
                             'numbers') from None
        return self.snapshot()

    def _tick(self, given, commands):
        point, friction, forces = self._point, self._friction, self._forces
        followed = tuple([actuator.follow(force, command) for actuator, force, command
                          in zip(self._actuators, forces, commands)])
        if followed != forces:
            friction = self._friction_under(followed)
            point = self._equations.at(point.array, friction, given)
        elif given != self._given:
            same_road = given._replace(torque=self._given.torque) == self._given
            point = self._equations.at(point.array, friction, given, point.train,
                                       point.road if same_road else None)
        flows = tuple([self._flow(*of_one) for of_one in zip(
            self._differentials, point.train.held, self._equations.layout.differentials,
            self._flows)])
        points, kept, is_coarse = self._stepper.tick(point, friction, given)
        h = self.dt / len(points)
        turned, pose = self._turned, self._pose
        before, speeds = point.x, self._equations.layout.speeds
        for end in points:
            turned = [angle + 0.5 * h * (u + v)
                      for angle, u, v in zip(turned, before[speeds], end.x[speeds])]
            pose = self._moved(pose, before, end.x, h)
            before = end.x
        self._books.note(point, points, given, h)
        self._point, self._friction, self._forces = points[-1], friction, followed
        self._given, self._flows, self._turned, self._pose = given, flows, turned, pose
        self._parts, self._stepper.kept = len(points), kept
        self.coarse_steps += is_coarse
        self.ticks += 1

    def _friction_under(self, forces):
        """Return the friction of each differential under the forces on all clutches, N."""
        friction, first = [], 0
        for differential in self._differentials:
            last = first + len(differential.clutches)
            friction.append(differential.friction(forces[first:last]))
            first = last
        return friction

    def _flow(self, differential, held, place, last):
        """Return who drives a differential, as ``losses`` has it; nothing depends on it."""
        w = self._point.x[place]
        return who_drives(held[0] * differential.ratio * w,
                          abs(w) > differential.k.sign_speed, 0.0, last)

    def _moved(self, pose, before, after, h):
        """Return the pose after a part, by the trapezoid."""
        x, y, yaw = pose
        (u_x, u_y, u_r), (v_x, v_y, v_r) = map(self._equations.road.twist, (before, after))
        end = yaw + 0.5 * h * (u_r + v_r)
        c, s, C, S = cos(yaw), sin(yaw), cos(end), sin(end)
        return (x + 0.5 * h * (c * u_x - s * u_y + C * v_x - S * v_y),
                y + 0.5 * h * (s * u_x + c * u_y + S * v_x + C * v_y), end)

    def snapshot(self):
        """Return the ``Snapshot`` of the last tick, or of the start under no inputs."""
        x, _, _, train, road = self._point
        layout = self._equations.layout
        alpha = x[layout.alpha] or (0.0,) * len(road.loads)
        return Snapshot(
            self.time, self._all_shafts(x), self._all_shafts(self._turned),
            tuple(train.shaft_torques), tuple(x[layout.twists]),
            tuple([moment for d, point in zip(self._differentials, train.points)
                   for moment in d.internal_moments(point)]),
            self._flows, tuple(zip(x[layout.kappa], alpha)),
            tuple([contact[:2] for _, _, contact in road.tyres]), tuple(road.loads), self._pose,
            tuple(self._equations.road.twist(x)), road.force)

    def _all_shafts(self, x):
        """Return the speeds of all shafts from the state, or their angles from its integral."""
        layout = self._equations.layout
        speeds = x[layout.inertias]
        for differential, n in zip(self._differentials, layout.differentials):
            speeds += differential.all_speeds(x[n], x[n + 1])
        return (*speeds, *x[layout.wheels])
