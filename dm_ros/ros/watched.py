# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The node that is watched: it comes and goes, is heard, and commanded if one may."""

from contextlib import suppress
import math
import time

from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import parameter_value_to_python
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Int8

from dm_ros.ros.messages import never_called, Polled
from dm_ros.ros.privates import poll
from dm_ros.ros.serialized import Layout, OdometryLayout
from dm_ros.watch.scenes import known_names

# best effort hears every publisher and makes none wait; deep enough for some seconds at 1 kHz
HEARD = QoSProfile(depth=5000, reliability=ReliabilityPolicy.BEST_EFFORT)
PATIENCE = 3.0    # s for the node to answer
LOOK = 0.3        # s from one look at who is there to the next
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
TOPICS = {'joint_states': ('position', 'velocity', 'effort'), 'internal_moments': ('effort',),
          'clutches': ('position', 'velocity', 'effort'), 'power_flow_stamped': ('position',)}
OF_OTHERS = {'tyres': ('position', 'velocity', 'effort')}   # likewise, of a driveline
LEVELS = {b'\0': 'ok', b'\1': 'warn', b'\2': 'error', b'\3': 'stale'}


class Asked:
    """Requests to services that have not been answered yet; nobody waits for them."""

    def __init__(self, node):
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        self._open = []   # (client, future, function of the response, deadline)

    def call(self, client, request, answered):
        """Call a service; answered: function of the response, None where none comes."""
        self._open.append((client, client.call_async(request), answered,
                           time.monotonic() + PATIENCE))

    def poll(self):
        """Take the answers that have come."""
        for _ in range(2 * len(self._open)):
            self._executor.spin_once(timeout_sec=0.0)
        before, self._open = self._open, []
        for client, future, answered, deadline in before:
            if future.done():
                answered(future.result())
            elif time.monotonic() > deadline:
                client.remove_pending_request(future)
                answered(None)
            else:
                self._open.append((client, future, answered, deadline))

    def forget(self):
        """Wait for no answer any longer."""
        before, self._open = self._open, []
        for client, future, answered, _ in before:
            client.remove_pending_request(future)
            answered(None)

    def close(self):
        """Ask nobody any more."""
        self._executor.shutdown()


class Watched:
    """A node that is shown, as another node sees it; call ``poll`` all the time."""

    def __init__(self, node, name, live, asked):
        """
        Listen to a node that need not be there.

        :param node: that listens; name: full name of the one that is watched.
        :param live: ``Live``, which is told; asked: ``Asked`` of the node that listens.
        """
        self._node, self._name, self._live, self._asked = node, name, live, asked
        self._topic = node.resolve_topic_name(f'{name}/joint_states')
        polled = Polled()

        def subscribe(message_type, topic, qos=HEARD):
            return node.create_subscription(message_type, topic, never_called, qos,
                                            callback_group=polled)
        self._subscribe = subscribe
        self._topics, self._flows = {}, {}
        self._listen(TOPICS)   # until there is a node of another kind
        self._diagnostics = subscribe(DiagnosticArray, '/diagnostics')
        self._events = subscribe(ParameterEvent, '/parameter_events')
        self._list = node.create_client(ListParameters, f'{name}/list_parameters')
        self._get = node.create_client(GetParameters, f'{name}/get_parameters')
        self._scene, self._layouts = None, {}   # for whose messages, {topic: (number, Layout)}
        self._learning, self._last_look = False, -math.inf
        self._publishers = set()   # of joint states, as DDS knows them

    def _listen(self, topics, flows=()):
        """Hear these topics of the node, by last words, and no others."""
        for heard, wanted in ((self._topics, topics), (self._flows, flows)):
            for topic in heard.keys() - set(wanted):
                self._node.destroy_subscription(heard.pop(topic))
        for topic in topics:
            if topic not in self._topics:
                self._topics[topic] = self._subscribe(
                    Odometry if topic == 'odometry' else JointState, f'{self._name}/{topic}')
        for topic in flows:
            if topic not in self._flows:
                self._flows[topic] = self._subscribe(Int8, f'{self._name}/{topic}', NEWEST)

    def poll(self):
        """Take all that has come."""
        self._asked.poll()
        now = time.monotonic()
        if now - self._last_look > LOOK:
            self._last_look = now
            self._look()
        if self._live.scene is not self._scene:
            self._begin(self._live.scene)
        for topic, subscription in self._topics.items():
            for data, _ in poll(subscription, raw=True):
                self._take(topic, data)
        for topic, subscription in self._flows.items():
            for message, _ in poll(subscription):
                self._live.put_flow(topic, message.data)
        for message, _ in poll(self._diagnostics):
            mine = [status for status in message.status if status.hardware_id == self._name]
            if mine and self._live.scene:
                self._live.reports([as_words(self._name, status) for status in mine])
        if any(message.node == self._name for message, _ in poll(self._events)):
            if self._live.scene and not self._learning:
                self._learn(self._live.changed)
        self._live.flush()

    def _look(self):
        """See whether the node has come or gone."""
        found = {bytes(info.endpoint_gid)
                 for info in self._node.get_publishers_info_by_topic(self._topic)}
        # one that was killed is still found for long, beside the one that takes its place
        if not found or found - self._publishers:
            self._went()
        self._publishers = found
        if (found and not self._live.scene and not self._learning
                and self._list.service_is_ready() and self._get.service_is_ready()):
            self._learn(self._live.came)

    def _went(self):
        self._asked.forget()
        self._learning = False
        self._live.went()

    def _begin(self, scene):
        """Hear what a scene is made of; None: what a node is known by that may come."""
        self._scene, self._layouts = scene, {}
        if not scene or not scene.odometry:   # clutches come and go with parameters
            self._listen(TOPICS)
        else:
            self._listen(scene.topics, scene.flows)
        if scene:
            layouts = {topic: Layout(scene.frame, names, {**TOPICS, **OF_OTHERS}[topic])
                       for topic, names in scene.names.items()}
            if scene.odometry:
                layouts['odometry'] = OdometryLayout(*scene.odometry)
            self._layouts = {topic: (scene.topics.index(topic), layout)
                             for topic, layout in layouts.items()}

    def _take(self, topic, data):
        """Take the bytes of a message of a topic."""
        if topic in self._layouts:
            index, layout = self._layouts[topic]
            with suppress(ValueError):   # of a node before or after this one
                self._live.put(index, *layout.read(data))

    def _learn(self, learned):
        """Ask for all parameters, and let ``learned`` take them."""
        self._learning, known = True, known_names()

        def listed(response):
            if response is None:
                self._learning = False
                return
            names = [name for name in response.result.names if name in known]

            def got(response):
                self._learning = False
                if response is not None and len(response.values) == len(names):
                    self._show(learned, dict(zip(
                        names, map(parameter_value_to_python, response.values))))
            self._asked.call(self._get, GetParameters.Request(names=names), got)
        self._asked.call(self._list, ListParameters.Request(), listed)

    def _show(self, learned, values):
        try:
            learned(values)
        except ValueError as error:   # as of another version
            self._live.went(str(error))


def as_words(name, status):
    """Return a DiagnosticStatus of a node as the page has it."""
    return {'name': status.name.removeprefix(f'{name}: '), 'level': LEVELS[status.level],
            'message': status.message,
            'values': [[pair.key, pair.value] for pair in status.values]}
