# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The node ``differential``: the simulation at a fixed rate, torques in, speeds out."""

import argparse
import gc
import os
import sys
import threading
import time

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import SetParametersResult
import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import install_signal_handlers, SignalHandlerOptions
from rclpy.utilities import remove_ros_args
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Int8
from std_srvs.srv import SetBool, Trigger

from dm_ros.ending import run_command
from dm_ros.mechanism.variants import variant_named
from dm_ros.motion.energy import AuditedSimulation
from dm_ros.motion.held_inputs import HeldInputs
from dm_ros.motion.pacing import Pacer
from dm_ros.motion.simulation import Simulation
from dm_ros.ros.diagnostics import Diagnostics
from dm_ros.ros.graph import Neighbours
from dm_ros.ros.leftovers import remove_leftovers
from dm_ros.ros.loops import (
    ask_for_priority,
    Control,
    follow_messages,
    follow_ros_clock,
    follow_steady_clock,
)
from dm_ros.ros.messages import (
    LATEST_QOS,
    LOCKSTEP_INPUT_QOS,
    LOCKSTEP_OUTPUT_QOS,
    never_called,
    OUTPUT_QOS,
    Polled,
    SHARED_QOS,
    SnapshotMessages,
)
from dm_ros.ros.parameters import declare, strictly_checked
from dm_ros.ros.privates import given_parameters, poll, WholeRequests
from dm_ros.settings import known_rows, NodeParameters

SWITCH_INTERVAL = 1e-4   # s that the loop waits at most for a service to let go of the interpreter

HELP = """\
A vehicle differential in real time: torques in as topics, speeds and internal moments out.

  in   ~/torque/<shaft>     std_msgs/Float64          N m, one shaft
       ~/torques            sensor_msgs/JointState    N m as effort, any shafts by name
  out  ~/joint_states       sensor_msgs/JointState    all shafts: rad, rad/s, N m
       ~/internal_moments   sensor_msgs/JointState    N m as effort
       ~/power_flow         std_msgs/Int8             +1 direct, -1 reverse
       /diagnostics         diagnostic_msgs/DiagnosticArray
  srv  ~/reset ~/step       std_srvs/Trigger
       ~/pause              std_srvs/SetBool

  --ros-args -p variant:=lsd_ode -p rate:=500.0
  --ros-args --params-file lsd.yaml -p variant:=lsd_dae

ros2 param list /differential names all parameters, ros2 param describe tells of each.
"""


