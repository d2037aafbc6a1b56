# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Faults on the topics, the services and the clocks of a node in this process."""

import ast
from contextlib import ExitStack
import math
from pathlib import Path
import re
import signal
import time

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from processes import Forked
import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.clock import ClockType
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from reports import told
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from dm_ros.motion.pacing import Pacer
from dm_ros.ros import loops
from dm_ros.ros.loops import Control, follow_steady_clock
from dm_ros.ros.messages import LOCKSTEP_OUTPUT_QOS

ROOT = Path(__file__).parents[2]
TORQUES, JOINTS = '/differential/torques', '/differential/joint_states'
SUBSCRIBER = """
import sys, time
import rclpy
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
reliability, pause = sys.argv[1], float(sys.argv[2])
rclpy.init()
node = rclpy.create_node('listener')
def heard(message):
    global count
    count += 1
    if count == 1:
        print('heard', flush=True)
    time.sleep(pause)
count = 0
node.create_subscription(JointState, '/differential/joint_states', heard, QoSProfile(
    depth=10, reliability=ReliabilityPolicy[reliability]))
rclpy.spin(node)
"""


def torques(names, efforts, stamp=0):
    message = JointState(name=list(names), effort=[float(effort) for effort in efforts])
    message.header.stamp = Time(sec=stamp // 10**9, nanosec=stamp % 10**9)
    return message


@pytest.fixture
def listeners(ros):
    """Return a function that starts subscribers to the joint states, ended after the test."""
    with ExitStack() as stack:
        yield lambda *arguments: stack.enter_context(Forked(SUBSCRIBER, *arguments))


# Numbers and names


@pytest.mark.parametrize('value', [math.nan, math.inf, -math.inf])
def test_what_is_no_number_on_the_topic_of_a_shaft_is_refused(ros, value):
    node = ros.differential(torque_timeout=0.0)
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    publisher = ros.publisher(Float64, '/differential/torque/left')
    publisher.publish(Float64(data=2.0))
    ros.until(lambda: node.simulation.snapshot().torque == (0.0, 2.0, 0.0))
    publisher.publish(Float64(data=value))
    ros.until(lambda: told(diagnostics, 'torques')[2].get('refused messages') == '1')
    level, message, values = told(diagnostics, 'torques')
    assert level == DiagnosticStatus.WARN and 'refused' in message
    assert values['last refused'] == f'~/torque/left: the torque on left is {value}'
    assert node.simulation.snapshot().torque == (0.0, 2.0, 0.0)


@pytest.mark.parametrize('mode', ['realtime', 'lockstep'])
def test_huge_torques_are_clamped_and_all_that_is_published_stays_finite(ros, mode):
    node = ros.differential('lsd_ode', mode=mode, torque_limit=1e9, torque_timeout=0.0)
    joints = ros.listen(JointState, JOINTS)
    publisher = ros.publisher(JointState, TORQUES)
    for sign in (1.0, -1.0) * 10:
        publisher.publish(torques(('carrier', 'front', 'rear'),
                                  (sign * 1e308, sign * 1e308, -sign * 1e308)))
    ros.until(lambda: len(joints) >= 20)
    assert any(max(map(abs, message.effort)) == 1e9 for message in joints)
    assert all(math.isfinite(number) for message in joints
               for number in (*message.position, *message.velocity, *message.effort))
    assert node.plant.inputs.clamped > 0


def test_names_may_come_in_any_order(ros):
    node = ros.differential('lsd_ode', torque_timeout=0.0)
    ros.publisher(JointState, TORQUES).publish(torques(('rear', 'carrier', 'front'), (3, 1, 2)))
    ros.until(lambda: node.simulation.snapshot().torque == (1.0, 2.0, 3.0))


# Stamps


def test_in_real_time_a_torque_counts_from_when_it_came_whatever_its_stamp(ros):
    node = ros.differential(torque_timeout=0.0)
    publisher = ros.publisher(JointState, TORQUES)
    now = time.time_ns()
    for effort, stamp in enumerate(
            (0, now, now, now - 3600 * 10**9, now + 3600 * 10**9, -10**9), start=1):
        publisher.publish(torques(['left'], [effort], stamp))
        ros.until(lambda effort=effort: node.simulation.snapshot().torque[1] == effort)
    assert node.plant.inputs.refused == 0


def test_in_lockstep_a_stamp_from_before_1970_is_an_old_one(ros):
    ros.differential('lsd_ode', mode='lockstep')
    joints = ros.listen(JointState, JOINTS)
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    publisher = ros.publisher(JointState, TORQUES)
    for effort, stamp in ((1, 10**9), (2, -10**9), (3, 10**9), (4, 2 * 10**9)):
        publisher.publish(torques(['carrier'], [effort], stamp))
    ros.until(lambda: joints and joints[-1].effort[0] == 4.0)
    assert [message.effort[0] for message in joints] == [1.0, 4.0]
    ros.until(lambda: told(diagnostics, 'torques')[2].get('refused messages') == '2')


def test_in_lockstep_a_stamp_of_the_far_future_holds_until_a_reset(ros):
    from std_srvs.srv import Trigger
    node = ros.differential('lsd_ode', mode='lockstep')
    joints = ros.listen(JointState, JOINTS)
    publisher = ros.publisher(JointState, TORQUES)
    publisher.publish(torques(['carrier'], [1], 2 * 10**18))
    publisher.publish(torques(['carrier'], [2], 10**9))
    ros.until(lambda: node.plant.inputs.refused == 1 and joints)
    assert [message.effort[0] for message in joints] == [1.0]
    ros.call(Trigger, '/differential/reset')
    publisher.publish(torques(['carrier'], [3], 10**9))
    ros.until(lambda: joints[-1].effort[0] == 3.0)


# Inputs that come and go


def test_without_any_input_it_stays_at_rest_and_says_so(ros):
    node = ros.differential('lsd_ode')
    joints = ros.listen(JointState, JOINTS)
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    ros.until(lambda: len(joints) > 100 and diagnostics)
    assert not any(number for message in joints
                   for number in (*message.velocity, *message.position, *message.effort))
    level, message, values = told(diagnostics, 'torques')
    assert (level, message) == (DiagnosticStatus.OK, 'no torque yet')
    assert values['without any torque yet'] == 'carrier, front, rear'
    assert node.simulation.snapshot().power_flow == 1


def test_an_input_that_stops_is_stale_and_one_that_comes_back_is_not(ros, steady):
    node = ros.differential(rate=200.0, torque_timeout=0.2)
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    publisher = ros.publisher(Float64, '/differential/torque/left')

    def torque_after_ticks(count):
        for _ in range(count):
            steady.tick(node)
        return node.simulation.snapshot().torque[1]

    publisher.publish(Float64(data=5.0))
    ros.until(lambda: torque_after_ticks(1) == 5.0)
    assert torque_after_ticks(40) == 5.0
    assert torque_after_ticks(1) == 0.0
    ros.until(lambda: told(diagnostics, 'torques')[2].get('stale') == 'left')
    level, message, _ = told(diagnostics, 'torques')
    assert level == DiagnosticStatus.WARN and 'too old' in message
    publisher.publish(Float64(data=6.0))
    ros.until(lambda: torque_after_ticks(1) == 6.0)
    ros.until(lambda: told(diagnostics, 'torques')[:2] == (DiagnosticStatus.OK, 'fine'))


# Subscribers that do not listen


@pytest.mark.parametrize('reliability', ['RELIABLE', 'BEST_EFFORT'])
def test_a_stopped_and_a_slow_subscriber_hold_no_tick_up(ros, steady, listeners, reliability):
    node = ros.differential(rate=500.0)
    stopped, slow = listeners(reliability, 0.0), listeners(reliability, 0.2)

    def both_hear():
        steady.tick(node)
        return all('heard' in process.output for process in (stopped, slow))
    ros.until(both_hear)
    stopped.send_signal(signal.SIGSTOP)
    # far more than any queue holds; a publisher that waits, does so for 0.1 s a message
    ticks = node.simulation.ticks + 1000
    steady.passes(1000 / 500)
    ros.until(lambda: node.simulation.ticks == ticks)
    assert node.pacer.missed == 0


def test_in_lockstep_a_stopped_subscriber_holds_no_tick_up_even_when_its_queue_is_full(
        ros, listeners, monkeypatch):
    assert LOCKSTEP_OUTPUT_QOS.depth == 10_000   # in full in test/long
    monkeypatch.setattr('dm_ros.ros.topics.LOCKSTEP_OUTPUT_QOS', QoSProfile(depth=500))
    fill_the_queue_of_a_stopped_subscriber(ros, listeners, 500)


def fill_the_queue_of_a_stopped_subscriber(ros, listeners, depth):
    """Make ticks in lockstep, far more than the queue of the node for a subscriber holds."""
    differential = ros.differential('lsd_ode', mode='lockstep')
    stopped = listeners('RELIABLE', 0.0)
    publisher = ros.publisher(JointState, TORQUES, depth=2000)
    message = torques(['carrier'], [1.0])
    ros.until(differential.is_connected)
    publisher.publish(message)
    stopped.says('heard')
    stopped.send_signal(signal.SIGSTOP)
    sent = 1
    while sent < depth + 1000:
        for _ in range(500):
            publisher.publish(message)
        sent += 500
        ros.until(lambda sent=sent: differential.simulation.ticks == sent)


# Parameters


@pytest.mark.parametrize('variant, values', [
    ('symmetric_ode', {'symmetric.efficiency.final_drive': 5e-324,
                       'symmetric.efficiency.carrier_bearing': 0.4}),
    ('symmetric_dae', {'symmetric.efficiency.final_drive': 5e-324}),
    ('lsd_ode', {'lsd.efficiency.front_mesh': 5e-324, 'lsd.efficiency.carrier_bearing': 0.4,
                 'lsd.pressure_angle': 0.0}),
    ('lsd_dae', {'lsd.crown_radius.front': 5e-324, 'lsd.pressure_angle': 0.0})])
def test_numbers_at_the_edge_of_what_is_allowed_are_refused_or_borne(ros, variant, values):
    node = ros.differential(variant, torque_timeout=0.0)
    joints = ros.listen(JointState, JOINTS)
    before = node.simulation.parameters
    result, *_ = ros.call(SetParameters, '/differential/set_parameters', parameters=[
        Parameter(name, value=value).to_parameter_msg()
        for name, value in values.items()]).results
    assert result.successful or result.reason and node.simulation.parameters == before
    ros.publisher(JointState, TORQUES).publish(torques(node.simulation.inputs, (50, -20, -25)))
    ros.until(lambda: sum(any(message.effort) for message in joints) > 10)
    assert all(map(math.isfinite, (*joints[-1].velocity, *joints[-1].position)))


def test_a_change_in_the_middle_of_a_locked_clutch_leaves_it_locked_and_moves_no_shaft(
        ros, steady):
    node = ros.differential('lsd_ode', torque_timeout=0.0)
    joints = ros.listen(JointState, JOINTS)
    ros.publisher(JointState, TORQUES).publish(
        torques(('carrier', 'front', 'rear'), (100, -38, -58)))

    def turns():
        steady.tick(node, joints)
        return joints[-1].velocity[0] > 5.0
    ros.until(turns)
    for preload in (60.0, 100.0, 80.0):
        results = ros.call(SetParameters, '/differential/set_parameters', parameters=[
            Parameter(name, value=value).to_parameter_msg() for name, value in (
                ('lsd.clutch.rear.preload', preload),
                ('lsd.clutch.front.friction_coefficient', preload / 1000))]).results
        assert all(result.successful for result in results)
        for _ in range(20):
            steady.tick(node, joints)
    speeds = [message.velocity for message in joints if message.effort[0] == 100.0]
    assert all(abs(front - rear) < 0.1 for _, front, rear, _ in speeds)
    # the torques alone make 0.33 rad/s in a tick
    assert all(0.0 < after[0] - before[0] < 0.4 for before, after in zip(speeds, speeds[1:]))
    assert node.simulation.parameters.N_2 == 80.0


# Clocks


class ClocksNobodyCanSet:
    """The module ``time`` without the clocks that follow system time."""

    def __getattr__(self, name):
        assert name in ('sleep', 'monotonic', 'monotonic_ns', 'perf_counter',
                        'perf_counter_ns', 'clock_gettime_ns', 'CLOCK_MONOTONIC'), name
        return getattr(time, name)


def test_real_time_is_paced_by_a_clock_that_nobody_can_set(ros, monkeypatch):
    monkeypatch.setattr(loops, 'time', ClocksNobodyCanSet())
    control, pacer = Control(), Pacer(1e6)

    def tick():
        if pacer.ticks == 20:
            control.stopping.set()
    follow_steady_clock(control, pacer, tick)
    assert pacer.ticks == 20
    node = ros.differential()
    assert [timer.clock.clock_type for timer in node.timers] == [ClockType.STEADY_TIME]
    ros.until(lambda: node.simulation.ticks > 20)


def test_every_test_that_the_table_of_faults_names_exists():
    page = (ROOT / 'doc' / 'faults.md').read_text()
    named = set(re.findall(r'`(test_\w+)`', page))
    there = {node.name for path in (ROOT / 'test').rglob('test_*.py')
             for node in ast.walk(ast.parse(path.read_text()))
             if isinstance(node, ast.FunctionDef)}
    assert named and not named - there
    rows = [line for line in page.splitlines() if line.startswith('| ') and '---' not in line]
    assert all('`test_' in line.split('|')[-2] for line in rows if not line.startswith('| fault'))
