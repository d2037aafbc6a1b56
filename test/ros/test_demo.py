# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The demo: two processes over DDS, recorded, reported, drawn."""

from contextlib import ExitStack
import csv
from pathlib import Path
import signal
import time

from processes import command, Forked
import pytest

from dm_ros.files.columns import column_names
from dm_ros.motion.simulation import Simulation
from dm_ros.tools.simulate import main as simulate

DEMO = command('demo')
VARIANTS = ('symmetric_dae', 'lsd_lagged')
LAWS = {'symmetric_dae': 'passive', 'lsd_lagged': 'paper'}
PRESETS = Path(__file__).parents[2] / 'config' / 'presets'


@pytest.fixture(scope='module')
def runs(tmp_path_factory):
    """Return (folder, exit code, stdout, stderr) by variant, of runs beside each other."""
    folders = {variant: tmp_path_factory.mktemp(variant) for variant in VARIANTS}
    with ExitStack() as stack:
        demos = {variant: stack.enter_context(Forked(
            DEMO, '--variant', variant, '--loss-law', LAWS[variant], '--out', folder,
            '--rate', 100, '--duration', 1))
            for variant, folder in folders.items()}
        return {variant: (folders[variant], demo.ended(), demo.output, demo.errors)
                for variant, demo in demos.items()}


def test_runs_beside_each_other_do_not_hear_each_other(runs):
    for variant, (folder, code, _, errors) in runs.items():
        assert code == 0, errors
        with open(folder / f'{variant}.csv', newline='') as file:
            assert next(csv.reader(file)) == column_names(Simulation(variant))


@pytest.mark.parametrize('variant', VARIANTS)
def test_it_records_what_the_node_publishes_and_draws_it(runs, variant):
    folder, code, output, errors = runs[variant]
    assert code == 0, errors
    assert f'{LAWS[variant]} law of losses' in errors   # the node says what it is
    for word in ('rate held', 'missed ticks', 'power flow', 'velocity carrier', 'lowest'):
        assert word in output
    with open(folder / f'{variant}.csv', newline='') as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == column_names(Simulation(variant))
    times = [float(row['time']) for row in rows]
    assert times[0] == 0.0
    assert times == sorted(times)
    # from the first torque, from rest
    driving = f'torque.{Simulation(variant).inputs[0]}'
    assert not any(float(rows[0][f'torque.{name}']) for name in Simulation(variant).inputs)
    assert any(float(rows[1][f'torque.{name}']) for name in Simulation(variant).inputs)
    assert not any(float(value) for name, value in rows[0].items()
                   if name.startswith(('velocity', 'position')))
    # the torques arrived and the shafts turned
    for column in (driving, 'velocity.carrier'):
        assert any(float(row[column]) for row in rows)
    assert (folder / f'{variant}.png').read_bytes().startswith(b'\x89PNG')


@pytest.mark.parametrize('variant', VARIANTS)
def test_it_leaves_a_bag_whose_run_is_that_of_the_node(runs, variant, tmp_path):
    pytest.importorskip('rosbags', reason='bags need rosbags: the extra bag')
    folder, _, output, _ = runs[variant]
    assert f'{variant}_bag' in output
    assert simulate(['--variant', variant, '--loss-law', LAWS[variant], '--torques',
                     str(folder / f'{variant}_bag'), '--out', str(tmp_path / 'again.csv')]) == 0
    with (open(folder / f'{variant}.csv', newline='') as file,
          open(tmp_path / 'again.csv', newline='') as again):
        name = 'velocity.carrier'
        speeds, ran = ([float(row[name]) for row in csv.DictReader(one)] for one in (file, again))
    first = ran.index(speeds[1]) - 1   # the record begins with the last tick before the load
    assert ran[first:][:len(speeds)] == speeds


def test_a_bad_variant_or_an_unwritable_folder_ends_it_with_one_line(tmp_path):
    blocked = tmp_path / 'file'
    blocked.write_text('')
    with Forked(DEMO, '--out', blocked / 'folder') as demo:
        assert demo.ended() == 1
        line, = demo.errors.strip().splitlines()
        assert line.startswith('demo: ')
    with Forked(DEMO, '--out', tmp_path, '--variant', 'torsen') as demo:
        assert demo.ended() == 2


def test_it_runs_with_the_parameters_of_a_file(tmp_path):
    preset = PRESETS / 'plate_axle_2_way.yaml'
    with Forked(DEMO, '--params', preset, '--rate', 100, '--duration', 1, '--out',
                tmp_path) as demo:
        assert demo.ended() == 0, demo.errors
    with open(tmp_path / 'symmetric_ode.csv', newline='') as file:
        rows = list(csv.DictReader(file))
    assert any(float(row['moment.left_clutch']) for row in rows)


def test_its_node_has_what_a_file_gives_to_the_node_without_a_namespace(tmp_path):
    file = tmp_path / 'node.yaml'
    file.write_text('/differential: {ros__parameters: {symmetric.inertia.satellite: 5e-05, '
                    'joint_prefix: rear_, energy_audit: false, symmetric: {clutch: {left: '
                    '{friction_surfaces: 4, preload: 100.0}}}}}')
    with Forked(DEMO, '--params', file, '--duration', 0.5, '--out', tmp_path) as demo:
        assert demo.ended() == 0, demo.errors
        assert 'forces on left' in demo.errors and 'nothing' not in demo.errors
    with open(tmp_path / 'symmetric_ode.csv', newline='') as file:
        rows = list(csv.DictReader(file))
    assert any(float(row['moment.left_clutch']) for row in rows)


def test_a_file_with_a_speed_port_is_refused_in_one_line(tmp_path):
    (tmp_path / 'speed.yaml').write_text('/**: {ros__parameters: {port.left.kind: speed}}')
    with Forked(DEMO, '--params', tmp_path / 'speed.yaml', '--out', tmp_path) as demo:
        assert demo.ended() == 1
        line, = demo.errors.strip().splitlines()
    assert line.endswith('the load is torques, but left would take a speed')


@pytest.mark.parametrize('arguments, words', [
    (('--rate', '1e9'), 'demo: error: rate: 1000000000.0 is not allowed, it must be in '
                        '[0.1, 10000]'),
    (('--duration', '0'), '0 is not allowed, it must be in (0, 1e+06)')])
def test_a_limit_is_told_in_words(tmp_path, arguments, words):
    with Forked(DEMO, *arguments, '--out', tmp_path / 'run') as demo:
        assert demo.ended() in (1, 2)
        assert demo.errors.strip().endswith(words)
    assert not (tmp_path / 'run').exists()


def test_a_signal_leaves_no_empty_folder_and_one_line(tmp_path):
    with Forked(DEMO, '--out', tmp_path / 'a' / 'run') as demo:
        end = time.monotonic() + 60.0
        while not (tmp_path / 'a' / 'run').is_dir():
            assert time.monotonic() < end
            time.sleep(0.01)
        assert demo.ended(signal.SIGINT) == 130
        line, = [line for line in demo.errors.splitlines() if line.startswith('demo')]
        assert line == 'demo: ended by a signal, the record is not whole'
        assert 'Traceback' not in demo.errors
    assert not list(tmp_path.iterdir())
