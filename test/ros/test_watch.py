# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""``watch`` beside nodes over real topics: what it tells is what they publish."""

import signal
import threading
import time

from pages import ask, Page, stamp_of
from processes import command, Forked
import pytest
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

from dm_ros.mechanism.variants import MECHANISMS
from dm_ros.ros.messages import LOCKSTEP_OUTPUT_QOS
from dm_ros.watch.ticks import LONGEST_GAP


@pytest.mark.parametrize('variant', ['symmetric_ode', 'lsd_ode'])
def test_the_page_has_the_numbers_of_the_topics(ros, page, variant):
    shaft = MECHANISMS[variant.split('_')[0]].outputs[0]
    ros.differential(variant, rate=100.0, **{f'initial_velocity__{shaft}': 5.0})
    heard = {topic: ros.listen(JointState, f'/differential/{topic}')
             for topic in ('joint_states', 'internal_moments')}
    it = page()
    ros.until(lambda: it.variant == variant and it.now)
    seen = []
    ros.until(lambda: seen.append(it.now) or len({now['stamp'] for now in seen}) > 5)
    for now in seen:
        joints, moments = (next(m for m in messages if abs(stamp_of(m) - now['stamp']) < 1e-4)
                           for messages in heard.values())
        for name, array in (('position', joints.position), ('velocity', joints.velocity),
                            ('torque', joints.effort), ('moment', moments.effort)):
            assert now[name] == list(array), name
    assert it.now['flow'] in (1.0, -1.0)


def test_in_lockstep_the_buttons_make_ticks_and_the_page_says_how_it_runs(ros, page):
    ros.differential('lsd_ode', mode='lockstep', rate=1000.0)
    it = page('--control')
    ros.until(lambda: it.variant == 'lsd_ode' and it.last['scene']['mode'] == 'lockstep')
    heard = ros.listen(JointState, '/differential/joint_states', LOCKSTEP_OUTPUT_QOS)
    assert it.ask(do='set', values={'carrier': 40.0})[0] == 200
    assert not heard   # a slider alone makes no tick
    for count in (1, 100):
        before = len(heard)
        answer = threading.Thread(target=it.ask, kwargs={'do': 'ticks', 'count': count})
        answer.start()
        ros.until(lambda: len(heard) == before + count and not answer.is_alive())  # noqa: B023
    assert {message.effort[0] for message in heard} == {40.0}

    def is_shown():   # by best effort: of a burst the end may be lost, until the next tick
        if it.now.get('stamp', 0.0) > 0.05:
            return True
        assert it.ask(do='ticks', count=1)[0] == 200
        return False

    def shown():
        return [message for message in heard
                if message.header.stamp.nanosec * 1e-9 == pytest.approx(it.now['stamp'])]

    ros.until(is_shown)
    ros.until(shown)
    assert it.now['velocity'] == list(shown()[0].velocity)
    assert it.ask(do='ticks', count=0)[0] == 400


def test_it_waits_for_a_node_and_finds_the_next_one_of_another_variant(ros, page):
    it = page()
    ros.until(lambda: it.last.get('scene') == {'node': '/differential', 'refusal': None})
    for variant in ('lsd_dae', 'symmetric_dae'):
        with Forked(command('differential'), '--ros-args', '-p', f'variant:={variant}') as node:
            ros.until(lambda: it.variant == variant and it.now)  # noqa: B023
            assert len(it.now['velocity']) == len(it.last['scene']['shafts'])
            ros.until(lambda: it.last.get('diagnostics'))
            assert {status['name'] for status in it.last['diagnostics']} == {
                'loop', 'torques', 'connections', 'energy'}
            node.ended(signal.SIGINT)
            ros.until(lambda: it.variant is None)


