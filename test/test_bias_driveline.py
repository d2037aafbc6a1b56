# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The tool ``bias`` with a driveline says of each differential what it says of it alone."""

import dataclasses

from mechanisms import random_self_locking, random_symmetric
import numpy as np
import pytest

from dm_ros import SelfLockingParameters, SymmetricParameters
from dm_ros.bias import torque_bias
from dm_ros.files.parameter_file import written
from dm_ros.tools.bias import main


@pytest.fixture
def said(capsys):
    """Return what calls the command and returns the lines that it prints."""
    def call(*arguments):
        assert main(list(map(str, arguments))) == 0
        out, err = capsys.readouterr()
        assert not err
        return out.splitlines()
    return call


def saved(path, *tables):
    """Write tables as a parameter file, each with a prefix of its names; return its path."""
    values = {prefix + name.removeprefix(p.prefix): value
              for prefix, p in tables for name, value in p.named().items()}
    path.write_text(written(values, {}, ()))
    return path


def with_plates(p):
    """Return parameters of an axle that has clutches."""
    return dataclasses.replace(p, n_F1=3, n_F2=5, mu_1=0.05, mu_2=0.08, N_1=30.0, N_2=60.0)


@pytest.mark.parametrize('reverse', [[], ['--reverse']])
@pytest.mark.parametrize('seed', range(5))
def test_each_differential_has_the_limits_that_it_has_alone(seed, reverse, said, tmp_path):
    rng = np.random.default_rng(seed)
    centre, rear = random_self_locking(rng), with_plates(random_symmetric(rng))
    front = random_symmetric(rng)   # open
    lines = said('--driveline', 'awd', '--torque', 2000, *reverse, '--params', saved(
        tmp_path / 'car.yaml', ('driveline.centre', centre), ('driveline.front', front),
        ('driveline.rear', rear)))
    expected = []
    for name, p in (('centre', centre), ('rear', rear)):
        alone = said('--torque', 2000, *reverse, '--params',
                     saved(tmp_path / f'{name}.yaml', (p.prefix, p)))
        expected.append([line.replace('this parameter set', f'the {name} differential')
                         for line in alone])
    assert lines[:2] == expected[0] and lines[3:] == expected[1] != expected[0]
    split, _ = torque_bias(front, direction=-1 if reverse else 1)
    left, right = (f'{100 * share:.1f} %' for share in split.share)
    assert lines[2] == 'the front differential ' + (
        f'takes {left} of any torque that brakes the carrier from the left and {right} from the '
        'right: it has no clutches' if reverse else
        f'sends {left} of any torque to the left and {right} to the right: it has no clutches')


def test_what_has_no_friction_splits_any_torque_alike():
    """So that one line tells all of it."""
    rng = np.random.default_rng(9)
    for p in (SymmetricParameters(), random_symmetric(rng),
              SelfLockingParameters(n_F1=0, n_F2=0)):
        for direction in (1, -1):
            large, _ = torque_bias(p, direction=direction)
            for torque in (1.0, 300.0):
                for split in torque_bias(p, torque, direction):
                    assert split.share == pytest.approx(large.share, rel=1e-12)


def test_a_centre_without_friction_splits_as_its_gears(said, tmp_path):
    p = SelfLockingParameters(n_F1=0, n_F2=0, eta_0B=1.0, eta_1G=1.0, eta_2G=1.0)
    first, *others = said('--driveline', 'awd', '--params', saved(
        tmp_path / 'car.yaml', ('driveline.centre', p)))
    assert first == ('the centre differential sends 40.0 % of any torque to the front and 60.0 % '
                     'to the rear: its clutches have no friction')
    assert len(others) == 2


@pytest.mark.parametrize('layout, names', [('fwd', ['front']), ('rwd', ['rear'])])
def test_a_car_with_one_driven_axle_has_one_differential(layout, names, said):
    assert [line.split()[1] for line in said('--driveline', layout)] == names


@pytest.mark.parametrize('arguments, content, message', [
    (['--mechanism', 'lsd'], '', '--mechanism: a driveline is made of several differentials'),
    (['--share-to', 'rear', '80'], '', '--share-to: a driveline is made of several'),
    (['--forces', '0', '200'], '', '--forces: a driveline is made of several'),
    (['--torque', '-1'], '', '--torque: -1.0 is not allowed'),
    (['--torque', 'nan'], '', '--torque: nan is not allowed'),
    ([], 'lsd.clutch.rear.preload: 1.0', 'lsd.clutch.rear.preload: there is no such parameter'),
    (['--torque', '0.1'], 'driveline.centre.efficiency.front_mesh: 0.8, '
     'driveline.centre.efficiency.rear_mesh: 0.8',
     'the centre differential: torque: 0.1 N m does not turn the shafts')])
def test_command_refuses_in_one_line(arguments, content, message, tmp_path, capsys):
    if content:
        path = tmp_path / 'p.yaml'
        path.write_text(f'/**: {{ros__parameters: {{{content}}}}}')
        arguments = [*arguments, '--params', str(path)]
    assert main(['--driveline', 'awd', *arguments]) == 2
    out, err = capsys.readouterr()
    assert not out and err.startswith('bias: error: ') and message in err
    assert err.count('\n') == 1
