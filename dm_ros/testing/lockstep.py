# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A node in lockstep, in a test's own process, in a ROS domain of its own."""

from collections import Counter
import os
import time

from dm_ros.files.driveline_record import driveline_row, DrivelineRecord
from dm_ros.files.record import Record
from dm_ros.testing.direct import Ticks, ticks_of

PATIENCE = 10.0   # s of real time without a tick
LAST_ANSWER = 0.5   # s of real time for the answer to the last state, before a reset


class LockstepDriven:
    """
    A node in lockstep, in a ROS context and domain of its own; a subclass says of what.

    Use it as a context manager. Nodes of the test are made with its ``context`` and given to
    ``attach``: one of them answers each message on the ``joint_states`` of the node with one on
    the topic that brings all inputs.
    """

    name = ''   # of the node

    def __init__(self, options, parameters):
        parameters = dict(parameters or {})
        for name in (*options, 'mode'):
            if name in parameters:
                raise ValueError(f'parameters: {name} is not one of them here; '
                                 f'{", ".join(list(options)[:-1])} and {list(options)[-1]} are '
                                 'arguments, and mode is lockstep')
        self._options = {**parameters, **options, 'mode': 'lockstep'}
        self.snapshots = []
        self._unanswered = 0   # states that the nodes of the test have still to answer: 0 or 1

    def _make_node(self, **options):
        """Return the node; only who uses topics needs ROS, so it is imported here."""
        raise NotImplementedError

    def _began(self):
        """Prepare for a run that begins with the state as it is."""

    def note(self, snapshot):
        """Take what a tick made."""
        self.snapshots.append(snapshot)

    def _record_of(self, first):
        """Return the record of the ticks from a number on."""
        raise NotImplementedError

    def __enter__(self):
        from contextlib import ExitStack

        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.parameter import Parameter

        from dm_ros.ros.domain import own_domain

        with ExitStack() as stack:
            self.domain = stack.enter_context(own_domain())
            before = os.environ.get('ROS_AUTOMATIC_DISCOVERY_RANGE')
            os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
            try:
                self.context = rclpy.Context()
                rclpy.init(context=self.context, domain_id=self.domain)
            finally:
                if before is None:
                    del os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE']
                else:
                    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = before
            stack.callback(rclpy.shutdown, context=self.context)
            self.executor = SingleThreadedExecutor(context=self.context)
            stack.callback(self.executor.shutdown)
            self.node = self._make_node(context=self.context, parameter_overrides=[
                Parameter(name, value=value) for name, value in self._options.items()])
            self.node.control.running.clear()
            self.node.on_tick = self._on_tick
            self._began()
            stack.callback(self.node.close)
            self.executor.add_node(self.node)
            self.node.start()
            self._attached = []
            stack.callback(self._detach)
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_):
        self._stack.close()

    @property
    def simulation(self):
        """The simulation in the node."""
        return self.node.simulation

    def attach(self, *nodes):
        """
        Let nodes of the test take part, and destroy them in the end; return the first.

        :raises ValueError: for a node that was made in another context, which would hear nothing.
        """
        for node in nodes:
            if node.context is not self.context:
                raise ValueError(f'attach: {node.get_name()} was made in another ROS context and '
                                 f'would hear nothing; give it context={self.name}.context')
        for node in nodes:
            self.executor.add_node(node)
            self._attached.append(node)
        return nodes[0]

    def reset(self):
        """
        Go back to the start; a further run repeats the first one bit for bit.

        The nodes of the test must go back to their start as well.
        """
        end = time.monotonic() + LAST_ANSWER
        while self._unanswered and time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.01)
            self._unanswered -= self.node.inputs.discard()
        with self.node.control.lock:
            self.node.plant.reset()
            self._began()
        self._unanswered = 0

    def run(self, seconds=None, until=None):
        """
        Step until a condition or for a time, whichever comes first; both in exact ticks.

        At the start the state is published, so that the nodes of the test have something to
        answer. Their answer to the last state of a run is the first one of the next run.

        :param seconds: simulated time.
        :param until: function of a ``Snapshot``; true at the last tick.
        :return: the record of this run.
        :raises TimeoutError: when no tick comes for ten seconds of real time.
        :raises ValueError: when the node refuses an answer; says why.
        """
        first = len(self.snapshots)
        count = ticks_of(seconds, until, self.simulation)
        self._last = lambda snapshot: (
            len(self.snapshots) - first == count or until is not None and until(snapshot))
        self._await_connections()
        control = self.node.control
        with control.lock:
            if not self._unanswered:
                self._unanswered = 1
                self.node.publish_state()
            control.running.set()
        refusing = self.node.plant.refusing
        refused = refusing.count
        ticks, end = first, time.monotonic() + PATIENCE
        while control.running.is_set():
            self.executor.spin_once(timeout_sec=0.05)
            if len(self.snapshots) > ticks:
                ticks, end = len(self.snapshots), time.monotonic() + PATIENCE
            if refusing.count > refused:
                control.running.clear()
                self._unanswered = 0   # nobody will answer the last state any more
                raise ValueError(f'the {self.name} refused an answer after {ticks - first} '
                                 f'ticks: {refusing.reason}')
            if time.monotonic() > end:
                control.running.clear()
                raise TimeoutError(
                    f'no tick for {PATIENCE:g} s after {ticks - first} ticks: does a node answer '
                    f'/{self.name}/joint_states with /{self.name}/{self.node.plant.grouped}?')
        return self._record_of(first)

    @property
    def record(self):
        """The record of all runs."""
        return self._record_of(0)

    def _on_tick(self, snapshot):
        self.note(snapshot)
        if self._last(snapshot):
            self.node.control.running.clear()

    def _await_connections(self):
        end = time.monotonic() + PATIENCE
        while not (self.node.is_connected() and self._hears_all()):
            if time.monotonic() > end:
                raise TimeoutError(f'nobody publishes on /{self.name}/{self.node.plant.grouped} '
                                   f'and listens to /{self.name}/joint_states, or to another '
                                   'of its topics')
            self.executor.spin_once(timeout_sec=0.01)

    def _hears_all(self):
        """Return whether what the nodes of the test subscribe to has found them, and they us."""
        wanted = Counter(subscription.topic_name for node in self._attached
                         for subscription in node.subscriptions)
        commanding = sum(publisher.topic_name == self.node.inputs.grouped.topic_name
                         for node in self._attached for publisher in node.publishers)
        return self.node.inputs.grouped.get_publisher_count() >= commanding and all(
            publisher.get_subscription_count() >= wanted[publisher.topic_name]
            for publisher, _ in self.node.outputs.of_a_tick)

    def _detach(self):
        for node in self._attached:
            self.executor.remove_node(node)
            node.destroy_node()


