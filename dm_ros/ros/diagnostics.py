# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What the node says of itself: conditions that are logged at their ends, and /diagnostics."""

import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from std_msgs.msg import Header

from dm_ros.motion.energy import AuditedSimulation, rated_efficiency


class Condition:
    """Something that should not be: counted, logged when it begins and when it has ended."""

    def __init__(self, what, logger):
        """:param what: in words, such as ``ticks are missed``; logger: of the node."""
        self.what = what
        self.count = 0
        self.reason = ''
        self.active = False
        self._logger = logger
        self._settled = 0

    def happened(self, reason, times=1):
        """Count it, and log it if it begins now."""
        self.count += times
        self.reason = reason
        if not self.active:
            self.active = True
            self._logger.warning(f'{self.what}: {reason}')

    def settle(self):
        """Log its end if it did not happen since the last call; to be called at 1 Hz."""
        if self.active and self.count == self._settled:
            self.active = False
            self._logger.info(f'over: {self.what} ({self.count} in all)')
        self._settled = self.count


def status(name, complaints, fine, values):
    """
    Return a DiagnosticStatus.

    :param complaints: the active ``Condition`` s, if any; fine: the message if there is none.
    :param values: mapping from key to value.
    """
    return DiagnosticStatus(
        level=DiagnosticStatus.WARN if complaints else DiagnosticStatus.OK,
        name=name,
        message='; '.join(condition.what for condition in complaints) or fine,
        hardware_id='dm_ros',
        values=[KeyValue(key=key, value=str(value)) for key, value in values.items()])


def lateness_values(lateness):
    """Return p50, p99 and the largest of sorted latenesses in ns, in words in microseconds."""
    def at(share):
        return f'{lateness[int(share * (len(lateness) - 1))] / 1e3:.1f}' if lateness else 'none'
    return {'lateness p50 [us]': at(0.5), 'lateness p99 [us]': at(0.99),
            'lateness max [us]': at(1.0)}


class Diagnostics:
    """The state of the node as /diagnostics tells it, and the conditions it logs."""

    def __init__(self, name, logger, simulation, pacer, inputs, control, neighbours):
        """Take what is looked at; ``name``: of the node."""
        self.name, self.neighbours = name, neighbours
        self.simulation, self.pacer, self.inputs, self.control = simulation, pacer, inputs, control
        self.ticks = 0   # since the node is there
        self.missing = Condition('ticks are missed', logger)
        self.coarse = Condition('solver steps are coarse', logger)
        self.out_of_range = Condition('ticks are refused', logger)
        self.refusing = Condition('torque messages are refused', logger)
        self.clamping = Condition('torques are clamped', logger)
        self.stale = Condition('torques are too old and count as zero', logger)
        self.misfitting = Condition('QoS does not fit', logger)
        self.ambiguous = Condition('another node has the same name', logger)
        self._before = 0, time.monotonic_ns()
        self._coarse_before = 0

    def report(self, stamp):
        """Return the DiagnosticArray of the time since the last report; to be called at 1 Hz."""
        self._notice()
        statuses = [self._loop(), self._torques(), self._connections()]
        if isinstance(self.simulation, AuditedSimulation):
            statuses.append(self._energy())
        for condition in (self.missing, self.coarse, self.out_of_range, self.refusing,
                          self.clamping, self.stale, self.misfitting, self.ambiguous):
            condition.settle()
        return DiagnosticArray(header=Header(stamp=stamp), status=statuses)

    def _notice(self):
        """Count what is not counted where it happens."""
        missed = self.pacer.missed - self.missing.count
        if missed > 0:
            self.missing.happened(f'{missed} since the last report', missed)
        coarse = self.simulation.coarse_steps
        if coarse > self._coarse_before:
            self.coarse.happened('their work reached its bound', coarse - self._coarse_before)
        self._coarse_before = coarse
        stale = self.inputs.stale(self.simulation.ticks)
        if stale:
            self.stale.happened(', '.join(stale))

    def _loop(self):
        ticks, now = self.ticks, time.monotonic_ns()
        (ticks_before, before), self._before = self._before, (ticks, now)
        running = 'running' if self.control.running.is_set() else 'paused'
        return status(
            f'{self.name}: loop', active(self.missing, self.coarse, self.out_of_range), running, {
                'variant': self.simulation.variant,
                'rate wanted [Hz]': f'{1.0 / self.simulation.dt:g}',
                'rate held [Hz]': f'{(ticks - ticks_before) / (now - before) * 1e9:.2f}',
                **lateness_values(self.pacer.take_lateness()),
                'ticks': ticks,
                'missed ticks': self.pacer.missed,
                'refused ticks': self.out_of_range.count,
                'coarse solver steps': self.coarse.count,
                'simulated time [s]': f'{self.simulation.time:.9g}'})

    def _torques(self):
        inputs = self.inputs
        silent, stale = inputs.silent(), inputs.stale(self.simulation.ticks)
        return status(
            f'{self.name}: torques', active(self.refusing, self.clamping, self.stale),
            'no torque yet' if len(silent) == len(inputs.ports) else 'fine', {
                'received messages': inputs.received,
                'refused messages': inputs.refused,
                'last refused': self.refusing.reason or 'none',
                'clamped messages': inputs.clamped,
                'stale': ', '.join(stale) or 'none',
                'without any torque yet': ', '.join(silent) or 'none'})

    def _connections(self):
        misfits = '; '.join(f'{t}: {what}' for t, what in self.neighbours.misfits().items())
        namesakes = self.neighbours.namesakes()
        if misfits:
            self.misfitting.happened(misfits)
        if namesakes:
            self.ambiguous.happened(f'{namesakes} more')
        return status(
            f'{self.name}: connections', active(self.misfitting, self.ambiguous), 'fine', {
                'QoS that does not fit': misfits or 'none',
                'other nodes of the same name': namesakes})

    def _energy(self):
        simulation = self.simulation
        with self.control.lock:   # one and the same tick
            total, worst, simulation.worst = simulation.total, simulation.worst, 0.0
            stored, efficiency = simulation.stored_energy, simulation.tick.efficiency
            returned = dict(simulation.returned)
        return status(f'{self.name}: energy', [], 'fine', {
            'worst balance residual since the last report [relative]': f'{worst:.1e}',
            'work of the torques [J]': f'{sum(total.work):.6g}',
            'stored [J]': f'{stored:.6g}',
            'lost by drag [J]': f'{total.viscous:.6g}',
            'lost in gears and bearings [J]': f'{sum(total.gears) + sum(total.bearings):.6g}',
            'lost in clutches [J]': f'{sum(total.clutches):.6g}',
            'taken by the error of the step [J]': f'{total.numerical:.3g}',
            'rated efficiency': f'{rated_efficiency(simulation.parameters):.6g}',
            'measured efficiency': 'none' if efficiency is None else f'{efficiency:.6g}',
            **{f'{name} gave back [J]': f'{part.energy:.6g} in {part.ticks} ticks'
               for name, part in returned.items()}})


def active(*conditions):
    """Return those of the conditions that hold now."""
    return [condition for condition in conditions if condition.active]
