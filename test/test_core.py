# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The core in C: the bits of Python, chosen by the environment, and not needed."""

import os
from pathlib import Path
import struct
import subprocess
import sys

import numpy as np
from properties import Twins
import pytest

from dm_ros import core, Simulation
from dm_ros.motion.models import LOSS_LAWS
from dm_ros.motion.packing import packed, packed_coupling

ROOT = Path(__file__).parents[1]
built = pytest.mark.skipif(core._chosen('') is None, reason='the core in C is not built')


def python(*arguments, **environment):
    """Return how a Python that finds this package ended."""
    return subprocess.run(
        [sys.executable, *arguments], capture_output=True, text=True, timeout=120,
        env={**os.environ, 'PYTHONPATH': str(ROOT), **environment})


@built
@pytest.mark.parametrize('ported', [False, True])
@pytest.mark.parametrize('clutched', [False, True])
@pytest.mark.parametrize('loss_law', LOSS_LAWS)
def test_c_and_python_give_the_same_bits_on_random_mechanisms(loss_law, clutched, ported):
    twins = Twins(loss_law, clutched, ported)
    for n in range(150):
        twins.run(n)
    print(twins)
    assert twins.cases == 150


@built
@pytest.mark.parametrize('loss_law', LOSS_LAWS)
def test_the_last_resort_on_half_shafts_has_the_same_bits(loss_law, monkeypatch):
    monkeypatch.setattr('dm_ros.motion.coupled.MOST_TRIALS', 3)
    twins = Twins(loss_law, ported=True)
    for n in range(30):
        twins.run(n)
    print(twins)
    assert twins.coarse_steps > 30


@built
def test_steps_with_half_shafts_are_in_the_language_that_was_chosen(monkeypatch):
    for coupled_step, language in ((core._chosen('').coupled_step, 'C'), (None, 'Python')):
        monkeypatch.setattr(core, 'coupled_step', coupled_step)
        assert Simulation('lsd_ode', ports={'front': (1e4, 100.0)}).language == language


@built
@pytest.mark.parametrize('choice, language', [('', 'C'), ('c', 'C'), ('python', 'Python')])
def test_the_environment_chooses_the_language(choice, language):
    process = python('-c', 'from dm_ros import core; print(core.language)', DM_ROS_CORE=choice)
    assert process.stdout == f'{language}\n'


def test_a_choice_that_there_is_not_is_refused_by_name():
    process = python('-c', 'import dm_ros.core', DM_ROS_CORE='fortran')
    assert "ImportError: DM_ROS_CORE: 'fortran' is not one of c, python" in process.stderr


def test_without_the_extension_python_does_it_and_c_is_refused(monkeypatch):
    monkeypatch.setitem(sys.modules, 'dm_ros._core', None)
    assert core._chosen('') is core._chosen('python') is None
    with pytest.raises(ImportError, match='DM_ROS_CORE: c is not built here'):
        core._chosen('c')


def test_a_build_without_a_compiler_ends_well(tmp_path):
    for name in ('setup.py', 'package.xml', 'core', 'dm_ros'):
        (tmp_path / name).symlink_to(ROOT / name)
    process = subprocess.run(
        [sys.executable, 'setup.py', 'build_ext', '--build-lib', 'out', '--build-temp', 'temp'],
        cwd=tmp_path, capture_output=True, text=True, timeout=120,
        env={**os.environ, 'CC': 'no-such-compiler'})
    assert process.returncode == 0, process.stderr
    assert not list((tmp_path / 'out').rglob('_core*'))


@built
def test_what_is_no_model_and_no_number_is_refused(monkeypatch):
    monkeypatch.setattr(core, 'Ticker', core._chosen('').Ticker)
    with pytest.raises(TypeError, match='model must be [0-9]+ bytes, not 8'):
        core.Ticker(bytes(8), False)
    ticker = Simulation('lsd_ode')._ticker
    assert ticker.language == 'C'
    for name, arguments, words in (
            ('tick', (('a',) * 3, (0.0, 0.0)), 'must be finite numbers'),
            ('tick', ((0.0,) * 2, (0.0, 0.0)), 'must be finite numbers'),
            ('tick', ((0.0,) * 3, (0.0, -1.0)), 'must be finite numbers'),
            ('reset', ([0.0, 0.0],), 'velocity must be a tuple of 2 numbers'),
            ('reset', (('a', 'b'),), 'must be real number'),
            ('follow', (None,), 'a ticker follows a ticker')):
        with pytest.raises(TypeError, match=words):
            getattr(ticker, name)(*arguments)
    with pytest.raises(TypeError, match='x must be a tuple of 2 numbers'):
        ticker.state = ticker.state._replace(x=(0.0,))


@built
@pytest.mark.parametrize('n, value, words', [
    (0, bytes(8), 'model must be [0-9]+ bytes, not 8'),
    (1, (0.0, 0.0), 'x must be a tuple of 3 numbers'),
    (2, (0.0, 'a'), 'must be real number'),
    (3, (0.0, 0.0), 'inputs must be a tuple of 3 numbers or None'),
    (3, (0.0, 'a', 0.0), 'must be real number')])
def test_what_is_no_step_on_half_shafts_is_refused(n, value, words):
    model = Simulation('lsd_ode', ports={'front': (1e4, 100.0)})._ticker.model
    arguments = [packed_coupling(model), (1.0, 0.0, 0.0), (0.0, 0.0), (5.0, None, 0.0), 1, True]
    core._chosen('').coupled_step(*arguments)
    arguments[n] = value
    with pytest.raises(TypeError, match=words):
        core._chosen('').coupled_step(*arguments)


@built
@pytest.mark.parametrize('torques', [[1, 2, 3], np.array([1.0, 2.0, 3.0]), ('1', '2', '3'),
                                     iter((1.0, 2.0, 3.0)), (True, np.float32(2), 3)])
def test_c_takes_the_numbers_that_python_takes(torques, monkeypatch):
    monkeypatch.setattr(core, 'Ticker', core._chosen('').Ticker)
    simulation, other = Simulation('lsd_ode'), Simulation('lsd_ode')
    assert simulation.step(torques) == other.step((1.0, 2.0, 3.0))


@built
def test_what_divides_by_zero_is_an_error_as_in_python():
    lsd = Simulation('lsd_ode')._ticker
    size = len(packed(lsd.model, lsd.run)) - 16
    model = struct.pack('dd', 0.0, 1.0) + bytes(size)   # passive, with a mesh_sign_speed of 0
    ticker = core._chosen('').Ticker(model, False)
    with pytest.raises(ArithmeticError):
        ticker.report()
