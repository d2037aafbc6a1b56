# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The launch files by the real ``ros2 launch``, where it is installed."""

import os
from pathlib import Path
import shlex
import sys

from command_line import has, Started
import pytest
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import GetParameters

pytestmark = pytest.mark.skipif(not has('launch'), reason='ros2 launch is not installed')
PUBLISHER = """
import rclpy, re
from sensor_msgs.msg import JointState
def heard(message):
    node.get_logger().info(f"heard {message.name[0]} of {robot}", once=True)
try:
    rclpy.init()
    node = rclpy.create_node("robot_state_publisher")
    text = node.declare_parameter("robot_description", "").value
    robot = re.search("robot name=.([a-z_]+)", text).group(1)
    node.create_subscription(JointState, "joint_states", heard, 10)
    rclpy.spin(node)
except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
    pass
"""
MANAGER = """
import rclpy, re
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
def heard(message):
    topic = re.search("commands_topic.>([^<]*)", message.data).group(1)
    node.get_logger().info(f"heard {topic} at {node.get_parameter('update_rate').value} Hz")
try:
    rclpy.init()
    node = rclpy.create_node("controller_manager",
                             automatically_declare_parameters_from_overrides=True)
    node.create_subscription(String, "robot_description", heard,
                             QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    rclpy.spin(node)
except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
    pass
"""
DESCRIBER = """
import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
try:
    rclpy.init()
    node = rclpy.create_node("robot_state_publisher")
    text = node.declare_parameter("robot_description", "").value
    node.create_publisher(String, "robot_description", QoSProfile(
        depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)).publish(String(data=text))
    rclpy.spin(node)
except (KeyboardInterrupt, rclpy.executors.ExternalShutdownException):
    pass
"""
SPAWNER = """
import sys
print("asked for", *sys.argv[1:], flush=True)
sys.exit("nope" in " ".join(sys.argv))
"""
KINDS = {ParameterType.PARAMETER_STRING: 'string_value',
         ParameterType.PARAMETER_DOUBLE: 'double_value',
         ParameterType.PARAMETER_INTEGER: 'integer_value'}


def parameters(ros, node, *names):
    """Return the values of parameters of a node, each with its type."""
    values = ros.call(GetParameters, f'{node}/get_parameters', names=names).values
    return [getattr(value, KINDS[value.type]) for value in values]


def stand_in(package, **programs):
    """Install executables that run programs in Python in place of a package."""
    prefix = Path(os.environ['AMENT_PREFIX_PATH'].split(os.pathsep)[0])
    folder = prefix / 'lib' / package
    folder.mkdir()
    for name, program in programs.items():
        script = folder / name
        script.write_text(f'#!/bin/sh\nexec {sys.executable} -c {shlex.quote(program)} "$@"\n')
        script.chmod(0o755)
    (prefix / 'share' / 'ament_index' / 'resource_index' / 'packages' / package).touch()


@pytest.fixture
def manager(desk):
    """Install stand-ins for what ros2_control needs."""
    stand_in('robot_state_publisher', robot_state_publisher=DESCRIBER)
    stand_in('controller_manager', ros2_control_node=MANAGER, spawner=SPAWNER)


def test_each_argument_arrives_with_the_type_of_its_parameter(ros, desk):
    arguments = ('namespace:=car variant:=lsd_ode loss_law:=paper rate:=500 joint_prefix:=x_ '
                 'realtime_priority:=0')
    with Started(f'ros2 launch dm_ros differential.launch.py {arguments}', desk) as launch:
        found = parameters(ros, '/car/differential', 'variant', 'loss_law', 'rate',
                           'joint_prefix', 'realtime_priority')
        assert found == ['lsd_ode', 'paper', 500.0, 'x_', 0] and type(found[2]) is float
        launch.interrupt()
        ros.until(launch.ended)
        assert launch.returncode == 0, launch.text


def test_what_is_not_given_is_as_the_file_has_it(ros, desk):
    (desk / 'p.yaml').write_text('/**: {ros__parameters: {variant: lsd_dae, rate: 50.0}}')
    with Started('ros2 launch dm_ros differential.launch.py params_file:=p.yaml rate:=60', desk):
        assert parameters(ros, '/differential', 'variant', 'rate', 'loss_law') == [
            'lsd_dae', 60.0, 'passive']