class DifferentialNode(Node):
    """
    A differential in real time or in lockstep.

    A thread of its own waits for what advances time, steps and publishes. Parameters, services
    and diagnostics are served by an executor and meet the loop at a lock, between two ticks.

    :raises ValueError: for an unknown or impossible parameter; names it.
    """

    def __init__(self, **node_options):
        super().__init__('differential', start_parameter_services=False, **node_options)
        try:
            self._declare_parameters()
        except ValueError:
            self.destroy_node()
            raise
        self.control = Control()
        self.on_tick = None   # called with each snapshot that a tick publishes
        self._failure = None
        self._thread = threading.Thread(target=self._run, name='differential loop')

        simulation, lockstep = self.simulation, self._settings.mode == 'lockstep'
        output_qos = LOCKSTEP_OUTPUT_QOS if lockstep else OUTPUT_QOS
        self._messages = SnapshotMessages(
            simulation.shafts, simulation.inputs, simulation.moments)
        self._neighbours = Neighbours(self)
        self._joint_states = self._publisher(JointState, '~/joint_states', output_qos)
        self._internal_moments = self._publisher(
            JointState, '~/internal_moments', output_qos)
        self._power_flow = self._publisher(Int8, '~/power_flow', output_qos)
        self._report = self._publisher(DiagnosticArray, '/diagnostics', OUTPUT_QOS)
        self._clock_publisher = (self._publisher(ClockMessage, '/clock', output_qos)
                                 if self._settings.publish_clock else None)
        self._simulated_stamps = lockstep or self._settings.publish_clock

        polled = Polled()
        self._shaft_torques = [] if lockstep else [
            (shaft, self.create_subscription(Float64, f'~/torque/{shaft}', never_called,
                                             LATEST_QOS, callback_group=polled))
            for shaft in simulation.inputs]
        self._torques = self.create_subscription(
            JointState, '~/torques', never_called,
            LOCKSTEP_INPUT_QOS if lockstep else SHARED_QOS, callback_group=polled)
        if lockstep:   # in real time publishers of all kinds are heard
            self._neighbours.watch('~/torques', 'RELIABILITY')

        self.create_service(Trigger, '~/reset', self._reset)
        self.create_service(SetBool, '~/pause', self._pause)
        self.create_service(Trigger, '~/step', self._step)
        self._parameter_services = WholeRequests(self, strictly_checked)
        # the steady clock: a timer of the ROS clock stalls when system time steps back
        self.create_timer(1.0, self._diagnose, clock=Clock(clock_type=ClockType.STEADY_TIME))
        log = self.get_logger()
        self._diagnostics = Diagnostics(
            self.get_name(), log, simulation, self._pacer, self._inputs, self.control,
            self._neighbours)
        log.info(f'{simulation.variant} at {self._settings.rate:g} Hz, {self._settings.mode}, '
                 f'torques on {", ".join(simulation.inputs)}')

    def start(self):
        """Begin to tick."""
        self._thread.start()

    def reset(self):
        """Go back to the start; the lock of ``control`` must be held."""
        self.simulation.reset()
        self._inputs.forget()
        self._last_stamp = 0

    def publish_state(self):
        """Publish the state as it is; the lock of ``control`` must be held."""
        self._publish(self.simulation.snapshot())

    def discard_torques(self):
        """Take all waiting messages on ``~/torques`` without a tick; return their number."""
        return sum(1 for _ in poll(self._torques))

    def is_connected(self):
        """Return whether somebody gives torques and somebody hears the joint states."""
        return (self._torques.get_publisher_count() > 0
                and self._joint_states.get_subscription_count() > 0)

    def close(self):
        """Stop ticking and destroy the node; raise what had stopped the loop, if anything."""
        self.control.stopping.set()
        if self._thread.is_alive():
            self._thread.join()
        self.destroy_node()
        if self._failure:
            raise self._failure

    def _publisher(self, message_type, topic, qos):
        return self.create_publisher(message_type, topic, qos,
                                     event_callbacks=self._neighbours.of_publisher(topic))

    # parameters

    def _declare_parameters(self):
        known = known_rows()
        for name in given_parameters(self):
            if name not in known and not self.has_parameter(name):
                raise ValueError(f'{name}: there is no such parameter')
        settings = NodeParameters()
        variant = given_parameters(self).get('variant', settings.variant)
        mechanism = variant_named(settings.changed({'variant': variant}).variant).mechanism
        not_mine = [f'initial_velocity.{shaft}' for shaft in ('left', 'right', 'front', 'rear')
                    if shaft not in mechanism.outputs]
        settings = declare(self, settings, lambda name: name not in not_mine)
        parameters = declare(self, mechanism.parameters())
        kind = AuditedSimulation if settings.energy_audit else Simulation
        self.simulation = kind(
            variant, dt=1.0 / settings.rate, parameters=parameters, substeps=settings.substeps,
            power_flow_deadband=settings.deadband,
            initial_velocity=settings.initial_velocity(mechanism.outputs))
        self._settings = settings
        self._follows_clock = self.get_parameter('use_sim_time').value
        if self._follows_clock and settings.publish_clock:
            raise ValueError('publish_clock: a node that follows /clock, by use_sim_time, '
                             'cannot drive it')
        # another simulator's clock may leap by many ticks, but not by more than a second
        self._pacer = Pacer(1e9 / settings.rate,
                            patience=settings.rate if self._follows_clock else 0)
        self._inputs = HeldInputs(self.simulation.mechanism.ports, settings.torque_limit, 0.0)
        self._last_stamp = 0
        self._prepared = settings, None
        self._apply(settings)
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._take_parameters)

    def _check_parameters(self, parameters):
        """Refuse a request as a whole, or prepare all that it changes."""
        changes = {parameter.name: parameter.value for parameter in parameters}
        own, mechanism = split(changes, self._settings, self.simulation.parameters)
        try:
            settings = self._settings.changed(own)
            prepared = None
            if mechanism or settings.substeps != self._settings.substeps:
                prepared = self.simulation.prepare(mechanism, settings.substeps)
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        self._prepared = settings, prepared
        return SetParametersResult(successful=True)

    def _take_parameters(self, parameters):
        """Put what was prepared into force between two ticks."""
        settings, prepared = self._prepared
        with self.control.lock:
            if prepared:
                self.simulation.adopt(prepared)
            self._apply(settings)

    def _apply(self, settings):
        """Put the parameters of the node that may change while it runs into force."""
        self._settings = settings
        simulation, inputs, pacer = self.simulation, self._inputs, self._pacer
        simulation.power_flow_deadband = settings.deadband
        simulation.initial_velocity = settings.initial_velocity(simulation.outputs)
        inputs.limit = settings.torque_limit
        # in lockstep time stands still without torques, so none is too old
        inputs.timeout = 0.0 if settings.mode == 'lockstep' else (
            settings.torque_timeout * settings.rate)
        factor = 1.0 if self._follows_clock else settings.real_time_factor
        period = 1e9 / (settings.rate * factor)
        if period != pacer.period:
            pacer.period = period
            pacer.restart(time.monotonic_ns())

    # services

    def _reset(self, request, response):
        with self.control.lock:
            self.reset()
            self.publish_state()
        response.success = True
        return response

    def _pause(self, request, response):
        with self.control.lock:
            if request.data:
                self.control.running.clear()
            else:
                self.control.running.set()
        response.success = True
        response.message = 'paused' if request.data else 'running'
        return response

    def _step(self, request, response):
        with self.control.lock:
            response.success = not self.control.running.is_set()
            if response.success:
                self._take_torques()
                self._tick()
                response.message = f'time {self.simulation.time:.9g} s'
            else:
                response.message = 'only while paused, see ~/pause'
        return response

    # the loop; the lock is held in a tick

    def _run(self):
        control, settings = self.control, self._settings
        try:
            if settings.realtime_priority:
                ask_for_priority(settings.realtime_priority, self.get_logger())
            if settings.mode == 'lockstep':
                follow_messages(control, self._torques, self.context, self._lockstep_tick)
            elif self._follows_clock:
                follow_ros_clock(control, self._pacer, self.get_clock(), self._followed_tick)
            else:
                follow_steady_clock(control, self._pacer, self._realtime_tick)
        except Exception as error:
            if self.context.ok():   # otherwise it is the shutdown that broke a call
                self._failure = error
                self.context.try_shutdown()

    def _realtime_tick(self):
        self._take_torques()
        self._tick()

    def _followed_tick(self):
        """Tick with the deadline as the stamp: a leap of the clock brings several at one time."""
        self._take_torques()
        self._tick(divmod(self._pacer.begun, 10**9))

    def _lockstep_tick(self, message):
        """Advance one tick with a message and answer it, or refuse both."""
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        if stamp and stamp <= self._last_stamp:
            self._inputs.refused += 1
            self._diagnostics.refusing.happened(
                '~/torques: its stamp repeats or goes back in time')
        elif self._demand(message.name, message.effort, 'torques'):
            self._last_stamp = stamp or self._last_stamp
            self._tick()

    def _take_torques(self):
        """Take the torques that came since the last tick."""
        if self._settings.mode == 'lockstep':
            return   # each of its messages brings its own tick
        for shaft, subscription in self._shaft_torques:
            for message, _ in poll(subscription):
                self._demand((shaft,), (message.data,), f'torque/{shaft}')
        for message, _ in poll(self._torques):
            self._demand(message.name, message.effort, 'torques')

    def _tick(self, stamp=None):
        """Advance one tick and publish; stamp: seconds and nanoseconds, None for those of now."""
        try:
            self.simulation.advance(self._inputs.in_force(self.simulation.ticks))
        except ValueError as error:
            self._diagnostics.out_of_range.happened(str(error))
        snapshot = self.simulation.snapshot()
        self._diagnostics.ticks += 1
        self._publish(snapshot, stamp)
        if self.on_tick:
            self.on_tick(snapshot)

    def _demand(self, names, torques, topic):
        """Take the torques of a message; return whether they were taken."""
        try:
            if self._inputs.demand(names, torques, self.simulation.ticks):
                self._diagnostics.clamping.happened(
                    f'~/{topic}: beyond {self._inputs.limit:g} N m')
        except ValueError as error:
            self._diagnostics.refusing.happened(f'~/{topic}: {error}')
            return False
        return True

    def _publish(self, snapshot, stamp=None):
        if self._simulated_stamps:
            stamp = divmod(round(self.simulation.ticks * 1e9 / self._settings.rate), 10**9)
        elif stamp is None:
            stamp = self.get_clock().now().seconds_nanoseconds()
        messages = self._messages
        messages.fill(snapshot, *stamp)
        if self._clock_publisher:
            self._clock_publisher.publish(
                ClockMessage(clock=messages.joint_states.header.stamp))
        self._joint_states.publish(messages.joint_states)
        self._internal_moments.publish(messages.internal_moments)
        self._power_flow.publish(messages.power_flow)

    def _diagnose(self):
        self._report.publish(self._diagnostics.report(self.get_clock().now().to_msg()))


