# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
Processes that share one start of Python, for tests that claim nothing about that start.

The fork server of ``multiprocessing`` loads Python, ROS and the package once for each worker of
pytest. A ``Forked`` process is a fork of it: it has its own exit code, signals, streams, folder
and environment, and is there in a tenth of the time that loading takes.
"""

import multiprocessing
import os
from pathlib import Path
import sys
import tempfile
import time

PATIENCE = 120.0   # s of real time for what a process will do
SERVER = multiprocessing.get_context('forkserver')
SERVER.set_forkserver_preload([   # what is not installed is passed over
    'dm_ros.ros.node', 'dm_ros.tools.demo', 'dm_ros.tools.play_torques',
    'matplotlib.backends.backend_agg', 'matplotlib.figure'])


def command(name):
    """Return the source that runs a command of the package as its console script does."""
    return f'import sys; from dm_ros.commands import {name}; sys.exit({name}())'


def run(source, arguments, streams, folder, environment):
    """Be the process: it has nothing of this one but what is loaded."""
    for number, path in enumerate(streams, start=1):
        os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT), number)
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(folder)
    sys.argv = ['-c', *arguments]
    exec(compile(source, '<forked>', 'exec'), {'__name__': '__main__'})


class Forked:
    """
    A process that runs Python source, as ``python -c`` would; use it as a context manager.

    :param source: Python; arguments: what it finds in ``sys.argv``.
    :param folder: where it runs; env: its environment; those of this process by default.
    """

    def __init__(self, source, *arguments, folder=None, env=None):
        self._streams = tempfile.TemporaryDirectory()
        self._paths = [Path(self._streams.name, name) for name in ('stdout', 'stderr')]
        for path in self._paths:
            path.touch()
        self._process = SERVER.Process(target=run, daemon=True, args=(
            source, list(map(str, arguments)), self._paths, folder or os.getcwd(),
            dict(os.environ if env is None else env)))
        self._process.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._process.kill()
        self._process.join()
        self._streams.cleanup()

    @property
    def returncode(self):
        """The exit code, below 0 for a signal, None while it runs."""
        return self._process.exitcode

    @property
    def output(self):
        """What it has written to stdout up to now."""
        return self._paths[0].read_text()

    @property
    def errors(self):
        """What it has written to stderr up to now."""
        return self._paths[1].read_text()

    def says(self, words):
        """Wait until it has written the words."""
        end = time.monotonic() + PATIENCE
        while words not in self.output + self.errors:
            assert time.monotonic() < end and self.returncode is None, self.errors
            time.sleep(0.01)

    @property
    def pid(self):
        """Its process id."""
        return self._process.pid

    def send_signal(self, number):
        """Send it a signal."""
        os.kill(self._process.pid, number)

    def ended(self, number=None):
        """Send it a signal, if one is given, wait for its end and return its exit code."""
        if number is not None:
            self.send_signal(number)
        self._process.join(PATIENCE)
        assert self.returncode is not None, f'it did not end in {PATIENCE:g} s: {self.errors}'
        return self.returncode
