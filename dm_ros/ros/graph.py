# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Who else is on a node's topics: those who do not fit, and nodes of the same name."""

from collections import Counter

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import NodeNameNonExistentError
from rclpy.qos import qos_check_compatible, qos_policy_name_from_kind, QoSCompatibility

UNKNOWN = '_NODE_NAME_UNKNOWN_'   # as rmw has it


class Neighbours:
    """
    What a node sees of the others.

    For a publisher the middleware tells once of QoS that does not fit, when it finds it; whether
    it is still so is looked up, but only then: a look takes some tenths of a millisecond. For a
    subscription it would tell too, but then each message would wake the executor.
    """

    def __init__(self, node, inputs):
        """:param inputs: what the topics of inputs begin with, such as ``~/torque/``."""
        self._node, self._inputs = node, inputs
        self._told = {}      # {topic: policy}
        self._watched = {}
        self.heard = {}      # {topic: message type} of the inputs of the node

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
        found = self._node.get_publishers_info_by_topic(self._node.resolve_topic_name(topic))
        # one that has just come has its name a bit later
        return [full_name(one) for one in found if one.node_name != UNKNOWN]

    def unheard(self):
        """
        Return ``{topic: nodes}`` of what others publish for the node and it does not take.

        That is on topics like those of its inputs, such as of a shaft that it has not, or of any
        shaft in lockstep, and messages of another type.
        """
        node, wrong = self._node, {}
        me = node.get_fully_qualified_name()
        own = tuple(me + part.removeprefix('~') for part in self._inputs)
        heard = self.heard_topics()
        for topic, types in node.get_topic_names_and_types():
            if topic in heard:
                wrong[topic] = set(types) - {heard[topic]}
            elif f'{topic}/'.startswith(own):
                wrong[topic] = set(types)
        if not any(wrong.values()):
            return {}
        found = {}
        for name in set(node.get_node_names_and_namespaces()):
            for topic, types in self._published_by(*name):
                if wrong.get(topic, set()).intersection(types):
                    found.setdefault(topic, []).append(joined(*name))
        return {topic: in_words(names) + (
            f' as {", ".join(sorted(wrong[topic]))} instead of {heard[topic]}'
            if topic in heard else '') for topic, names in sorted(found.items())}

    def heard_topics(self):
        """Return ``{full topic: message type}`` of the inputs of the node."""
        return {self._node.resolve_topic_name(topic): kind for topic, kind in self.heard.items()}

    def _published_by(self, name, namespace):
        # get_publishers_info_by_topic would remap the topic as the node's own, whatever it says
        try:
            return self._node.get_publisher_names_and_types_by_node(name, namespace)
        except NodeNameNonExistentError:   # it has just gone
            return []

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
    return joined(endpoint.node_name, endpoint.node_namespace)


def joined(name, namespace):
    """Return the full name of a node."""
    return f'{namespace.rstrip("/")}/{name}'


def in_words(names):
    """Return names once each, with their number where they come several times."""
    return ', '.join(f'{name} ({count})' if count > 1 else name
                     for name, count in sorted(Counter(names).items()))
