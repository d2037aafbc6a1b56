# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A differential as the node ``differential`` drives it."""

import math
from typing import NamedTuple

from dm_ros.driven import Condition, Driven
from dm_ros.files.published import input_topics
from dm_ros.motion.energy import AuditedSimulation, given_back, rated_efficiency
from dm_ros.motion.models import PAPER
from dm_ros.motion.simulation import NO_FORCE, Simulation
from dm_ros.settings import make_simulation, NodeParameters, port_parameters, speed_ports


class Prepared(NamedTuple):
    """A change of parameters that may be adopted: what holds then."""

    settings: NodeParameters
    ports: dict           # {shaft: PortParameters}
    model: tuple | None   # of ``Simulation.prepare``; None where the mechanism stays as it is


class Plant(Driven):
    """
    A differential as the node runs it.

    Its ports are the shafts that take a torque, N m, or a speed, rad/s, and the clutches that take
    an axial force, N, by the names of their moments.

    :param values: ``{full name: value}`` of the parameters that differ from their defaults.
    :param log: has ``warning`` and ``info``; conditions are logged there.
    :raises ValueError: names the parameter, its value and what is allowed.
    """

    def __init__(self, values, log):
        settings = NodeParameters().changed(NodeParameters.part_of(values))
        simulation = make_simulation(
            settings.variant, values,
            kind=AuditedSimulation if settings.energy_audit else Simulation)
        mechanism = simulation.mechanism
        super().__init__(settings, simulation, mechanism.ports + mechanism.actuators,
                         input_topics(mechanism), log)
        self.ports = port_parameters(mechanism.inputs, values)
        self.driving = mechanism.inputs
        self._shafts = len(mechanism.ports)
        self.freed = Condition('speeds are too old and their shafts are free', log)
        self.motoring = Condition('gears and bearings give energy back, as motors', log)
        self.reset()
        self.adopt(self.prepared({}))

    @property
    def title(self):
        """What it is, in a word."""
        return self.simulation.variant

    @property
    def words(self):
        """What the log tells of it at the start, in parts."""
        mechanism = self.simulation.mechanism
        inputs = {'torques': [port.name for port in mechanism.ports if port.kind == 'torque'],
                  'speeds': mechanism.half_shafts, 'forces': mechanism.clutches}
        return [f'{self.settings.loss_law} law of losses', f'steps in {self.simulation.language}',
                *(f'{kind} on {", ".join(names)}' for kind, names in inputs.items() if names)]

    @property
    def values(self):
        """``{full name: value}`` of all parameters, its own and those of its mechanism."""
        return {name: value for table in self._tables for name, value in table.named().items()}

    @property
    def rows(self):
        """``{full name: Row}`` of all parameters."""
        return {name: row for table in self._tables for name, row in table.rows().values()}

    @property
    def _tables(self):
        return self.settings, self.simulation.parameters, *self.ports.values()

    def _step(self, held):
        forces = held[self._shafts:]
        return self.simulation.step(held[:self._shafts], forces if any(forces) else NO_FORCE)

    def reset(self):
        """Go back to the start, without any demand; parameters stay."""
        super().reset()
        self._books_before = self._books()

    def prepared(self, changes):
        """
        Return what ``adopt`` takes, all of the changes or none; nothing is touched yet.

        It may be called from another thread: what it makes takes some hundred microseconds.

        :param changes: ``{full name: value}``.
        :raises ValueError: names the parameter, its value and what is allowed.
        """
        changes = self.checked(changes)
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
        self.limit((*(limit[port.kind] for port in simulation.mechanism.ports),
                    *simulation.force_limits))

    def notice(self):
        """Notice what is not noticed where it happens; to be called at 1 Hz."""
        super().notice()
        before, self._books_before = self._books_before, self._books()
        if self._books_before and (energy := given_back(before, self._books_before)):
            self.motoring.happened(
                f"{energy:.3g} J since the last report: the paper's law of losses does that where "
                'power does not run all one way; loss_law: passive does not')

    def told_of_loop(self):
        """Return ``{key: value}`` of what is driven, for diagnostics."""
        return {'variant': self.simulation.variant, **super().told_of_loop()}

    def told_of_inputs(self):
        """Return ``{key: value}`` of the forces of the actuators, for diagnostics."""
        simulation = self.simulation
        return {f'force on {clutch.name} [N]': f'{force:g}' for clutch, force in zip(
            simulation.mechanism.actuators, simulation.state.force)}

    def told_of_energy(self):
        """Return complaints and ``{key: value}`` of the energy, for diagnostics, None without."""
        simulation = self.simulation
        if not isinstance(simulation, AuditedSimulation):
            return None
        total, worst, simulation.worst = simulation.total, simulation.worst, 0.0
        efficiency, motoring = simulation.tick.efficiency, self.motoring
        return [str(motoring)] if motoring.active else [], {
            'worst balance residual since the last report [relative]': f'{worst:.1e}',
            'work of the torques [J]': f'{sum(total.work):.6g}',
            'stored [J]': f'{simulation.stored_energy:.6g}',
            'lost by drag [J]': f'{total.viscous:.6g}',
            'lost in gears and bearings [J]': f'{sum(total.gears) + sum(total.bearings):.6g}',
            'lost in clutches [J]': f'{sum(total.clutches):.6g}',
            **({'lost in half-shafts [J]': f'{sum(total.half_shafts):.6g}'}
               if total.half_shafts else {}),
            'taken by the error of the step [J]': f'{total.numerical:.3g}',
            'rated efficiency': f'{rated_efficiency(simulation.parameters):.6g}',
            'measured efficiency': 'none' if efficiency is None else f'{efficiency:.6g}',
            **{f'{name} gave back [J]': f'{part.energy:.6g} in {part.ticks} ticks'
               for name, part in simulation.returned.items()}}

    def _notice_stale(self, names):
        free = set(self.simulation.mechanism.half_shafts)
        for condition, some in ((self.stale, [name for name in names if name not in free]),
                                (self.freed, [name for name in names if name in free])):
            if some:
                condition.happened(', '.join(some))

    @property
    def of_inputs(self):
        """Those conditions that are of demands."""
        return *super().of_inputs, self.freed

    @property
    def conditions(self):
        """All that should not be and may be."""
        return *super().conditions, self.motoring

    def _books(self):
        """Return all that was lost under the law whose losses may be gains, None if it is not."""
        simulation = self.simulation
        return simulation.total if (
            self.settings.energy_audit and simulation.loss_law == PAPER) else None
