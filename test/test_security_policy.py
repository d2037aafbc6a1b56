# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The SROS2 policy grants the node what it uses and nothing more; files and messages are data."""

import ast
from pathlib import Path
import re
from xml.etree import ElementTree

import pytest

from dm_ros.commands import COMMANDS

ROOT = Path(__file__).parents[1]
POLICY = ROOT / 'config' / 'sros2_policy.xml'
# tag: (allowed attributes, allowed children), as in the schema of policies of version 0.2.0
SCHEMA = {
    'policy': ({'version'}, {'enclaves'}),
    'enclaves': (set(), {'enclave'}),
    'enclave': ({'path'}, {'profiles'}),
    'profiles': ({'type'}, {'profile', 'metadata'}),
    'profile': ({'ns', 'node'}, {'topics', 'services', 'actions'}),
    'topics': ({'publish', 'subscribe'}, {'topic'}),
    'services': ({'reply', 'request'}, {'service'}),
    'actions': ({'call', 'execute'}, {'action'}),
    'topic': (set(), set()), 'service': (set(), set()), 'action': (set(), set()),
}
NEEDED = {'policy': {'version'}, 'enclave': {'path'}, 'profile': {'ns', 'node'}}


def granted(profile, group, what):
    """Return the full names for which a group of a profile has ALLOW, as sros2 expands them."""
    own = f'{profile.get("ns").rstrip("/")}/{profile.get("node")}'
    return [re.sub('^~', own, entry.text) for entries in profile.findall(group)
            if entries.get(what) == 'ALLOW' for entry in entries]


def test_the_policy_has_the_form_that_sros2_reads():
    root = ElementTree.parse(POLICY).getroot()
    assert (root.tag, root.get('version')) == ('policy', '0.2.0')
    for element in root.iter():
        attributes, children = SCHEMA[element.tag]
        assert NEEDED.get(element.tag, set()) <= set(element.attrib) <= attributes
        assert {child.tag for child in element} <= children
        assert len(element) > 0 or not children
        if element.tag in ('topics', 'services'):
            assert element.attrib and set(element.attrib.values()) == {'ALLOW'}
        if not children:
            assert re.fullmatch(r'(~/|/)[a-z_]+(/[a-z_]+)*', element.text)


def test_the_policy_grants_what_the_node_uses_and_nothing_more(monkeypatch):
    rclpy = pytest.importorskip('rclpy')
    from rclpy.parameter import Parameter

    from dm_ros.ros.domain import own_domain
    from dm_ros.ros.node import DifferentialNode

    used = {'publish': set(), 'subscribe': set(), 'reply': set(), 'request': set()}
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    with own_domain() as domain:
        context = rclpy.Context()
        rclpy.init(context=context, domain_id=domain)
        try:
            for options in ({'symmetric.clutch.left.friction_surfaces': 2}, {'variant': 'lsd_ode'},
                            {f'port.{shaft}.kind': 'speed'
                             for shaft in ('pinion', 'left', 'right')},
                            {'variant': 'lsd_ode', **{
                                f'port.{shaft}.kind': 'speed'
                                for shaft in ('carrier', 'front', 'rear')}},
                            {'mode': 'lockstep'}, {'use_sim_time': True},
                            {'publish_clock': True}):
                node = DifferentialNode(context=context, parameter_overrides=[
                    Parameter(name, value=value) for name, value in options.items()])
                me = node.get_name(), node.get_namespace()
                for what, look in (('publish', node.get_publisher_names_and_types_by_node),
                                   ('subscribe', node.get_subscriber_names_and_types_by_node),
                                   ('reply', node.get_service_names_and_types_by_node),
                                   ('request', node.get_client_names_and_types_by_node)):
                    used[what].update(name for name, _ in look(*me))
                node.close()
        finally:
            rclpy.shutdown(context=context)
    profile, = ElementTree.parse(POLICY).getroot().iter('profile')
    for group, whats in (('topics', ('publish', 'subscribe')), ('services', ('reply', 'request'))):
        for what in whats:
            names = granted(profile, group, what)
            assert sorted(names) == sorted(used[what]), what


