# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The core in C: the bits of Python, chosen by the environment, and not needed."""

import os
from pathlib import Path
import subprocess
import sys

from properties import Twins
import pytest

from dm_ros import core
from dm_ros.motion.models import LOSS_LAWS

ROOT = Path(__file__).parents[1]
built = pytest.mark.skipif(core._chosen('') is None, reason='the core in C is not built')


def python(*arguments, **environment):
    """Return how a Python that finds this package ended."""
    return subprocess.run(
        [sys.executable, *arguments], capture_output=True, text=True, timeout=120,
        env={**os.environ, 'PYTHONPATH': str(ROOT), **environment})


@built
@pytest.mark.parametrize('clutched', [False, True])
@pytest.mark.parametrize('loss_law', LOSS_LAWS)
def test_c_and_python_give_the_same_bits_on_random_mechanisms(loss_law, clutched, monkeypatch):
    for name in core.STEPS:
        monkeypatch.setattr(core, name, getattr(core._chosen(''), name))
    twins = Twins(loss_law, clutched)
    for n in range(150):
        twins.run(n)
    print(twins)
    assert twins.cases == 150


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
def test_numbers_that_are_none_are_refused():
    passive = bytes(8 * 29), (0.0,) * 5, (0.0, 0.0), 1e-3, 1e-4, (0.0,) * 3
    paper = (bytes(8 * 34), bytes(8 * 10), (0.0,) * 6, (0.0,) * 3, (0.0, 0.0), 1e-3, 1e-4,
             (0.0,) * 3)
    for name, good, place, bad, words in (
            ('passive_step', passive, 0, b'', 'coefficients must be 232 bytes, not 0'),
            ('passive_step', passive, 1, (0.0,), 'u must be a tuple of 5 numbers'),
            ('passive_step', passive, 1, ('a',) * 5, 'must be real number'),
            ('passive_step', passive, 2, [0.0, 0.0], 'y must be a tuple of 2'),
            ('passive_step', passive, 5, (1.0,), 'form must be a tuple of 3'),
            ('paper_step', paper, 0, b'', 'coefficients must be 272 bytes'),
            ('paper_step', paper, 1, bytes(9), 'losses must be 184 bytes, not 9'),
            ('paper_step', paper, 3, (1.0,), 'T must be a tuple of 3')):
        with pytest.raises(TypeError, match=words):
            getattr(core._chosen(''), name)(*good[:place], bad, *good[place + 1:])


@built
def test_what_divides_by_zero_is_an_error_as_in_python():
    with pytest.raises(ArithmeticError):
        core._chosen('').passive_step(bytes(8 * 29), (0.0,) * 5, (1.0, 0.0), 1e-3, 1e-4,
                                      (0.0,) * 3)
