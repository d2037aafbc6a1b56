# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""One differential, on request with description, ros2_control, recorder; all end with one."""

from pathlib import Path
import shlex

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction, Shutdown
from launch.substitutions import Command
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.utilities import make_namespace_absolute, prefix_namespace
import yaml

from dm_ros.files.parameter_file import read_parameter_file
from dm_ros.mechanism.variants import variant_named
from dm_ros.settings import NodeParameters
from dm_ros.tools.bias import mechanism_of

ROWS = dict(NodeParameters().rows().values())
# of the node, by their names
PARAMETERS = ('variant', 'loss_law', 'rate', 'joint_prefix', 'realtime_priority')
ARGUMENTS = {
    'params_file': 'a parameter file for the node; what is given beside it counts before it',
    'namespace': 'the namespace of the node',
    'description': 'true to publish a URDF of the differential, by robot_state_publisher',
    'ros2_control': 'true, or a parameter file with other controllers, to start ros2_control',
    'record': 'a new folder, to record the topics of the node in it by ros2 bag',
} | {name: f'{ROWS[name].description}: {ROWS[name].allowed}; '
           'not given: as the file, else the node has it' for name in PARAMETERS}


def generate_launch_description():
    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value='', description=description)
          for name, description in ARGUMENTS.items()),
        OpaqueFunction(function=processes)])


def processes(context):
    """Return the processes that the arguments ask for; an empty one is not given."""
    given = {name: text for name, text in context.launch_configurations.items() if text}
    namespace = make_namespace_absolute(
        prefix_namespace(given.get('ros_namespace'), given.get('namespace', '')))
    shown = {'output': 'screen', 'emulate_tty': True, 'on_exit': ended}
    result = [Node(
        package='dm_ros', executable='differential', name='differential', namespace=namespace,
        parameters=[{name: value(name, given[name]) for name in PARAMETERS if name in given}],
        # not in parameters, where a file that is missing is passed over with a warning
        ros_arguments=['--params-file', given['params_file']] if 'params_file' in given else None,
        **shown)]
    controlled = 'ros2_control' in given
    if controlled or given.get('description') == 'true':
        command = urdf_command(given, f'{namespace.rstrip("/")}/differential')
        result.append(Node(
            package='robot_state_publisher', executable='robot_state_publisher',
            namespace=namespace,   # the joint_state_broadcaster has the clutches, too
            remappings=None if controlled else [('joint_states', 'differential/joint_states')],
            parameters=[{'publish_frequency': 50.0, 'robot_description': ParameterValue(
                Command(command), value_type=str)}], **shown))
    if controlled:
        result += control(given, namespace, shown)
    if 'record' in given:
        topics = f'{prefix_namespace(namespace, "differential")}/.*|/diagnostics'
        result.append(ExecuteProcess(cmd=[
            'ros2', 'bag', 'record', '--output', given['record'], '--regex', topics], **shown))
    return result


def control(given, namespace, shown):
    """Return the controller manager, and what starts all controllers of its parameter file."""
    file = given['ros2_control']
    if file == 'true':
        file = installed_controllers(given)
    sections = yaml.safe_load(Path(file).read_text())
    keys = (f'{namespace.rstrip("/")}/controller_manager', '/**/controller_manager',
            'controller_manager')
    found = [sections[key]['ros__parameters'] for key in keys if key in sections]
    if not found:
        raise RuntimeError(f'{file}: there is none of {", ".join(keys)}')
    controllers = [name for name, value in found[0].items()
                   if isinstance(value, dict) and 'type' in value]
    return [
        Node(package='controller_manager', executable='ros2_control_node', namespace=namespace,
             parameters=[file], **shown),
        Node(package='controller_manager', executable='spawner', namespace=namespace,
             arguments=[*controllers, '--param-file', file], output='screen',
             on_exit=lambda event, context: ended(event, context) if event.returncode else None)]


def installed_controllers(given):
    """Return the installed parameter file for the controllers of a mechanism."""
    values = read_parameter_file(given['params_file']) if 'params_file' in given else {}
    values.update({name: given[name] for name in PARAMETERS if name in given})
    if values.get('joint_prefix'):
        raise RuntimeError('ros2_control: with a joint_prefix it must be a file with such joints')
    mechanism = mechanism_of(values, variant_named(NodeParameters().variant).mechanism)
    return str(Path(__file__).parents[1] / 'config' / 'ros2_control'
               / f'{mechanism.name}_controllers.yaml')


def urdf_command(given, node):
    """Return the words of the command that prints the URDF of a node with such arguments."""
    options = {'params_file': '--params', 'variant': '--variant', 'joint_prefix': '--joint-prefix'}
    words = ['ros2 run dm_ros urdf']
    for name, option in options.items():
        if name in given:
            words += [f' {option} ', shlex.quote(given[name])]
    if 'ros2_control' in given:
        words += [' --ros2-control ', node]
    return words


def value(name, text):
    """Return the value of a parameter with its type; the node refuses what has another one."""
    try:
        typed = ROWS[name].kind(text)
    except ValueError:
        typed = text
    return ParameterValue(typed, value_type=type(typed))


def ended(event, context):
    """End all, with exit code 1 where the process failed by itself."""
    if event.returncode and not context.is_shutdown:
        raise RuntimeError(f'{event.process_name} has failed: all end')
    return Shutdown(reason=f'{event.process_name} has ended')