def sources():
    """Yield (path, syntax tree) of all Python of the project."""
    for folder in ('dm_ros', 'examples', 'bench'):
        for path in sorted((ROOT / folder).rglob('*.py')):
            yield path, ast.parse(path.read_text())


def calls(tree):
    """Return the calls of a module as dotted names, such as ``yaml.load``."""
    return [ast.unparse(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)]


def test_nothing_is_evaluated_and_nothing_unpickled():
    forbidden = {'eval', 'exec', 'compile', '__import__', 'os.system', 'os.popen', 'yaml.load',
                 'yaml.load_all', 'yaml.unsafe_load', 'yaml.full_load', 'pickle.load',
                 'pickle.loads', 'marshal.loads', 'numpy.load', 'np.load'}
    for path, tree in sources():
        assert not forbidden & set(calls(tree)), path
        for node in ast.walk(tree):
            if isinstance(node, ast.Call):
                assert not any(keyword.arg == 'shell' for keyword in node.keywords), path


def test_yaml_is_read_by_the_safe_loader_alone():
    loads = [node for _, tree in sources() for node in ast.walk(tree)
             if isinstance(node, ast.Call) and ast.unparse(node.func).startswith('yaml.')]
    assert loads
    for node in loads:
        loader, = [ast.unparse(k.value) for k in node.keywords if k.arg == 'Loader']
        assert loader == 'yaml.SafeLoader'


RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
LOCAL = re.compile(rf'{RANGE}\W+LOCALHOST\b')   # in a recipe, and as code sets or passes it


def recipe_lines():
    """Return all lines of recipes in the Makefile, those that go on joined."""
    return re.findall(r'^\t(.*)', (ROOT / 'Makefile').read_text().replace('\\\n', ' '),
                      re.MULTILINE)


def started_by_make():
    """Yield (path, recipe line) of each script and each command of this project in a recipe."""
    commands = {name: ROOT / 'dm_ros' / f'{module.replace(".", "/")}.py'
                for name, (module, _) in COMMANDS.items()}
    for line in recipe_lines():
        for script in re.findall(r'python (\S+\.py)\b', line):
            yield ROOT / script, line
        for name in re.findall(r'(?:bin|lib/dm_ros)/(\w+)', line):
            if name in commands:
                yield commands[name], line


def uses_ros(path):
    """Return whether a module imports rclpy or what of this package does."""
    return re.search(r'^\s*(import rclpy|from (rclpy|dm_ros\.ros)\b)', path.read_text(),
                     re.MULTILINE)


def test_the_tests_that_make_starts_stay_on_this_host():
    lines = [line for line in recipe_lines() if '-m pytest' in line]
    assert len(lines) >= 3
    for line in lines:
        assert LOCAL.search(line) or '--ignore=test/ros' in line, line


def test_what_make_starts_stays_on_this_host_and_a_node_of_a_user_is_as_visible_as_he_wants():
    """What make starts without a range sets it, as the fixtures do; nothing else touches it."""
    must = {path for path, line in started_by_make() if uses_ros(path) and not LOCAL.search(line)}
    assert ROOT / 'dm_ros/tools/demo.py' in must
    must.add(ROOT / 'dm_ros/testing/lockstep.py')
    transport = ROOT / 'dm_ros/ros/transport.py'   # has a profile for this host, and tests for it
    assert {path for path, _ in sources() if RANGE in path.read_text()} - {transport} == must
    for path in must:
        assert LOCAL.search(path.read_text()), path


def test_a_test_that_starts_ros_in_its_process_stays_on_this_host_without_make_too():
    starting = [path for path in sorted((ROOT / 'test').rglob('*.py'))
                if 'rclpy.init' in calls(ast.parse(path.read_text()))]
    assert ROOT / 'test/ros/conftest.py' in starting
    for path in starting:
        assert LOCAL.search(path.read_text()), path