def test_a_node_that_was_killed_is_replaced_at_once(ros, page):
    with Forked(command('differential'), '--ros-args', '-p', 'variant:=lsd_dae') as node:
        it = page()
        ros.until(lambda: it.variant == 'lsd_dae' and it.now)
        node.ended(signal.SIGKILL)   # for DDS it is there for long
    with Forked(command('differential'), '--ros-args', '-p', 'variant:=symmetric_ode'):
        ros.until(lambda: it.variant == 'symmetric_ode' and it.now)


def test_a_changed_parameter_changes_the_drawing(ros, page):
    node = ros.differential()
    it = page()
    ros.until(lambda: it.now and it.last['scene']['gears']['count'] == 2)
    node.set_parameters([Parameter('symmetric.satellite_count', value=4)])
    ros.until(lambda: it.last['scene']['gears']['count'] == 4)


def test_a_reset_in_simulated_time_empties_the_strips(ros, page):
    node = ros.differential(mode='lockstep')
    it = page('--control')
    ros.until(lambda: it.variant and it.last.get('viewer'))
    for _ in range(30):   # a busy machine may lose the last of some
        assert ask(ros, it, do='ticks', count=10)[1]['success']
    ros.until(lambda: it.now.get('stamp', 0.0) > 1.0 and len(it.rows) > 10)
    assert ask(ros, it, do='reset')[1]['success'] and node.simulation.ticks == 0
    ros.until(lambda: it.rows and it.now['stamp'] == 0.0)
    assert [row[0] for row in it.rows if row] == [0.0]


def test_a_slider_goes_out_again_and_again_and_ends_with_its_page(ros, page):
    node = ros.differential('lsd_ode', joint_prefix='rear_', torque_timeout=0.1)
    it = page('--control')
    ros.until(lambda: it.now and it.last.get('viewer'))
    messages = []
    ros.node.create_subscription(JointState, '/differential/torques', messages.append,
                                 QoSProfile(depth=1000))
    assert ask(ros, it, do='set', values={'front': 7.0, 'rear_clutch': 300})[0] == 200
    ros.until(lambda: len(messages) > 20)
    assert {tuple(message.name) for message in messages} == {('rear_front', 'rear_rear_clutch')}
    assert {tuple(message.effort) for message in messages} == {(7.0, 300.0)}
    ros.until(lambda: it.now['torque'][1] == 7.0 and it.now['force'] == [0.0, 300.0])
    assert it.last['commands'] == {'front': 7.0, 'rear_clutch': 300.0}
    assert not node.plant.inputs.refused
    it.close()
    ros.until(lambda: list(messages[-1].effort) == [0.0, 0.0])
    ros.until(lambda: node.plant.inputs.in_force(node.simulation.ticks) == (0.0,) * 5)
    before = len(messages)
    ros.until(lambda: node.plant.ticks > 20)
    assert not [m for m in messages[before:] if any(m.effort)]


def test_what_was_set_is_released_with_the_command_itself(ros, start):
    node = ros.differential(torque_timeout=0.0)   # it would hold for ever
    process, port = start('--control')
    it = Page(port)
    ros.until(lambda: it.now and it.last.get('viewer'))
    assert ask(ros, it, do='set', values={'pinion': 3.0})[0] == 200
    ros.until(lambda: it.now['torque'][3] == 3.0)
    process.send_signal(signal.SIGTERM)
    ros.until(lambda: process.returncode is not None)
    assert process.returncode == 0
    ros.until(lambda: node.plant.inputs.in_force(node.simulation.ticks) == (0.0,) * 3)


def test_a_speed_port_takes_a_speed(ros, page):
    node = ros.differential(port__left__kind='speed')
    it = page('--control')
    ros.until(lambda: it.now and it.last.get('viewer'))
    assert ask(ros, it, do='set', values={'left': 4.0, 'pinion': 1.0})[0] == 200
    ros.until(lambda: abs(it.now['velocity'][1] - 4.0) < 0.1)
    assert ask(ros, it, do='release')[0] == 200
    ros.until(lambda: node.plant.inputs.in_force(node.simulation.ticks)[1] is None)
    assert not node.plant.inputs.refused


