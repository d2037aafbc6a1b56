# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Publish torques to a differential node: a built-in load, or a CSV file."""

import argparse
from collections import deque
from contextlib import ExitStack
import sys
import time
from typing import Callable, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
import rclpy
from rclpy.duration import Duration
from rclpy.exceptions import NameValidationException
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from sensor_msgs.msg import JointState

from dm_ros.ending import ignore_signals, run_command
from dm_ros.files.bag import Bag, INPUT_DEPTH
from dm_ros.files.parameter_file import read_parameter_file
from dm_ros.files.published import CommandMessage
from dm_ros.files.recorded_drive import is_bag, read_drive
from dm_ros.files.torque_table import read_torque_file
from dm_ros.mechanism.variants import (
    equipped,
    Mechanism,
    MECHANISMS,
    variant_named,
    VARIANTS,
    WITH_CLUTCHES,
)
from dm_ros.ros.messages import never_called, Polled
from dm_ros.ros.privates import poll
from dm_ros.ros.recorder import Taps
from dm_ros.ros.transport import prefer_udp
from dm_ros.settings import NodeParameters, port_parameters, speed_ports
from dm_ros.tools.passed_over import warn
from dm_ros.tools.progress import progress
from dm_ros.tools.tables import add_ignore_columns, remarks

LOOK = 0.1          # s between two looks at what is to be recorded
LAST_ANSWER = 0.2   # s that a recording goes on after the load is off

EPILOG = """\
CSV is a file as `simulate` reads it: a header "time,<shaft>,..." with every input shaft, and a
row's torques hold until the time of the next row, those of the last row beyond it. A file that
begins later than 1000 s, as at an epoch, is played from its first row on. A bag, a folder or an
.mcap file, is played as `simulate` reads it: what was in force in each tick. Forces on
clutches, in columns <clutch>_clutch, are played where CSV has any. Where FILE has a speed port
(port.<shaft>.kind: speed), the column of its shaft is the speed outside in rad/s. Without
--duration the last time ends the playing. All goes to the topic <node>/torques, in one message. A
<node> without / in front is in the namespace of this one: --ros-args -r __ns:=/rear is enough to
play to /rear/differential. Where the node has a joint_prefix the names in messages need it too,
from FILE or --joint-prefix; those in CSV have none. At the end, and on Ctrl-C or SIGTERM as well,
zeros are published so that no load stays behind.
"""


