# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What the viewers of ``watch`` command, as messages and requests to the node."""

from concurrent.futures import Future
import math
from queue import Queue
import time

from rclpy.duration import Duration
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

from dm_ros.files.published import CommandMessage
from dm_ros.ros.watched import PATIENCE
from dm_ros.watch.commands import MOST_TICKS, Refused

QOS = QoSProfile(depth=MOST_TICKS, reliability=ReliabilityPolicy.RELIABLE)
SERVICES = {'pause': (SetBool, 'pause', {'data': True}),
            'continue': (SetBool, 'pause', {'data': False}),
            'step': (Trigger, 'step', {}), 'reset': (Trigger, 'reset', {})}
OFTEN = 4   # messages within ``torque_timeout``, so that it never comes to count


class Commander:
    """
    Sends commands to a node.

    ``command`` serves the threads of requests; all else is for the thread of ROS.
    """

    def __init__(self, node, name, live, commands, asked):
        """
        Send to a node that need not be there.

        :param node: that sends; name: full name of the one that is commanded.
        :param live: ``Live``, which knows its ports; commands: ``Commands`` of the viewers.
        :param asked: ``Asked`` of the node that sends.
        """
        self._node, self._live, self._commands, self._asked = node, live, commands, asked
        self._name, self._grouped = name, 'torques'   # until there is a node of another kind
        self._publisher = self._made_publisher()
        self._clients = {word: node.create_client(kind, f'{name}/{service}')
                         for word, (kind, service, _) in SERVICES.items()}
        self._requests = Queue()   # (word, count, Future, deadline)
        self._sent = {}   # the last commands that went out

    def _made_publisher(self):
        return self._node.create_publisher(JointState, f'{self._name}/{self._grouped}', QOS)

    def command(self, viewer, request):
        """Do what a viewer asks for; return the answer to it, or raise ``Refused``."""
        word, commands = request['do'], self._commands
        if word == 'set':
            commands.set(viewer, request.get('values'))
        elif word == 'zero':
            commands.zero(viewer)
        elif word == 'release':
            commands.release()
        else:
            if word == 'reset':   # what starts anew stands, and is not driven on
                commands.release()
            return self._ask(word, request.get('count', 1))
        return {'success': True, 'message': ''}

    def _ask(self, word, count):
        """Let the thread of ROS do it, and wait for it."""
        if type(count) is not int or not 1 <= count <= MOST_TICKS:
            raise Refused(400, f'count: {count!r} is not allowed, it must be an integer in '
                               f'[1, {MOST_TICKS}]')
        future = Future()
        self._requests.put((word, count, future, time.monotonic() + PATIENCE))
        try:
            success, message = future.result(timeout=2 * PATIENCE)
        except TimeoutError as error:
            raise Refused(504, 'the node does not answer') from error
        return {'success': success, 'message': message}

    @property
    def period(self):
        """How often to call ``poll`` at least, s."""
        scene = self._live.scene
        if not scene or not self._sent or not scene.node.torque_timeout:
            return math.inf
        return max(0.002, scene.node.torque_timeout / scene.node.real_time_factor / OFTEN)

    def poll(self):
        """Send what is to be sent now."""
        for _ in range(self._requests.qsize()):
            self._serve(*self._requests.get_nowait())
        scene = self._live.scene
        if scene and scene.grouped != self._grouped:
            self._node.destroy_publisher(self._publisher)
            self._grouped, self._sent = scene.grouped, {}
            self._publisher = self._made_publisher()
        if not scene:
            self._sent = {}
        elif scene.node.mode == 'realtime':
            values = self._commands.values
            if dropped := self._sent.keys() - values.keys():
                self._publish({port.name: port.idle for port in self._ports()
                               if port.name in dropped and not port.lasts})
            if values:
                self._publish(values)
            self._sent = values

    def close(self):
        """Leave no command behind."""
        self._commands.release()
        self.poll()
        self._publisher.wait_for_all_acked(Duration(seconds=1))

    def _ports(self):
        return self._live.scene.inputs

    def _publish(self, values):
        """Publish values by name, if any, None for a speed that is none."""
        if not values:
            return
        prefix = self._live.scene.node.joint_prefix
        ports = [port for port in self._ports() if port.name in values]
        command = CommandMessage(ports, prefix)
        position, velocity, effort = command.arrays([values[port.name] for port in ports])
        message = JointState(name=command.names, position=position, velocity=velocity,
                             effort=effort)
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)

    def _serve(self, word, count, future, deadline):
        """Begin what a request asks for; the future has its end, (success, message)."""
        scene = self._live.scene
        if not scene:
            future.set_result((False, 'there is no node'))
        elif word == 'ticks':
            self._tick(scene, count, future)
        elif not self._clients[word].service_is_ready():   # it may come later than topics
            if time.monotonic() > deadline:
                future.set_result((False, 'the node does not serve it'))
            else:
                self._requests.put((word, count, future, deadline))
        else:
            kind, _, fields = SERVICES[word]
            self._asked.call(
                self._clients[word], kind.Request(**fields),
                lambda response: future.set_result(
                    (response.success, response.message) if response
                    else (False, f'no answer in {PATIENCE:g} s')))

    def _tick(self, scene, count, future):
        """Send messages, each of which is a tick, with what is commanded."""
        if scene.node.mode != 'lockstep':
            future.set_result((False, 'only in lockstep a message is a tick'))
            return
        values = self._commands.values
        if not values:   # all that it holds stays
            values = {self._ports()[0].name: math.nan}
        for _ in range(count):
            self._publish(values)
        future.set_result((True, f'{count} sent'))
