# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The commands that the pages quote, by the real ``ros2`` command line where it is installed."""

from pathlib import Path
import re

from command_line import asked, has, ROS2, Started
import pytest

from dm_ros import Simulation
from dm_ros.files.bag import TickBag
from dm_ros.files.parameter_file import read_parameter_file

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / 'README.md', ROOT / 'examples' / 'README.md', *sorted((ROOT / 'doc').glob('*.md'))]
AXLE = ROOT / 'config' / 'presets' / 'actuated_axle.yaml'
# what runs until a signal: how one sees that it does, None where a node hears it
STARTS_A_NODE = 'ros2 run dm_ros differential', 'ros2 run dm_ros driveline', 'ros2 launch '
LASTING = {**dict.fromkeys(STARTS_A_NODE, ' Hz, '), 'ros2 run dm_ros play_torques': 'playing',
           'ros2 run dm_ros watch': 'watching ',
           'ros2 topic pub': None, 'ros2 topic echo': 'position:', 'ros2 bag record': 'Subscribed'}


def quoted():
    """Return (page, what it quotes before, command) of each command of ``ros2``."""
    found = []
    for page in PAGES:
        before = []
        text = re.sub(r'\\\n\s*', '', page.read_text())
        for line in re.findall(r'^ {4,}(\S.*)', text, re.MULTILINE):
            ours = not re.match(   # without ros2_control
                'ros2 ((run|launch) (?!dm_ros )|control |topic echo /joint)|.* ros2_control:=|'
                '.*_controller/', line)
            if line.startswith('ros2 ') and ours and '[' not in line:   # a synopsis is none
                found.append((page.name, list(before), line))
            if re.match(r'\w+=|export |ros2 security ', line):
                before.append(line)
    return found


def leave_bag(folder):
    """Leave the bag of a short drive of a self-locking differential."""
    simulation = Simulation('lsd_ode', 0.01)
    with TickBag(folder, simulation.mechanism, 100.0) as bag:
        bag.start(simulation.snapshot())
        for _ in range(1000):
            bag.tick((30.0, -10.0, -15.0), simulation.step((30.0, -10.0, -15.0)))


def test_the_pages_quote_commands():
    verbs = {command.split()[1] for _, _, command in quoted()}
    assert {'run', 'topic', 'param', 'service', 'bag', 'security'} <= verbs


@pytest.mark.skipif(not ROS2, reason='the ros2 command line is not installed')
@pytest.mark.parametrize('page, before, command', quoted())
def test_a_command_that_a_page_quotes_does_what_it_says(ros, desk, page, before, command):
    for verb in {line.split()[1] for line in [*before, command] if line.startswith('ros2 ')}:
        if not has(verb):
            pytest.skip(f'ros2 {verb} is not installed')
    if 'record:=' in command and not has('bag'):
        pytest.skip('ros2 bag is not installed')
    if 'description:=' in command and asked(
            'pkg', 'prefix', 'robot_state_publisher').returncode:
        pytest.skip('robot_state_publisher is not installed')
    if '--torques drive' in command:
        leave_bag(desk / 'drive')
    node = None
    if not command.startswith(STARTS_A_NODE):
        node = (ros.differential('lsd_ode') if re.search('carrier|lsd|rear', command)
                else ros.differential(**read_parameter_file(AXLE)))
        # the daemon of the command line has just been started
        ros.until(lambda: '/differential' in asked('node', 'list').stdout.split()
                  and '/differential/joint_states' in asked('topic', 'list').stdout)
    words = next((words for start, words in LASTING.items() if command.startswith(start)
                  and not command.endswith('--show-args')), '')
    with Started('\n'.join([*before, command]), desk) as process:
        if words != '':
            ros.until(lambda: process.ended() or (
                words in process.text if words else node.plant.inputs.received > 2))
            assert not process.ended(), process.text
            process.interrupt()
        ros.until(process.ended)
        assert words != '' or process.returncode == 0, process.text
        assert not re.search('Traceback|usage:|[Ee]rror', process.text), process.text
        if words is None:
            assert not node.plant.inputs.refused
        if ' param set ' in command:
            *_, name, value = command.split()
            assert node.get_parameter(name).value == float(value)
        if ' service call ' in command:
            assert 'success=True' in process.text