class LockstepDifferential(LockstepDriven):
    """
    The node ``differential`` in lockstep, in a ROS context and domain of its own.

    Use it as a context manager. Nodes of the test are made with ``context=differential.context``
    and given to ``attach``: one of them answers each message on ``/differential/joint_states``
    with one on ``/differential/torques``.

    :param variant: one of ``dm_ros.VARIANTS``; rate: ticks in a second.
    :param parameters: mapping from parameter names of the node to values.
    """

    name = 'differential'

    def __init__(self, variant='symmetric_ode', rate=1000.0, parameters=None):
        super().__init__({'variant': variant, 'rate': float(rate)}, parameters)

    def _make_node(self, **options):
        from dm_ros.ros.node import DifferentialNode
        return DifferentialNode(**options)

    def _began(self):
        settings = self.node.plant.settings
        self._ticks = Ticks(self.simulation, settings.rate, settings.joint_prefix)

    def note(self, snapshot):
        super().note(snapshot)
        self._ticks.append(self.node.plant.inputs.in_force(0), snapshot)

    def _record_of(self, first):
        return Record.of(self.simulation, self.snapshots[first:])

    def save_bag(self, path):
        """
        Write a bag of all runs since the last reset; it needs rosbags.

        It has the topics of the node, with what it was commanded in each tick.

        :param path: a folder, in place of a bag that may be there.
        """
        self._ticks.save(path)


class LockstepDriveline(LockstepDriven):
    """
    The node ``driveline`` in lockstep, in a ROS context and domain of its own.

    Use it as a context manager. Nodes of the test are made with ``context=driveline.context`` and
    given to ``attach``: one of them answers each message on ``/driveline/joint_states`` with one
    on ``/driveline/commands``.

    :param layout: ``awd``, ``fwd`` or ``rwd``; planar: whether the body also moves sideways and
        yaws; rate: ticks in a second.
    :param parameters: mapping from parameter names of the node to values.
    """

    name = 'driveline'

    def __init__(self, layout='awd', planar=False, rate=1000.0, parameters=None):
        super().__init__({'layout': layout, 'planar': planar, 'rate': float(rate)}, parameters)
        self._rows = []

    def _make_node(self, **options):
        from dm_ros.ros.driveline_node import DrivelineNode
        return DrivelineNode(**options)

    def note(self, snapshot):
        super().note(snapshot)
        self._rows.append(driveline_row(snapshot, self.simulation.clutch_force))

    def _record_of(self, first):
        return DrivelineRecord(self.simulation, self._rows[first:], self.node.plant.title)
