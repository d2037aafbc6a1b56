# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Lockstep: a message is a tick and an answer, to the last bit."""

import itertools
import signal
import time
from types import SimpleNamespace

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from processes import command, Forked
import pytest
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Int8
from std_srvs.srv import SetBool, Trigger

from dm_ros import Simulation
from dm_ros.motion.models import LOSS_LAWS
from dm_ros.testing import lockstep, LockstepDifferential

BURNER = 'print("burning", flush=True)\nwhile True: pass'


def torques(*efforts, names=('carrier', 'front', 'rear'), stamp=0):
    message = JointState(name=list(names), effort=[float(effort) for effort in efforts])
    message.header.stamp = Time(sec=stamp // 10**9, nanosec=stamp % 10**9)
    return message


def load(n):
    """Return torques of a deterministic load that locks, slips and reverses."""
    return (300.0 - n % 400, -100.0 + n % 37, -150.0 + n % 91)


class Controller(Node):
    """Answers each joint state with the torques of the next tick."""

    def __init__(self, context, limit=None):
        super().__init__('controller', context=context)
        self.heard, self.limit = 0, limit
        self.torques = self.create_publisher(JointState, '/differential/torques', 100)
        self.states = self.create_subscription(
            JointState, '/differential/joint_states', self.answer, 100)

    def answer(self, message):
        self.heard += 1
        if self.limit is None or self.heard <= self.limit:
            T_0, T_1, T_2 = load(self.heard)
            self.torques.publish(torques(T_0 - message.velocity[0], T_1, T_2))


def test_each_message_is_one_tick_with_one_answer_of_each_kind(ros):
    node = ros.differential('lsd_ode', mode='lockstep', rate=500.0)
    joints = ros.listen(JointState, '/differential/joint_states')
    moments = ros.listen(JointState, '/differential/internal_moments')
    flow = ros.listen(Int8, '/differential/power_flow')
    stamped = ros.listen(JointState, '/differential/power_flow_stamped')
    publisher = ros.publisher(JointState, '/differential/torques')
    simulation = Simulation('lsd_ode', 1 / 500.0)
    for n in range(1, 101):
        publisher.publish(torques(*load(n)))
        ros.until(lambda n=n: len(joints) == len(moments) == len(flow) == len(stamped) == n)
        snapshot = simulation.step(load(n))
        assert tuple(joints[-1].velocity) == snapshot.velocity
        assert tuple(joints[-1].position) == snapshot.position
        assert tuple(moments[-1].effort) == snapshot.moment
        assert flow[-1].data == snapshot.power_flow
        assert stamped[-1].position[0] == snapshot.power_flow
        assert joints[-1].header == moments[-1].header == stamped[-1].header
        assert joints[-1].header.stamp.nanosec == n * 2_000_000
    assert node.simulation.ticks == 100


def test_a_burst_loses_nothing(ros):
    node = ros.differential('symmetric_ode', mode='lockstep')
    joints = ros.listen(JointState, '/differential/joint_states', depth=5000)
    publisher = ros.publisher(JointState, '/differential/torques', depth=5000)
    for n in range(2000):
        publisher.publish(torques(n, names=['pinion']))
    ros.until(lambda: len(joints) == 2000)
    assert [m.effort[3] for m in joints] == [float(n) for n in range(2000)]
    assert node.simulation.ticks == 2000


def test_missing_shafts_keep_their_torque_however_long(ros):
    ros.differential('lsd_ode', mode='lockstep', torque_timeout=0.01)
    joints = ros.listen(JointState, '/differential/joint_states')
    publisher = ros.publisher(JointState, '/differential/torques')
    publisher.publish(torques(1, 2, 3))
    for _ in range(50):
        publisher.publish(torques(5, names=['front']))
    publisher.publish(torques(names=[]))
    ros.until(lambda: len(joints) == 52)
    assert list(joints[-1].effort) == [1.0, 5.0, 3.0, 0.0]


def test_a_stamp_that_repeats_or_goes_back_is_refused_and_a_zero_stamp_is_none(ros):
    node = ros.differential('lsd_ode', mode='lockstep')
    joints = ros.listen(JointState, '/differential/joint_states')
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    publisher = ros.publisher(JointState, '/differential/torques')
    for effort, stamp in ((1, 0), (2, 100), (3, 100), (4, 50), (5, 0), (6, 101)):
        publisher.publish(torques(effort, names=['carrier'], stamp=stamp))
    ros.until(lambda: len(joints) == 4)
    assert [m.effort[0] for m in joints] == [1.0, 2.0, 5.0, 6.0]
    ros.until(lambda: diagnostics and any(
        pair.key == 'refused messages' and pair.value == '2'
        for status in diagnostics[-1].status for pair in status.values))
    assert node.simulation.ticks == 4


def test_a_refused_message_is_no_tick(ros):
    node = ros.differential('lsd_ode', mode='lockstep')
    joints = ros.listen(JointState, '/differential/joint_states')
    publisher = ros.publisher(JointState, '/differential/torques')
    publisher.publish(torques(1, float('inf'), names=['front', 'rear']))
    publisher.publish(torques(7, names=['front']))
    ros.until(lambda: joints)
    assert list(joints[0].effort) == [0.0, 7.0, 0.0, 0.0]
    assert node.simulation.ticks == 1


def test_paused_messages_wait_and_a_step_is_one_tick(ros):
    node = ros.differential('lsd_ode', mode='lockstep')
    joints = ros.listen(JointState, '/differential/joint_states')
    publisher = ros.publisher(JointState, '/differential/torques')
    publisher.publish(torques(1, 2, 3))
    ros.until(lambda: len(joints) == 1)
    ros.call(SetBool, '/differential/pause', data=True)
    publisher.publish(torques(4, 5, 6))
    assert ros.call(Trigger, '/differential/step').success
    ros.until(lambda: len(joints) == 2)
    assert list(joints[1].effort) == [1.0, 2.0, 3.0, 0.0]
    ros.call(SetBool, '/differential/pause', data=False)
    ros.until(lambda: len(joints) == 3)
    assert list(joints[2].effort) == [4.0, 5.0, 6.0, 0.0]
    assert node.simulation.ticks == 3


def test_after_a_reset_a_run_repeats_bit_for_bit(monkeypatch):
    monkeypatch.setattr(lockstep, 'LAST_ANSWER', 60.0)   # a slow machine may need it
    with LockstepDifferential('lsd_lagged', 1000.0) as vehicle:
        controller = vehicle.attach(Controller(vehicle.context))
        first = vehicle.run(seconds=0.5)
        vehicle.reset()
        controller.heard = 0
        again = vehicle.run(seconds=0.5)
    for name, values in first.columns.items():
        assert (values == again.columns[name]).all(), name


@pytest.mark.parametrize('variant', ['symmetric_ode', 'lsd_ode'])
def test_the_lockstep_run_is_the_direct_run_to_the_last_bit_under_load(variant):
    def law(heard, snapshot):
        T_0, T_1, T_2 = load(heard)
        return dict(zip(('carrier', 'front', 'rear'), (T_0 - snapshot.velocity[0], T_1, T_2)))

    with Forked(BURNER) as burner, LockstepDifferential(variant, 1000.0) as vehicle:
        burner.says('burning')
        names = vehicle.simulation.inputs
        controller = Controller(vehicle.context)
        if variant == 'symmetric_ode':
            controller.destroy_subscription(controller.states)

            def answer(message):
                controller.heard += 1
                controller.torques.publish(torques(*load(controller.heard), names=names))
            controller.states = controller.create_subscription(
                JointState, '/differential/joint_states', answer, 100)
        vehicle.attach(controller)
        record = vehicle.run(seconds=0.5)
    assert len(record) == 500
    simulation = Simulation(variant, 1e-3)
    snapshot = simulation.snapshot()
    for n in range(500):
        T = load(n + 1) if variant == 'symmetric_ode' else tuple(law(n + 1, snapshot).values())
        snapshot = simulation.step(T)
        assert tuple(record.columns[f'velocity.{shaft}'][n] for shaft in simulation.shafts) \
            == snapshot.velocity


@pytest.mark.parametrize('loss_law', LOSS_LAWS)
def test_the_node_runs_by_the_law_of_losses_that_is_asked_for(differential, loss_law):
    vehicle = differential('lsd_ode', parameters={'loss_law': loss_law})
    vehicle.attach(Controller(vehicle.context))
    record = vehicle.run(seconds=0.2)
    runs = {}
    for law in LOSS_LAWS:
        simulation, runs[law] = Simulation('lsd_ode', 1e-3, loss_law=law), []
        snapshot = simulation.snapshot()
        for n in range(1, 201):
            T_0, T_1, T_2 = load(n)
            snapshot = simulation.step((T_0 - snapshot.velocity[0], T_1, T_2))
            runs[law].append((*snapshot.velocity, *snapshot.moment))
    passive, paper = runs.values()
    assert passive[-1] != paper[-1]
    names = [f'velocity.{shaft}' for shaft in simulation.shafts]
    names += [f'moment.{moment}' for moment in simulation.moments]
    assert list(zip(*(record.columns[name] for name in names))) == runs[loss_law]


def test_a_law_of_losses_that_is_unknown_is_refused_and_named(differential):
    with pytest.raises(ValueError, match="loss_law: 'torsen' is not allowed.*passive, paper"):
        differential('lsd_ode', parameters={'loss_law': 'torsen'})


def test_a_run_ends_to_the_tick_and_says_so_when_nobody_answers(monkeypatch):
    seconds, waiting = itertools.count(), True

    def monotonic():
        """Return a time that goes on only while there is nothing to come."""
        return next(seconds) if waiting or vehicle.simulation.ticks == 7 else 0.0

    with LockstepDifferential('lsd_ode', 1000.0) as vehicle:
        monkeypatch.setattr(lockstep, 'time', SimpleNamespace(monotonic=monotonic))
        with pytest.raises(TimeoutError, match='nobody publishes'):
            vehicle.run(seconds=1.0)
        waiting = False
        vehicle.attach(Controller(vehicle.context, limit=7))
        with pytest.raises(TimeoutError, match='no tick for 10 s after 7 ticks'):
            vehicle.run(seconds=1.0)
        assert vehicle.simulation.ticks == 7


@pytest.mark.parametrize('effort, words', [
    ((1.0, float('inf'), 3.0), 'the torque on front is inf'),
    ((1.0, 2.0), '3 names but 2 efforts')])
def test_a_refused_answer_ends_the_run_at_once_with_its_words(effort, words):
    class Wrong(Controller):
        def answer(self, joints):
            if self.heard < 5:
                super().answer(joints)
            else:
                self.torques.publish(JointState(name=['carrier', 'front', 'rear'],
                                                effort=[float(value) for value in effort]))

    with LockstepDifferential('lsd_ode', 1000.0) as vehicle:
        controller = vehicle.attach(Wrong(vehicle.context))
        begin = time.monotonic()
        with pytest.raises(ValueError, match=f'refused an answer after 5 ticks: .*{words}'):
            vehicle.run(seconds=1.0)
        assert time.monotonic() - begin < lockstep.PATIENCE
        controller.heard = 0   # and it can go on
        assert len(vehicle.run(seconds=0.004)) == 4


@pytest.mark.parametrize('name, value', [('rate', 50.0), ('mode', 'realtime'), ('variant', 'x')])
def test_a_parameter_that_is_an_argument_is_refused(name, value):
    with pytest.raises(ValueError, match=f'parameters: {name} is not one of them here'):
        LockstepDifferential('lsd_ode', 1000.0, {name: value})


def test_a_node_of_another_context_is_refused_when_it_is_attached(ros):
    with LockstepDifferential('lsd_ode', 1000.0) as vehicle:
        stranger = Controller(ros.context)
        try:
            with pytest.raises(ValueError, match='controller was made in another ROS context'):
                vehicle.attach(Controller(vehicle.context), stranger)
        finally:
            stranger.destroy_node()


def test_a_reset_sets_off_a_controller_that_only_answers(ros):
    node = ros.differential('lsd_ode', mode='lockstep')
    joints = ros.listen(JointState, '/differential/joint_states')
    controller = Controller(ros.context, limit=20)
    ros.executor.add_node(controller)
    try:
        ros.until(lambda: node.is_connected())
        assert not joints
        ros.call(Trigger, '/differential/reset')
        ros.until(lambda: len(joints) == 21)   # the first is no tick
        assert node.simulation.ticks == 20
    finally:
        ros.executor.remove_node(controller)
        controller.destroy_node()


def test_a_run_ends_at_its_condition_and_goes_on():
    with LockstepDifferential('lsd_ode', 1000.0) as vehicle:
        vehicle.attach(Controller(vehicle.context))
        record = vehicle.run(seconds=9.0, until=lambda snapshot: snapshot.time >= 0.123)
        assert len(record) == vehicle.simulation.ticks == 123
        assert len(vehicle.run(seconds=0.2)) == 200
        assert len(vehicle.record) == 323
        whole = vehicle.record
    with LockstepDifferential('lsd_ode', 1000.0) as vehicle:
        vehicle.attach(Controller(vehicle.context))
        assert (vehicle.run(seconds=0.323).position['rear'] == whole.position['rear']).all()


def test_a_stopped_and_continued_process_misses_no_tick(ros):
    with Forked(command('differential'), '--ros-args', '-p', 'mode:=lockstep', '-p',
                'variant:=lsd_ode', '-p', 'rate:=1000.0') as process:
        heard = ros.listen(JointState, '/differential/joint_states', depth=5000)
        publisher = ros.publisher(JointState, '/differential/torques', depth=5000)
        # a reset publishes the state: when it is heard, so is what comes after it
        ros.until(lambda: ros.call(Trigger, '/differential/reset').success and heard)
        for n in range(1, 401):
            if n == 200:
                process.send_signal(signal.SIGSTOP)
            publisher.publish(torques(*load(n)))
            if n == 300:
                process.send_signal(signal.SIGCONT)
        ros.until(lambda: heard[-1].header.stamp == Time(nanosec=400_000_000))
        assert process.ended(signal.SIGTERM) == 0
    joints = [message for message in heard if message.header.stamp != Time()]
    assert len(joints) == 400
    simulation = Simulation('lsd_ode', 1e-3)
    for n, message in enumerate(joints, start=1):
        assert tuple(message.velocity) == simulation.step(load(n)).velocity


def test_the_clock_goes_with_the_ticks(ros):
    ros.differential('lsd_ode', mode='lockstep', rate=100.0, publish_clock=True)
    clock = ros.listen(Clock, '/clock')
    publisher = ros.publisher(JointState, '/differential/torques')
    for _ in range(5):
        publisher.publish(torques(1, 2, 3))
    ros.until(lambda: len(clock) == 5)
    assert [m.clock.nanosec for m in clock] == [n * 10_000_000 for n in range(1, 6)]


def test_shaft_topics_do_not_exist_in_lockstep(ros):
    def heard(node):
        """Return the topics of torques that a node subscribes to."""
        names = [name for name, _ in node.get_subscriber_names_and_types_by_node(
            node.get_name(), node.get_namespace())]
        return {name for name in names if 'torque' in name}

    assert heard(ros.differential('lsd_ode', mode='lockstep')) == {'/differential/torques'}
    assert heard(ros.differential('lsd_ode', arguments=['--ros-args', '-r', '__node:=free'])) == {
        '/free/torques', *(f'/free/torque/{shaft}' for shaft in ('carrier', 'front', 'rear'))}
