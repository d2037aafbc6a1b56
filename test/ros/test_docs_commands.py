# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The commands that the pages quote, by the real ``ros2`` command line where it is installed."""

import os
from pathlib import Path
import re
import shutil
import signal
import subprocess
import sys

import pytest

from dm_ros.commands import COMMANDS
from dm_ros.files.parameter_file import read_parameter_file

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / 'README.md', ROOT / 'examples' / 'README.md', *sorted((ROOT / 'doc').glob('*.md'))]
AXLE = ROOT / 'config' / 'presets' / 'actuated_axle.yaml'
TORQUES = 'time,pinion,left,right\n0,100,-50,-50\n0.1,0,0,0\n'
PATIENCE = 60.0   # s
# what runs until a signal: how one sees that it does, None where a node hears it
LASTING = {'ros2 run dm_ros differential': ' Hz, ', 'ros2 run dm_ros play_torques': 'playing',
           'ros2 topic pub': None, 'ros2 topic echo': 'position:', 'ros2 bag record': 'Subscribed'}


def quoted():
    """Return (page, what it quotes before, command) of each command of ``ros2``."""
    found = []
    for page in PAGES:
        before = []
        text = re.sub(r'\\\n\s*', '', page.read_text())
        for line in re.findall(r'^ {4,}(\S.*)', text, re.MULTILINE):
            ours = not re.match('ros2 (run|launch) (?!dm_ros )', line)
            if line.startswith('ros2 ') and ours and '[' not in line:   # a synopsis is none
                found.append((page.name, list(before), line))
            if re.match(r'\w+=|export |ros2 security ', line):
                before.append(line)
    return found


def asked(*arguments):
    """Return the ended process of the command line."""
    return subprocess.run(['ros2', *arguments], capture_output=True, text=True, timeout=PATIENCE)


@pytest.fixture
def desk(ros, tmp_path, monkeypatch):
    """Return a folder with what the commands need, in which the package is installed."""
    prefix, folder = tmp_path / 'prefix', tmp_path / 'desk'
    shutil.copytree(ROOT / 'config', prefix / 'share' / 'dm_ros' / 'config')
    shutil.copytree(ROOT / 'config', folder / 'config')
    for file in (ROOT / 'config').glob('*.yaml'):
        shutil.copy(file, folder)
    (folder / 'IN.csv').write_text(TORQUES)
    marker = prefix / 'share' / 'ament_index' / 'resource_index' / 'packages' / 'dm_ros'
    marker.parent.mkdir(parents=True)
    marker.touch()
    executables = prefix / 'lib' / 'dm_ros'
    executables.mkdir(parents=True)
    for name in COMMANDS:
        script = executables / name
        script.write_text(f'#!/bin/sh\nexec {sys.executable} -m dm_ros.commands {name} "$@"\n')
        script.chmod(0o755)
    monkeypatch.setenv('AMENT_PREFIX_PATH', os.pathsep.join(
        [str(prefix), *filter(None, [os.environ.get('AMENT_PREFIX_PATH')])]))
    monkeypatch.setenv('PYTHONUNBUFFERED', '1')
    yield folder
    asked('daemon', 'stop')


def test_the_pages_quote_commands():
    verbs = {command.split()[1] for _, _, command in quoted()}
    assert {'run', 'topic', 'param', 'service', 'bag', 'security'} <= verbs


@pytest.mark.skipif(not shutil.which('ros2'), reason='the ros2 command line is not installed')
@pytest.mark.parametrize('page, before, command', quoted())
def test_a_command_that_a_page_quotes_does_what_it_says(ros, desk, page, before, command):
    for verb in {line.split()[1] for line in [*before, command] if line.startswith('ros2 ')}:
        if asked(verb, '--help').returncode:
            pytest.skip(f'ros2 {verb} is not installed')
    node = None
    if not command.startswith('ros2 run dm_ros differential'):
        node = (ros.differential('lsd_ode') if re.search('carrier|lsd|rear', command)
                else ros.differential(**read_parameter_file(AXLE)))
        # the daemon of the command line has just been started
        ros.until(lambda: '/differential/joint_states' in asked('topic', 'list').stdout)
    words = next((words for start, words in LASTING.items() if command.startswith(start)), '')
    with (desk / 'said').open('wb') as said:
        process = subprocess.Popen(['bash', '-ec', '\n'.join([*before, command])], cwd=desk,
                                   stdout=said, stderr=said, start_new_session=True)
    try:
        def ended():
            return process.poll() is not None

        def text():
            return (desk / 'said').read_text()
        if words != '':
            ros.until(lambda: ended() or (
                words in text() if words else node.plant.inputs.received > 2), PATIENCE)
            assert not ended(), text()
            os.killpg(process.pid, signal.SIGINT)
        ros.until(ended, PATIENCE)
        assert words != '' or process.returncode == 0, text()
        assert not re.search('Traceback|usage:|[Ee]rror', text()), text()
        if words is None:
            assert not node.plant.inputs.refused
        if ' param set ' in command:
            *_, name, value = command.split()
            assert node.get_parameter(name).value == float(value)
        if ' service call ' in command:
            assert 'success=True' in text()
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
