# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The soak: does the node stay what it is, hour after hour, with all its topics alive.

Starts the node and a load as processes, listens to all topics, and looks at the node's memory,
at /dev/shm and at the rate it holds, beside a loop with no work at the same rate, which shows
what the machine allowed. Run ``make soak``, shorter by ``make soak DURATION=600``. Exits with 1
where memory, /dev/shm or the rate did not hold.
"""

import argparse
import os
from pathlib import Path
import subprocess
import sys
import tempfile
import time

import numpy as np

from dm_ros.mechanism.variants import variant_named
from dm_ros.ros.domain import own_domain
from dm_ros.ros.recorder import Recorder
from dm_ros.tools.demo import process, wait

LOOK = 5.0        # s between two looks
DROP = 0.005      # of the rate, beyond that of the loop with no work
MEMORY = 1024     # kB that the node may grow by after the warm-up


def memory_of(pid):
    """Return the resident memory of a process in kB."""
    for line in Path(f'/proc/{pid}/status').read_text().splitlines():
        if line.startswith('VmRSS'):
            return int(line.split()[1])
    raise ProcessLookupError(pid)


def shared_memory():
    """Return the bytes that files in /dev/shm take."""
    return sum(path.stat().st_size for path in Path('/dev/shm').iterdir() if path.is_file())


def soak(arguments, folder):
    """Return one row a look: time in s, kB of the node, bytes in /dev/shm, rate heard in Hz."""
    rows = []
    parameters = ['--ros-args', '-p', f'variant:={arguments.variant}', '-p',
                  f'rate:={arguments.rate!r}']
    with Recorder('/differential', variant_named(arguments.variant).mechanism) as recorder, \
            process('differential', *parameters) as node, \
            process('play_torques', '--variant', arguments.variant) as player:
        wait(lambda: recorder.poll() and recorder.loaded, 'torque on a shaft', node, player)
        idle = subprocess.Popen([
            sys.executable, str(Path(__file__).with_name('loop.py')), 'python_loop',
            str(arguments.rate), str(arguments.duration), str(folder / 'idle')])
        start = looked = time.monotonic()
        heard = 0
        while (now := time.monotonic()) - start < arguments.duration:
            heard += recorder.poll()
            if now - looked > LOOK:
                rows.append((now, memory_of(node.pid), shared_memory(),
                             heard / (now - looked)))
                looked, heard = now, 0
                recorder.clear()
            time.sleep(0.02)
        idle.wait(60)
    return np.array(rows)


def rate_within(ticks, begin, end):
    """Return the rate of ticks, given by their times in s, within a span of time, Hz."""
    return ((begin <= ticks) & (ticks < end)).sum() / (end - begin)


def main():
    parser = argparse.ArgumentParser('soak', description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--duration', type=float, default=3600.0, help='s')
    parser.add_argument('--warm-up', type=float, default=60.0, help='s')
    parser.add_argument('--rate', type=float, default=500.0, help='Hz')
    parser.add_argument('--variant', default='lsd_ode')
    arguments = parser.parse_args()
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    with own_domain() as domain, tempfile.TemporaryDirectory() as folder:
        os.environ['ROS_DOMAIN_ID'] = str(domain)
        rows = soak(arguments, Path(folder))
        idle = np.frombuffer((Path(folder) / 'idle').read_bytes(), dtype=np.int64)[::2] * 1e-9
    length = rows[-1, 0] - rows[0, 0] + LOOK
    warm = rows[rows[:, 0] > rows[0, 0] + min(arguments.warm_up, length / 2)]
    part = max(1, len(warm) // 4)
    first, last = warm[:part], warm[-part:]
    memory, shared = warm[:, 1], warm[:, 2]
    grown = np.median(last[:, 1]) - np.median(first[:, 1])
    rates = [(rows[:, 3].mean(), rate_within(idle, rows[0, 0] - LOOK, rows[-1, 0]))
             for rows in (first, last)]
    (node_first, idle_first), (node_last, idle_last) = rates
    held = {
        f'memory of the node: {memory[0]:.0f} kB after the warm-up, {memory[-1]:.0f} kB at the '
        f'end, first to last quarter {grown:+.0f} kB': grown <= MEMORY,
        f'/dev/shm: {shared[0] / 1024:.0f} kB after the warm-up, {shared[-1] / 1024:.0f} kB at '
        'the end': shared[-1] <= shared[0],
        f'rate heard, first and last quarter: {node_first:.2f} and {node_last:.2f} Hz; of a loop '
        f'with no work beside it: {idle_first:.2f} and {idle_last:.2f} Hz':
            node_last / node_first >= (1 - DROP) * idle_last / idle_first}
    print(f'{length:.0f} s of {arguments.variant} at {arguments.rate:g} Hz')
    for line, holds in held.items():
        print(f'{"holds" if holds else "FAILS"}  {line}')
    return 0 if all(held.values()) else 1


if __name__ == '__main__':
    sys.exit(main())
