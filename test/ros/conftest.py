# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Fixtures for tests over real topics: each test has its own context in its own domain."""

import time

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter

from dm_ros.ros.domain import own_domain
from dm_ros.ros.node import DifferentialNode


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
        self._differentials = []

    def differential(self, variant='symmetric_ode', arguments=(), **parameters):
        """Start a node ``differential`` in this process, in this domain; return it."""
        overrides = [Parameter(name.replace('__', '.'), value=value)
                     for name, value in {'variant': variant, **parameters}.items()]
        node = DifferentialNode(context=self.context, parameter_overrides=overrides,
                                cli_args=list(arguments))
        self._differentials.append(node)
        self.executor.add_node(node)
        node.start()
        return node

    def until(self, condition, timeout=20.0):
        """Spin until the condition holds; fail when it does not in time."""
        end = time.monotonic() + timeout
        while not condition():
            assert time.monotonic() < end, 'the condition did not come true in time'
            self.executor.spin_once(timeout_sec=0.05)

    def listen(self, message_type, topic, depth=1000):
        """Return a list that fills with the messages of a topic, once a publisher is there."""
        messages = []
        subscription = self.node.create_subscription(message_type, topic, messages.append, depth)
        self.until(lambda: subscription.get_publisher_count() > 0)
        return messages

    def publisher(self, message_type, topic):
        """Return a publisher, once a subscription is there."""
        publisher = self.node.create_publisher(message_type, topic, 10)
        self.until(lambda: publisher.get_subscription_count() > 0)
        return publisher

    def call(self, service_type, name, **request):
        """Return the response of a service."""
        client = self.node.create_client(service_type, name)
        self.until(client.service_is_ready)
        future = client.call_async(service_type.Request(**request))
        self.until(future.done)
        self.node.destroy_client(client)
        return future.result()

    def close(self):
        for node in self._differentials:
            node.close()
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


@pytest.fixture
def ros(monkeypatch):
    with own_domain() as domain:
        user = Ros(monkeypatch, domain)
        yield user
        user.close()
