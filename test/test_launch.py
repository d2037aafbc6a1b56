# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The launch files as data, also where ``launch`` is not installed."""

import ast
from pathlib import Path

from dm_ros.settings import NodeParameters

ROOT = Path(__file__).parents[1]
FILES = sorted((ROOT / 'launch').glob('*.launch.py'))
PAGE = (ROOT / 'doc' / 'launch.md').read_text()


def constant(file, name):
    """Return the value of a constant of a launch file."""
    for node in ast.parse((ROOT / 'launch' / file).read_text()).body:
        if isinstance(node, ast.Assign) and node.targets[0].id == name:
            return ast.literal_eval(node.value)
    raise LookupError(name)


def test_arguments_by_the_name_of_a_parameter_are_parameters_of_the_node():
    names = {name for name, _ in NodeParameters().rows().values()}
    assert set(constant('differential.launch.py', 'PARAMETERS')) <= names


def test_the_page_tells_of_each_file_and_each_argument():
    names = [file.name for file in FILES]
    assert names == ['axle_pair.launch.py', 'differential.launch.py']
    arguments = [*constant('differential.launch.py', 'PARAMETERS'), 'params_file', 'namespace',
                 'description', 'ros2_control', 'record', 'front_params_file', 'rear_params_file']
    for word in (*names, *arguments):
        assert f'`{word}`' in PAGE
