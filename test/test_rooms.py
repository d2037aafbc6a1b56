# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The rooms of the package: who may use whom, and who may know ROS."""

import ast
import importlib
import os
from pathlib import Path
import re
import subprocess
import sys

import pytest

ROOT = Path(__file__).parents[1] / 'dm_ros'
FLOORS = [   # from the ground up; a file of the package itself is a room of its own
    {'ending', 'core'}, {'mechanism'}, {'motion'}, {'driveline'},
    {'settings', 'ensemble', 'driven'}, {'files'}, {'plant', 'driveline_plant', 'fmu'},
    {'watch'}, {'ros'}, {'tools', 'testing'}, {'__init__', 'bias', 'commands', 'energy', 'gym'}]
KNOW_ROS = {'ros', 'tools', 'testing'}
NEED_MORE = {'gym'}   # an extra, to be imported
PRIVATES = ROOT / 'ros' / 'privates.py'
INNER = {'handle', 'impl', 'take_message', 'WaitSet', 'ParameterService'}   # names within rclpy
FILES = sorted(ROOT.rglob('*.py'))


def room(path):
    """Return the room of a file of the package."""
    first, *rest = path.relative_to(ROOT).parts
    return first if rest else Path(first).stem


def floor(name):
    """Return on which floor a room is."""
    return next(n for n, rooms in enumerate(FLOORS) if name in rooms)


def imports(path):
    """Return the names of all modules that a file imports anywhere in it."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f'{path}: a relative import'
            names |= {f'{node.module}.{alias.name}' for alias in node.names}
    return names


def own(path):
    """Return the files of the package that a file imports."""
    found = set()
    for name in imports(path):
        if name.split('.')[0] != 'dm_ros':
            continue
        parts = name.split('.')[1:]
        for end in (len(parts), len(parts) - 1):   # what is imported from a module, too
            base = ROOT.joinpath(*parts[:end])
            if base.with_suffix('.py').is_file() and end:
                found.add(base.with_suffix('.py'))
                break
            if (base / '__init__.py').is_file():
                found.add(base / '__init__.py')
                break
        else:
            raise AssertionError(f'{path}: {name} is nowhere')
    return found


def module(path):
    """Return the full name of the module of a file."""
    return '.'.join(path.relative_to(ROOT.parent).with_suffix('').parts).removesuffix('.__init__')


def test_every_file_is_in_a_room_that_is_known():
    assert {room(path) for path in FILES} == set().union(*FLOORS)
    assert len(FILES) > 40


def test_no_file_asks_for_a_second_look():
    assert not {str(path): lines for path in FILES
                if (lines := len(path.read_text().splitlines())) > 400}


def test_no_script_of_the_page_does_either():
    own = [path for path in (ROOT / 'watch' / 'web').iterdir() if path.is_file()]
    assert len(own) > 8
    assert not {path.name: lines for path in own
                if (lines := len(path.read_text().splitlines())) > 400}


def test_all_files_of_the_page_and_of_fmus_are_installed():
    setup = (ROOT.parent / 'setup.py').read_text()
    patterns = re.search(r'package_data=\{NAME: \[(.*)\]\}', setup).group(1)
    installed = {path for pattern in re.findall(r"'(.+?)'", patterns)
                 for path in ROOT.glob(pattern)}
    web = {path for path in (ROOT / 'watch' / 'web').rglob('*') if path.is_file()}
    core = {path for path in (ROOT / 'sources').glob('**/*') if path.is_file()}
    assert len(core) > 20 and web | core <= installed


def test_only_the_rooms_of_ros_import_it():
    ros = {path for path in FILES
           if any(name.split('.')[0] == 'rclpy' or '_msgs' in name or name.startswith('std_srvs')
                  for name in imports(path))}
    assert {room(path) for path in ros} <= KNOW_ROS
    assert ROOT / 'ros' / 'driven_node.py' in ros


def test_what_is_not_of_ros_loads_without_it():
    modules = [module(path) for path in FILES if room(path) not in KNOW_ROS | NEED_MORE]
    code = (f'import sys, {", ".join(modules)}\n'
            'dm_ros.Simulation("lsd_ode").step((1, 2, 3))\n'
            'print(*sorted(sys.modules))')
    path = os.pathsep.join([str(ROOT.parent), *filter(None, sys.path)])
    loaded = subprocess.run([sys.executable, '-c', code], env={**os.environ, 'PYTHONPATH': path},
                            capture_output=True, text=True, check=True).stdout.split()
    assert set(modules) <= set(loaded) and len(modules) > 20
    assert not [m for m in loaded if m.startswith(('rclpy', 'rcl_', 'std_msgs', 'sensor_msgs'))]


@pytest.mark.parametrize('path', FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_imports_go_down_or_sideways_within_a_room(path):
    for other in own(path):
        assert room(other) == room(path) or floor(room(other)) < floor(room(path)), other


def test_no_file_imports_itself_through_others():
    graph = {path: own(path) for path in FILES}
    while leaves := [path for path, others in graph.items() if not others & graph.keys()]:
        for path in leaves:
            del graph[path]
    assert not graph, sorted(map(str, graph))


def reached_into(path):
    """Return what a file touches that belongs to another: its private names, or inner ones."""
    tree = ast.parse(path.read_text())
    mine = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
    found = {part for name in imports(path) for part in name.split('.')
             if part in INNER or part.startswith('_') and not part.startswith('__')}
    for node in ast.walk(tree):
        if not isinstance(node, ast.Attribute):
            continue
        if isinstance(node.ctx, ast.Store) and ast.unparse(node.value) == 'self':
            mine.add(node.attr)
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute):
            private = node.attr.startswith('_') and not node.attr.startswith('__')
            own = ast.unparse(node.value) == 'self' and node.attr in mine
            if node.attr in INNER or private and not own:
                found.add(node.attr)
    return found


def test_no_file_but_one_touches_private_parts_of_rclpy():
    assert reached_into(PRIVATES) >= {
        '_parameter_overrides', 'take_message', 'impl', 'WaitSet', '_get_node'}
    others = [path for path in FILES if room(path) in KNOW_ROS and path != PRIVATES]
    assert len(others) > 15
    # os._exit is public, whatever its name
    assert not {path.name: names for path in others if (names := reached_into(path) - {'_exit'})}


def test_no_class_but_one_overrides_private_parts_of_rclpy():
    pytest.importorskip('rclpy')
    overriding = set()
    for path in FILES:
        if room(path) != 'ros':
            continue
        for found in vars(importlib.import_module(module(path))).values():
            if isinstance(found, type) and found.__module__ == module(path):
                inherited = {name for base in found.mro() if base.__module__.startswith('rclpy')
                             for name in vars(base)}
                if [name for name in inherited & vars(found).keys()
                        if name.startswith('_') and not name.startswith('__')]:
                    overriding.add(path)
    assert overriding == {PRIVATES}
