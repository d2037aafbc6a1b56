# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Fixtures for tests over real topics: each test has its own context in its own domain."""

from contextlib import ExitStack
import math
import os
from pathlib import Path
import re
import shutil
import sys
import time

from command_line import asked
from pages import Page
from processes import command, Forked
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter

from dm_ros.commands import COMMANDS
from dm_ros.ros import loops
from dm_ros.ros.domain import own_domain
from dm_ros.ros.driveline_node import DrivelineNode
from dm_ros.ros.node import DifferentialNode

ROOT = Path(__file__).parents[2]
TORQUES = 'time,pinion,left,right\n0,100,-50,-50\n0.1,0,0,0\n'
PATIENCE = 60.0   # s of real time until a condition that will come true is given up


class Ros:
    """A user of ROS in its own context: one node, one executor, all waits end."""

    def __init__(self, monkeypatch, domain):
        self.domain = domain
        monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
        monkeypatch.setenv('ROS_DOMAIN_ID', str(domain))
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.node = rclpy.create_node('user', context=self.context)
        self.executor.add_node(self.node)
        self._differentials, self._contexts = [], []

    def differential(self, variant='symmetric_ode', arguments=(), **parameters):
        """Start a node ``differential`` in this process, in this domain; return it."""
        overrides = [Parameter(name.replace('__', '.'), value=value)
                     for name, value in {'variant': variant, **parameters}.items()]
        return self._started(DifferentialNode, overrides, arguments)

    def driveline(self, **parameters):
        """Start a node ``driveline`` in this process, in this domain; return it."""
        overrides = [Parameter(name.replace('__', '.'), value=value)
                     for name, value in parameters.items()]
        return self._started(DrivelineNode, overrides, ())

    def _started(self, kind, overrides, arguments):
        node = kind(context=self.context, parameter_overrides=overrides,
                    cli_args=list(arguments))
        self._differentials.append(node)
        timer, = node.timers
        assert timer.timer_period_ns == 10**9
        timer.timer_period_ns = 10**8   # nobody wants to wait a second for /diagnostics
        self.executor.add_node(node)
        node.start()
        return node

    def participant(self, name):
        """Return a node that DDS takes for one of another process: in one a topic has one type."""
        self._contexts.append(rclpy.Context())
        rclpy.init(context=self._contexts[-1], domain_id=self.domain)
        return rclpy.create_node(name, context=self._contexts[-1])

    def until(self, condition, timeout=PATIENCE):
        """Spin until the condition holds; fail when it does not in time."""
        end = time.monotonic() + timeout
        while not condition():
            assert time.monotonic() < end, 'the condition did not come true in time'
            self.executor.spin_once(timeout_sec=0.01)

    def listen(self, message_type, topic, depth=1000):
        """Return a list that fills with the messages of a topic, once both sides are connected."""
        publishers = self._of_differentials('publishers', topic)
        before = [publisher.get_subscription_count() for publisher in publishers]
        messages = []
        subscription = self.node.create_subscription(message_type, topic, messages.append, depth)
        self.until(lambda: subscription.get_publisher_count() > 0 and all(
            p.get_subscription_count() > count for p, count in zip(publishers, before)))
        return messages

    def publisher(self, message_type, topic, depth=10):
        """Return a publisher, once both sides are connected."""
        subscriptions = self._of_differentials('subscriptions', topic)
        before = [subscription.get_publisher_count() for subscription in subscriptions]
        publisher = self.node.create_publisher(message_type, topic, depth)
        self.until(lambda: publisher.get_subscription_count() > 0 and all(
            s.get_publisher_count() > count for s, count in zip(subscriptions, before)))
        return publisher

    def _of_differentials(self, kind, topic):
        """Return the publishers or subscriptions of a topic in the nodes of this process."""
        return [end for node in self._differentials for end in getattr(node, kind)
                if end.topic_name == topic]

    def call(self, service_type, name, **request):
        """Return the response of a service."""
        client = self.node.create_client(service_type, name)
        self.until(client.service_is_ready)
        future = client.call_async(service_type.Request(**request))
        self.until(future.done)
        self.node.destroy_client(client)
        return future.result()

    def stop(self):
        """Let the differentials make no more ticks."""
        for node in self._differentials:
            node.control.stopping.set()

    def close(self):
        for node in self._differentials:
            node.close()
        self.executor.shutdown()
        self.node.destroy_node()
        for context in (self.context, *self._contexts):
            rclpy.shutdown(context=context)


@pytest.fixture
def ros(monkeypatch):
    with own_domain() as domain:
        user = Ros(monkeypatch, domain)
        yield user
        user.close()


