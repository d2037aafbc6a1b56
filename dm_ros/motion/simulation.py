# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
A differential in time: ``Simulation`` steps one of the five variants at a fixed rate.

Nothing here depends on measured time: equal inputs give equal bits.
"""

import math
from operator import add

from dm_ros.mechanism.power_flow import DIRECT
from dm_ros.mechanism.variants import equipped, variant_named
from dm_ros.motion.actuators import actuators_of
from dm_ros.motion.checks import checked, checked_ports, numbers_for, refuse
from dm_ros.motion.coupled_model import model_with
from dm_ros.motion.models import LOSS_LAWS, PASSIVE
from dm_ros.motion.state import Snapshot, State

NO_FORCE = (0.0, 0.0)   # on both clutches, where there are any


class Simulation:
    """
    One differential in simulated time.

    At each tick the torques are held, the power-flow index is decided at the start of each
    solver step, and the speeds advance by the tick length.

    :param variant: one of ``VARIANTS``.
    :param dt: length of a tick, s.
    :param parameters: ``SymmetricParameters`` or ``SelfLockingParameters``, or a mapping from
        parameter names to values that differ from the defaults.
    :param loss_law: 'passive', where no element ever gives energy back, or 'paper'.
    :param substeps: solver steps in a tick.
    :param power_flow_deadband: W, see ``dm_ros.mechanism.power_flow``.
    :param initial_velocity: speeds of the two output shafts at the start, rad/s.
    :param ports: ``{shaft: (stiffness, damping)}`` of the input shafts where an outside speed
        comes in instead of a torque, by an elastic shaft, N m/rad and N m s/rad.
    :raises ValueError: names what is wrong, its value and what is allowed.
    """

    def __init__(self, variant, dt=0.001, parameters=None, *, loss_law=PASSIVE, substeps=1,
                 power_flow_deadband=0.0, initial_velocity=(0.0, 0.0), ports=()):
        self._variant = variant_named(variant)
        self._model = None
        if loss_law not in LOSS_LAWS:
            raise ValueError(f'loss_law: {loss_law!r} is not one of {", ".join(LOSS_LAWS)}')
        self.loss_law = loss_law
        parameters = self._table({} if parameters is None else parameters)
        self.mechanism = self._variant.mechanism
        ports = checked_ports(ports, self.inputs)
        self.mechanism = equipped(self.mechanism, parameters, ports)
        self.dt = checked('dt', dt, lambda v: v > 0.0, 'a positive number of seconds')
        self.power_flow_deadband = power_flow_deadband
        self.initial_velocity = initial_velocity
        self._substeps = None
        self.adopt(self.prepare(parameters, substeps, ports))
        self.reset()

    @property
    def variant(self):
        """Name of the variant."""
        return self._variant.name

    @property
    def language(self):
        """What the steps are made in, 'C' or 'Python', to the same bits, see ``dm_ros.core``."""
        return self._model.language

    @property
    def shafts(self):
        """Names of all shafts."""
        return self.mechanism.shafts

    @property
    def inputs(self):
        """Names of the shafts that take a torque."""
        return self.mechanism.inputs

    @property
    def outputs(self):
        """Names of the two output shafts."""
        return self.mechanism.outputs

    @property
    def clutches(self):
        """Names of the clutches that an axial force can press."""
        return self.mechanism.clutches

    @property
    def force_limits(self):
        """Largest force on each clutch, N; larger commands are clamped to it."""
        return tuple([actuator.limit for actuator in self._actuators])

    @property
    def moments(self):
        """Names of the internal moments."""
        return self.mechanism.moments

    @property
    def time(self):
        """Simulated time, s."""
        return self._ticks * self.dt

    @property
    def ticks(self):
        """Ticks since the start."""
        return self._ticks

    @property
    def coarse_steps(self):
        """Solver steps since the start that reached the bound of work, see ``adaptive``."""
        return self._coarse_steps

    @property
    def power_flow_deadband(self):
        """Difference of power within which the index stays what it is, W."""
        return self._deadband

    @power_flow_deadband.setter
    def power_flow_deadband(self, value):
        self._deadband = checked('power_flow_deadband', value, lambda v: v >= 0.0,
                                 'a number of watts that is not negative')

    @property
    def initial_velocity(self):
        """Speeds of the two output shafts at the start and after a reset, rad/s."""
        return self._initial_velocity

    @initial_velocity.setter
    def initial_velocity(self, velocities):
        try:
            pair = dict(zip(self.outputs, velocities, strict=True))
        except (TypeError, ValueError):
            raise ValueError(f'initial_velocity: {velocities!r} must be two numbers, '
                             f'for {", ".join(self.outputs)}') from None
        self._initial_velocity = tuple(
            checked(f'initial_velocity.{name}', value, lambda v: abs(v) <= 1e6,
                    'a number of rad/s in [-1e+06, 1e+06]') for name, value in pair.items())

    @property
    def substeps(self):
        """Solver steps in a tick."""
        return self._substeps

    @substeps.setter
    def substeps(self, value):
        self.adopt(self.prepare({}, value))

    @property
    def parameters(self):
        """
        The parameters in force.

        They may be set between two ticks, also by a mapping of those that change; the speeds
        of the output shafts and all angles go on from where they are.
        """
        return self._model.parameters

    @parameters.setter
    def parameters(self, parameters):
        self.adopt(self.prepare(parameters))

    @property
    def ports(self):
        """``{shaft: (stiffness, damping)}`` of the ports that take a speed, N m/rad, N m s/rad."""
        return {shaft: (half_shaft.stiffness, half_shaft.damping) for shaft, half_shaft
                in zip(self.mechanism.half_shafts, self._model.half_shafts)}

    @ports.setter
    def ports(self, ports):
        self.adopt(self.prepare({}, ports=ports))

    @property
    def state(self):
        """
        The ``State``, all that goes on from tick to tick but their number.

        One that a simulation of the same variant, law and parameters had may be put back.
        """
        return State(self._x, self._turned, self._origin, self._torque, self._flow,
                     self._memory, self._force, self._held)

    @state.setter
    def state(self, state):
        (self._x, self._turned, self._origin, self._torque, self._flow,
         self._memory, self._force, self._held) = state
        self._point = None

    def prepare(self, parameters, substeps=None, ports=None):
        """
        Return what ``adopt`` takes, without touching this simulation.

        It may be called from another thread: making the matrices takes some hundred
        microseconds, adopting them next to nothing.

        :param parameters: as for the simulation itself; a mapping changes those in force.
        :param substeps: solver steps in a tick, None for those in force.
        :param ports: stiffness and damping of the speed ports, None for those in force; which
            ports are speed ports cannot change.
        :raises ValueError: names what is wrong, its value and what is allowed.
        """
        parameters = self._table(parameters)
        if parameters.has_clutches and not self.mechanism.clutches:
            raise ValueError(f'{parameters.prefix}.clutch: what began without clutches cannot get '
                             'any while it runs; friction_surfaces must be set at the start')
        substeps = checked('substeps', self._substeps if substeps is None else substeps,
                           lambda v: v >= 1 and v == int(v), 'a positive integer')
        ports = self.ports if ports is None else checked_ports(ports, self.inputs)
        if set(ports) != set(self.mechanism.half_shafts):
            raise ValueError('ports: which shafts take a speed cannot change while it runs')
        return (model_with(ports, self._variant.formulation, self.mechanism, self.loss_law,
                           parameters, self.dt / substeps), int(substeps))

    def _table(self, parameters):
        """Return a table of parameters, or those in force with a mapping of changes."""
        kind = self._variant.mechanism.parameters
        if isinstance(parameters, kind):
            return parameters
        now = self._model.parameters if self._model else kind()
        try:
            return now.changed(dict(parameters))
        except TypeError:
            raise ValueError(f'parameters: {type(parameters).__name__} is not '
                             f'{kind.__name__} or a mapping') from None

    def adopt(self, prepared):
        """Take what ``prepare`` made; the speeds of the output shafts and all angles go on."""
        old = self._model
        self._model, self._substeps = prepared
        self._actuators = actuators_of(self._model.parameters, self.clutches, self.dt)
        if old is not None:
            self._origin = self._positions(old)
            self._turned = (0.0, 0.0)
            velocity = dict(zip(self.shafts, old.all_shafts(self._x)))
            outputs = (velocity[shaft] for shaft in self.outputs)
            self._x = *self._model.independent(*outputs), *self._x[2:]   # and the twists
            self._point = None

    def reset(self):
        """Go back to the start: time, angles, torques, forces zero, initial speeds, index +1."""
        self._ticks = 0
        self._coarse_steps = 0
        model = self._model
        idle = tuple(port.idle for port in self.mechanism.ports)
        twists = (0.0,) * len(self.mechanism.half_shafts)
        self.state = State(
            x=(*model.independent(*self._initial_velocity), *twists), turned=(0.0, 0.0),
            origin=(0.0,) * len(self.shafts), torque=(0.0,) * len(self.inputs),
            power_flow=DIRECT, memory=(0.0, 0.0) if model.lagged else (),
            force=(0.0,) * len(self.clutches), held=idle)

    def step(self, torques, clutch_forces=NO_FORCE):
        """Advance one tick, as ``advance``, and return its ``Snapshot``."""
        self.advance(torques, clutch_forces)
        return self.snapshot()

    def advance(self, torques, clutch_forces=NO_FORCE):
        """
        Advance one tick; return the solver steps that did it, as ``models`` tells them.

        :param torques: N m, in the order of ``inputs``, held in the tick. For a speed port it is
            the speed outside instead, rad/s, or None where nothing holds the outside: the shaft
            is free then, its twist is forgotten.
        :param clutch_forces: axial forces that the actuators are told to press the clutches with,
            N, in the order of ``clutches``, beside their preload. The force follows with the time
            constant of the actuator, up to its limit.
        :raises ValueError: for torques or forces that are not as many finite numbers as there are
            inputs or clutches, for a force below 0, or for what leads out of the range of floating
            point numbers; the state stays what it was.
        """
        T = self._checked_torques(torques)
        force = self._pressed(clutch_forces)
        model, deadband = self._model, self._deadband
        x, memory, flow = self._x, self._memory, self._flow
        lagged, point = model.lagged, self._point
        if lagged and point is None:
            point = model.point(x, model.friction(memory, self._force), self._held, flow)
        S = model.friction(memory, force)
        turned_1, turned_2 = self._turned
        coarse_steps = 0
        steps = []
        try:
            for _ in range(self._substeps):
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
            in_range = math.isfinite(sum(x) + turned_1 + turned_2)
        except ArithmeticError:
            in_range = False
        if not in_range:
            raise ValueError(f'torques: {T} lead out of the range of floating point numbers')
        self._x, self._turned, self._held = x, (turned_1, turned_2), T
        self._torque = model.mean_torques(T, steps) if model.half_shafts else T
        self._flow, self._memory, self._point, self._force = flow, memory, point, force
        self._coarse_steps += coarse_steps
        self._ticks += 1
        return steps

    def snapshot(self):
        """Return the ``Snapshot`` of the last tick, or of the start at zero torque."""
        return Snapshot(*self._report())

    def _report(self):
        model, x, T, flow = self._model, self._x, self._held, self._flow
        if self._point is None:
            self._point = model.point(x, model.friction(self._memory, self._force), T, flow)
        return (self._ticks * self.dt, model.all_shafts(x), self._positions(model), self._torque,
                model.internal_moments(x, T, flow, self._point), flow, self._force)

    def _positions(self, model):
        return tuple(map(add, self._origin, model.all_shafts(self._turned)))

    def _checked_torques(self, torques):
        if self._model.half_shafts:
            return self._checked_inputs(torques)
        T = numbers_for('torques', torques, self.mechanism.ports)
        if not math.isfinite(sum(T)):   # as nearly never
            refuse('torques', T, self.mechanism.ports)
        return T

    def _checked_inputs(self, inputs):
        """Return the inputs where some ports take a speed, or None."""
        ports = self.mechanism.ports
        try:
            free = [value is None for _, value in zip(ports, inputs, strict=True)]
        except (TypeError, ValueError):
            free = []
        for port, gone in zip(ports, free):
            if gone and port.idle is not None:
                raise ValueError(f'torques: None is not allowed on {port.name}, it takes a '
                                 f'{port.kind}')
        given = (tuple([0.0 if gone else value for gone, value in zip(free, inputs)])
                 if free else inputs)
        values = numbers_for('torques', given, ports)
        refuse('torques', values, ports)
        return tuple([None if gone else value for gone, value in zip(free, values)])

    def _pressed(self, commands):
        """Return the forces in force in the next tick."""
        if commands is NO_FORCE and not any(self._force):
            return self._force
        ports = self.mechanism.actuators
        if not ports:
            # a numpy array is no tuple
            if not hasattr(commands, '__iter__') or tuple(commands) not in ((), NO_FORCE):
                raise ValueError(f'clutch_forces: {commands!r} is not allowed, there is no clutch')
            return ()
        A = numbers_for('clutch_forces', commands, ports)
        refuse('clutch_forces', A, ports)
        return tuple([actuator.follow(force, command) for actuator, force, command
                      in zip(self._actuators, self._force, A)])
