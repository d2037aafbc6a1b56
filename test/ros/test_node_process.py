# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The node as a process: how it starts, what it refuses, how it ends."""

import os
from pathlib import Path
import signal
import subprocess
import sys

import pytest
from sensor_msgs.msg import JointState

CONFIG = Path(__file__).parents[2] / 'config'


def start(*arguments):
    command = [sys.executable, '-m', 'dm_ros.ros.node', *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                            env=os.environ)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize('variant', ['symmetric_ode', 'lsd_ode'])
def test_a_signal_ends_it_with_exit_code_0_and_no_traceback(ros, number, variant):
    process = start('--ros-args', '-p', f'variant:={variant}', '-p', 'rate:=500.0')
    joints = ros.listen(JointState, '/differential/joint_states')
    ros.until(lambda: len(joints) > 10)
    process.send_signal(number)
    _, errors = process.communicate(timeout=20)
    assert process.returncode == 0
    assert 'Traceback' not in errors


@pytest.mark.parametrize('name', ['symmetric', 'lsd'])
def test_its_parameter_file_loads(ros, name):
    process = start('--ros-args', '--params-file', str(CONFIG / f'{name}.yaml'),
                    '-p', f'variant:={name}_dae')
    joints = ros.listen(JointState, '/differential/joint_states')
    ros.until(lambda: joints)
    process.terminate()
    process.communicate(timeout=20)
    assert process.returncode == 0


@pytest.mark.parametrize('parameter, words', [
    ('symmetric.efficiency.left_mesh:=1.5', ['symmetric.efficiency.left_mesh', '1.5', '(0, 1]']),
    ('symmetric.satellite_count:=0', ['symmetric.satellite_count', '0']),
    ('rate:=0.0', ['rate', '0.0']),
    ('rate:=100', ['rate', '100', 'double']),
    ('variant:=torsen', ['variant', 'torsen', 'lsd_ode']),
    ('symmetric.inertia.wheel:=1.0', ['symmetric.inertia.wheel']),
])
def test_an_unknown_or_impossible_parameter_ends_it_with_code_2_and_one_line(
        ros, parameter, words):
    _, errors = (process := start('--ros-args', '-p', parameter)).communicate(timeout=30)
    assert process.returncode == 2
    line, = errors.strip().splitlines()
    assert all(word in line for word in words)