@pytest.fixture
def drive(ros):
    """Return a function that starts a node ``driveline`` in this process."""
    nodes = []

    def drive(**parameters):
        node = DrivelineNode(context=ros.context, parameter_overrides=[
            Parameter(name.replace('__', '.'), value=value) for name, value in parameters.items()])
        nodes.append(node)
        ros.executor.add_node(node)
        node.start()
        return node
    yield drive
    for node in nodes:
        ros.executor.remove_node(node)
        node.close()


@pytest.fixture
def start(ros):
    """Return a function that starts ``watch``; returns the process and its port."""
    with ExitStack() as stack:
        def start(*arguments):
            process = stack.enter_context(
                Forked(command('watch'), '--port', 0, *arguments))
            process.says('/\n')
            return process, int(re.search(r':(\d+)/\n', process.output).group(1))
        yield start


@pytest.fixture
def page(start):
    """Return a function that starts ``watch`` and returns a ``Page`` of it."""
    pages = []

    def page(*arguments):
        _, port = start(*arguments)
        pages.append(Page(port))
        return pages[-1]
    yield page
    for one in pages:
        one.close()


@pytest.fixture
def play(ros):
    """Return a function that starts play_torques and returns the process, ended after the test."""
    with ExitStack() as stack:
        yield lambda *arguments: stack.enter_context(
            Forked(command('play_torques'), *arguments))


class SteadyClock:
    """
    The steady clock for the loop of a node, which goes on only as far as a test lets it.

    However slow the machine, the node meets every deadline: what it makes of them is exact.
    """

    READING = 1000   # ns that the clock goes on from one reading to the next

    def __init__(self, ros):
        self._ros = ros
        self._now, self._end = 0, 500_000   # ns; far from where the loop watches a deadline
        self._wanted = 0   # how far the loop wants to sleep

    def passes(self, seconds):
        """Let so much time pass: a whole number of ticks of the node."""
        self._end += seconds * 1e9

    def leaps(self, seconds):
        """Let so much time pass at once, as for a loop that is paused."""
        self._now += seconds * 1e9
        self._end += seconds * 1e9

    def stands(self):
        """Return whether all time has passed: the loop sleeps until there is more."""
        return self._wanted > self._end

    def tick(self, node, *heard):
        """Let a node make a tick, and wait until each list of messages has one more."""
        lengths = [len(messages) for messages in heard]
        self.passes(node.simulation.dt)
        self._ros.until(lambda: self.stands() and all(
            len(messages) > length for messages, length in zip(heard, lengths)))

    def monotonic_ns(self):
        self._now = min(self._now + self.READING, self._end)
        return self._now

    def sleep(self, seconds):
        self._wanted = self._now + round(seconds * 1e9)
        while self.stands():
            time.sleep(0.0005)
        self._now = max(self._now, self._wanted)


@pytest.fixture
def steady(ros, monkeypatch):
    """Return the ``SteadyClock`` by which the nodes of the test run."""
    clock = SteadyClock(ros)
    monkeypatch.setattr(loops, 'time', clock)
    yield clock
    ros.stop()
    clock.passes(math.inf)   # the loops see it


@pytest.fixture
def desk(ros, tmp_path, monkeypatch):
    """Return a folder with what the commands need, in which the package is installed."""
    prefix, folder = tmp_path / 'prefix', tmp_path / 'desk'
    for name in ('config', 'launch'):
        shutil.copytree(ROOT / name, prefix / 'share' / 'dm_ros' / name)
    shutil.copytree(ROOT / 'config', folder / 'config')
    for file in (ROOT / 'config').glob('*.yaml'):
        shutil.copy(file, folder)
    (folder / 'IN.csv').write_text(TORQUES)
    marker = prefix / 'share' / 'ament_index' / 'resource_index' / 'packages' / 'dm_ros'
    marker.parent.mkdir(parents=True)
    marker.touch()
    executables = prefix / 'lib' / 'dm_ros'
    executables.mkdir(parents=True)
    for name in COMMANDS:
        script = executables / name
        script.write_text(f'#!/bin/sh\nexec {sys.executable} -m dm_ros.commands {name} "$@"\n')
        script.chmod(0o755)
    monkeypatch.setenv('AMENT_PREFIX_PATH', os.pathsep.join(
        [str(prefix), *filter(None, [os.environ.get('AMENT_PREFIX_PATH')])]))
    monkeypatch.setenv('PYTHONUNBUFFERED', '1')
    yield folder
    asked('daemon', 'stop')
