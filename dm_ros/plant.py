# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
What advances: a simulation with what was demanded of it, what is refused, and what it says of it.

The node gives a ``Plant`` to a loop, and topics and services to the loop; a test or another
program drives it by the same methods. It knows no ROS, no clock and no thread: all its methods but
``prepared`` belong between two ticks.
"""

import math
from typing import NamedTuple

from dm_ros.motion.energy import AuditedSimulation, given_back
from dm_ros.motion.held_inputs import HeldInputs
from dm_ros.motion.models import PAPER
from dm_ros.motion.simulation import NO_FORCE, Simulation
from dm_ros.settings import make_simulation, NodeParameters, port_parameters, speed_ports


class Condition:
    """
    Something that should not be: counted, logged when it begins and when it has ended.

    It is ``active`` until a second without it. The log is slower to say that it is over, so that
    one that comes and goes takes two lines, and not two in every second.
    """

    QUIET = 10   # s without it, after which the log says that it is over

    def __init__(self, what, log):
        """:param what: in words, such as ``ticks are missed``; log: has ``warning``, ``info``."""
        self.what = what
        self.count = 0
        self.reason = ''
        self.active = False
        self._log = log
        self._settled = self._before = self._quiet = 0
        self._told = False   # in the log that it has begun, and not yet that it is over

    def __str__(self):
        return f'{self.what}: {self.reason}'

    def happened(self, reason, times=1):
        """Count it, and log it if it begins now."""
        self.count += times
        self.reason = reason
        self.active = True
        if not self._told:
            self._told = True
            self._log.warning(str(self))

    def settle(self):
        """End it if it did not happen since the last call; to be called at 1 Hz."""
        self._quiet = self._quiet + 1 if self.count == self._settled else 0
        if self._quiet:
            self.active = False
        if self._told and self._quiet >= self.QUIET:
            self._tell('over')
        self._settled = self.count

    def end(self):
        """Tell what was since it began, if that is not over; when nothing more will happen."""
        if self._told:
            self._tell('at the end')

    def _tell(self, when):
        self._told = False
        times = self.count - self._before
        self._log.info(f'{when}: {self.what} ({times} times since it began)')
        self._before = self.count


class Prepared(NamedTuple):
    """A change of parameters that may be adopted: what holds then."""

    settings: NodeParameters
    ports: dict           # {shaft: PortParameters}
    model: tuple | None   # of ``Simulation.prepare``; None where the mechanism stays as it is


class Plant:
    """
    A differential as the node runs it.

    :param values: ``{full name: value}`` of the parameters that differ from their defaults.
    :param log: has ``warning`` and ``info``; conditions are logged there.
    :raises ValueError: names the parameter, its value and what is allowed.
    """

    def __init__(self, values, log):
        self.settings = settings = NodeParameters().changed(NodeParameters.part_of(values))
        self.simulation = make_simulation(
            settings.variant, values,
            kind=AuditedSimulation if settings.energy_audit else Simulation)
        mechanism = self.simulation.mechanism
        self.ports = port_parameters(mechanism.inputs, values)
        self.inputs = HeldInputs(mechanism.ports + mechanism.actuators, (), 0.0,
                                 settings.joint_prefix)
        self._shafts = len(mechanism.ports)
        self.ticks = 0   # in all, also refused ones and those before a reset
        self.refusing = Condition('messages are refused', log)
        self.clamping = Condition('demands are clamped', log)
        self.stale = Condition('demands are too old and count as zero', log)
        self.freed = Condition('speeds are too old and their shafts are free', log)
        self.out_of_range = Condition('ticks are refused', log)
        self.coarse = Condition('solver steps are coarse', log)
        self.motoring = Condition('gears and bearings give energy back, as motors', log)
        self.reset()
        self.adopt(self.prepared({}))

    @property
    def lockstep(self):
        """Whether each demand brings its own tick."""
        return self.settings.mode == 'lockstep'

    @property
    def values(self):
        """``{full name: value}`` of all parameters, its own and those of its mechanism."""
        return {name: value for table in self._tables for name, value in table.named().items()}

    @property
    def _tables(self):
        return self.settings, self.simulation.parameters, *self.ports.values()

    def take(self, names, values, what, stamp=0, sparse=False):
        """
        Take a demand for some ports, whole or not at all; return whether it was taken.

        The ports are the shafts that take a torque, N m, or a speed, rad/s, and the clutches that
        take an axial force, N, by the names of their moments.

        :param values: for each name, or ``Joints``, see ``HeldInputs.demand``.
        :param what: what brought it, in words.
        :param stamp: ns, in which demands must follow one another; 0 for none.
        :param sparse: whether NaN stands for no demand, else it is refused.
        """
        if stamp and stamp <= self._last_stamp:
            self.inputs.refused += 1
            self.refusing.happened(f'{what}: its stamp repeats or goes back in time')
            return False
        try:
            if clamped := self.inputs.demand(names, values, self.simulation.ticks, sparse):
                limits = dict.fromkeys(f'{limit:g} {port.unit}' for port, limit in clamped)
                self.clamping.happened(f'{what}: beyond {", ".join(limits)}')
        except ValueError as error:
            self.refusing.happened(f'{what}: {error}')
            return False
        self._last_stamp = stamp or self._last_stamp
        return True

    def tick(self):
        """
        Advance one tick under the inputs in force and return the ``Snapshot``.

        A tick that would lead out of the range of numbers is refused and counted: the state stays.
        """
        held, shafts = self.inputs.in_force(self.simulation.ticks), self._shafts
        forces = held[shafts:]
        self.ticks += 1
        try:
            return self.simulation.step(held[:shafts], forces if any(forces) else NO_FORCE)
        except ValueError as error:
            self.out_of_range.happened(str(error))
            return self.simulation.snapshot()

    def reset(self):
        """Go back to the start, without any demand; parameters stay."""
        self.simulation.reset()
        self.inputs.forget()
        self._last_stamp = 0
        self._coarse_before = 0
        self._books_before = self._books()

    def prepared(self, changes):
        """
        Return what ``adopt`` takes, all of the changes or none; nothing is touched yet.

        It may be called from another thread: what it makes takes some hundred microseconds.

        :param changes: ``{full name: value}``.
        :raises ValueError: names the parameter, its value and what is allowed.
        """
        rows = {name: row for table in self._tables for name, row in table.rows().values()}
        before = self.values
        for name, value in changes.items():
            if name not in rows:
                raise ValueError(f'{name}: there is no such parameter')
            if rows[name].read_only and value != before[name]:
                raise ValueError(f'{name}: it cannot be changed while it runs')
        settings = self.settings.changed(self.settings.part_of(changes))
        mechanism = self.simulation.parameters.part_of(changes)
        ports = {shaft: table.changed(table.part_of(changes))
                 for shaft, table in self.ports.items()}
        model = None
        if mechanism or settings.substeps != self.settings.substeps or ports != self.ports:
            model = self.simulation.prepare(mechanism, settings.substeps, speed_ports(ports))
        return Prepared(settings, ports, model)

    def adopt(self, prepared):
        """Put into force what ``prepared`` returned; speeds and angles go on."""
        self.settings, self.ports = prepared.settings, prepared.ports
        settings = self.settings
        simulation = self.simulation
        if prepared.model:
            simulation.adopt(prepared.model)
        simulation.power_flow_deadband = settings.deadband
        simulation.initial_velocity = settings.initial_velocity(simulation.outputs)
        limit = {'torque': settings.torque_limit, 'speed': math.inf}
        self.inputs.limits = (*(limit[port.kind] for port in simulation.mechanism.ports),
                              *simulation.force_limits)
        # in lockstep time stands still without torques, so none is too old
        self.inputs.timeout = 0.0 if self.lockstep else settings.torque_timeout * settings.rate

    def notice(self):
        """Notice what is not noticed where it happens; to be called at 1 Hz."""
        coarse = self.simulation.coarse_steps
        if coarse > self._coarse_before:
            self.coarse.happened('their work reached its bound', coarse - self._coarse_before)
        self._coarse_before = coarse
        free = set(self.simulation.mechanism.half_shafts)
        stale = self.inputs.stale(self.simulation.ticks)
        for condition, names in ((self.stale, [name for name in stale if name not in free]),
                                 (self.freed, [name for name in stale if name in free])):
            if names:
                condition.happened(', '.join(names))
        before, self._books_before = self._books_before, self._books()
        if self._books_before and (energy := given_back(before, self._books_before)):
            self.motoring.happened(
                f"{energy:.3g} J since the last report: the paper's law of losses does that where "
                'power does not run all one way; loss_law: passive does not')

    def settle(self):
        """Let the conditions end that are over; to be called at 1 Hz, after ``notice``."""
        for condition in self.conditions:
            condition.settle()

    @property
    def conditions(self):
        """All that should not be and may be."""
        return (self.refusing, self.clamping, self.stale, self.freed, self.out_of_range,
                self.coarse, self.motoring)

    def _books(self):
        """Return all that was lost under the law whose losses may be gains, None if it is not."""
        simulation = self.simulation
        return simulation.total if (
            self.settings.energy_audit and simulation.loss_law == PAPER) else None
