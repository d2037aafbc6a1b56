# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Who else is on a node's topics: those whose QoS does not fit, and nodes of the same name."""

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.qos import qos_check_compatible, qos_policy_name_from_kind, QoSCompatibility


class Neighbours:
    """
    What a node sees of the others.

    For a publisher the middleware tells once of QoS that does not fit, when it finds it; whether
    it is still so is looked up, but only then: a look takes some tenths of a millisecond. For a
    subscription it would tell too, but then each message would wake the executor.
    """

    def __init__(self, node):
        self._node = node
        self._told = {}      # {topic: policy}
        self._watched = {}

    def of_publisher(self, topic):
        """Return the event callbacks for a publisher of the node."""
        def told(event):
            self._told[topic] = qos_policy_name_from_kind(event.last_policy_kind)
        return PublisherEventCallbacks(incompatible_qos=told)

    def watch(self, topic, policy):
        """Look always at a topic that the node hears, for the one policy it insists on."""
        self._watched[topic] = policy

    def misfits(self):
        """Return ``{topic: policy and nodes}`` of those that are there and do not fit."""
        policies = {**self._told, **self._watched}
        found = {topic: others for topic in policies if (others := self._others(topic))}
        self._told = {topic: policy for topic, policy in self._told.items() if topic in found}
        return {topic: f'{policies[topic]} of {", ".join(others)}'
                for topic, others in found.items()}

    def publishers(self, topic):
        """Return the full names of the nodes of all publishers of a topic."""
        return [full_name(endpoint) for endpoint in self._node.get_publishers_info_by_topic(
            self._node.resolve_topic_name(topic))]

    def namesakes(self):
        """Return the number of other nodes of the same full name."""
        node = self._node
        return node.get_node_names_and_namespaces().count(
            (node.get_name(), node.get_namespace())) - 1

    def _others(self, topic):
        name = self._node.resolve_topic_name(topic)
        me = self._node.get_fully_qualified_name()
        pairs = [(full_name(publisher), full_name(subscription))
                 for publisher in self._node.get_publishers_info_by_topic(name)
                 for subscription in self._node.get_subscriptions_info_by_topic(name)
                 if qos_check_compatible(publisher.qos_profile, subscription.qos_profile)[0]
                 == QoSCompatibility.ERROR]
        return sorted({other for pair in pairs if me in pair for other in pair if other != me})


def full_name(endpoint):
    """Return the full name of the node of an endpoint."""
    return f'{endpoint.node_namespace.rstrip("/")}/{endpoint.node_name}'
