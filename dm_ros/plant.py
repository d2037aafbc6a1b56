# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
What advances: a simulation with what was demanded of it, what is refused, and what it says of it.

The node gives a ``Plant`` to a loop, and topics and services to the loop; a test or another
program drives it by the same methods. It knows no ROS, no clock and no thread: all its methods but
``prepared`` belong between two ticks.
"""

from typing import NamedTuple

from dm_ros.motion.energy import AuditedSimulation, given_back
from dm_ros.motion.held_inputs import HeldInputs
from dm_ros.motion.models import PAPER
from dm_ros.motion.simulation import NO_FORCE, Simulation
from dm_ros.settings import make_simulation, NodeParameters


class Condition:
    """Something that should not be: counted, logged when it begins and when it has ended."""

    def __init__(self, what, log):
        """:param what: in words, such as ``ticks are missed``; log: has ``warning``, ``info``."""
        self.what = what
        self.count = 0
        self.reason = ''
        self.active = False
        self._log = log
        self._settled = 0

    def __str__(self):
        return f'{self.what}: {self.reason}'

    def happened(self, reason, times=1):
        """Count it, and log it if it begins now."""
        self.count += times
        self.reason = reason
        if not self.active:
            self.active = True
            self._log.warning(str(self))

    def settle(self):
        """Log its end if it did not happen since the last call; to be called at 1 Hz."""
        if self.active and self.count == self._settled:
            self.active = False
            self._log.info(f'over: {self.what} ({self.count} in all)')
        self._settled = self.count


class Prepared(NamedTuple):
    """A change of parameters that may be adopted: what holds then."""

    settings: NodeParameters
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
        self.inputs = HeldInputs(mechanism.ports + mechanism.actuators, (), 0.0)
        self._shafts = len(mechanism.ports)
        self.ticks = 0   # in all, also refused ones and those before a reset
        self.refusing = Condition('messages are refused', log)
        self.clamping = Condition('demands are clamped', log)
        self.stale = Condition('demands are too old and count as zero', log)
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
        return {**self.settings.named(), **self.simulation.parameters.named()}

    def take(self, names, values, what, stamp=0, sparse=False):
        """
        Take a demand for some ports, whole or not at all; return whether it was taken.

        The ports are the shafts that take a torque, N m, and the clutches that take an axial
        force, N, by the names of their moments.

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
        try:
            self.simulation.advance(held[:shafts], forces if any(forces) else NO_FORCE)
        except ValueError as error:
            self.out_of_range.happened(str(error))
        self.ticks += 1
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
        rows = {name: row for name, row in (*self.settings.rows().values(),
                                            *self.simulation.parameters.rows().values())}
        for name in changes:
            if name not in rows:
                raise ValueError(f'{name}: there is no such parameter')
            if rows[name].read_only:
                raise ValueError(f'{name}: it cannot be changed while it runs')
        settings = self.settings.changed(self.settings.part_of(changes))
        mechanism = self.simulation.parameters.part_of(changes)
        model = None
        if mechanism or settings.substeps != self.settings.substeps:
            model = self.simulation.prepare(mechanism, settings.substeps)
        return Prepared(settings, model)

    def adopt(self, prepared):
        """Put into force what ``prepared`` returned; speeds and angles go on."""
        self.settings = settings = prepared.settings
        simulation = self.simulation
        if prepared.model:
            simulation.adopt(prepared.model)
        simulation.power_flow_deadband = settings.deadband
        simulation.initial_velocity = settings.initial_velocity(simulation.outputs)
        self.inputs.limits = (settings.torque_limit,) * self._shafts + simulation.force_limits
        # in lockstep time stands still without torques, so none is too old
        self.inputs.timeout = 0.0 if self.lockstep else settings.torque_timeout * settings.rate

    def notice(self):
        """Notice what is not noticed where it happens; to be called at 1 Hz."""
        coarse = self.simulation.coarse_steps
        if coarse > self._coarse_before:
            self.coarse.happened('their work reached its bound', coarse - self._coarse_before)
        self._coarse_before = coarse
        stale = self.inputs.stale(self.simulation.ticks)
        if stale:
            self.stale.happened(', '.join(stale))
        before, self._books_before = self._books_before, self._books()
        if self._books_before and (energy := given_back(before, self._books_before)):
            self.motoring.happened(
                f"{energy:.3g} J since the last report: the paper's law of losses does that where "
                'power does not run all one way; loss_law: passive does not')

    def settle(self):
        """Let the conditions end that are over; to be called at 1 Hz, after ``notice``."""
        for condition in (self.refusing, self.clamping, self.stale, self.out_of_range,
                          self.coarse, self.motoring):
            condition.settle()

    def _books(self):
        """Return all that was lost under the law whose losses may be gains, None if it is not."""
        simulation = self.simulation
        return simulation.total if (
            self.settings.energy_audit and simulation.loss_law == PAPER) else None
