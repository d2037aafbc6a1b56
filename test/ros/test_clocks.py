# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Whose time it is: the steady clock faster or slower, and another simulator's /clock."""

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import pytest
from rcl_interfaces.srv import SetParameters
import rclpy
from rclpy.parameter import Parameter
from reports import told
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger


class Simulator:
    """Another simulator, whose clock the test sets."""

    def __init__(self, ros, node=None):
        self.publisher = (node or ros.node).create_publisher(Clock, '/clock', 10)
        self.ros = ros

    def show(self, nanoseconds, node, ticks):
        """Show a time until the node has made so many ticks."""
        message = Clock(clock=Time(sec=nanoseconds // 10**9, nanosec=nanoseconds % 10**9))

        def done():
            self.publisher.publish(message)
            # the loop has seen it: its next tick is due within a period from then
            seen = 0 < node.pacer.due - nanoseconds <= node.pacer.period
            return seen and node.simulation.ticks == ticks
        self.ros.until(done)


@pytest.fixture(params=['differential', 'driveline'])
def start(ros, request):
    """Return what starts a node of either kind."""
    return getattr(ros, request.param)


@pytest.fixture
def follower(ros, start):
    node = start(rate=100.0, use_sim_time=True)
    return node, Simulator(ros)


def test_it_follows_another_clock_tick_by_tick_also_in_leaps(follower):
    node, simulator = follower
    simulator.show(10**9, node, 0)
    simulator.show(10**9 + 10_000_000, node, 1)
    simulator.show(10**9 + 15_000_000, node, 1)
    simulator.show(10**9 + 100_000_000, node, 10)
    assert node.simulation.time == pytest.approx(0.1)


def test_a_clock_that_stands_still_pauses_it(ros, follower):
    node, simulator = follower
    simulator.show(10**9, node, 0)
    simulator.show(10**9 + 50_000_000, node, 5)
    before = node.get_clock().now().nanoseconds
    reports = ros.listen(DiagnosticArray, '/diagnostics')
    ros.until(lambda: len(reports) == 4)   # more than a quarter of a second of real time
    assert (node.simulation.ticks, node.get_clock().now().nanoseconds) == (5, before)


def test_a_clock_that_jumps_back_makes_no_negative_step_and_goes_on(follower):
    node, simulator = follower
    simulator.show(50 * 10**9, node, 0)
    simulator.show(50 * 10**9 + 30_000_000, node, 3)
    simulator.show(2 * 10**9, node, 3)
    simulator.show(2 * 10**9 + 20_000_000, node, 5)
    assert node.simulation.time == pytest.approx(0.05)


def test_a_clock_that_jumps_an_hour_ahead_is_not_caught_up_with(follower):
    node, simulator = follower
    simulator.show(10**9, node, 0)
    simulator.show(3601 * 10**9 + 5_000_000, node, 1)
    assert node.pacer.missed == 359_999
    simulator.show(3601 * 10**9 + 20_000_000, node, 3)


def test_stamps_are_those_of_the_followed_clock(ros, follower):
    node, simulator = follower
    joints = ros.listen(JointState, f'/{node.get_name()}/joint_states')
    simulator.show(7 * 10**9, node, 0)
    simulator.show(7 * 10**9 + 20_000_000, node, 2)
    ros.until(lambda: len(joints) == 2)
    # a leap of two ticks: each has its own
    assert [m.header.stamp for m in joints] == [
        Time(sec=7, nanosec=10_000_000), Time(sec=7, nanosec=20_000_000)]


def test_it_cannot_follow_and_drive_the_clock_at_once(start):
    with pytest.raises(ValueError, match='publish_clock'):
        start(use_sim_time=True, publish_clock=True)


def test_without_a_clock_it_says_that_it_waits_and_for_whom(ros, capfd):
    node = ros.differential(use_sim_time=True)
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    ros.until(lambda: told(diagnostics, 'loop')[:2] == (
        DiagnosticStatus.WARN, 'waiting for /clock'))
    assert told(diagnostics, 'loop')[2]['/clock driven by'] == 'nobody'
    assert ('waiting for /clock: use_sim_time is set, and nobody publishes it'
            in capfd.readouterr().err)
    simulator = Simulator(ros)
    ros.until(lambda: told(diagnostics, 'loop')[2]['/clock driven by'] == '/user')
    assert told(diagnostics, 'loop')[1] == 'waiting for /clock'
    simulator.show(10**9, node, 0)
    ros.until(lambda: told(diagnostics, 'loop')[:2] == (DiagnosticStatus.OK, 'running'))


def test_when_the_clock_has_gone_it_waits_again(ros):
    node = ros.differential(use_sim_time=True)
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    simulator = Simulator(ros)
    simulator.show(10**9, node, 0)
    ros.until(lambda: told(diagnostics, 'loop')[1] == 'running')
    ros.node.destroy_publisher(simulator.publisher)
    ros.until(lambda: told(diagnostics, 'loop')[:2] == (
        DiagnosticStatus.WARN, 'waiting for /clock'))


@pytest.mark.parametrize('parameters', [{'use_sim_time': True}, {'publish_clock': True}])
def test_two_publishers_of_the_clock_are_named_until_one_goes(ros, capfd, parameters):
    ros.differential(**parameters)
    Simulator(ros)
    other = rclpy.create_node('other', context=ros.context)
    Simulator(ros, other)
    first = '/user' if 'use_sim_time' in parameters else '/differential'
    names = {'/other', '/user', first}
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    ros.until(lambda: told(diagnostics, 'loop')[2].get('/clock driven by')
              == ', '.join(sorted(names)))
    level, message, _ = told(diagnostics, 'loop')
    assert level == DiagnosticStatus.WARN and 'several publishers drive /clock' in message
    assert 'several publishers drive /clock: ' in capfd.readouterr().err
    other.destroy_node()
    if first == '/user':
        ros.until(lambda: told(diagnostics, 'loop')[2]['/clock driven by'] == first
                  and 'several' not in told(diagnostics, 'loop')[1])


def test_a_clock_that_goes_back_is_told_with_the_times(ros, follower, capfd):
    node, simulator = follower
    name = f'/{node.get_name()}'
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    simulator.show(50 * 10**9, node, 0)
    simulator.show(2 * 10**9 + 1_000_000, node, 0)
    ros.until(lambda: any(told([report], 'loop', name)[:2] == (
        DiagnosticStatus.WARN, '/clock goes back') for report in diagnostics))
    assert '/clock goes back: from 50.000 s to 2.001 s\n' in capfd.readouterr().err
    ros.until(lambda: told(diagnostics, 'loop', name)[:2] == (DiagnosticStatus.OK, 'running'))


@pytest.mark.parametrize('mode', ['realtime', 'lockstep'])
@pytest.mark.parametrize('follows', [True, False])
def test_use_sim_time_is_refused_while_it_runs_with_the_reason(ros, follows, mode):
    node = ros.differential(use_sim_time=follows, mode=mode)

    def answer(value, **others):
        return ros.call(SetParameters, '/differential/set_parameters', parameters=[
            Parameter(name, value=v).to_parameter_msg()
            for name, v in {'use_sim_time': value, **others}.items()]).results
    refused = answer(not follows, torque_limit=7.0)
    assert not any(result.successful for result in refused)
    assert refused[0].reason.startswith('use_sim_time: it cannot be changed while it runs')
    assert node.get_parameter('use_sim_time').value is follows
    assert node.plant.settings.torque_limit == 1e5
    assert (node.get_clock().ros_time_is_active is follows)
    assert all(result.successful for result in answer(follows, torque_limit=7.0))
    assert node.plant.settings.torque_limit == 7.0


def test_a_driven_clock_goes_with_the_ticks_in_real_time_and_paused(ros, start, steady):
    node = start(rate=200.0, publish_clock=True)
    name = node.get_name()
    joints = ros.listen(JointState, f'/{name}/joint_states')
    clock = ros.listen(Clock, '/clock')
    for _ in range(10):
        steady.tick(node, joints, clock)
    ros.call(SetBool, f'/{name}/pause', data=True)
    assert ros.call(Trigger, f'/{name}/step').success
    ros.until(lambda: len(joints) == len(clock) == 11)
    assert [m.clock.sec * 10**9 + m.clock.nanosec for m in clock] == [
        n * 5_000_000 for n in range(1, 12)]
    assert [m.header.stamp for m in joints] == [m.clock for m in clock]


@pytest.mark.parametrize('factor', [0.1, 5.0])
def test_the_real_time_factor_is_the_speed_of_simulated_time(ros, steady, factor):
    node = ros.differential(rate=100.0, real_time_factor=factor)
    steady.passes(2.0)
    ros.until(steady.stands)
    assert node.simulation.ticks == 200 * factor
    assert node.simulation.time == pytest.approx(2.0 * factor)
    assert node.pacer.missed == 0
