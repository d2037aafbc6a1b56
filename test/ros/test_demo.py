# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The demo: two processes over DDS, recorded, reported, drawn."""

import csv
import os
import subprocess
import sys

import pytest

from dm_ros.files.columns import column_names
from dm_ros.motion.simulation import Simulation


def demo(folder, *arguments):
    return subprocess.run(
        [sys.executable, '-m', 'dm_ros.tools.demo', '--out', str(folder), '--duration', '1.5',
         *arguments],
        capture_output=True, text=True, timeout=90)


@pytest.mark.parametrize('variant', ['symmetric_dae', 'lsd_lagged'])
def test_it_records_what_the_node_publishes_and_draws_it(tmp_path, variant):
    done = demo(tmp_path, '--variant', variant, '--rate', '100')
    assert done.returncode == 0, done.stderr
    for word in ('rate held', 'missed ticks', 'power flow', 'velocity carrier', 'lowest'):
        assert word in done.stdout
    with open(tmp_path / f'{variant}.csv', newline='') as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == column_names(Simulation(variant))
    times = [float(row['time']) for row in rows]
    assert times[0] == 0.0
    assert times == sorted(times)
    # the torques arrived and the shafts turned
    for column in (f'torque.{Simulation(variant).inputs[0]}', 'velocity.carrier'):
        assert any(float(row[column]) for row in rows)
    assert (tmp_path / f'{variant}.png').read_bytes().startswith(b'\x89PNG')


def test_a_bad_variant_or_an_unwritable_folder_ends_it_with_one_line(tmp_path):
    blocked = tmp_path / 'file'
    blocked.write_text('')
    done = demo(blocked / 'folder')
    assert done.returncode == 1
    line, = done.stderr.strip().splitlines()
    assert line.startswith('demo: ')
    assert demo(tmp_path, '--variant', 'torsen').returncode == 2


def test_runs_beside_each_other_do_not_hear_each_other(tmp_path):
    command = [sys.executable, '-m', 'dm_ros.tools.demo', '--duration', '1.5', '--rate', '50']
    runs = [subprocess.Popen([*command, '--variant', variant, '--out', str(tmp_path / variant)],
                             stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                             env=os.environ)
            for variant in ('symmetric_ode', 'lsd_ode')]
    for run in runs:
        _, errors = run.communicate(timeout=120)
        assert run.returncode == 0, errors
