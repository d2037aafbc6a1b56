# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Parameter files are read as ROS 2 reads them; the default files hold exactly the defaults."""

from pathlib import Path

import pytest
import yaml

from dm_ros.files.parameter_file import default_text, read_parameter_file, written
from dm_ros.mechanism.variants import SELF_LOCKING, SYMMETRIC
from dm_ros.settings import NodeParameters

CONFIG = Path(__file__).parent.parent / 'config'
FILES = {'symmetric.yaml': SYMMETRIC, 'lsd.yaml': SELF_LOCKING}


@pytest.fixture
def read(tmp_path):
    def read(text):
        path = tmp_path / 'file.yaml'
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_parameter_file(path)
    return read


@pytest.mark.parametrize('name, mechanism', FILES.items())
def test_default_files_are_what_the_tables_say(name, mechanism):
    assert (CONFIG / name).read_text() == default_text(mechanism)
    assert read_parameter_file(CONFIG / name) == mechanism.parameters().named()


@pytest.mark.parametrize('mechanism', FILES.values())
def test_default_files_mean_the_same_to_other_yaml_readers(mechanism):
    def flat(tree, prefix=''):
        for name, value in tree.items():
            if isinstance(value, dict):
                yield from flat(value, f'{prefix}{name}.')
            else:
                yield prefix + name, value
    tree = yaml.safe_load(default_text(mechanism))
    assert dict(flat(tree['/**']['ros__parameters'])) == mechanism.parameters().named()


@pytest.mark.parametrize('mechanism', FILES.values())
def test_default_files_mark_every_assumed_value(mechanism):
    rows = mechanism.parameters.rows().values()
    assumed = [row for _, row in rows if 'assumed' in row.description]
    assert default_text(mechanism).count('(assumed') == len(assumed)


def test_names_are_nested_dotted_or_mixed(read):
    assert read("""
/**:
  ros__parameters:
    lsd.inertia.front: 0.1
    lsd.inertia: {rear: 0.2}
    lsd:
      clutch.front.preload: 50.0
      satellite_count: 3
    rate: 100.0
""") == {'lsd.inertia.front': 0.1, 'lsd.inertia.rear': 0.2, 'lsd.clutch.front.preload': 50.0,
         'lsd.satellite_count': 3, 'rate': 100.0}


@pytest.mark.parametrize('section', ['/**', '/*', '"*"', '"**"', 'differential', '/differential',
                                     '/**/differential', '{above}'])
def test_sections_for_the_node_are_read(read, section):
    text = f'{section}:\n  ros__parameters: {{rate: 7.0}}'
    if section == '{above}':
        text = '/:\n  differential:\n    ros__parameters: {rate: 7.0}'
    assert read(text) == {'rate': 7.0}


@pytest.mark.parametrize('section', ['/other', 'differential2', '/ns/differential',
                                     '/*/differential'])
def test_sections_for_other_nodes_are_not_read(read, section):
    assert read(f'{section}:\n  ros__parameters: {{what: [ever]}}') == {}


def test_the_later_section_wins(read):
    assert read('differential: {ros__parameters: {rate: 1.0, substeps: 2}}\n'
                '/**: {ros__parameters: {rate: 3.0}}') == {'rate': 3.0, 'substeps': 2}


@pytest.mark.parametrize('text, value', [
    ('1e-3', 1e-3), ('1E3', 1e3), ('.5', 0.5), ('5.', 5.0), ('+1.0', 1.0), ('1.e1', 10.0),
    ('08', 8.0), ('05.0', 5.0), ('0x1p3', 8.0)])
def test_doubles_are_those_of_ros(read, text, value):
    text = f'/**: {{ros__parameters: {{torque_timeout: {text}}}}}'
    assert read(text) == {'torque_timeout': value}


@pytest.mark.parametrize('text, value', [('16', 16), ('0x10', 16), ('010', 8), ('+2', 2),
                                         ('05', 5)])
def test_integers_are_those_of_ros(read, text, value):
    assert read(f'/**: {{ros__parameters: {{substeps: {text}}}}}') == {'substeps': value}


def test_what_every_node_takes_is_let_through(read):
    assert read("""
/**:
  ros__parameters:
    use_sim_time: yes
    qos_overrides: {/clock: {subscription: {depth: 3}}}
""") == {'use_sim_time': True, 'qos_overrides./clock.subscription.depth': 3}


def test_an_empty_file_gives_nothing(read):
    assert read('') == {}