def parser():
    """Return the parser of the command line."""
    result = argparse.ArgumentParser('play_torques', description=__doc__, epilog=EPILOG,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    family = result.add_mutually_exclusive_group()
    family.add_argument('--variant', choices=VARIANTS, default='symmetric_ode',
                        help='the variant that the node runs: it decides the input shafts and '
                        'the built-in load; default: %(default)s')
    family.add_argument('--profile', choices=MECHANISMS, help='the same by the mechanism alone')
    family.add_argument('--params', metavar='FILE',
                        help='the same by the variant in the ROS 2 parameter file of the node, '
                        'and which ports take a speed')
    result.add_argument('--torques', metavar='CSV',
                        help='play this file, or bag, not the built-in load')
    add_ignore_columns(result, 'CSV')
    result.add_argument('--rate', type=float, metavar='HZ',
                        help='messages in a second; default: 100, or the ticks of a bag')
    result.add_argument('--record', metavar='FOLDER',
                        help='record the node in a bag, a new folder, while it plays')
    result.add_argument('--duration', type=_positive, metavar='S',
                        help='how long to play; default: to the end of CSV, or endless')
    result.add_argument('--node', default='differential', metavar='NAME',
                        help='name of the differential node, in the namespace of this one or '
                        'full; default: %(default)s')
    result.add_argument('--joint-prefix', metavar='PREFIX',
                        help='before the names in messages; default: joint_prefix of FILE')
    result.add_argument('--wait', type=_not_negative, default=10.0, metavar='S',
                        help='how long to wait for a subscriber before playing all the same; '
                        'default: 10')
    return result


def _not_negative(text):
    value = float(text)
    if not 0.0 <= value <= 1e9:
        raise argparse.ArgumentTypeError(f'{text} must be in [0, 1e+09]')
    return value


def _positive(text):
    if not _not_negative(text) > 0.0:
        raise argparse.ArgumentTypeError(f'{text} must be above 0')
    return float(text)


class Player:
    """Publishes torques, outside speeds, and forces on clutches, to a node's topic ``torques``."""

    def __init__(self, node, target, ports, prefix='', taps=None):
        """
        Make the publisher.

        :param target: name of the differential; prefix: before the names of the ports.
        :param taps: ``Taps`` to be polled, if any.
        """
        self._node, self._taps = node, taps
        self._differential, self._told = full_name(node, target), False
        self._diagnostics = node.create_subscription(
            DiagnosticArray, '/diagnostics', never_called, 10, callback_group=Polled())
        reliable = QoSProfile(depth=INPUT_DEPTH, reliability=ReliabilityPolicy.RELIABLE)
        self._publisher = node.create_publisher(JointState, topic_of(target), reliable)
        self._idle, self._commands = [port.idle for port in ports], CommandMessage(ports, prefix)
        self._message = JointState(name=self._commands.names)

    def wait(self, seconds):
        """Wait for a subscriber, at most so long, and tell how it went."""
        log, topic = self._node.get_logger(), self._publisher.topic_name
        deadline = time.monotonic() + seconds
        if not self._is_connected() and seconds > 0.0:
            log.info(f'waiting up to {seconds:g} s for a subscriber of {topic}')
        while not self._is_connected():
            if time.monotonic() >= deadline:
                log.warning(f'{topic} has no subscriber, playing all the same')
                return
            time.sleep(0.02)
        log.info(f'playing to {topic}')

    def _is_connected(self):
        return self._publisher.get_subscription_count() > 0 and (
            self._taps is None or self._taps.is_connected())

    def publish(self, values):
        """Publish one value for each port, in its unit; None for a speed that is none."""
        self._message.header.stamp = self._node.get_clock().now().to_msg()
        _, self._message.velocity, self._message.effort = self._commands.arrays(values)
        self._publisher.publish(self._message)

    def play(self, torques_at, rate, count=None):
        """
        Publish ``torques_at(n)`` at ``n / rate`` seconds from now on, for n below count.

        The deadlines are absolute, so that nothing adds up; those that were missed, as after a
        suspension, are skipped.
        """
        with progress(total=count, unit='message') as bar:
            start, n = time.monotonic(), 0
            while count is None or n < count:
                self.publish(torques_at(n))
                due = max(n + 1, int((time.monotonic() - start) * rate))
                bar.update(due - n)
                n = due
                self._sleep_until(start + n / rate)
                self._tell_refusals()

    def _tell_refusals(self):
        """Tell once what the differential says of messages that it refuses."""
        for message, _ in poll(self._diagnostics):
            for status in message.status:
                if (not self._told and status.hardware_id == self._differential
                        and 'messages are refused' in status.message):
                    self._told = True
                    reason = next((pair.value for pair in status.values
                                   if pair.key == 'last refused'), '')
                    self._node.get_logger().warning(
                        f'{self._differential} refuses messages: {reason}')

    def unload(self):
        """Publish what an idle port has and wait until it has arrived."""
        self.publish(self._idle)
        self._publisher.wait_for_all_acked(Duration(seconds=1))
        if self._taps:
            self._sleep_until(time.monotonic() + LAST_ANSWER)

    def _sleep_until(self, end):
        while (left := end - time.monotonic()) > 0.0:
            time.sleep(min(left, LOOK) if self._taps else left)
            if self._taps:
                deque(self._taps.poll(), 0)


def full_name(node, target):
    """Return the full name of the differential to which a node plays."""
    topic = node.resolve_topic_name(topic_of(target), only_expand=True)
    return topic.removesuffix('/torques')


def topic_of(target):
    """Return the topic of a differential on which one message takes all."""
    return f'{target.rstrip("/")}/torques'


class Load(NamedTuple):
    """What to play."""

    mechanism: Mechanism
    ports: tuple         # to which it is played
    rate: float          # messages in a second
    values_at: Callable  # of n: a value for each port
    count: int | None    # of messages
    prefix: str          # before the names in messages


def load(arguments, target='/differential'):
    """
    Return what to play, as a ``Load``.

    :param target: full name of the node for which FILE counts.
    :raises ValueError: for a CSV that is not as it should be, or none where one is needed.
    """
    rate, count = 100.0 if arguments.rate is None else arguments.rate, None
    NodeParameters(rate=rate)   # refuses what is none
    values = read_parameter_file(arguments.params, target) if arguments.params else {}
    prefix = arguments.joint_prefix
    if prefix is None:
        prefix = values.get('joint_prefix', '')
    NodeParameters(joint_prefix=prefix)   # refuses what is none
    mechanism = (MECHANISMS[arguments.profile] if arguments.profile
                 else variant_named(values.get('variant', arguments.variant)).mechanism)
    warn('play_torques', arguments.params, values, mechanism, node=target)
    speeds = speed_ports(port_parameters(mechanism.inputs, values))
    mechanism = equipped(WITH_CLUTCHES[mechanism.name], mechanism.parameters(), speeds)
    ports = mechanism.ports
    if arguments.torques:
        if is_bag(arguments.torques):
            drive = read_drive(arguments.torques, mechanism, NodeParameters().changed(
                NodeParameters.part_of(values)).rate, default=target)
            table, lines = drive.table, drive.remarks
            rate = 1 / drive.dt if arguments.rate is None else rate
        else:
            table = read_torque_file(arguments.torques, ports, mechanism.clutch_moments,
                                     arguments.ignore_columns)
            lines = ()
        held = table.held(1 / rate)
        lines = *(f'{arguments.torques}: {line}' for line in lines), *remarks(
            arguments.torques, table, 1 / rate, lambda dt: f'--rate {1 / dt:.9g}')
        for line in lines:
            print('play_torques:', line, file=sys.stderr, flush=True)
        torques_at, count = held.at, len(held)
        if len(torques_at(0)) > len(ports):
            ports += mechanism.actuators
    elif speeds:
        raise ValueError(f'--torques: it is needed where speed comes in, on {", ".join(speeds)}')
    else:
        def torques_at(n):
            return mechanism.load(n / rate)
    if arguments.duration:
        count = max(1, round(arguments.duration * rate))
    return Load(mechanism, ports, rate, torques_at, count, prefix)


def run(args):
    """Play what the command line says, and unload in the end."""
    try:
        arguments = parser().parse_args(remove_ros_args(args)[1:])
        prefer_udp()
        # rclpy's own handlers would shut down before the zero torques are out
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        node = rclpy.create_node('play_torques')
        target = full_name(node, arguments.node)
        what = load(arguments, target)
        with ExitStack() as stack:
            taps = None
            if arguments.record:
                taps = Taps(node, target, what.mechanism)
                taps.record(stack.enter_context(Bag(arguments.record, whole=False)))
            player = Player(node, arguments.node, what.ports, what.prefix, taps)
            try:
                player.wait(arguments.wait)
                player.play(what.values_at, what.rate, what.count)
            finally:
                ignore_signals()
                player.unload()
    finally:
        ignore_signals()
        rclpy.try_shutdown()


def main(args=None):
    """Run the tool ``play_torques`` and return its exit code."""
    args = sys.argv if args is None else ['play_torques', *args]
    return run_command(
        'play_torques', lambda: run(args), until_signal=True,
        expected=(ValueError, RuntimeError, NameValidationException))   # RuntimeError: of rclpy


if __name__ == '__main__':
    sys.exit(main())
