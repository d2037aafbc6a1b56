# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Parameters that count for nothing do not vanish without a word."""

import pytest

from dm_ros.files.parameter_file import default_text, missing
from dm_ros.mechanism.variants import MECHANISMS, SELF_LOCKING, SYMMETRIC
from dm_ros.settings import known_rows, names_for, passed_over
from dm_ros.tools import bias, simulate

OTHERS = {'lsd': ['initial_velocity.left', 'initial_velocity.right', 'port.pinion.kind',
                  'port.left.stiffness', 'port.right.damping', 'symmetric.inertia.left'],
          'symmetric': ['initial_velocity.front', 'initial_velocity.rear', 'port.carrier.kind',
                        'port.front.stiffness', 'port.rear.damping', 'lsd.inertia.rear']}
OWN = ['rate', 'variant', 'substeps', 'use_sim_time', 'qos_overrides./clock.depth']


@pytest.fixture
def lines(tmp_path, monkeypatch, capsys):
    """Return a function that runs a tool in a folder with files; it returns lines of stderr."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'symmetric.csv').write_text('time,pinion,left,right\n0,1,0,0\n0.1,0,0,0\n')
    (tmp_path / 'lsd.csv').write_text('time,carrier,front,rear\n0,1,0,0\n0.1,0,0,0\n')
    for mechanism in MECHANISMS.values():
        (tmp_path / f'{mechanism.name}.yaml').write_text(default_text(mechanism))

    def lines(tool, *arguments):
        assert tool.main(list(arguments)) == 0
        return [line for line in capsys.readouterr().err.splitlines() if 'warning' in line]
    return lines


@pytest.mark.parametrize('mechanism', MECHANISMS.values(), ids=lambda mechanism: mechanism.name)
def test_every_parameter_is_of_a_mechanism_and_those_of_others_are_counted_and_named(mechanism):
    values = dict.fromkeys(OTHERS[mechanism.name] + OWN, 1.0)
    assert passed_over(values, mechanism) == (
        f'6 parameters of another mechanism than the {mechanism.title} count for nothing: '
        + ', '.join(OTHERS[mechanism.name]))
    assert passed_over(values, SYMMETRIC, SELF_LOCKING) is None
    assert passed_over(dict.fromkeys(names_for(mechanism)), mechanism) is None
    others = set(known_rows()) - set(names_for(mechanism))
    assert others >= set(OTHERS[mechanism.name])
    assert passed_over(dict.fromkeys(known_rows()), mechanism).startswith(f'{len(others)} ')


@pytest.mark.parametrize('variant, mechanism', [
    ('lsd_ode', 'symmetric'), ('symmetric_dae', 'lsd')])
def test_simulate_warns_of_a_file_for_the_other_mechanism_and_runs(lines, variant, mechanism):
    own = variant.partition('_')[0]
    arguments = '--variant', variant, '--torques', f'{own}.csv', '--out', 'OUT.csv'
    assert not lines(simulate, *arguments, '--params', f'{own}.yaml')
    line, = lines(simulate, *arguments, '--params', f'{mechanism}.yaml')
    names = MECHANISMS[mechanism].parameters().named()
    assert line.startswith(f'simulate: warning: {len(names)} parameters of another mechanism')
    assert set(line.rpartition('nothing: ')[2].split(', ')) == names.keys()


def test_bias_warns_of_a_file_for_the_other_mechanism_and_answers(lines):
    assert not lines(bias, '--params', 'lsd.yaml')
    line, = lines(bias, '--params', 'lsd.yaml', '--mechanism', 'symmetric')
    assert line.startswith('bias: warning: ') and 'lsd.clutch.rear.preload' in line


@pytest.mark.parametrize('section', ['diferential', '/other', '/car/differential', '/*/*/node'])
def test_a_file_for_another_node_alone_is_told(lines, tmp_path, section):
    file = tmp_path / 'other.yaml'
    text = f'{section}: {{ros__parameters: {{rate: 7.0}}}}\n'
    file.write_text(text)
    line, = lines(simulate, '--variant', 'lsd_ode', '--torques', 'lsd.csv', '--out', 'OUT.csv',
                  '--params', 'other.yaml')
    full_name = '/' + section.lstrip('/')
    assert line == ('simulate: warning: other.yaml: nothing in it is for /differential, '
                    f'but for {full_name}')
    file.write_text(f'{text}/**: {{ros__parameters: {{rate: 8.0}}}}')
    assert missing(file) is None
    file.write_text('# nothing')
    assert missing(file) is None