@pytest.mark.parametrize('parameters, parts', [
    ('rate: 5', ['rate: 5 is an integer', 'a double', '5.0']),
    ('rate: "5.0"', ["rate: '5.0' is a string", 'a double']),
    ('rate: true', ['rate: True is a bool', 'a double']),
    ('rate: [5.0]', ['rate: ', 'is a list']),
    ('rate: null', ["rate: 'null' is a string"]),
    ('rate:', ['rate: there is no value']),
    ('substeps: 2.0', ['substeps: 2.0 is a double', 'an integer']),
    ('substeps: 0', ['substeps: 0 is not allowed', '[1, 1000]']),
    ('variant: other', ["variant: 'other'", 'lsd_dae']),
    ('variant: 3', ['variant: 3 is an integer', 'a string']),
    ('use_sim_time: 1', ['use_sim_time: 1 is an integer', 'a bool']),
    ('rate: .nan', ['rate: nan']),
    ('rate: -.inf', ['rate: -inf']),
    ('rate: 99999999999999999999', ['rate: 1e+20']),
    ('lsd.inertia.front: -1.0', ['lsd.inertia.front: -1.0']),
    ('lsd: {inertia: {left: 1.0}}', ['lsd.inertia.left: there is no such parameter']),
    ('lsd: 1.0', ['lsd: there is no such parameter']),
    ('"a\\nb": 1.0', ['there is no such parameter']),
    ('symmetric.final_drive_ratio: 0.0', ['symmetric.final_drive_ratio: 0.0', 'not be 0']),
    ('lsd.clutch.rear.friction_coefficient: 9.0', ['lsd.clutch.rear', 'locks itself']),
    ('{rate: 1.0, rate: 2.0}', ['rate: given twice', 'line 1', 'would take the last']),
    ('{lsd.inertia.rear: 1.0, lsd: {inertia.rear: 1.0}}', ['lsd.inertia.rear: given twice']),
    ('{rate: 1.0, rate: {a: 2.0}}', ['rate: given twice']),
    ('substeps: 05.0', ['substeps: 5.0 is a double']),
    ('rate: 05', ['rate: 5 is an integer']),
    ('rate: 1e-310', ["rate: '1e-310' is a string"]),
    ('rate: 1e999', ["rate: '1e999' is a string"]),
    ('rate: !!float 5', ['line 1', 'YAML tag']),
    ('rate: [[5.0]]', ['rate: a list has single values']),
    ('{lsd: {}, rate: 5.0}', ['lsd: there is no name below it']),
])
def test_bad_parameters_are_refused_by_name(read, tmp_path, parameters, parts):
    parameters = parameters if parameters.startswith('{') else f'{{{parameters}}}'
    with pytest.raises(ValueError) as error:
        read(f'/**: {{ros__parameters: {parameters}}}')
    assert str(error.value).startswith(f'{tmp_path / "file.yaml"}: ')
    for part in parts:
        assert part in str(error.value)


@pytest.mark.parametrize('text, part', [
    (b'\xff\xfe\xfa', 'UTF-8'),
    ('a\0b', 'not YAML'),
    ('a: [', 'line 1: not YAML'),
    ('just words', 'ros__parameters'),
    ('- a\n- b', 'ros__parameters'),
    ('/**:\n  rate: 1.0', 'ros__parameters'),
    ('/**:', 'ros__parameters'),
    ('ros__parameters:\n  rate: 1.0', 'below a node'),
    ('/**: {ros__parameters: {}, ros__parameters: {}}', 'nothing may follow'),
    ('//a: {ros__parameters: {}}', 'cannot be the name of a node, line 1'),
    ('/**: {ros__parameters: 3}', 'ros__parameters'),
    ('/**: {ros__parameters: {rate: &a 1.0, torque_timeout: *a}}', 'aliases'),
    ('[' * 600 + ']' * 600, 'nested too deeply'),
])
def test_what_is_no_parameter_file_is_refused_in_one_line(read, text, part):
    with pytest.raises(ValueError) as error:
        read(text)
    assert part in str(error.value) and '\n' not in str(error.value)


@pytest.mark.parametrize('name', ['', 'missing.yaml'])
def test_an_unreadable_file_is_named(tmp_path, name):
    with pytest.raises(ValueError, match=str(tmp_path / name)):
        read_parameter_file(tmp_path / name)


def test_every_parameter_of_the_node_can_stand_in_a_file(read):
    def text(value):
        return str(value).lower() if isinstance(value, bool) else str(value) or "''"
    named = NodeParameters().named()
    lines = [f'    {name}: {text(value)}' for name, value in named.items()]
    assert read('/**:\n  ros__parameters:\n' + '\n'.join(lines)) == named


def test_what_is_written_is_read_again_with_its_types(tmp_path):
    values = {'variant': 'lsd_ode', 'joint_prefix': 'no', 'rate': 1e-1, 'substeps': 5,
              'torque_limit': 1e6, 'lsd.inertia.front': 1e-5, 'lsd.inertia.rear': 0.1 + 0.2,
              'use_sim_time': True, 'qos_overrides./clock.history': ['1', 'true']}
    path = tmp_path / 'written.yaml'
    path.write_text(written(values, {'lsd.inertia.front': '95 %: # no value'}, ['a: b', '# c']))
    again = read_parameter_file(path)
    assert again == values and list(map(type, again.values())) == list(map(type, values.values()))
