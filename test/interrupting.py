# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A tool that a signal ends while it writes OUT.csv leaves that and its folder as they were."""

import os
import subprocess
import sys
import time

PATIENCE = 60.0   # s


def check_interrupt(number, folder, *arguments):
    """Start a tool, send it a signal as soon as it writes, and assert what it leaves behind."""
    (folder / 'OUT.csv').write_text('precious')
    before = set(folder.iterdir())
    # the tool finds the package where this process does
    path = os.pathsep.join(path or os.getcwd() for path in sys.path)
    process = subprocess.Popen(
        [*arguments, '--out', 'OUT.csv'], stderr=subprocess.PIPE, text=True, cwd=folder,
        env={**os.environ, 'PYTHONPATH': path})
    try:
        end = time.monotonic() + PATIENCE
        while not any(path.suffix == '.part' for path in folder.iterdir()):
            assert time.monotonic() < end and process.poll() is None
            time.sleep(0.01)
        process.send_signal(number)
        _, err = process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
    assert process.returncode == 128 + number and not err
    assert set(folder.iterdir()) == before
    assert (folder / 'OUT.csv').read_text() == 'precious'
