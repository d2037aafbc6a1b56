# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What ros2_control sends by the installed descriptions, cycle by cycle, drives the node."""

from math import isnan
from pathlib import Path
from xml.etree import ElementTree

from hardware import components, GroupEffortController
import pytest
import rclpy
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
import yaml

from dm_ros.tools.urdf import main

FOLDER = Path(__file__).parents[2] / 'config' / 'ros2_control'
VARIANTS = {'symmetric': 'symmetric_ode', 'lsd': 'lsd_ode'}
TORQUES = '/differential/torques'
BRIEF = dict(rate=200.0, torque_timeout=0.1)   # 20 ticks until a torque is stale
EFFORT = {'symmetric': (40.0, -70.0, -60.0), 'lsd': (200.0, -110.0, -90.0)}


def description(name, threshold='-1'):
    """Return the installed description, with another threshold."""
    text = (FOLDER / f'{name}.urdf').read_text()
    assert text.count('threshold">-1<') > 0
    return text.replace('threshold">-1<', f'threshold">{threshold}<')


class Manager:
    """A controller manager whose cycles the test calls: read, update, write."""

    def __init__(self, ros, text):
        self._ros = ros
        self.components = components(text)
        self._publishers, self._states = {}, {}
        for end, component in self.components.items():
            self._publishers[end] = ros.publisher(JointState, TORQUES, depth=1)   # as the plugin
            topic = component.parameters['joint_states_topic']
            if topic not in self._states:
                self._states[topic] = ros.listen(JointState, topic, qos_profile_sensor_data)
        self.shafts = self.components['']
        self.controllers = []
        self.sent = 0

    def controller(self, end='', joints=None):
        """Return an active controller of some joints of a component, by the end of its name."""
        component = self.components[end]
        self.controllers.append(GroupEffortController(component, joints or component.commanded))
        return self.controllers[-1]

    def cycle(self):
        """Do one cycle; return whether the shafts were sent anything."""
        for component in self.components.values():
            if heard := self._states[component.parameters['joint_states_topic']]:
                component.read(heard[-1])
        for controller in self.controllers:
            controller.update()
        sent = set()
        for end, component in self.components.items():
            now = self._ros.node.get_clock().now().to_msg()
            if message := component.write(JointState, now):
                sent.add(end)
                self._publishers[end].publish(message)
                self.sent += 1
        return '' in sent

    @property
    def joint_states(self):
        return self._states['/differential/joint_states']

    def efforts(self):
        """Return the efforts of the commanded shafts in each of the joint states."""
        return [tuple(message.effort[message.name.index(name)] for name in self.shafts.commanded)
                for message in self.joint_states]


def drops(efforts, wanted):
    """Return how often the torques fell from those that are wanted to zero."""
    return sum(before == wanted and not any(after) for before, after in zip(efforts, efforts[1:]))


@pytest.mark.parametrize('name', VARIANTS)
def test_a_constant_torque_holds_in_every_tick(ros, steady, name):
    node = ros.differential(VARIANTS[name], **BRIEF)
    manager = Manager(ros, description(name))
    manager.controller().command(*EFFORT[name])
    while not manager.efforts() or manager.efforts()[-1] != EFFORT[name]:
        assert manager.cycle()
        steady.tick(node, manager.joint_states)
    begin = len(manager.efforts())
    for _ in range(200):
        # a cycle that is heard a tick late is no drop: 20 ticks would be one
        assert manager.cycle()
        steady.tick(node, manager.joint_states)
    assert manager.efforts()[begin:] == [EFFORT[name]] * 200
    assert not node.plant.inputs.refused and not node.plant.stale.count


def test_by_the_default_threshold_of_the_plugin_a_constant_torque_pulses(ros, steady):
    node = ros.differential(**BRIEF)
    manager = Manager(ros, description('symmetric', '1e-5'))
    manager.controller().command(*EFFORT['symmetric'])
    while drops(manager.efforts(), EFFORT['symmetric']) < 3:
        manager.cycle()
        steady.tick(node, manager.joint_states)
        assert len(manager.efforts()) < 2000
    assert manager.sent < len(manager.efforts()) / 2


@pytest.mark.parametrize('name', VARIANTS)
def test_in_lockstep_each_cycle_is_a_tick_from_the_first_one_on(ros, name):
    node = ros.differential(VARIANTS[name], mode='lockstep')
    text = description(name)
    robot = ElementTree.fromstring(text)   # as printed for mode: lockstep
    for tag in robot.findall("ros2_control[@name='differential_clutches']"):
        robot.remove(tag)
    manager = Manager(ros, ElementTree.tostring(robot, 'unicode'))
    controller = manager.controller()
    for n in range(1, 101):
        if n == 11:
            controller.command(*EFFORT[name])
        assert manager.cycle()   # all NaN until there is a command: a tick all the same
        ros.until(lambda n=n: len(manager.joint_states) == n)
    assert node.simulation.ticks == 100 and not node.plant.inputs.refused
    assert manager.efforts() == [(0.0, 0.0, 0.0)] * 10 + [EFFORT[name]] * 90