def split(changes, *tables):
    """Return one dict for each table of parameters, with those changes that are its own."""
    return [{name: value for name, value in changes.items() if name in table.named()}
            for table in tables]


def parser():
    """Return the parser of what is not for ROS on the command line."""
    return argparse.ArgumentParser(
        'differential', description=HELP, formatter_class=argparse.RawDescriptionHelpFormatter)


class CannotStart(Exception):
    """Why there is no node: a wrong command line, or something wrong around it."""


def started(args):
    """Return the node; raise ``CannotStart`` where there can be none."""
    if 'HOME' not in os.environ and (home := os.path.expanduser('~')) != '~':
        os.environ['HOME'] = home   # where rclpy has its logs
    try:
        parser().parse_args(remove_ros_args(args)[1:])
        remove_leftovers()
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        return DifferentialNode()
    except (ValueError, ParameterException, RuntimeError) as error:
        # RuntimeError: of rclpy, such as an unwritable folder for its logs
        raise CannotStart(error) from error


def run(args, ended):
    """Run the node until a signal has set ``ended``."""
    node = None
    try:
        node = started(args)
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


def main(args=None):
    """Run the node until SIGINT or SIGTERM; return the exit code."""
    args = sys.argv if args is None else ['differential', *args]
    ended = threading.Event()
    return run_command('differential', lambda: run(args, ended), expected=(CannotStart,),
                       on_signal=lambda *_: ended.set(), until_signal=True)


if __name__ == '__main__':
    sys.exit(main())
