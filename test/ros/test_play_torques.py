# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""``play_torques`` over real topics, as a process of its own."""

import signal
import subprocess
import sys

import pytest
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

from dm_ros.mechanism.variants import MECHANISMS

TOOL = [sys.executable, '-m', 'dm_ros.tools.play_torques']


@pytest.fixture
def play(ros):
    """Return a function that starts the tool and returns the process, ended after the test."""
    processes = []

    def play(*arguments):
        process = subprocess.Popen([*TOOL, *map(str, arguments)], stderr=subprocess.PIPE,
                                   text=True)
        processes.append(process)
        return process
    yield play
    for process in processes:
        process.kill()
        process.communicate()


def listen(ros, topic='/differential/torques'):
    """Return a list that fills with the messages of a topic."""
    messages = []
    ros.node.create_subscription(JointState, topic, messages.append, QoSProfile(depth=1000))
    return messages


@pytest.mark.parametrize('arguments, profile, names', [
    ([], 'symmetric', ['pinion', 'left', 'right']),
    (['--profile', 'lsd'], 'lsd', ['carrier', 'front', 'rear']),
    (['--variant', 'lsd_dae'], 'lsd', ['carrier', 'front', 'rear'])])
def test_plays_a_built_in_load_and_ends_with_zero(ros, play, arguments, profile, names):
    messages = listen(ros)
    process = play(*arguments, '--rate', 200, '--duration', 0.5, '--wait', 60)
    ros.until(lambda: process.poll() is not None)
    ros.until(lambda: messages and not any(messages[-1].effort))
    assert process.returncode == 0
    *played, last = messages
    load = MECHANISMS[profile].load
    expected = [list(load(n / 200)) for n in range(100)]
    # a machine that is late skips messages, so not every one of the hundred must be there
    assert len(played) <= 100 and list(played[0].effort) == expected[0]
    assert all(list(message.effort) in expected for message in played)
    assert all(message.name == names for message in messages)
    assert list(last.effort) == [0.0, 0.0, 0.0]


def test_plays_a_file_to_its_end(ros, play, tmp_path):
    file = tmp_path / 'torques.csv'
    file.write_text('right,time,left,pinion\n3,0,2,1\n6,0.3,5,4\n9,0.6,8,7\n')
    messages = listen(ros)
    process = play('--torques', file, '--wait', 60)
    ros.until(lambda: process.poll() is not None)
    ros.until(lambda: messages and not any(messages[-1].effort))
    assert process.returncode == 0
    efforts = [tuple(message.effort) for message in messages]
    assert list(dict.fromkeys(efforts)) == [(1.0, 2.0, 3.0), (4.0, 5.0, 6.0), (0.0, 0.0, 0.0)]


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_unloads_and_ends_cleanly(ros, play, number):
    messages = listen(ros)
    process = play('--wait', 60)
    ros.until(lambda: len(messages) > 5)
    process.send_signal(number)
    _, errors = process.communicate(timeout=20)
    assert process.returncode == 0 and 'Traceback' not in errors
    ros.until(lambda: not any(messages[-1].effort))


@pytest.mark.parametrize('arguments', [
    ['--node', '/my/axle'],
    ['--ros-args', '-r', '/differential/torques:=/my/axle/torques']])
def test_the_topic_can_be_chosen(ros, play, arguments):
    messages = listen(ros, '/my/axle/torques')
    play('--wait', 60, *arguments)
    ros.until(lambda: len(messages) > 1)


def test_without_a_subscriber_it_warns_and_plays_all_the_same(ros, play):
    process = play('--wait', 0.1, '--duration', 0.1)
    _, errors = process.communicate(timeout=20)
    assert process.returncode == 0
    assert '/differential/torques has no subscriber' in errors


def test_drives_the_node(ros, play):
    ros.differential()
    states = listen(ros, '/differential/joint_states')
    play('--wait', 60)
    ros.until(lambda: states and abs(states[-1].velocity[states[-1].name.index('left')]) > 1.0)


@pytest.mark.parametrize('arguments, part', [
    (['--torques', 'missing.csv'], 'missing.csv: No such file'),
    (['--node', 'no name'], 'topic name'),
    (['--rate', '0'], '--rate: 0 must be above 0'),
    (['--duration', 'nan'], '--duration: nan must be in'),
    (['--profile', 'lsd', '--variant', 'lsd_ode'], 'not allowed with'),
    (['--what'], 'unrecognized arguments'),
    (['--ros-args', '-r', 'what'], "remap rule: '-r what'"),
    (['--ros-args', '--what'], '--what')])
def test_bad_arguments_end_it_with_one_line(play, arguments, part):
    process = play('--wait', 0, '--duration', 0.1, *arguments)
    _, errors = process.communicate(timeout=20)
    *usage, error = errors.splitlines()
    assert process.returncode == 2 and part in error
    assert not usage or usage[0].startswith('usage:')
