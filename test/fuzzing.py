# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
Machines that do at random what users do to a differential, good and bad, in any order.

``CoreMachine``  the core as the node uses it: a ``Plant``
``NodeMachine``  a ``DifferentialNode`` in lockstep, by its public methods and real publishers

A sequence is one life of a machine. After each of its steps the laws of ``Laws`` hold.
"""

from contextlib import contextmanager, ExitStack
from copy import deepcopy
from functools import cache
import math
import os
import time
from types import SimpleNamespace
from unittest.mock import patch

from hypothesis import HealthCheck, seed, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    initialize,
    invariant,
    precondition,
    rule,
    RuleBasedStateMachine,
    run_state_machine_as_test,
)
import numpy as np
from properties import constraints

from dm_ros import VARIANTS
from dm_ros.energy import AuditedSimulation
from dm_ros.mechanism.variants import MECHANISMS, PORT_TABLES, variant_named
from dm_ros.plant import Plant
from dm_ros.settings import NodeParameters
from dm_ros.tools.progress import progress

ROUNDING = 1e-13   # of the largest term of a constraint, also after many changes of parameters
SUBNORMAL = 1e-300
STAMPS = ('none', 'none', 'none', 'next', 'next', 'same', 'old', 'far', 'below')
SILENT = SimpleNamespace(warning=lambda words: None, info=lambda words: None)
STEPS = 12         # in a sequence, at most
CHUNK = 1000       # sequences from one seed

finite = st.floats(-1e6, 1e6) | st.sampled_from([0.0, -0.0, 30.0, -200.0, 1e5, -1e5])
anything = finite | st.floats() | st.sampled_from([math.nan, math.inf, -math.inf, 1e308, -1e308])


@cache
def demands(mechanism):
    """Return demands as (names, values): good ones, and such that must be refused."""
    forces = [port.name for port in mechanism.actuators]
    pair = st.tuples(st.sampled_from(mechanism.inputs), finite | st.just(math.nan))
    if forces:
        pair |= st.tuples(st.sampled_from(forces), finite.map(abs) | st.just(math.nan))
    good = st.lists(pair, max_size=5, unique_by=lambda named: named[0]).map(
        lambda pairs: ([name for name, _ in pairs], [value for _, value in pairs]))
    names = st.lists(st.sampled_from(
        [*mechanism.inputs, *forces, 'wheel', '', 'satellite', 'left_clutch']), max_size=5)
    bad = st.tuples(names, st.lists(anything, max_size=5))
    return good | good | bad


def as_demanded(mechanism, names, values, sparse=True):
    """Return whether a demand is to be taken; sparse: whether NaN is no demand."""
    ports = {port.name: port for port in mechanism.ports + mechanism.actuators}
    return (len(names) == len(values) == len(set(names)) and set(names) <= set(ports)
            and all(sparse if math.isnan(value) else
                    math.isfinite(value) and ports[name].low <= value <= ports[name].high
                    for name, value in zip(names, values)))


def stamp_of(which, last):
    """Return one of the ``STAMPS``, ns, of those that a message can hold."""
    return min({'none': 0, 'next': last + 1, 'same': last, 'old': last // 2, 'far': last + 10**17,
                'below': -10**9}[which], (2**31 - 1) * 10**9)


def values(entry, default):
    """Return values of a parameter: near its default, anywhere allowed, or impossible."""
    if entry.kind is bool:
        return st.booleans() | st.sampled_from([0, 'x'])
    if entry.kind is str:
        return st.sampled_from([*entry.choices, 'torsen'])
    if entry.kind is int:
        few = int(min(entry.high, max(entry.low, 10)))   # 1000 substeps would take their time
        return (st.integers(int(entry.low), few)
                | st.sampled_from([int(entry.low) - 1, int(entry.high) + 1, 2.5, 'x']))
    near = st.floats(0.5, 2.0).map(lambda factor: min(default * factor, entry.high))
    allowed = st.floats(entry.low, entry.high, exclude_min=entry.above_low)
    impossible = st.sampled_from([math.nan, math.inf, -math.inf, entry.low - 1.0,
                                  entry.high * 2.0 + 1.0, 1e308, '1.0'])
    return near | near | near | allowed | impossible


def changes(table, wanted=lambda name: True):
    """Return changes of a table of parameters as ``{name: value}``, some of them impossible."""
    rows = {name: entry for name, entry in table.rows().values() if wanted(name)}
    defaults = table().named()
    pairs = {name: st.tuples(st.just(name), values(entry, defaults[name]))
             for name, entry in rows.items()}
    pairs['no.such.parameter'] = st.just(('no.such.parameter', 1.0))
    pair = st.sampled_from(list(pairs)).flatmap(pairs.get)
    return st.lists(pair, min_size=1, max_size=3).map(dict)


TABLES = {m.parameters: changes(m.parameters) for m in MECHANISMS.values()}
PORTS = {shaft: changes(table) for shaft, table in PORT_TABLES.items()}
OWN = ('torque_limit', 'torque_timeout', 'power_flow_deadband', 'substeps')
own_changes = changes(
    NodeParameters, lambda name: name in OWN or name.startswith('initial_velocity'))


class Laws:
    """What holds for whatever a differential reports."""

    def __init__(self, variant):
        self.variant = variant
        self.start_over()

    def start_over(self):
        self._offset = None   # angles from before the last change of parameters

    def parameters_changed(self, position):
        """Take the angles at which the ratios changed: from there on they follow the new ones."""
        self._offset = position

    def check(self, parameters, velocity, position, moment, power_flow):
        """Check numbers, constraints of speeds and angles, friction and the index."""
        assert all(map(math.isfinite, (*velocity, *position, *moment))), (
            velocity, position, moment, parameters)
        assert power_flow in (1, -1), power_flow
        g = constraints(self.variant, parameters)
        offset = self._offset or (0.0,) * len(position)
        for terms, size in ((g * velocity, np.abs(g * velocity)),
                            (g * np.subtract(position, offset),
                             np.abs(g * position) + np.abs(g * offset))):
            off = np.abs(terms.sum(axis=1))
            assert (off <= ROUNDING * size.max(axis=1) + SUBNORMAL).all(), (
                off, velocity, position, offset)
        if len(moment) > 3:   # friction opposes slip; the satellite turns with the rear
            slip = -velocity[-1]
            assert moment[-2] * slip >= 0.0 >= moment[-1] * slip, (moment, slip)


class CoreMachine(RuleBasedStateMachine):
    """The core, as the node uses it: a ``Plant``, by its public methods."""

    sequences = 0   # counts, of the class
    done = {}

    def __init__(self):
        super().__init__()
        CoreMachine.sequences += 1
        self.paused = False

    @initialize(variant=st.sampled_from(VARIANTS), rate=st.sampled_from([50.0, 200.0, 1000.0]),
                start=st.tuples(finite, finite), audited=st.booleans(), clutches=st.booleans(),
                speeds=st.just(()) | st.just(()) | st.sets(st.integers(0, 2)))
    def begin(self, variant, rate, start, audited, clutches, speeds):
        mechanism = variant_named(variant).mechanism
        surfaces = {'symmetric.clutch.right.friction_surfaces': 3} if clutches else {}
        self.plant = Plant({
            'variant': variant, 'rate': rate, 'energy_audit': audited,
            **mechanism.parameters.part_of(surfaces),
            **{f'port.{mechanism.inputs[n]}.kind': 'speed' for n in speeds},
            **{f'initial_velocity.{shaft}': v
               for shaft, v in zip(mechanism.outputs, start)}}, SILENT)
        self.simulation, self.inputs = self.plant.simulation, self.plant.inputs
        self.laws = Laws(variant)
        self.last_stamp = self.ticks = 0
        self.demand = {}   # what it should be: {name: (value, tick)}

    def count(self, what):
        self.done[what] = self.done.get(what, 0) + 1

    def in_force(self):
        """Return all that a refused request must not touch."""
        return (self.plant.values, self.inputs.limits, self.inputs.timeout,
                self.inputs.in_force(self.ticks), repr(self.simulation.snapshot()))

    @rule(data=st.data(), stamp=st.sampled_from(STAMPS), sparse=st.booleans())
    def demands(self, data, stamp, sparse):
        mechanism = self.simulation.mechanism
        limits = dict(zip(self.inputs.names, self.inputs.limits))
        names, values = data.draw(demands(mechanism))
        stamp = stamp_of(stamp, self.last_stamp)
        good = as_demanded(mechanism, names, values, sparse) and (
            stamp == 0 or stamp > self.last_stamp)
        before, counts = self.in_force(), (self.inputs.received, self.inputs.refused)
        refused, clamped = self.plant.refusing.count, self.plant.clamping.count
        assert self.plant.take(names, values, 'a demand', stamp, sparse) == good
        assert (self.inputs.received - counts[0], self.inputs.refused - counts[1]) == (
            (1, 0) if good else (0, 1))
        assert self.plant.refusing.count - refused == (not good)
        if not good:
            self.count('refused demands')
            assert repr(self.in_force()) == repr(before)
            return
        assert self.plant.clamping.count - clamped == any(
            abs(value) > limits[name] for name, value in zip(names, values))
        self.count('demands')
        self.last_stamp = stamp or self.last_stamp
        for name, value in zip(names, values):
            if not math.isnan(value):
                limit = limits[name]
                self.demand[name] = max(-limit, min(limit, value)), self.ticks

    @precondition(lambda self: not self.paused)
    @rule(ticks=st.integers(1, 8))
    def ticks_pass(self, ticks):
        for _ in range(ticks):
            held = self.inputs.in_force(self.ticks)
            timeout = self.inputs.timeout
            assert held == tuple(
                port.idle if port.name not in self.demand or timeout
                and self.demand[port.name][1] < self.ticks - timeout else
                self.demand[port.name][0] for port in self.inputs.ports)
            before, refused = self.simulation.snapshot(), self.plant.out_of_range.count
            snapshot = self.plant.tick()
            if self.plant.out_of_range.count > refused:
                self.count('refused ticks')
                assert repr(snapshot) == repr(before)
                continue
            self.ticks += 1
            self.count('ticks')
            shafts = len(snapshot.torque)
            assert self.simulation.state.held == held[:shafts]
            for port, torque, value in zip(self.inputs.ports, snapshot.torque, held):
                assert torque == value or port.kind == 'speed' and math.isfinite(torque)
            for before_, force, command in zip(
                    before.clutch_force, snapshot.clutch_force, held[shafts:], strict=True):
                # an actuator moves towards its command, or its limit
                assert 0.0 <= force <= max(before_, command) * (1 + 1e-15)
            self.laws_hold()

    @rule(data=st.data(), substeps=st.none() | st.sampled_from([0, 1, 2, 5, 2.5]))
    def change_of_the_mechanism(self, data, substeps):
        changed = data.draw(TABLES[type(self.simulation.parameters)])
        self.change_of(changed if substeps is None else {**changed, 'substeps': substeps})

    @rule(data=st.data())
    def change_of_a_port(self, data):
        self.change_of(data.draw(PORTS[data.draw(st.sampled_from(self.simulation.inputs))]))

    @rule(changed=own_changes | changes(NodeParameters))
    def change_of(self, changed):
        before, snapshot = self.in_force(), self.simulation.snapshot()
        parameters = self.simulation.parameters
        try:
            prepared = self.plant.prepared(changed)
        except ValueError as error:
            assert str(error)
            self.count('refused changes')
            assert repr(self.in_force()) == repr(before)
            assert self.simulation.parameters is parameters
            return
        assert repr(self.in_force()) == repr(before)
        self.plant.adopt(prepared)
        self.count('changes')
        assert self.plant.values == {**before[0], **changed}
        assert self.simulation.substeps == self.plant.settings.substeps
        after = self.simulation.snapshot()
        assert after.position == snapshot.position
        if prepared.model:
            self.laws.parameters_changed(snapshot.position)
        np.testing.assert_allclose(after.velocity[1:3], snapshot.velocity[1:3], rtol=1e-12,
                                   atol=1e-12 * max(map(abs, snapshot.velocity[1:3]))
                                   + SUBNORMAL)
        # a demand that was clamped to an older limit stays what it is
        shafts = len(snapshot.torque)
        assert self.inputs.limits[:shafts] == tuple(
            self.plant.settings.torque_limit if port.kind == 'torque' else math.inf
            for port in self.simulation.mechanism.ports)
        assert after.clutch_force == snapshot.clutch_force

    @rule()
    def pause(self):
        self.paused = not self.paused
        self.count('pauses')

    @rule()
    def look(self):
        self.plant.notice()
        self.plant.settle()

    @rule()
    def reset(self):
        self.plant.reset()
        self.laws.start_over()
        self.last_stamp = self.ticks = 0
        self.demand = {}
        self.count('resets')
        snapshot = self.simulation.snapshot()
        assert (snapshot.time, snapshot.power_flow) == (0.0, 1)
        assert not any((*snapshot.position, *snapshot.torque, *snapshot.clutch_force))

    @invariant()
    def laws_hold(self):
        if not hasattr(self, 'plant'):
            return
        snapshot = self.simulation.snapshot()
        assert self.simulation.ticks == self.ticks
        if isinstance(self.simulation, AuditedSimulation):
            assert math.isfinite(self.simulation.stored_energy)
            assert all(map(math.isfinite, self.simulation.total.work))
        assert snapshot.time == self.ticks * self.simulation.dt
        self.laws.check(self.simulation.parameters, *snapshot[1:3], *snapshot[4:6])


class NodeMachine(RuleBasedStateMachine):
    """A node in lockstep, by its callbacks; ``nodes`` must be there while it runs."""

    sequences = 0
    done = {}
    nodes = {}   # one for each variant, used by one sequence after the other

    def __init__(self):
        super().__init__()
        NodeMachine.sequences += 1

    @initialize(variant=st.sampled_from(VARIANTS))
    def begin(self, variant):
        self.node, self.heard, self.defaults = self.nodes[variant]
        self.messages = len(self.node.outputs.of_a_tick)
        self.node.control.running.set()
        self.heard.clear()   # a sequence may be broken off
        self.laws = Laws(variant)
        self.last_stamp = self.ticks = 0
        assert all(result.successful for result in self.request(self.defaults))
        self.reset()

    def count(self, what):
        self.done[what] = self.done.get(what, 0) + 1

    def request(self, changed):
        from rcl_interfaces.srv import SetParameters
        from rclpy.parameter import Parameter
        return self.node.requests.parameters.set_parameters(
            SetParameters.Request(parameters=[
                Parameter(name, value=value).to_parameter_msg()
                for name, value in changed.items()]), SetParameters.Response()).results

    def in_force(self):
        """Return all that a refused request must not touch."""
        simulation, inputs = self.node.simulation, self.node.plant.inputs
        return (simulation.parameters, simulation.substeps, simulation.power_flow_deadband,
                simulation.initial_velocity, inputs.limits, repr(simulation.snapshot()),
                {name: self.node.get_parameter(name).value for name in self.defaults})

    @precondition(lambda self: self.node.control.running.is_set())
    @rule(data=st.data(), stamp=st.sampled_from(STAMPS),
          times=st.integers(1, 4))
    def torques(self, data, stamp, times):
        from builtin_interfaces.msg import Time
        from sensor_msgs.msg import JointState
        mechanism = self.node.simulation.mechanism
        names, values = data.draw(demands(mechanism))
        for _ in range(times):
            stamp_now = stamp_of(stamp, self.last_stamp)
            message = JointState(name=names, effort=values)
            message.header.stamp = Time(sec=stamp_now // 10**9, nanosec=stamp_now % 10**9)
            good = as_demanded(mechanism, names, values) and (
                stamp_now == 0 or stamp_now > self.last_stamp)
            inputs = self.node.plant.inputs
            before = inputs.received, inputs.refused, self.in_force()[-2]
            refused_ticks = self.node.plant.out_of_range.count
            with self.node.control.lock:
                self.node.lockstep_tick(message, {'publication_sequence_number': None})
            assert (inputs.received - before[0], inputs.refused - before[1]) == (
                (1, 0) if good else (0, 1))
            if not good:
                self.count('refused messages')
                assert not self.heard and self.in_force()[-2] == before[-1]
                continue
            self.last_stamp = stamp_now or self.last_stamp
            self.a_tick_was_made(refused_ticks)

    def a_tick_was_made(self, refused_ticks):
        refused = self.node.plant.out_of_range.count - refused_ticks
        assert refused in (0, 1)
        self.ticks += not refused
        self.count('refused ticks' if refused else 'ticks')
        assert len(self.heard) == self.messages
        self.laws_hold()

    @rule(data=st.data())
    def parameters_of_the_mechanism(self, data):
        self.parameters_of(data.draw(TABLES[type(self.node.simulation.parameters)]))

    @rule(changed=own_changes | changes(NodeParameters))
    def parameters_of(self, changed):
        before, position = self.in_force(), self.node.simulation.snapshot().position
        results = self.request(changed)
        successes = {result.successful for result in results}
        assert len(results) == len(changed) and len(successes) == 1
        if successes == {False}:
            self.count('refused requests')
            assert all(result.reason for result in results)
            assert repr(self.in_force()) == repr(before)
            return
        self.count('requests')
        simulation = self.node.simulation
        if simulation.parameters != before[0] or simulation.substeps != before[1]:
            self.laws.parameters_changed(position)
        for name, value in changed.items():
            assert self.node.get_parameter(name).value == value
            if name in simulation.parameters.named():
                assert simulation.parameters.named()[name] == value

    @rule(wanted=st.sampled_from([False, False, True]))
    def pause(self, wanted):
        from std_srvs.srv import SetBool
        response = self.node.requests.pause(SetBool.Request(data=wanted), SetBool.Response())
        assert response.success and self.node.control.running.is_set() != wanted
        self.count('pauses')

    @rule()
    def step(self):
        from std_srvs.srv import Trigger
        refused_ticks = self.node.plant.out_of_range.count
        response = self.node.requests.step(Trigger.Request(), Trigger.Response())
        assert response.success != self.node.control.running.is_set()
        if response.success:
            self.a_tick_was_made(refused_ticks)

    @rule()
    def reset(self):
        from std_srvs.srv import Trigger
        assert self.node.requests.reset(Trigger.Request(), Trigger.Response()).success
        self.count('resets')
        self.laws.start_over()
        self.last_stamp = self.ticks = 0
        assert not any((*self.node.simulation.snapshot().position,
                        *self.node.plant.inputs.in_force(0)))

    @rule()
    def diagnose(self):
        self.node.diagnose()

    @invariant()
    def laws_hold(self):
        """Check all that was published since the last time."""
        if not hasattr(self, 'node'):
            return
        simulation = self.node.simulation
        assert simulation.ticks == self.ticks
        assert simulation.time == self.ticks * simulation.dt
        assert len(self.heard) % self.messages == 0
        while self.heard:
            joints, moments, *clutches, flow = [self.heard.pop(0) for _ in range(self.messages)]
            for message in clutches:
                assert message.header.stamp == joints.header.stamp
                assert all(map(math.isfinite, (*message.position, *message.velocity)))
                assert all(0.0 <= force < math.inf for force in message.effort)
            assert joints.header.stamp == moments.header.stamp
            stamp = joints.header.stamp.sec * 10**9 + joints.header.stamp.nanosec
            assert stamp == round(simulation.ticks * simulation.dt * 1e9)
            assert all(map(math.isfinite, joints.effort))
            self.laws.check(simulation.parameters, joints.velocity, joints.position,
                            moments.effort, flow.data)


class Heard:
    """A publisher that also keeps what it publishes."""

    def __init__(self, publisher, messages):
        self._publisher, self._messages = publisher, messages

    def publish(self, message):
        self._messages.append(deepcopy(message))
        self._publisher.publish(message)


@contextmanager
def nodes():
    """Have a node of each variant, in a domain of their own."""
    import rclpy
    from rclpy.logging import LoggingSeverity
    from rclpy.parameter import Parameter

    from dm_ros.ros.domain import own_domain
    from dm_ros.ros.node import DifferentialNode
    with own_domain() as domain, ExitStack() as stack:
        stack.enter_context(
            patch.dict(os.environ, ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST'))
        context = rclpy.Context()
        rclpy.init(context=context, domain_id=domain)
        stack.callback(rclpy.shutdown, context=context)
        for variant in VARIANTS:
            node = DifferentialNode(context=context, parameter_overrides=[
                Parameter('variant', value=variant), Parameter('mode', value='lockstep')],
                cli_args=['--ros-args', '-r', f'__node:={variant}'])
            stack.callback(node.close)
            node.get_logger().set_level(LoggingSeverity.FATAL)   # it has much to complain about
            messages = []
            node.outputs.of_a_tick[:] = [(Heard(publisher, messages), message)
                                         for publisher, message in node.outputs.of_a_tick]
            tables = (NodeParameters(), node.simulation.parameters)
            defaults = {name: value for table in tables for name, value in table.named().items()
                        if node.has_parameter(name)
                        and not node.describe_parameter(name).read_only}
            NodeMachine.nodes[variant] = node, messages, defaults
        yield
        NodeMachine.nodes.clear()


def run(machine, sequences, first=0):
    """
    Run a machine so often, print and return its count of sequences.

    Each thousand has its own seed, from ``first`` on: equal runs are equal to the last draw.
    """
    machine.sequences, machine.done = 0, {}
    begin = time.monotonic()
    for n in progress(range(0, sequences, CHUNK), total=-(-sequences // CHUNK), unit='thousand'):
        run_state_machine_as_test(seed(first + n)(machine), settings=settings(
            max_examples=min(CHUNK, sequences - n), stateful_step_count=STEPS, deadline=None,
            database=None, suppress_health_check=list(HealthCheck)))
    done = ', '.join(f'{count} {what}' for what, count in sorted(machine.done.items()))
    print(f'\n{machine.__name__}: {machine.sequences} sequences in '
          f'{time.monotonic() - begin:.0f} s: {done}')
    return machine.sequences
