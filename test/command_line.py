# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The ``ros2`` command line, where it is installed."""

import os
import shutil
import signal
import subprocess

ROS2 = shutil.which('ros2')
PATIENCE = 60.0   # s


def asked(*arguments):
    """Return the ended process of the command line."""
    return subprocess.run(['ros2', *arguments], capture_output=True, text=True, timeout=PATIENCE)


def has(verb):
    """Return whether the command line is installed with a verb."""
    return bool(ROS2) and not asked(verb, '--help').returncode


class Started:
    """A script of the shell that runs; use it as a context manager."""

    def __init__(self, script, folder):
        self._said = folder / 'said'
        with self._said.open('wb') as said:
            self._process = subprocess.Popen(['bash', '-ec', script], cwd=folder, stdout=said,
                                             stderr=said, start_new_session=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if not self.ended():
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()

    def ended(self):
        """Return whether it has ended."""
        return self._process.poll() is not None

    @property
    def returncode(self):
        """The exit code, below 0 for a signal, None while it runs."""
        return self._process.poll()

    @property
    def text(self):
        """What it has written up to now."""
        return self._said.read_text()

    def interrupt(self):
        """Send SIGINT to all of it, as Ctrl-C in a terminal does."""
        os.killpg(self._process.pid, signal.SIGINT)
