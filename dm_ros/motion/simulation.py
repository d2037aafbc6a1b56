# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
A differential in time: ``Simulation`` steps one of the five variants at a fixed rate.

Nothing here depends on measured time: equal inputs give equal bits.
"""

import math

from dm_ros.mechanism.variants import equipped, variant_named
from dm_ros.motion.actuators import actuators_of
from dm_ros.motion.checks import checked, checked_ports, numbers_for, refuse
from dm_ros.motion.coupled_model import model_with
from dm_ros.motion.models import LOSS_LAWS, PASSIVE
from dm_ros.motion.state import Snapshot
from dm_ros.motion.ticker import Run, ticker_of

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
        self._ticker = None
        if loss_law not in LOSS_LAWS:
            raise ValueError(f'loss_law: {loss_law!r} is not one of {", ".join(LOSS_LAWS)}')
        self.loss_law = loss_law
        parameters = self._table({} if parameters is None else parameters)
        self.mechanism = self._variant.mechanism
        ports = checked_ports(ports, self.inputs)
        self.mechanism = equipped(self.mechanism, parameters, ports)
        self.dt = checked('dt', dt, lambda v: v > 0.0, 'a positive number of seconds')
        self.initial_velocity = initial_velocity
        self._ticker = self.prepare(parameters, substeps, ports)
        self.power_flow_deadband = power_flow_deadband
        self.reset()

    @property
    def variant(self):
        """Name of the variant."""
        return self._variant.name

    @property
    def language(self):
        """What the steps are made in, 'C' or 'Python', to the same bits, see ``dm_ros.core``."""
        return self._ticker.language

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
        return tuple([actuator.limit for actuator in self._ticker.run.actuators])

    @property
    def moments(self):
        """Names of the internal moments."""
        return self.mechanism.moments

    @property
    def time(self):
        """Simulated time, s."""
        return self._ticker.ticks * self.dt

    @property
    def ticks(self):
        """Ticks since the start."""
        return self._ticker.ticks

    @property
    def coarse_steps(self):
        """Solver steps since the start that reached the bound of work, see ``adaptive``."""
        return self._ticker.coarse_steps

    @property
    def power_flow_deadband(self):
        """Difference of power within which the index stays what it is, W."""
        return self._ticker.deadband

    @power_flow_deadband.setter
    def power_flow_deadband(self, value):
        self._ticker.deadband = checked('power_flow_deadband', value, lambda v: v >= 0.0,
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
        return self._ticker.run.substeps

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
        return self._ticker.model.parameters

    @parameters.setter
    def parameters(self, parameters):
        self.adopt(self.prepare(parameters))

    @property
    def ports(self):
        """``{shaft: (stiffness, damping)}`` of the ports that take a speed, N m/rad, N m s/rad."""
        return {shaft: (half_shaft.stiffness, half_shaft.damping) for shaft, half_shaft
                in zip(self.mechanism.half_shafts, self._ticker.model.half_shafts)}

    @ports.setter
    def ports(self, ports):
        self.adopt(self.prepare({}, ports=ports))

    @property
    def state(self):
        """
        The ``State``, all that goes on from tick to tick but their number.

        One that a simulation of the same variant, law and parameters had may be put back.
        """
        return self._ticker.state

    @state.setter
    def state(self, state):
        self._ticker.state = state

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
        substeps = checked('substeps', self.substeps if substeps is None else substeps,
                           lambda v: v >= 1 and v == int(v), 'a positive integer')
        ports = self.ports if ports is None else checked_ports(ports, self.inputs)
        if set(ports) != set(self.mechanism.half_shafts):
            raise ValueError('ports: which shafts take a speed cannot change while it runs')
        model = model_with(ports, self._variant.formulation, self.mechanism, self.loss_law,
                           parameters, self.dt / substeps)
        mechanism = self.mechanism
        run = Run(int(substeps), self.dt, actuators_of(parameters, mechanism.clutches, self.dt),
                  mechanism.shafts, mechanism.outputs,
                  tuple([port.idle for port in mechanism.ports]))
        return self._made(model, run)

    def _made(self, model, run, books=None):
        return ticker_of(model, run, books)

    def _table(self, parameters):
        """Return a table of parameters, or those in force with a mapping of changes."""
        kind = self._variant.mechanism.parameters
        if isinstance(parameters, kind):
            return parameters
        now = self._ticker.model.parameters if self._ticker else kind()
        try:
            return now.changed(dict(parameters))
        except TypeError:
            raise ValueError(f'parameters: {type(parameters).__name__} is not '
                             f'{kind.__name__} or a mapping') from None

    def adopt(self, prepared):
        """Take what ``prepare`` made; the speeds of the output shafts and all angles go on."""
        prepared.follow(self._ticker)
        self._ticker = prepared

    def reset(self):
        """Go back to the start: time, angles, torques, forces zero, initial speeds, index +1."""
        self._ticker.reset(self._initial_velocity)

    def step(self, torques, clutch_forces=NO_FORCE):
        """Advance one tick, as ``advance``, and return its ``Snapshot``."""
        return tuple.__new__(Snapshot, self._stepped(torques, clutch_forces))

    def _stepped(self, torques, clutch_forces):
        """Advance one tick and return what is reported of it."""
        try:
            if reported := self._ticker.quick(torques, clutch_forces, True):
                return reported
        except ArithmeticError:
            pass   # it gets its words there
        self._checked_tick(torques, clutch_forces)
        return self._ticker.report()

    def advance(self, torques, clutch_forces=NO_FORCE):
        """
        Advance one tick.

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
        try:
            if self._ticker.quick(torques, clutch_forces, False) is not None:
                return
        except ArithmeticError:
            pass
        self._checked_tick(torques, clutch_forces)

    def _checked_tick(self, torques, clutch_forces):
        T = self._checked_torques(torques)
        try:
            self._ticker.tick(T, self._checked_forces(clutch_forces))
        except ArithmeticError:
            raise ValueError(
                f'torques: {T} lead out of the range of floating point numbers') from None

    def snapshot(self):
        """Return the ``Snapshot`` of the last tick, or of the start at zero torque."""
        return tuple.__new__(Snapshot, self._ticker.report())

    def _checked_torques(self, torques):
        if self.mechanism.half_shafts:
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

    def _checked_forces(self, commands):
        """Return what the actuators are told, N."""
        ports = self.mechanism.actuators
        if commands is NO_FORCE:
            return NO_FORCE
        if not ports:
            # a numpy array is no tuple
            if not hasattr(commands, '__iter__') or tuple(commands) not in ((), NO_FORCE):
                raise ValueError(f'clutch_forces: {commands!r} is not allowed, there is no clutch')
            return ()
        A = numbers_for('clutch_forces', commands, ports)
        refuse('clutch_forces', A, ports)
        return A
