# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The node as a process: how it starts, what it refuses, how it ends."""

from pathlib import Path
import signal

from processes import command, Forked
import pytest
from sensor_msgs.msg import JointState

CONFIG = Path(__file__).parents[2] / 'config'


def start(*arguments):
    return Forked(command('differential'), *arguments)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize('variant', ['symmetric_ode', 'lsd_ode'])
def test_a_signal_ends_it_with_exit_code_0_and_no_traceback(ros, number, variant):
    with start('--ros-args', '-p', f'variant:={variant}', '-p', 'rate:=500.0') as process:
        joints = ros.listen(JointState, '/differential/joint_states')
        ros.until(lambda: len(joints) > 10)
        assert process.ended(number) == 0
        assert 'Traceback' not in process.errors


@pytest.mark.parametrize('name', ['symmetric', 'lsd'])
def test_its_parameter_file_loads(ros, name):
    with start('--ros-args', '--params-file', CONFIG / f'{name}.yaml',
               '-p', f'variant:={name}_dae') as process:
        joints = ros.listen(JointState, '/differential/joint_states')
        ros.until(lambda: joints)
        assert process.ended(signal.SIGTERM) == 0


@pytest.mark.parametrize('preset, words', [
    ('centre_40_60', 'lsd_ode at 200 Hz'), ('plate_axle_1_5_way', 'forces on left, right'),
    ('open_axle', 'torques on pinion, left, right\n')])
def test_a_preset_loads_with_its_variant(ros, preset, words):
    with start('--ros-args', '--params-file', CONFIG / 'presets' / f'{preset}.yaml') as process:
        joints = ros.listen(JointState, '/differential/joint_states')
        ros.until(lambda: joints)
        assert process.ended(signal.SIGTERM) == 0
        assert words in process.errors


def warnings_of(ros, arguments):
    """Return the warnings of a node as it starts, which it does."""
    with start('--ros-args', '-r', '__node:=axle', *arguments) as process:
        joints = ros.listen(JointState, '/axle/joint_states')
        ros.until(lambda: joints)
        assert process.ended(signal.SIGTERM) == 0
        return [line for line in process.errors.splitlines()
                if '[WARN]' in line and 'ticks are missed' not in line]   # as on a busy machine


@pytest.mark.parametrize('arguments, words', [
    (['-p', 'lsd.clutch.rear.preload:=-50.0'],
     '1 parameter of another mechanism than the symmetric differential counts for nothing: '
     'lsd.clutch.rear.preload'),
    (['-p', 'variant:=lsd_ode', '-p', 'port.left.kind:=speed', '-p', 'port.rear.damping:=9.0',
      '-p', 'initial_velocity.right:=3.0'],
     '2 parameters of another mechanism than the self-locking differential count for nothing: '
     'port.left.kind, initial_velocity.right'),
    (['--params-file', CONFIG / 'lsd.yaml'], 'lsd.viscosity.satellite'),
    (['-p', 'differential:rate:=7.0'], 'not for /axle, but for /differential'),
])
def test_parameters_of_the_other_mechanism_and_of_other_nodes_are_told_in_one_line(
        ros, arguments, words):
    line, = warnings_of(ros, arguments)
    assert words in line


@pytest.mark.parametrize('section, is_told', [
    ('differential', True), ('/axel', True), ('/car/axle', True),
    ('/axle', False), ('/**', False), ('/*', False), ('/**/axle', False)])
def test_a_file_for_other_nodes_alone_is_told_where_it_changes_nothing(
        ros, tmp_path, section, is_told):
    file = tmp_path / 'node.yaml'
    file.write_text(f'"{section}": {{ros__parameters: {{rate: 7.0}}}}\n')
    lines = warnings_of(ros, ['--params-file', file])
    told = f'{file}: nothing in it is for /axle, but for /{section.lstrip("/")}'
    assert [line.endswith(told) for line in lines] == [True] * is_told


@pytest.mark.parametrize('parameters, words', [
    ('rate: 100', ['rate: 100 ', 'a double']),
    ('symmetric.inertia.left: 1', ['symmetric.inertia.left: 1 ', 'a double']),
    ('symmetric: {clutch: {left: {preload: 50}}}', ['symmetric.clutch.left.preload: 50 ']),
    ('substeps: 2.0', ['substeps: 2.0 ', 'an integer']),
    ('energy_audit: 1', ['energy_audit: 1 ', 'a boolean']),
    ('variant: 1', ['variant: 1 ', 'lsd_ode']),
    ('rate: [100.0]', ['rate: ', 'a double']),
    ('use_sim_time: 1', ['use_sim_time', 'BOOL']),
    ('start_type_description_service: 1', ['start_type_description_service', 'BOOL'])])
def test_a_value_of_another_type_in_a_file_as_launch_writes_it_ends_it_with_code_2_and_one_line(
        ros, tmp_path, parameters, words):
    file = tmp_path / 'launch_params'
    file.write_text(f'/**:\n  ros__parameters:\n    {parameters}\n')
    with start('--ros-args', '-r', '__node:=rear', '-r', '__ns:=/car', '--params-file',
               file) as process:
        assert process.ended() == 2
        line, = process.errors.strip().splitlines()
    assert line.startswith('differential: error: ')
    assert all(word in line for word in words), line


def test_at_its_end_it_tells_what_is_not_over(ros):
    with start('--ros-args', '-p', 'use_sim_time:=true') as process:
        process.says('waiting for /clock: ')
        assert process.ended(signal.SIGTERM) == 0
        *_, last = process.errors.strip().splitlines()
    assert 'at the end: waiting for /clock (' in last


@pytest.mark.parametrize('parameter, words', [
    ('symmetric.efficiency.left_mesh:=1.5', ['symmetric.efficiency.left_mesh', '1.5', '(0, 1]']),
    ('symmetric.satellite_count:=0', ['symmetric.satellite_count', '0']),
    ('rate:=0.0', ['rate', '0.0']),
    ('rate:=100', ['rate', '100', 'double']),
    ('variant:=torsen', ['variant', 'torsen', 'lsd_ode']),
    ('loss_law:=torsen', ['loss_law', 'torsen', 'passive, paper']),
    ('joint_prefix:=2rear', ['joint_prefix', '2rear', 'letter']),
    ('symmetric.inertia.wheel:=1.0', ['symmetric.inertia.wheel']),
])
def test_an_unknown_or_impossible_parameter_ends_it_with_code_2_and_one_line(
        ros, parameter, words):
    with start('--ros-args', '-p', parameter) as process:
        assert process.ended() == 2
        line, = process.errors.strip().splitlines()
    assert all(word in line for word in words)
