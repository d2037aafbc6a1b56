# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A node of what is driven: at a fixed rate, inputs in, what it reports out."""

import argparse
import gc
import os
import sys
import threading
import time

from diagnostic_msgs.msg import DiagnosticArray
import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import install_signal_handlers, SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from dm_ros.ending import run_command
from dm_ros.motion.pacing import Pacer
from dm_ros.ros.diagnostics import Diagnostics
from dm_ros.ros.graph import Neighbours
from dm_ros.ros.loops import (
    ask_for_priority,
    Control,
    follow_messages,
    follow_ros_clock,
    follow_steady_clock,
)
from dm_ros.ros.messages import OUTPUT_QOS
from dm_ros.ros.services import Requests
from dm_ros.ros.strays import strays
from dm_ros.ros.topics import Inputs, Outputs
from dm_ros.ros.transport import prefer_udp

SWITCH_INTERVAL = 1e-4   # s that the loop waits at most for a service to let go of the interpreter


class DrivenNode(Node):
    """
    What is ``Driven``, in real time or in lockstep.

    A thread of its own waits for what advances time, lets the ``plant`` tick and publishes.
    Parameters, services and diagnostics are served by an executor and meet the loop at the lock
    of ``control``, between two ticks.

    A subclass says what: ``name``, the default name of the node; ``input_topics``, what the topics
    of its inputs begin with; ``declared()``, which declares its parameters and returns what is
    ``Driven``, or raises ValueError; ``messages()`` of a tick, see ``Outputs``.

    :raises ValueError: for an unknown or impossible parameter; names it.
    """

    def __init__(self, **node_options):
        super().__init__(self.name, start_parameter_services=False, **node_options)
        try:
            self.plant = self.declared()
            self.use_sim_time = self.get_parameter('use_sim_time').value
            if self.use_sim_time and self.plant.settings.publish_clock:
                raise ValueError('publish_clock: a node that follows /clock, by use_sim_time, '
                                 'cannot drive it')
        except ValueError:
            self.destroy_node()
            raise
        self.control = Control()
        self.on_tick = None   # called with each snapshot that a tick publishes
        settings = self.plant.settings
        # another simulator's clock may leap by many ticks, but not by more than a second
        self.pacer = Pacer(1e9 / settings.rate,
                           patience=settings.rate if self.follows_clock else 0)
        self.set_pace()
        self._failure = None
        self._thread = threading.Thread(target=self._run, name=f'{self.name} loop')

        self.neighbours = Neighbours(self, self.input_topics)
        self.outputs = Outputs(self, self.messages())
        self.inputs = Inputs(self)
        self._report = self.publisher(DiagnosticArray, '/diagnostics', OUTPUT_QOS)
        self.requests = Requests(self)
        self._diagnostics = Diagnostics(self)
        # the steady clock: a timer of the ROS clock stalls when system time steps back
        self.create_timer(1.0, self.diagnose, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.get_logger().info(', '.join([
            f'{self.plant.title} at {settings.rate:g} Hz', settings.mode,
            *self.plant.words]))

    @property
    def simulation(self):
        """The simulation of the ``plant``."""
        return self.plant.simulation

    @property
    def follows_clock(self):
        """Whether ``/clock`` advances time; in lockstep nothing but messages does."""
        return self.use_sim_time and not self.plant.lockstep

    @property
    def drives_clock(self):
        """Whether the node publishes ``/clock``."""
        return self.plant.settings.publish_clock

    def start(self):
        """Begin to tick."""
        self._thread.start()

    def publish_state(self):
        """Publish the state as it is; the lock of ``control`` must be held."""
        self.outputs.publish(self.simulation.snapshot())

    def is_connected(self):
        """Return whether somebody commands and somebody hears what it reports."""
        return self.inputs.grouped.get_publisher_count() > 0 and any(
            publisher.get_subscription_count() > 0 for publisher, _ in self.outputs.of_a_tick)

    def set_pace(self):
        """Let the pacer follow the settings; the lock of ``control`` must be held."""
        settings, pacer = self.plant.settings, self.pacer
        factor = 1.0 if self.follows_clock else settings.real_time_factor
        period = 1e9 / (settings.rate * factor)
        if period != pacer.period:
            pacer.period = period
            pacer.restart(time.monotonic_ns())

    def diagnose(self):
        """Publish on ``/diagnostics``; to be called at 1 Hz."""
        self._report.publish(self._diagnostics.report(self.get_clock().now().to_msg()))

    def publisher(self, message_type, topic, qos):
        """Return a publisher that tells of subscribers whose QoS does not fit."""
        return self.create_publisher(message_type, topic, qos,
                                     event_callbacks=self.neighbours.of_publisher(topic))

    def close(self):
        """Stop ticking and destroy the node; raise what had stopped the loop, if anything."""
        self.control.stopping.set()
        if self._thread.is_alive():
            self._thread.join()
        self.destroy_node()
        self._diagnostics.end()   # on stderr alone: /rosout may be gone
        if self._failure:
            raise self._failure

    # the loop; the lock is held in a tick

    def _run(self):
        control, settings = self.control, self.plant.settings
        try:
            if settings.realtime_priority:
                ask_for_priority(settings.realtime_priority, self.get_logger())
            if self.plant.lockstep:
                follow_messages(control, self.inputs.grouped, self.context, self.lockstep_tick)
            elif self.follows_clock:
                follow_ros_clock(control, self.pacer, self.get_clock(), self._followed_tick,
                                 self._diagnostics.clock_went_back)
            else:
                follow_steady_clock(control, self.pacer, self.tick)
        except Exception as error:
            if self.context.ok():   # otherwise it is the shutdown that broke a call
                self._failure = error
                self.context.try_shutdown()

    def tick(self):
        """Take what came and tick; in lockstep, where each message has its tick, just tick."""
        if not self.plant.lockstep:
            self.inputs.take()
        self._advance()

    def lockstep_tick(self, message, info):
        """Advance one tick with a message and answer it, or refuse both; info: of ``take``."""
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        if self.inputs.take_grouped(message, info, stamp):
            self._advance()

    def _followed_tick(self):
        """Tick with the deadline as the stamp: a leap of the clock brings several at one time."""
        self.inputs.take()
        self._advance(divmod(self.pacer.begun, 10**9))

    def _advance(self, stamp=None):
        """Advance one tick and publish; stamp: as for ``Outputs.publish``."""
        snapshot = self.plant.tick()
        self.outputs.publish(snapshot, stamp)
        if self.on_tick:
            self.on_tick(snapshot)


class CannotStart(Exception):
    """Why there is no node: a wrong command line, or something wrong around it."""


def parser(kind):
    """Return the parser of what is not for ROS on the command line of a ``DrivenNode``."""
    return argparse.ArgumentParser(
        kind.name, description=kind.help, formatter_class=argparse.RawDescriptionHelpFormatter)


def started(kind, args):
    """Return the node; raise ``CannotStart`` where there can be none."""
    if 'HOME' not in os.environ and (home := os.path.expanduser('~')) != '~':
        os.environ['HOME'] = home   # where rclpy has its logs
    try:
        parser(kind).parse_args(remove_ros_args(args)[1:])
        prefer_udp()
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        node = kind()
        for line in strays(args, node.get_fully_qualified_name()):
            node.get_logger().warning(line)
        return node
    except (ValueError, ParameterException, RuntimeError) as error:
        # RuntimeError: of rclpy, such as an unwritable folder for its logs
        raise CannotStart(error) from error


def run(kind, args, ended):
    """Run the node until a signal has set ``ended``."""
    node = None
    try:
        node = started(kind, args)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        gc.collect()
        gc.freeze()   # a full collection takes tens of ms; this leaves it little to look at
        sys.setswitchinterval(SWITCH_INTERVAL)
        # these call those that set it and shut the context down, which breaks whatever uses it
        install_signal_handlers()
        if not ended.is_set():
            node.start()
            executor.spin()
    except ExternalShutdownException:
        pass
    except Exception:
        if not ended.is_set():
            raise
    finally:
        if node:
            node.close()
        rclpy.try_shutdown()


def main_of(kind, args=None):
    """Run a ``DrivenNode`` until SIGINT or SIGTERM; return the exit code."""
    args = sys.argv if args is None else [kind.name, *args]
    ended = threading.Event()
    return run_command(kind.name, lambda: run(kind, args, ended), expected=(CannotStart,),
                       on_signal=lambda *_: ended.set(), until_signal=True)
