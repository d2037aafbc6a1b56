# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Descriptions and controllers for ros2_control fit each other, the mechanism and the node."""

import io
from pathlib import Path
from xml.etree import ElementTree

from hardware import components, KINDS
import pytest
import yaml

from dm_ros.files.ros2_control import PLUGIN
from dm_ros.mechanism.variants import equipped, MECHANISMS
from dm_ros.tools.urdf import main

FOLDER = Path(__file__).parents[1] / 'config' / 'ros2_control'
BROADCASTER = 'joint_state_broadcaster/JointStateBroadcaster'
EFFORT = 'effort_controllers/JointGroupEffortController'
each_mechanism = pytest.mark.parametrize('name', MECHANISMS)


def default(name):
    """Return a mechanism with its default parameters."""
    return equipped(MECHANISMS[name], MECHANISMS[name].parameters())


def controllers(name):
    """Return ``{controller: (type, parameters)}`` of the installed file, and the manager's."""
    sections = yaml.safe_load((FOLDER / f'{name}_controllers.yaml').read_text())
    manager = sections.pop('/**/controller_manager')['ros__parameters']
    own = {key.removeprefix('/**/'): section['ros__parameters']
           for key, section in sections.items()}
    assert all(set(section) == {'ros__parameters'} for section in sections.values())
    return {controller: (value['type'], own.pop(controller, {}))
            for controller, value in manager.items() if isinstance(value, dict)}, manager, own


@pytest.fixture
def printed(capsys, tmp_path):
    """Return what calls the command with the lines of a parameter file and options."""
    def call(content, *options):
        path = tmp_path / 'p.yaml'
        path.write_text(f'/**: {{ros__parameters: {{{content}}}}}')
        assert main(['--params', str(path), *options]) == 0
        return capsys.readouterr().out
    return call


@each_mechanism
def test_the_installed_description_is_the_one_that_the_command_prints(name, capsys):
    assert main(['--variant', MECHANISMS[name].variant, '--ros2-control']) == 0
    # after a change: urdf --variant ... --ros2-control --out config/ros2_control/....urdf
    assert (FOLDER / f'{name}.urdf').read_text() == capsys.readouterr().out


@each_mechanism
def test_each_shaft_and_each_clutch_is_in_one_component_with_all_states(name):
    mechanism, found = default(name), components((FOLDER / f'{name}.urdf').read_text())
    assert set(found) == {'', '_states', *(['_clutches'] if mechanism.actuators else [])}
    assert tuple(found[''].commanded) == mechanism.inputs
    assert set(found['_states'].commanded) == set(mechanism.shafts) - set(mechanism.inputs)
    if mechanism.actuators:
        assert tuple(found['_clutches'].commanded) == mechanism.clutch_moments
    for end, component in found.items():
        assert (component.plugin, component.type) == (PLUGIN, 'system')
        kinds = [] if end == '_states' else ['effort']
        assert all(interfaces == kinds for interfaces in component.commanded.values())
        # the plugin throws where a message has a state that is not declared
        assert set(component.states) == {
            (joint, kind) for joint in component.commanded for kind in KINDS}


@each_mechanism
def test_topics_are_those_of_the_node_and_a_command_goes_out_each_cycle(name):
    for end, component in components((FOLDER / f'{name}.urdf').read_text()).items():
        states = 'clutches' if end == '_clutches' else 'joint_states'
        sent = {} if end == '_states' else {
            'joint_commands_topic': '/differential/torques',
            'trigger_joint_command_threshold': '-1'}
        assert component.parameters == {'joint_states_topic': f'/differential/{states}', **sent}


@each_mechanism
def test_every_joint_is_one_that_moves_in_the_urdf(name):
    text = (FOLDER / f'{name}.urdf').read_text()
    moving = {joint.get('name') for joint in ElementTree.fromstring(text).findall('joint')
              if joint.get('type') == 'continuous' and joint.find('mimic') is None}
    assert moving == {joint for component in components(text).values()
                      for joint in component.commanded}


@each_mechanism
def test_controllers_command_each_joint_once_by_what_the_description_has(name):
    found, manager, rest = controllers(name)
    assert not rest and type(manager['update_rate']) is int
    assert found.pop('joint_state_broadcaster') == (BROADCASTER, {})
    assert {kind for kind, _ in found.values()} == {EFFORT}
    joints = [joint for _, parameters in found.values() for joint in parameters['joints']]
    assert sorted(joints) == sorted(
        joint for component in components((FOLDER / f'{name}.urdf').read_text()).values()
        for joint, interfaces in component.commanded.items() if 'effort' in interfaces)
    mechanism = default(name)
    assert found['drive_controller'][1] == {'joints': [mechanism.inputs[0]]}
    assert found['output_controller'][1] == {'joints': list(mechanism.outputs)}


def test_names_and_topics_follow_prefix_and_node(printed):
    text = printed('variant: lsd_ode, joint_prefix: rear_', '--ros2-control', '/car/rear/node')
    assert 'name="rear_differential_clutches"' in text
    found = components(text)
    assert list(found['_clutches'].commanded) == ['rear_front_clutch', 'rear_rear_clutch']
    assert list(found[''].commanded) == ['rear_carrier', 'rear_front', 'rear_rear']
    assert found[''].parameters['joint_commands_topic'] == '/car/rear/node/torques'
    assert found['_states'].parameters['joint_states_topic'] == '/car/rear/node/joint_states'


def test_a_symmetric_differential_with_clutches_has_them(printed):
    found = components(printed('symmetric.clutch.left.friction_surfaces: 4', '--ros2-control'))
    assert list(found['_clutches'].commanded) == ['left_clutch', 'right_clutch']


def test_in_lockstep_one_message_is_one_tick_so_nothing_else_sends_any(printed):
    found = components(printed('variant: lsd_ode, mode: lockstep', '--ros2-control'))
    assert set(found) == {'', '_states'}


def test_with_a_speed_port_each_joint_has_both_commands(printed):
    found = components(printed('variant: lsd_ode, port.front.kind: speed', '--ros2-control'))
    for end in ('', '_clutches'):
        assert set(map(tuple, found[end].commanded.values())) == {('effort', 'velocity')}


def test_without_the_option_there_is_nothing_of_it(printed):
    assert not components(printed('variant: lsd_ode'))
    assert 'clutch' not in printed('variant: lsd_ode')


@pytest.mark.parametrize('words', ['differential', '/a//b', '/a/', '/a b', '/1a', ''])
def test_a_node_without_a_full_name_is_refused_in_one_line(words, capsys):
    assert main(['--ros2-control', words]) == 2
    out, err = capsys.readouterr()
    assert not out and err.count('\n') == 1
    assert err.startswith(f'urdf: error: --ros2-control: {words!r} is not the full name of a node')


@each_mechanism
def test_yourdfpy_loads_the_installed_description(name):
    yourdfpy = pytest.importorskip('yourdfpy')
    robot = yourdfpy.URDF.load(io.BytesIO((FOLDER / f'{name}.urdf').read_bytes()))
    assert robot.validate() and not robot.errors
    mechanism = default(name)
    assert set(robot.actuated_joint_names) == {*mechanism.shafts, *mechanism.clutch_moments}