def test_the_description_is_that_of_the_node_and_turns_by_its_joints(ros, desk):
    stand_in('robot_state_publisher', robot_state_publisher=PUBLISHER)
    (desk / 'my file.yaml').write_text('/**: {ros__parameters: {variant: lsd_ode}}')
    with Started('ros2 launch dm_ros differential.launch.py namespace:=car description:=true '
                 'joint_prefix:=x_ params_file:="my file.yaml"', desk) as launch:
        ros.until(lambda: launch.ended() or 'heard ' in launch.text)
        assert 'heard x_carrier of x_differential' in launch.text
        launch.interrupt()
        ros.until(launch.ended)
        assert launch.returncode == 0, launch.text


def test_a_pair_has_two_namespaces_prefixes_and_files_and_ends_together(ros, desk):
    for axle, rate in (('front', 50.0), ('rear', 60.0)):
        (desk / f'{axle}.yaml').write_text(f'/**: {{ros__parameters: {{rate: {rate}}}}}')
    with Started('ros2 launch dm_ros axle_pair.launch.py namespace:=car joint_prefix:=x_ '
                 'front_params_file:=front.yaml rear_params_file:=rear.yaml', desk) as launch:
        for axle, rate in (('front', 50.0), ('rear', 60.0)):
            assert parameters(ros, f'/car/{axle}/differential', 'rate', 'joint_prefix') == [
                rate, f'x_{axle}_']
        launch.interrupt()
        ros.until(launch.ended)
        assert launch.returncode == 0, launch.text


@pytest.mark.parametrize('argument, words', [
    ('rate:=abc', 'rate'), ('variant:=nope', 'variant'), ('rate:=-1', 'rate'),
    ('realtime_priority:=1.5', 'realtime_priority'), ('params_file:=none.yaml', 'none.yaml')])
def test_what_the_node_refuses_ends_it_with_code_1_and_the_reason(ros, desk, argument, words):
    with Started(f'ros2 launch dm_ros differential.launch.py {argument}', desk) as launch:
        ros.until(launch.ended)
        assert launch.returncode == 1
        assert any('differential: error:' in line and words in line
                   for line in launch.text.splitlines()), launch.text


@pytest.mark.parametrize('arguments, topic, controllers', [
    ('variant:=lsd_ode', '/differential/torques',
     'joint_state_broadcaster drive_controller output_controller clutch_controller'),
    ('namespace:=car params_file:=symmetric.yaml', '/car/differential/torques',
     'joint_state_broadcaster drive_controller output_controller')])
def test_ros2_control_has_the_description_of_the_node_and_its_controllers(
        ros, desk, manager, arguments, topic, controllers):
    with Started(f'ros2 launch dm_ros differential.launch.py ros2_control:=true {arguments}',
                 desk) as launch:
        ros.until(lambda: launch.ended() or (
            f'heard {topic} at 200 Hz' in launch.text
            and f'asked for {controllers} --param-file ' in launch.text))
        ros.until(lambda: launch.ended() or 'finished cleanly' in launch.text)   # the spawner
        assert parameters(ros, topic.removesuffix('/torques'), 'rate') == [200.0]
        assert not launch.ended(), launch.text
        launch.interrupt()
        ros.until(launch.ended)
        assert launch.returncode == 0, launch.text


def test_ros2_control_takes_other_controllers_by_a_file_also_of_a_pair(ros, desk, manager):
    (desk / 'c.yaml').write_text('\n'.join(
        f'/{axle}/controller_manager: {{ros__parameters: {{update_rate: {rate}, '
        f'{axle}_torques: {{type: x}}}}}}' for axle, rate in (('front', 50), ('rear', 60))))
    with Started('ros2 launch dm_ros axle_pair.launch.py ros2_control:=c.yaml', desk) as launch:
        for words in ('heard /front/differential/torques at 50 Hz',
                      'heard /rear/differential/torques at 60 Hz',
                      'asked for front_torques --param-file c.yaml',
                      'asked for rear_torques --param-file c.yaml'):
            ros.until(lambda words=words: launch.ended() or words in launch.text)
            assert not launch.ended(), launch.text


@pytest.mark.parametrize('arguments, words', [
    ('ros2_control:=c.yaml', 'spawner'), ('ros2_control:=none.yaml', 'none.yaml'),
    ('ros2_control:=lsd.yaml', 'lsd.yaml: there is none of /controller_manager'),
    ('ros2_control:=true joint_prefix:=x_', 'with a joint_prefix it must be a file')])
def test_a_controller_that_cannot_be_started_ends_all(ros, desk, manager, arguments, words):
    (desk / 'c.yaml').write_text(
        'controller_manager: {ros__parameters: {update_rate: 50, nope: {type: x}}}')
    with Started(f'ros2 launch dm_ros differential.launch.py {arguments}', desk) as launch:
        ros.until(launch.ended)
        assert launch.returncode == 1 and words in launch.text
