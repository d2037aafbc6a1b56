# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""How commands end: exit codes, one line for what is expected, quiet for a signal."""

import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import time

import pytest

from dm_ros.commands import COMMANDS
from dm_ros.ending import AGAIN, run_command, SIGNALS

ROOT = Path(__file__).parents[1]


@pytest.fixture(autouse=True)
def handlers():
    """Give the signals back as they were."""
    before = {number: signal.getsignal(number) for number in SIGNALS}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def failing(error):
    """Return work that fails."""
    def work():
        raise error
    return work


@pytest.mark.parametrize('error, line', [
    (ValueError('rate: 0\n  is not allowed'), 'tool: error: rate: 0 is not allowed\n'),
    (OSError(28, 'No space left on device', 'a.csv'),
     'tool: error: a.csv: No space left on device\n'),
    (OSError(28, 'No space left on device'), 'tool: error: out: No space left on device\n'),
    (OSError('every domain is in use'), 'tool: error: every domain is in use\n')])
def test_what_is_expected_is_one_line_and_its_code(error, line, capsys):
    assert run_command('tool', failing(error), 'out') == 2
    assert run_command('tool', failing(error), 'out', code=1) == 1
    assert capsys.readouterr() == ('', line * 2)


def test_what_is_not_expected_is_a_fault_of_the_command():
    with pytest.raises(KeyError):
        run_command('tool', failing(KeyError('x')))
    with pytest.raises(ValueError):
        run_command('tool', failing(ValueError('x')), expected=(RuntimeError,))


def test_a_pager_that_was_left_is_no_error(capsys):
    assert run_command('tool', failing(BrokenPipeError(32, 'Broken pipe'))) == 141
    assert capsys.readouterr() == ('', '')


@pytest.mark.parametrize('number', SIGNALS)
@pytest.mark.parametrize('until_signal', [False, True])
def test_a_signal_ends_the_work_quietly_and_a_second_one_not_its_tidying_up(
        number, until_signal, capsys):
    tidied = []

    def work():
        try:
            os.kill(os.getpid(), number)
        finally:
            os.kill(os.getpid(), number)
            tidied.append(True)
    assert run_command('tool', work, until_signal=until_signal) == (
        0 if until_signal else 128 + number)
    assert tidied and capsys.readouterr() == ('', '')
    if until_signal:   # nothing disturbs the end of the interpreter
        assert signal.getsignal(number) == signal.SIG_IGN


class Signals:
    """Sends this process a signal where Python drops every exception."""

    def __init__(self, number):
        self._number = number

    def __del__(self):
        os.kill(os.getpid(), self._number)


@pytest.mark.parametrize('number', SIGNALS)
def test_a_signal_in_the_end_of_an_object_ends_the_work_too(number, capsys):
    def work():
        Signals(number)
        time.sleep(60.0)
        raise AssertionError('it was lost')
    hook = sys.unraisablehook
    assert run_command('tool', work) == 128 + number
    assert sys.unraisablehook is hook
    assert capsys.readouterr() == ('', '')


@pytest.mark.parametrize('number', SIGNALS)
def test_a_signal_in_the_end_of_the_last_object_disturbs_nothing(number, capsys):
    assert run_command('tool', lambda: Signals(number) and None) == 0
    time.sleep(5 * AGAIN)
    assert capsys.readouterr() == ('', '')


class Fails:
    def __del__(self):
        raise ValueError('in its end')


def test_what_else_fails_in_the_end_of_an_object_is_told(capsys):
    assert run_command('tool', Fails) == 0
    assert 'ValueError: in its end' in capsys.readouterr().err


def test_handlers_are_given_back_and_what_a_shell_lets_it_ignore_stays_ignored():
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    before = [signal.getsignal(number) for number in SIGNALS]
    assert run_command('tool', lambda: os.kill(os.getpid(), signal.SIGINT)) == 0
    assert [signal.getsignal(number) for number in SIGNALS] == before


def test_every_command_ends_so():
    assert len(COMMANDS) > 5
    for module in [*(module for module, _ in COMMANDS.values()), 'ros.driven_node']:
        path = ROOT / 'dm_ros' / (module.replace('.', '/') + '.py')
        of_all = 'main_of' if module in ('ros.node', 'ros.driveline_node') else 'run_command'
        assert path.read_text().count(f'return {of_all}(') == 1, path


# a signal comes when Python begins to load the command
EARLY = """
import os, sys
class Loading:
    def find_spec(name, path, target=None):
        if name == 'dm_ros.{module}':
            os.kill(os.getpid(), {number})
sys.meta_path.insert(0, Loading)
from dm_ros.commands import {name}
sys.exit({name}())
"""


@pytest.mark.parametrize('number', SIGNALS)
@pytest.mark.parametrize('name', COMMANDS)
def test_a_signal_ends_each_command_quietly_also_while_python_loads_it(name, number):
    module, until_signal = COMMANDS[name]
    ended = subprocess.run(
        [sys.executable, '-c', EARLY.format(name=name, module=module, number=int(number))],
        capture_output=True, text=True)
    assert (ended.returncode, ended.stdout, ended.stderr) == (
        0 if until_signal else 128 + number, '', '')


def test_the_console_scripts_are_the_commands():
    text = (ROOT / 'setup.py').read_text()
    scripts = dict(re.findall(r"'(\w+) = dm_ros\.commands:(\w+)'", text))
    assert scripts == {name: name for name in COMMANDS}
