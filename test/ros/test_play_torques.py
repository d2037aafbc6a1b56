# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""``play_torques`` over real topics, as a process of its own."""

from pathlib import Path
import signal

import pytest
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

from dm_ros.mechanism.variants import MECHANISMS
from dm_ros.tools.play_torques import load, parser

PRESETS = Path(__file__).parents[2] / 'config' / 'presets'


def listen(ros, topic='/differential/torques'):
    """Return a list that fills with the messages of a topic."""
    messages = []
    ros.node.create_subscription(JointState, topic, messages.append, QoSProfile(depth=1000))
    return messages


@pytest.mark.parametrize('arguments, profile, names', [
    ([], 'symmetric', ['pinion', 'left', 'right']),
    (['--profile', 'lsd'], 'lsd', ['carrier', 'front', 'rear']),
    (['--variant', 'lsd_dae'], 'lsd', ['carrier', 'front', 'rear']),
    (['--params', PRESETS / 'centre_40_60.yaml'], 'lsd', ['carrier', 'front', 'rear'])])
def test_plays_a_built_in_load_and_ends_with_zero(ros, play, arguments, profile, names):
    messages = listen(ros)
    process = play(*arguments, '--rate', 200, '--duration', 0.5, '--wait', 60)
    ros.until(lambda: process.returncode is not None)
    ros.until(lambda: messages and not any(messages[-1].effort))
    assert process.returncode == 0
    *played, last = messages
    expected = [list(MECHANISMS[profile].load(n / 200)) for n in range(100)]
    # a machine that is late skips messages, so not every one of the hundred must be there
    assert len(played) <= 100 and list(played[0].effort) == expected[0]
    assert all(list(message.effort) in expected for message in played)
    assert all(message.name == names for message in messages)
    assert list(last.effort) == [0.0, 0.0, 0.0]


def test_warns_of_a_file_for_another_node_and_of_one_for_the_other_mechanism(play, tmp_path):
    file = tmp_path / 'node.yaml'
    file.write_text('/other: {ros__parameters: {variant: lsd_ode}}')
    options = '--wait', 0, '--duration', 0.1, '--params'
    other, lsd = play(*options, file), play(*options, PRESETS.parent / 'lsd.yaml')
    assert other.ended() == lsd.ended() == 0
    assert f'warning: {file}: nothing in it is for /differential, but for /other' in other.errors
    assert 'play_torques: warning: 33 parameters of another mechanism' in lsd.errors


def test_plays_forces_where_the_file_has_any_and_ends_with_open_clutches(ros, play, tmp_path):
    file = tmp_path / 'torques.csv'
    file.write_text('time,carrier,front,rear,rear_clutch\n0,30,-10,-15,500\n0.4,0,0,0,0\n')
    messages = listen(ros)
    process = play('--variant', 'lsd_ode', '--torques', file, '--wait', 60)
    ros.until(lambda: process.returncode is not None)
    ros.until(lambda: messages and not any(messages[-1].effort))
    *played, last = messages
    assert process.returncode == 0 and played
    assert all(list(message.effort) == [30.0, -10.0, -15.0, 0.0, 500.0] for message in played)
    assert last.name == ['carrier', 'front', 'rear', 'front_clutch', 'rear_clutch']
    assert list(last.effort) == [0.0] * 5


def test_plays_a_file_to_its_end(ros, play, tmp_path):
    rows = [(float(n), n + 0.25, n + 0.5) for n in range(1, 31)]   # pinion, left, right
    file = tmp_path / 'torques.csv'
    file.write_text('right,time,left,pinion\n' + ''.join(
        f'{right},{n / 50},{left},{pinion}\n' for n, (pinion, left, right) in enumerate(rows)))
    arguments = ['--torques', str(file), '--wait', '60']
    played = load(parser().parse_args(arguments))
    assert [played.values_at(n) for n in range(played.count)] == [
        row for row in rows[:-1] for _ in range(2)]
    messages = listen(ros)
    process = play(*arguments)
    ros.until(lambda: process.returncode is not None)
    ros.until(lambda: messages and not any(messages[-1].effort))
    assert process.returncode == 0
    *played, last = dict.fromkeys(tuple(message.effort) for message in messages)
    # a machine that is late passes rows over
    assert played[0] == rows[0] and played == [row for row in rows[:-1] if row in played]
    assert last == (0.0, 0.0, 0.0)


