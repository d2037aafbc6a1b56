# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Two axles of a vehicle: a differential in ``front`` and one in ``rear``; both end together."""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, GroupAction, IncludeLaunchDescription
from launch.substitutions import EqualsSubstitution, IfElseSubstitution, LaunchConfiguration
from launch_ros.actions import PushROSNamespace

AXLES = ('front', 'rear')


def generate_launch_description():
    return LaunchDescription([*map(params_file, AXLES), *map(differential, AXLES)])


def params_file(axle):
    return DeclareLaunchArgument(
        f'{axle}_params_file', default_value=LaunchConfiguration('params_file', default=''),
        description=f'a parameter file for the {axle} differential in place of params_file')


def differential(axle):
    """Return one axle: its own of some arguments, the others as they are given for both."""
    namespace, prefix, record = (LaunchConfiguration(name, default='')
                                 for name in ('namespace', 'joint_prefix', 'record'))
    return GroupAction([   # what is set in a group is for it alone
        PushROSNamespace(namespace),
        IncludeLaunchDescription(
            str(Path(__file__).with_name('differential.launch.py')),
            launch_arguments={
                'params_file': LaunchConfiguration(f'{axle}_params_file'),
                'namespace': axle,
                'joint_prefix': [prefix, f'{axle}_'],
                'record': IfElseSubstitution(
                    EqualsSubstitution(record, ''), else_value=[record, f'/{axle}']),
            }.items())])
