# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The SROS2 policy grants the node what it uses and nothing more; files and messages are data."""

import ast
from pathlib import Path
import re
from xml.etree import ElementTree

import pytest

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


def test_what_make_starts_stays_on_this_host():
    """The demo, the fixtures and the tests set the range themselves or get it from make."""
    assert re.search(r'^test:.*\n(\t.*\n)*\t.*ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST',
                     (ROOT / 'Makefile').read_text(), re.MULTILINE)
    for name in ('dm_ros/tools/demo.py', 'dm_ros/testing/lockstep.py', 'test/ros/conftest.py'):
        text = (ROOT / name).read_text()
        assert re.search(r"ROS_AUTOMATIC_DISCOVERY_RANGE'(\] = |, )'LOCALHOST'", text), name
    # whoever else starts ROS in this repository says so too, but a node that its user starts
    for path, tree in sources():
        if ROOT / 'dm_ros' in path.parents or path.name == 'limited_slip.py':
            continue
        if 'rclpy.init' in calls(tree):
            assert 'LOCALHOST' in path.read_text(), path