def test_in_lockstep_by_the_default_threshold_time_stands_still(ros):
    node = ros.differential(mode='lockstep')
    manager = Manager(ros, description('symmetric', '1e-5'))
    manager.controller().command(*EFFORT['symmetric'])
    assert manager.cycle()
    ros.until(lambda: manager.joint_states)
    assert [manager.cycle() for _ in range(100)] == [False] * 100
    assert node.simulation.ticks == 1


def test_an_inactive_controller_commands_nothing_and_an_ended_one_zero(ros):
    node = ros.differential(mode='lockstep')
    manager = Manager(ros, description('symmetric'))
    drive = manager.controller(joints=['pinion'])   # nothing commands left and right

    def effort(n):
        assert manager.cycle()
        ros.until(lambda: len(manager.joint_states) == n)
        return manager.efforts()[-1]
    assert effort(1) == (0.0, 0.0, 0.0)
    assert all(map(isnan, manager.shafts.commands.values()))
    drive.command(5.0)
    assert effort(2) == (5.0, 0.0, 0.0)
    assert node.plant.inputs.silent() == ['left', 'right']
    drive.deactivate()
    assert effort(3) == (0.0, 0.0, 0.0)
    assert node.plant.inputs.received == 3 and not node.plant.inputs.refused


def test_forces_on_clutches_come_as_a_message_of_their_own_and_their_states_go_back(ros, steady):
    node = ros.differential('lsd_ode', **BRIEF)
    manager = Manager(ros, description('lsd'))
    manager.controller().command(*EFFORT['lsd'])
    clutches = manager.components['_clutches']
    manager.controller('_clutches').command(300.0, 0.0)
    while clutches.states['front_clutch', 'effort'] != 300.0:
        manager.cycle()
        steady.tick(node, manager.joint_states)
    speed = manager.shafts.states
    slip = clutches.states['rear_clutch', 'velocity']
    assert slip == pytest.approx(
        speed['rear', 'velocity'] - speed['carrier', 'velocity'], abs=0.1)   # of near ticks
    assert not node.plant.inputs.refused
    assert not node.inputs.sources.contested()


def test_a_negative_force_is_refused_without_the_torques(ros, steady):
    node = ros.differential('lsd_ode', **BRIEF)
    manager = Manager(ros, description('lsd'))
    manager.controller().command(*EFFORT['lsd'])
    manager.controller('_clutches').command(-1.0, 0.0)
    while not node.plant.inputs.refused or manager.efforts()[-1] != EFFORT['lsd']:
        manager.cycle()
        steady.tick(node, manager.joint_states)
    assert 'force on front_clutch is -1.0' in node.plant.refusing.reason


def test_a_joint_without_a_command_among_the_others_is_refused_with_what_to_declare(ros):
    node = ros.differential(mode='lockstep')
    robot = ElementTree.fromstring(description('symmetric'))
    shafts, states = robot.findall('ros2_control')
    shafts.extend(states.findall('joint'))
    robot.remove(states)
    manager = Manager(ros, ElementTree.tostring(robot, 'unicode'))
    manager.controller(joints=['pinion', 'left', 'right']).command(*EFFORT['symmetric'])
    manager.cycle()
    ros.until(lambda: node.plant.inputs.refused)
    reason = node.plant.refusing.reason
    for words in ('5 names but 3 efforts', 'NaN for no command', 'leave out carrier, satellite',
                  'command interface effort', 'in a system of their own'):
        assert words in reason
    assert '\n' not in reason and node.simulation.ticks == 0


def test_a_speed_port_takes_its_velocity_beside_the_efforts_of_others(ros, capsys, tmp_path):
    (tmp_path / 'p.yaml').write_text(
        '/**: {ros__parameters: {port.left.kind: speed, mode: lockstep}}')
    assert main(['--params', str(tmp_path / 'p.yaml'), '--ros2-control']) == 0
    node = ros.differential(mode='lockstep', port__left__kind='speed')
    manager = Manager(ros, capsys.readouterr().out)
    manager.shafts.commands['left', 'velocity'] = 2.0
    manager.controller(joints=['pinion', 'right']).command(3.0, -4.0)
    assert manager.cycle()
    ros.until(lambda: manager.joint_states)
    assert node.simulation.state.held == (3.0, 2.0, -4.0) and not node.plant.inputs.refused


@pytest.mark.parametrize('namespace', ['', '/car'])
@pytest.mark.parametrize('name', VARIANTS)
def test_ros_reads_the_controllers_file_for_manager_and_controllers(ros, name, namespace):
    file = FOLDER / f'{name}_controllers.yaml'
    for key, section in yaml.safe_load(file.read_text()).items():
        node = rclpy.create_node(
            key.removeprefix('/**/'), context=ros.context, namespace=namespace,
            cli_args=['--ros-args', '--params-file', str(file)],
            automatically_declare_parameters_from_overrides=True)
        found = {full_name: parameter.value
                 for full_name, parameter in node.get_parameters_by_prefix('').items()}
        node.destroy_node()
        for parameter, value in section['ros__parameters'].items():
            if isinstance(value, dict):
                assert found[f'{parameter}.type'] == value['type']
            else:
                assert found[parameter] == value
