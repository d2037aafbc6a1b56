# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What the node says of itself once in a second: /diagnostics."""

import time

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from std_msgs.msg import Header

from dm_ros.driven import Condition
from dm_ros.files.published import RATE_TOLD
from dm_ros.ros.graph import in_words


def status(node, part, complaints, fine, values):
    """
    Return a DiagnosticStatus.

    :param node: full name of the node, by which several differentials are told apart.
    :param part: which part of it the status is of.
    :param complaints: what is wrong, in words, if anything; fine: the message if nothing is.
    :param values: mapping from key to value.
    """
    return DiagnosticStatus(
        level=DiagnosticStatus.WARN if complaints else DiagnosticStatus.OK,
        name=f'{node}: {part}',
        message='; '.join(complaints) or fine,
        hardware_id=node,
        values=[KeyValue(key=key, value=str(value)) for key, value in values.items()])


def lateness_values(lateness):
    """Return p50, p99 and the largest of sorted latenesses in ns, in words in microseconds."""
    def at(share):
        return f'{lateness[int(share * (len(lateness) - 1))] / 1e3:.1f}' if lateness else 'none'
    return {'lateness p50 [us]': at(0.5), 'lateness p99 [us]': at(0.99),
            'lateness max [us]': at(1.0)}


class Diagnostics:
    """The state of a node as /diagnostics tells it."""

    def __init__(self, node):
        self._node, log = node, node.get_logger()
        self.missing = Condition('ticks are missed', log)
        self.waiting = Condition('waiting for /clock', log)
        self.set_back = Condition('/clock goes back', log)
        self.driven = Condition('several publishers drive /clock', log)
        self.misfitting = Condition('QoS does not fit', log)
        self.contested = Condition('several sources command one shaft or clutch', log)
        self.unheard = Condition('nobody hears a topic', log)
        self.ambiguous = Condition('another node has the same name', log)
        self._conditions = [part for part in vars(self).values() if isinstance(part, Condition)]
        self._before = 0, time.monotonic_ns()

    def report(self, stamp):
        """Return the DiagnosticArray of the time since the last report; to be called at 1 Hz."""
        plant = self._node.plant
        self._count_missed()
        plant.notice()
        statuses = [self._loop(), self._inputs(), self._connections()]
        with self._node.control.lock:   # one and the same tick
            energy = plant.told_of_energy()
        if energy:
            complaints, values = energy
            statuses.append(self._status('energy', complaints, 'fine', values))
        plant.settle()
        for condition in self._conditions:
            condition.settle()
        return DiagnosticArray(header=Header(stamp=stamp), status=statuses)

    def end(self):
        """Let the log tell what is not over when the node ends."""
        self._count_missed()
        for condition in (*self._node.plant.conditions, *self._conditions):
            condition.end()

    def _count_missed(self):
        missed = self._node.pacer.missed - self.missing.count
        if missed > 0:
            self.missing.happened(f'{missed} since the last report', missed)

    def clock_went_back(self, before, now):
        """Notice that ``/clock`` went back, from one time to another, ns."""
        self.set_back.happened(f'from {before * 1e-9:.3f} s to {now * 1e-9:.3f} s')

    def _status(self, part, complaints, fine, values):
        return status(self._node.get_fully_qualified_name(), part, complaints, fine, values)

    def _loop(self):
        plant, pacer = self._node.plant, self._node.pacer
        ticks, now = plant.ticks, time.monotonic_ns()
        (ticks_before, before), self._before = self._before, (ticks, now)
        running = 'running' if self._node.control.running.is_set() else 'paused'
        clock = self._clock() if self._node.follows_clock or self._node.drives_clock else {}
        return self._status(
            'loop', active(self.waiting, self.driven, self.set_back, self.missing, plant.coarse,
                           plant.out_of_range), running, {
                **plant.told_of_loop(),
                RATE_TOLD: f'{1.0 / plant.simulation.dt:.12g}',
                'rate held [Hz]': f'{(ticks - ticks_before) / (now - before) * 1e9:.2f}',
                **lateness_values(pacer.take_lateness()),
                'ticks': ticks,
                'missed ticks': pacer.missed,
                'refused ticks': plant.out_of_range.count,
                'coarse solver steps': plant.coarse.count,
                'simulated time [s]': f'{plant.simulation.time:.9g}',
                **clock})

    def _clock(self):
        """Notice what is wrong with /clock, and return who drives it."""
        drivers = self._node.neighbours.publishers('/clock')
        names = in_words(drivers) or 'nobody'
        if len(drivers) > 1:
            self.driven.happened(names)
        if self._node.follows_clock and not (
                drivers and self._node.get_clock().now().nanoseconds):
            self.waiting.happened(f'use_sim_time is set, and {names} publishes it')
        return {'/clock driven by': names}

    def _inputs(self):
        plant = self._node.plant
        inputs = plant.inputs
        silent, stale = inputs.silent(), inputs.stale(plant.simulation.ticks)
        without = {port.kind: [other.name for other in inputs.ports
                               if other.kind == port.kind and other.name in silent]
                   for port in inputs.ports}
        return self._status(
            plant.grouped, active(*plant.of_inputs),
            'fine' if set(plant.driving) - set(silent) else 'no torque yet', {
                'received messages': inputs.received,
                'refused messages': inputs.refused,
                'last refused': plant.refusing.reason or 'none',
                'clamped messages': inputs.clamped,
                'stale': ', '.join(stale) or 'none',
                **{f'without any {kind} yet': ', '.join(names) or 'none'
                   for kind, names in without.items()},
                **plant.told_of_inputs()})

    def _connections(self):
        misfits = '; '.join(f'{t}: {what}' for t, what in self._node.neighbours.misfits().items())
        contested = '; '.join(
            f'{port}: {who}' for port, who in self._node.inputs.sources.contested().items())
        unheard = '; '.join(
            f'{topic} of {who}' for topic, who in self._node.neighbours.unheard().items())
        namesakes = self._node.neighbours.namesakes()
        if misfits:
            self.misfitting.happened(misfits)
        if contested:
            self.contested.happened(contested)
        if unheard:
            heard = ', '.join(self._node.neighbours.heard_topics())
            self.unheard.happened(f'{unheard}; the node hears {heard}')
        if namesakes:
            self.ambiguous.happened(f'{namesakes} more')
        return self._status(
            'connections',
            active(self.misfitting, self.contested, self.unheard, self.ambiguous), 'fine', {
                'QoS that does not fit': misfits or 'none',
                'commanded by several sources': contested or 'none',
                'topics that nobody hears': unheard or 'none',
                'other nodes of the same name': namesakes})


def active(*conditions):
    """Return, in words, those of the conditions that hold now."""
    return [condition.what for condition in conditions if condition.active]