def test_a_log_is_played_from_its_begin_and_what_it_loses_is_told(tmp_path, capsys):
    file = tmp_path / 'torques.csv'
    file.write_text('time,gear,pinion,left,right\n' + ''.join(
        f'{1748873654 + n / 1000:.3f},D,{n},-1,-1\n' for n in range(101)))
    arguments = parser().parse_args(['--torques', str(file), '--ignore-columns', 'gear'])
    played = load(arguments)
    assert [played.values_at(n)[0] for n in range(played.count)] == list(range(0, 100, 10))
    begin, lost = capsys.readouterr().err.splitlines()
    assert begin.startswith(f'play_torques: {file}: time 0 is 1748873654.0 s in the file')
    assert lost == (f'play_torques: {file}: 90 of 101 rows are never in force in ticks of '
                    '0.01 s, --rate 1000 takes all')


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_unloads_and_ends_cleanly(ros, play, number):
    messages = listen(ros)
    process = play('--wait', 60)
    ros.until(lambda: len(messages) > 5)
    assert process.ended(number) == 0 and 'Traceback' not in process.errors
    ros.until(lambda: not any(messages[-1].effort))


@pytest.mark.parametrize('arguments', [
    ['--node', '/my/axle'],
    ['--node', 'axle', '--ros-args', '-r', '__ns:=/my'],
    ['--ros-args', '-r', '__ns:=/my', '-r', 'differential/torques:=/my/axle/torques'],
    ['--ros-args', '-r', '/differential/torques:=/my/axle/torques']])
def test_the_topic_can_be_chosen(ros, play, arguments):
    messages = listen(ros, '/my/axle/torques')
    play('--wait', 60, *arguments)
    ros.until(lambda: len(messages) > 1)


def test_in_a_namespace_it_drives_the_differential_of_that_namespace(ros, play):
    there = [ros.differential(arguments=['--ros-args', '-r', f'__ns:=/{name}'])
             for name in ('front', 'rear')]
    states = listen(ros, '/rear/differential/joint_states')
    play('--wait', 60, '--ros-args', '-r', '__ns:=/rear')
    ros.until(lambda: states and abs(states[-1].velocity[states[-1].name.index('left')]) > 1.0)
    assert [node.plant.inputs.received > 0 for node in there] == [False, True]


@pytest.mark.parametrize('by_file', [False, True])
def test_plays_to_a_node_with_a_joint_prefix(ros, play, tmp_path, by_file):
    node = ros.differential('lsd_ode', joint_prefix='rear_',
                            arguments=['--ros-args', '-r', '__ns:=/car'])
    file = tmp_path / 'node.yaml'
    file.write_text('/car/differential: {ros__parameters: '
                    '{joint_prefix: rear_, variant: lsd_ode}}')
    process = play('--wait', 60, '--ros-args', '-r', '__ns:=/car', '--', *(
        ['--params', file] if by_file else ['--variant', 'lsd_ode', '--joint-prefix', 'rear_']))
    ros.until(lambda: node.plant.inputs.received > 10)
    assert node.plant.inputs.refused == 0 and 'warning' not in process.errors


def test_without_a_subscriber_it_warns_and_plays_all_the_same(ros, play):
    process = play('--wait', 0.1, '--duration', 0.1)
    assert process.ended() == 0
    assert '/differential/torques has no subscriber' in process.errors


def test_drives_the_node(ros, play):
    ros.differential()
    states = listen(ros, '/differential/joint_states')
    play('--wait', 60)
    ros.until(lambda: states and abs(states[-1].velocity[states[-1].name.index('left')]) > 1.0)


@pytest.mark.parametrize('arguments, part', [
    (['--torques', 'missing.csv'], 'missing.csv: No such file'),
    (['--node', 'no name'], 'topic name'),
    (['--rate', '0'], 'rate: 0.0 is not allowed, it must be in [0.1, 10000]'),
    (['--rate', '20000'], 'rate: 20000.0 is not allowed, it must be in [0.1, 10000]'),
    (['--duration', 'nan'], '--duration: nan must be in'),
    (['--profile', 'lsd', '--variant', 'lsd_ode'], 'not allowed with'),
    (['--params', 'missing.yaml'], 'missing.yaml: No such file'),
    (['--joint-prefix', ' '], "joint_prefix: ' ' is not allowed"),
    (['--what'], 'unrecognized arguments'),
    (['--ros-args', '-r', 'what'], "remap rule: '-r what'"),
    (['--ros-args', '--what'], '--what')])
def test_bad_arguments_end_it_with_one_line(play, arguments, part):
    process = play('--wait', 0, '--duration', 0.1, *arguments)
    assert process.ended() == 2
    *usage, error = process.errors.splitlines()
    assert part in error
    assert not usage or usage[0].startswith('usage:')


def test_a_load_for_another_variant_is_told_as_the_node_refuses_it(ros, play):
    ros.differential('lsd_ode')
    process = play('--variant', 'symmetric_ode', '--wait', 60, '--duration', 20)
    ros.until(lambda: 'refuses messages' in process.errors or process.returncode is not None)
    told = "/differential refuses messages: ~/torques: 'pinion' is not one of carrier, front, rear"
    assert told in process.errors
    assert process.errors.count('refuses messages') == 1