def test_pause_step_and_continue(ros, page):
    node = ros.differential()
    it = page('--control')
    ros.until(lambda: it.now and it.last.get('viewer'))
    assert ask(ros, it, do='step') == (
        200, {'success': False, 'message': 'only while paused, see ~/pause'})
    assert ask(ros, it, do='pause') == (200, {'success': True, 'message': 'paused'})
    ros.until(lambda: any(status['message'] == 'paused' for status in it.last['diagnostics']))
    paused = time.monotonic()
    ros.until(lambda: time.monotonic() - paused > 2 * LONGEST_GAP)
    ticks = node.plant.ticks
    assert ask(ros, it, do='step')[1]['success'] and node.plant.ticks == ticks + 1
    position = node.simulation.snapshot().position
    ros.until(lambda: it.now['position'] == list(position))
    assert ask(ros, it, do='continue')[1]['success']
    ros.until(lambda: node.plant.ticks > ticks + 5)
    ros.until(lambda: None in it.rows)   # no line goes across the pause


def test_commands_need_a_node(page, ros):
    it = page('--control')
    ros.until(lambda: it.last.get('viewer') and 'scene' in it.last)
    assert it.ask(do='set', values={'pinion': 1.0})[0] == 409
    assert it.ask(do='reset')[1] == {'success': False, 'message': 'there is no node'}


def test_without_control_nothing_goes_to_the_node(ros, page):
    ros.differential()
    it = page()
    ros.until(lambda: it.now and it.last.get('viewer'))
    assert it.ask(do='reset')[0] == 403
    assert not ros.node.get_publishers_info_by_topic('/differential/torques')


def test_a_node_in_a_namespace_is_found_by_its_name(ros, page):
    ros.differential(arguments=['--ros-args', '-r', '__ns:=/rear'])
    for arguments in (['--node', '/rear/differential'], ['--ros-args', '-r', '__ns:=/rear']):
        it = page(*arguments)
        ros.until(lambda: it.now and it.last['scene']['node'] == '/rear/differential')  # noqa: B023


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize('with_node', [False, True])
def test_a_signal_ends_it_with_zero_also_with_viewers(ros, start, number, with_node):
    if with_node:
        ros.differential()
    process, port = start()
    it = Page(port)
    ros.until(lambda: it.now if with_node else it.last.get('scene'))
    process.send_signal(number)
    ros.until(lambda: process.returncode is not None)
    assert process.returncode == 0 and process.errors == ''


@pytest.mark.parametrize('arguments, words', [
    ([], ''), (['--control'], ' and can command the node')])
def test_it_says_who_reaches_a_page_that_is_not_for_this_machine_alone(ros, arguments, words):
    with Forked(command('watch'), '--port', 0, '--host', '0.0.0.0', *arguments) as process:
        process.says('password\n')
        assert process.output.splitlines()[1] == (
            f'everybody who reaches 0.0.0.0 sees this page{words}, without a password')


def test_a_port_that_is_taken_ends_it_with_two_and_one_line(start):
    _, port = start()
    with Forked(command('watch'), '--port', port) as second:
        assert second.ended() == 2
        assert second.errors == f'watch: error: port {port} of 127.0.0.1: Address already in use\n'


@pytest.mark.parametrize('arguments, words', [
    (['--port', '70000'], '70000 must be in [0, 65535]'), (['--port', 'x'], '--port'),
    (['--host', 'no.such.host.invalid'], 'port 8350 of no.such.host.invalid: '),
    *((['--node', name, '--port', '0'],
       f'watch: error: --node: {name!r} is not the name of a node, such as differential or '
       '/rear/differential\n') for name in ('a-b', '', 'a//b', '1a'))])
def test_a_bad_command_line_ends_it_with_two(ros, arguments, words):
    with Forked(command('watch'), *arguments) as process:
        assert process.ended() == 2
        assert words in process.errors and 'Traceback' not in process.errors
