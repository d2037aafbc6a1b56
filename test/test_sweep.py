# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The tool ``sweep``: its sets, its metrics, what a kill costs, and how it refuses bad input."""

import json
import os
from pathlib import Path
import re
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from scipy.stats import qmc

from dm_ros import Simulation
from dm_ros.energy import AuditedSimulation
from dm_ros.mechanism.variants import variant_named
from dm_ros.tools.sweep import main
from dm_ros.tools.sweeping import study
from dm_ros.tools.sweeping.picture import FEW

PATIENCE = 120.0   # s
PRELOAD, INERTIA = 'lsd.clutch.rear.preload', 'lsd.inertia.rear'
SHORT = ['--duration', '0.5']
# some seconds of work in 32 chunks
LONG = ['--variant', 'lsd_ode', '--vary', f'{PRELOAD}=0:300', '--vary', f'{INERTIA}=0.001:0.1:log',
        '--sobol', '512', '--duration', '20', '--chunk', '16', '--metric', 'final.slip',
        '--metric', 'lost_energy', '--out', 'OUT.csv']


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Run each test in a folder of its own."""
    monkeypatch.setenv('PYTHONPATH', os.pathsep.join(path or os.getcwd() for path in sys.path))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def sweep(*arguments, variant='lsd_ode', out='OUT.csv'):
    return main(['--variant', variant, *arguments, '--out', out])


def table(name='OUT.csv'):
    """Return the columns of a result, ``{name: values}``."""
    names, *rows = (line.split(',') for line in Path(name).read_text().splitlines())
    return {name: np.array([float(cell) if name != 'status' else cell for cell in column])
            for name, column in zip(names, zip(*rows))}


def started(*arguments):
    """Return a process of the tool that has been started."""
    return subprocess.Popen([sys.executable, '-m', 'dm_ros.tools.sweep', *arguments],
                            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def wait_for(condition, process):
    """Wait until a condition holds while a process runs."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert process.poll() is None, process.stderr and process.stderr.read()
        assert time.monotonic() < end
        time.sleep(0.002)


def done():
    """Return the chunks that are done."""
    return sorted(Path('OUT.csv.parts').glob('[0-9]*.doubles'))


def single(variant, parameters, forces=(0.0, 0.0), kind=Simulation, ticks=100, dt=0.005):
    """Return a simulation after the built-in load, and its snapshots."""
    simulation = kind(variant, dt, parameters)
    load = simulation.mechanism.load
    return simulation, [simulation.step(load(n * dt), forces if simulation.clutches else ())
                        for n in range(ticks)]


def test_a_grid_has_all_values_of_each_with_all_of_the_others():
    assert sweep('--vary', f'{PRELOAD}=0,50.5', '--vary', f'{INERTIA}=0.01:1:3:log',
                 '--vary', 'lsd.satellite_count=2:4:3', *SHORT) == 0
    found = table()
    assert list(found) == [PRELOAD, INERTIA, 'lsd.satellite_count', 'final.velocity.front',
                           'final.velocity.rear', 'peak.slip', 'lost_energy', 'status']
    assert list(found[PRELOAD]) == [0.0] * 9 + [50.5] * 9
    assert found[INERTIA][:9] == pytest.approx(np.repeat([0.01, 0.1, 1.0], 3), rel=1e-15)
    assert list(found['lsd.satellite_count']) == [2, 3, 4] * 6
    assert set(found['status']) == {'ok'}
    assert not Path('OUT.csv.parts').exists()


@pytest.mark.parametrize('loss_law', ['passive', 'paper'])
@pytest.mark.parametrize('variant, name', [
    ('lsd_ode', 'lsd.viscosity.front'), ('symmetric_ode', 'symmetric.viscosity.left'),
    ('symmetric_ode', 'symmetric.clutch.left.friction_surfaces')])
def test_the_metrics_are_those_of_single_runs(variant, name, loss_law):
    one = variant_named(variant).mechanism
    first, second = one.outputs
    column = f'velocity.{first}'
    wanted = [*(f'{s}.{column}' for s in ('final', 'mean', 'min', 'max', 'peak', 'rms')),
              'final.position.carrier', f'mean.moment.{one.gears[0]}', 'mean.power_flow',
              'max.slip', 'locked', f'work.{one.inputs[0]}', 'final.velocity.satellite']
    Path('P.yaml').write_text(f'/**: {{ros__parameters: {{loss_law: {loss_law}}}}}')
    values = [0.0, 3.0] if 'surfaces' in name else [1e-3, 0.2]
    assert sweep('--vary', f'{name}={values[0]},{values[1]}', '--params', 'P.yaml', *SHORT,
                 *(word for metric in wanted for word in ('--metric', metric)),
                 variant=variant) == 0
    found = table()
    for n, value in enumerate(values):
        simulation = Simulation(variant, 0.005, {name: value}, loss_law=loss_law)
        load = [one.load(tick * 0.005) for tick in range(100)]
        told = [simulation.step(T) for T in load]
        v = np.array([snapshot.velocity for snapshot in told])
        slip = v[:, 1] - v[:, 2]
        turned = np.diff([0.0, *(s.position[simulation.shafts.index(one.inputs[0])]
                                 for s in told)])
        expected = [v[-1, 1], v[:, 1].mean(), v[:, 1].min(), v[:, 1].max(), abs(v[:, 1]).max(),
                    np.sqrt((v[:, 1]**2).mean()), told[-1].position[0],
                    np.mean([s.moment[0] for s in told]), np.mean([s.power_flow for s in told]),
                    slip.max(), (abs(slip) < 1.0).mean(), np.dot(np.array(load)[:, 0], turned),
                    v[-1, simulation.shafts.index('satellite')]]
        for metric, number in zip(wanted, expected):
            assert found[metric][n] == pytest.approx(number, rel=1e-12), metric
        assert found[f'final.{column}'][n] == v[-1, 1]   # the bits


@pytest.mark.parametrize('variant, name', [('lsd_ode', INERTIA),
                                           ('symmetric_ode', 'symmetric.inertia.left')])
def test_the_lost_energy_is_that_of_the_books(variant, name):
    assert sweep('--vary', f'{name}=0.001,0.1', '--vary', f'{name[:-len(name.split(".")[-1])]}'
                 'satellite=0.001,0.01', *SHORT, variant=variant) == 0
    found = table()
    names = list(found)[:2]
    for n, lost in enumerate(found['lost_energy']):
        _, told = single(variant, {name: found[name][n] for name in names}, kind=AuditedSimulation)
        books = sum(sum(s.energy.work) - s.energy.stored for s in told)
        assert lost == pytest.approx(books, rel=1e-9)


def test_forces_of_a_table_press_the_clutches_where_there_are_any():
    rows = [(0.0, 20.0, -30.0, -35.0, 500.0), (0.25, 20.0, -30.0, -35.0, 0.0), (0.5,) * 5]
    Path('IN.csv').write_text('time,pinion,left,right,left_clutch\n' + ''.join(
        ','.join(map(str, row)) + '\n' for row in rows))
    assert sweep('--vary', 'symmetric.clutch.left.friction_surfaces=0,4', '--torques', 'IN.csv',
                 '--metric', 'max.clutch_force.left', '--metric', 'final.slip',
                 variant='symmetric_ode') == 0
    found = table()
    assert list(found['max.clutch_force.left']) == [0.0, 500.0]
    for n, surfaces in enumerate((0, 4)):
        simulation = Simulation('symmetric_ode', 0.005,
                                {'symmetric.clutch.left.friction_surfaces': surfaces})
        for tick in range(100):
            forces = (500.0 if tick < 50 else 0.0, 0.0) if surfaces else ()
            snapshot = simulation.step((20.0, -30.0, -35.0), forces)
        assert found['final.slip'][n] == snapshot.velocity[1] - snapshot.velocity[2]


def test_initial_speeds_may_be_varied():
    assert sweep('--vary', 'initial_velocity.front=0,10', '--metric', 'final.velocity.front',
                 *SHORT) == 0
    for n, speed in enumerate((0.0, 10.0)):
        simulation = Simulation('lsd_ode', 0.005, initial_velocity=(speed, 0.0))
        for tick in range(100):
            snapshot = simulation.step(simulation.mechanism.load(tick * 0.005))
        assert table()['final.velocity.front'][n] == snapshot.velocity[1]


@pytest.mark.parametrize('way, engine', [('--sobol', qmc.Sobol), ('--latin', qmc.LatinHypercube)])
def test_spread_sets_fill_all_ranges_at_once(way, engine):
    names = [PRELOAD, INERTIA, 'lsd.satellite_count', 'lsd.clutch.rear.radius']
    ranges = ['0:400', '0.001:0.1:log', '1:4', '0.05,0.06,0.07']
    arguments = [word for name, given in zip(names, ranges) for word in (
        '--vary', f'{name}={given}')] + [way, '64', '--duration', '0.01', '--metric', 'final.slip']
    assert sweep(*arguments) == sweep(*arguments, '--seed', '1', out='OTHER.csv') == 0
    found, other = table(), table('OTHER.csv')
    shares = np.stack([found[PRELOAD] / 400, np.log10(found[INERTIA] / 0.001) / 2], axis=1)
    assert qmc.discrepancy(shares) < 0.5 * np.mean([
        qmc.discrepancy(np.random.default_rng(n).random((64, 2))) for n in range(20)])
    for name, counts in ((names[2], [16] * 4), (names[3], None)):
        assert [sum(found[name] == value) for value in sorted(set(found[name]))] == pytest.approx(
            counts or [64 / 3] * 3, abs=1)
    assert (found[PRELOAD] != other[PRELOAD]).all()
    assert len(engine(2).random(4)) == 4


def test_a_function_gets_a_record_of_each_run():
    Path('of_mine.py').write_text(
        'def numbers(record):\n'
        "    return {'ends': len(record), 'worst': abs(record.slip).max(),\n"
        "            'clutch': record.moment['rear_clutch'][-1], 'at': record.time[-1]}\n"
        'def number(record):\n    return record.torque["carrier"][1]\n')
    assert sweep('--vary', f'{PRELOAD}=0:300:4', '--metric', 'of_mine:numbers', '--metric',
                 'peak.slip', *SHORT) == 0
    found = table()
    assert list(found) == [PRELOAD, 'peak.slip', 'ends', 'worst', 'clutch', 'at', 'status']
    assert (found['worst'] == found['peak.slip']).all()
    assert list(found['ends']) == [101] * 4 and list(found['at']) == [0.5] * 4
    for n, preload in enumerate(found[PRELOAD]):
        assert found['clutch'][n] == single('lsd_ode', {PRELOAD: preload})[1][-1].moment[3]
    assert sweep('--vary', f'{PRELOAD}=0,1', '--metric', 'of_mine:number', *SHORT) == 0
    load = variant_named('lsd_ode').mechanism.load
    assert list(table()['number']) == [load(0.0)[0]] * 2


def test_what_makes_no_mechanism_and_what_fails_is_told_and_the_rest_goes_on(capsys):
    Path('IN.csv').write_text('time,carrier,front,rear\n0,3e150,0,0\n0.5,0,0,0\n')
    assert sweep('--vary', 'lsd.clutch.rear.friction_coefficient=0.1,9', '--vary',
                 'lsd.inertia.carrier=1e-6,1e6', '--torques', 'IN.csv', '--metric', 'max.slip',
                 '--loss-law', 'paper') == 0
    found = table()
    assert list(found['status']) == ['failed', 'ok', 'impossible', 'impossible']
    assert np.isnan(found['max.slip']).tolist() == [True, False, True, True]
    assert '4 sets, 100 ticks each: 1 ok, 1 failed, 2 impossible' in capsys.readouterr().err


def test_no_bit_depends_on_the_chunks_or_on_the_language(monkeypatch):
    arguments = ['--vary', f'{PRELOAD}=0:300', '--vary', 'lsd.satellite_count=1:4', '--latin',
                 '40', '--duration', '0.2', *(word for metric in (
                     'mean.slip', 'rms.velocity.rear', 'lost_energy', 'locked')
                     for word in ('--metric', metric))]
    for chunk in ('1', '7', '40'):
        assert sweep(*arguments, '--chunk', chunk, out=f'{chunk}.csv') == 0
    subprocess.run([sys.executable, '-m', 'dm_ros.tools.sweep', '--variant', 'lsd_ode',
                    *arguments, '--out', 'python.csv'], check=True, stderr=subprocess.DEVNULL,
                   env={**os.environ, 'DM_ROS_CORE': 'python'})
    texts = {Path(name).read_bytes() for name in ('1.csv', '7.csv', '40.csv', 'python.csv')}
    assert len(texts) == 1


def test_parquet_has_what_csv_has():
    parquet = pytest.importorskip('pyarrow.parquet')
    arguments = ['--vary', f'{PRELOAD}=0:300:30', *SHORT, '--chunk', '7']
    assert sweep(*arguments) == sweep(*arguments, out='OUT.parquet') == 0
    found = parquet.read_table('OUT.parquet').to_pydict()
    assert list(found) == list(table())
    for name, values in table().items():
        assert found[name] == values.tolist()


def test_without_pyarrow_parquet_is_refused_in_words(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, 'pyarrow', None)
    monkeypatch.setitem(sys.modules, 'pyarrow.parquet', None)
    assert sweep('--vary', f'{PRELOAD}=0,1', out='OUT.parquet') == 2
    assert 'Parquet needs pyarrow: pip install "dm_ros[parquet]"' in capsys.readouterr().err


@pytest.mark.parametrize('count', [20, FEW + 100])
def test_the_picture_is_drawn_of_few_and_of_many(count):
    pytest.importorskip('matplotlib')
    assert sweep('--vary', f'{PRELOAD}=0:300', '--vary', f'{INERTIA}=0.001:0.1:log', '--latin',
                 str(count), '--duration', '0.02', '--plot', 'OUT.png') == 0
    assert Path('OUT.png').read_bytes().startswith(b'\x89PNG')


@pytest.fixture(scope='module')
def in_one_go(tmp_path_factory):
    """Return the result of the long sweep, run in one go."""
    folder = tmp_path_factory.mktemp('whole')
    subprocess.run([sys.executable, '-m', 'dm_ros.tools.sweep', *LONG], check=True, cwd=folder,
                   stderr=subprocess.DEVNULL,
                   env={**os.environ, 'PYTHONPATH': os.pathsep.join(filter(None, sys.path))})
    return (folder / 'OUT.csv').read_bytes()


def test_a_kill_costs_no_chunk_that_is_done_and_changes_no_bit(in_one_go):
    process = started(*LONG)
    wait_for(lambda: len(done()) >= 3, process)
    process.send_signal(signal.SIGKILL)
    process.wait()
    before = done()
    assert 3 <= len(before) < 32 and not Path('OUT.csv').exists()
    shutil.copytree('OUT.csv.parts', 'kept')
    assert main(LONG) == 0
    assert Path('OUT.csv').read_bytes() == in_one_go
    # what is done is not computed again: a mark in it is still there
    shutil.copytree('kept', 'OUT.csv.parts')
    before[1].write_bytes(bytes(before[1].stat().st_size))
    assert main(LONG) == 0
    found = table()
    marked = np.flatnonzero(found['lost_energy'] == 0.0)
    assert len(marked) == 16 and len(set(marked // 16)) == 1


def test_an_interrupt_tells_how_to_go_on(in_one_go):
    process = started(*LONG)
    wait_for(done, process)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert re.search(r'\d+ of 512 sets are done, the same command goes on from there', said)
    assert main(LONG) == 0
    assert Path('OUT.csv').read_bytes() == in_one_go


def test_another_study_does_not_take_what_is_done(capsys):
    process = started(*LONG)
    wait_for(done, process)
    assert main(LONG) == 2   # while the other one is at work
    assert 'OUT.csv.parts: another sweep is at work there' in capsys.readouterr().err
    process.kill()
    process.wait()
    left = done()
    assert main([*LONG, '--seed', '3']) == 2
    assert ('OUT.csv.parts: what is done there is of another study, which differs in varied; '
            'remove the folder, or name another --out') in capsys.readouterr().err
    assert main([*LONG[:-4], '--dt', '0.01', *LONG[-2:]]) == 2
    assert 'differs in dt, torques, metrics' in capsys.readouterr().err
    assert done() == left
    assert json.loads(Path('OUT.csv.parts', 'study.json').read_text())['variant'] == 'lsd_ode'


def test_the_chunks_follow_from_the_study_alone():
    def chunk(ticks):
        return study.Study('lsd_ode', 0.001, {}, {}, {}, np.zeros((ticks, 3)), None, (), '',
                           ()).chunk
    assert [chunk(ticks) for ticks in (1, 10**4, 10**9)] == [study.MOST_SETS, 2000, 16]


@pytest.mark.parametrize('arguments, words', [
    (['--vary', 'lsd.inertia=1,2'], 'lsd.inertia: there is no such parameter'),
    (['--vary', 'symmetric.inertia.left=1,2'], 'the self-locking differential has no such'),
    (['--vary', 'substeps=1,2'], 'substeps: the self-locking differential has no such'),
    (['--vary', PRELOAD], f'{PRELOAD}: values are missing, such as {PRELOAD}=LOW:HIGH'),
    (['--vary', f'{PRELOAD}=a,b'], "'a' is not a number"),
    (['--vary', f'{INERTIA}=-1:2:3'], f'{INERTIA}: -1.0 is not allowed, it must be in (0, 1e+06]'),
    (['--vary', f'{INERTIA}=nan,1'], f'{INERTIA}: nan is not allowed'),
    (['--vary', f'{PRELOAD}=2:1:3'], '2 is not below 1'),
    (['--vary', f'{PRELOAD}=0:1:3:log'], '0 is not above 0, as it must be for log'),
    (['--vary', f'{PRELOAD}=0:1:x'], "'x' is not allowed, it must be COUNT, an integer"),
    (['--vary', f'{PRELOAD}=0:1'], 'a grid needs LOW:HIGH:COUNT'),
    (['--vary', f'{PRELOAD}=0:1:5', '--sobol', '8'], 'COUNT is for a grid'),
    (['--vary', 'lsd.satellite_count=1:4:3'], '3 values from 1 to 4 are no integers'),
    (['--vary', f'{PRELOAD}=0,1', '--vary', f'{PRELOAD}=2,3'], f'{PRELOAD}: given twice'),
    (['--vary', f'{PRELOAD}=0:1', '--sobol', '0'], '0 sets are not allowed'),
    (['--vary', f'{PRELOAD}=0:1:100000', '--vary', f'{INERTIA}=1:2:10000'], 'sets are not'),
    (['--vary', f'{PRELOAD}=0,1', '--metric', 'slip'], "'slip' is none of lost_energy, locked"),
    (['--vary', f'{PRELOAD}=0,1', '--metric', 'max.velocity.left'], "'max.velocity.left' is"),
    (['--vary', f'{PRELOAD}=0,1', '--metric', 'nowhere:f'], "No module named 'nowhere'"),
    (['--vary', f'{PRELOAD}=0,1', '--metric', 'math:nothing'], "no attribute 'nothing'"),
    (['--vary', f'{PRELOAD}=0,1', '--metric', 'math:pi'], 'math:pi: it is no function'),
    (['--vary', f'{PRELOAD}=0,1', '--metric', 'math:sin'], 'math:sin: TypeError: '),
    (['--vary', f'{PRELOAD}=0,1', '--metric', 'a:b', '--metric', 'c:d'], 'one function may be'),
    (['--vary', f'{PRELOAD}=0,1', '--duration', '0'], '--duration: 0.0 is not allowed'),
    (['--vary', f'{PRELOAD}=0,1', '--node', '/a'], '--node: it needs --torques'),
    (['--vary', f'{PRELOAD}=0,1', '--torques', 'NO.csv'], 'NO.csv: No such file'),
    (['--vary', f'{PRELOAD}=0,1', '--chunk', '0'], '--chunk: 0 is not allowed'),
    (['--vary', f'{PRELOAD}=0,1', '--seed', '-1'], '--seed: -1 is not allowed'),
    (['--vary', f'{PRELOAD}=0,1', '--plot', 'no/OUT.png'], 'no/OUT.png: there is no folder'),
    (['--vary', f'{PRELOAD}=0,1', '--torques', 'OUT.csv'], 'given for two files'),
    (['--vary', f'{PRELOAD}=0,1', '--plot', 'OUT.jpg'], 'OUT.jpg: its name must end in .png'),
    (['--vary', f'{PRELOAD}=0,1', '--dt', '1e-9'], 'and at most 10000000'),
])
def test_bad_input_is_named_in_one_line_and_leaves_nothing(arguments, words, capsys):
    assert sweep(*arguments) == 2
    line, = capsys.readouterr().err.splitlines()
    assert line.startswith('sweep: error: ') and words in line
    assert not os.listdir()


def test_what_is_not_of_a_sweep_is_left_alone(capsys):
    parts = Path('OUT.csv.parts')
    parts.mkdir()
    (parts / 'notes.txt').write_text('precious')
    assert sweep('--vary', f'{PRELOAD}=0,1', *SHORT) == 2
    assert 'OUT.csv.parts: notes.txt in it is not of a sweep' in capsys.readouterr().err
    assert (parts / 'notes.txt').read_text() == 'precious' and not Path('OUT.csv').exists()
    shutil.rmtree(parts)
    Path('elsewhere').mkdir()
    parts.symlink_to('elsewhere')
    assert sweep('--vary', f'{PRELOAD}=0,1', *SHORT) == 2
    assert 'it must be a folder of its own' in capsys.readouterr().err
    assert sweep('--vary', f'{PRELOAD}=0,1', *SHORT, out='OUT.feather') == 2
    assert 'OUT.feather: its name must end in .csv or .parquet' in capsys.readouterr().err


def test_a_damaged_chunk_is_computed_again_and_what_a_kill_left_is_removed(in_one_go, capsys):
    process = started(*LONG)
    wait_for(lambda: len(done()) >= 3, process)
    process.send_signal(signal.SIGKILL)
    process.wait()
    os.truncate(done()[1], 100)
    (Path('OUT.csv.parts') / '.00000005.doubles.17.part').write_bytes(b'x')
    Path('.OUT.csv.17.part').write_bytes(b'x')
    assert main(LONG) == 0
    assert Path('OUT.csv').read_bytes() == in_one_go
    assert sorted(os.listdir()) == ['OUT.csv']
    process = started(*LONG)
    wait_for(done, process)
    process.send_signal(signal.SIGKILL)
    process.wait()
    (Path('OUT.csv.parts') / 'study.json').write_text('{')
    capsys.readouterr()
    assert main(LONG) == 2
    assert 'study.json: it does not tell which study is done there' in capsys.readouterr().err


def test_where_nothing_is_done_another_study_may_begin():
    assert sweep('--vary', f'{PRELOAD}=0,1', *SHORT, '--scheduler', 'tcp://127.0.0.1:1') == 2
    assert sweep('--vary', f'{PRELOAD}=0,1,2', *SHORT) == 0
    assert len(table()['status']) == 3


@pytest.mark.parametrize('returned, words', [
    ('None', 'it returned None, a number is needed'), ('"1"', "it returned '1', a number"),
    ('{"a,b": 1.0}', "it returned the name 'a,b', which must not"),
    ('{"a": 1j}', 'it returned 1j, a number is needed')])
def test_what_is_no_number_by_name_is_told(returned, words, capsys):
    module = f'odd_{abs(hash(returned))}'
    Path(f'{module}.py').write_text(f'def f(record):\n    return {returned}\n')
    assert sweep('--vary', f'{PRELOAD}=0,1', *SHORT, '--metric', f'{module}:f') == 2
    assert words in capsys.readouterr().err


def test_speed_ports_are_refused(capsys):
    Path('P.yaml').write_text('/**: {ros__parameters: {port.front.kind: speed}}')
    assert sweep('--vary', f'{PRELOAD}=0,1', '--params', 'P.yaml') == 2
    assert 'port.front.kind: speed: a sweep is of torques alone' in capsys.readouterr().err


def test_a_function_that_returns_other_names_is_refused(capsys):
    Path('moody.py').write_text('def f(record):\n'
                                '    return {"a" if record.slip[-1] < 1e9 else "b": 1.0}\n'
                                'def g(record):\n    return {"status": 1.0}\n'
                                'def h(record):\n    return record.velocity["left"]\n')
    for name, words in (('g', 'returned status, names that no column has'),
                        ('h', "KeyError: 'left', in ")):
        assert sweep('--vary', f'{PRELOAD}=0,1', '--metric', f'moody:{name}', *SHORT) == 2
        assert words in capsys.readouterr().err


@pytest.fixture
def cluster(folder):
    """Give the address of a scheduler on loopback, and two workers as processes."""
    pytest.importorskip('distributed')
    quiet = {'stdout': subprocess.DEVNULL, 'stderr': subprocess.DEVNULL}
    dask = [sys.executable, '-m', 'dask']
    file, processes = Path('scheduler.json'), []
    try:
        processes.append(subprocess.Popen([
            *dask, 'scheduler', '--host', '127.0.0.1', '--port', '0', '--no-dashboard',
            '--scheduler-file', file], **quiet))
        wait_for(lambda: file.exists() and file.read_text().endswith('}'), processes[0])
        address = json.loads(file.read_text())['address']
        for n in range(2):
            processes.append(subprocess.Popen([
                *dask, 'worker', address, '--no-nanny', '--nthreads', '1', '--no-dashboard',
                '--local-directory', f'worker{n}'], **quiet))
        yield address, processes[1:]
    finally:
        for process in reversed(processes):
            process.kill()
            process.wait()


def test_a_cluster_gives_the_same_bits_also_when_a_worker_dies_in_the_middle(cluster, in_one_go):
    address, workers = cluster
    process = started(*LONG, '--scheduler', address)
    wait_for(lambda: len(done()) >= 4, process)
    workers[1].kill()
    at_kill = len(done())
    _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, said
    assert 4 <= at_kill < 32
    assert Path('OUT.csv').read_bytes() == in_one_go


def test_a_function_goes_to_the_workers(cluster):
    address, _ = cluster
    Path('of_theirs.py').write_text('def worst(record):\n    return abs(record.slip).max()\n')
    arguments = ['--vary', f'{PRELOAD}=0:300:10', '--metric', 'of_theirs:worst', '--chunk', '3',
                 *SHORT]
    assert sweep(*arguments, '--scheduler', address) == sweep(*arguments, out='HERE.csv') == 0
    assert Path('OUT.csv').read_bytes() == Path('HERE.csv').read_bytes()


def test_no_scheduler_and_no_dask_are_told_in_one_line(monkeypatch, capsys):
    pytest.importorskip('distributed')
    monkeypatch.setattr('dm_ros.tools.sweeping.cluster.PATIENCE', 0.5)
    arguments = ['--vary', f'{PRELOAD}=0,1', *SHORT, '--scheduler', 'tcp://127.0.0.1:9']
    assert sweep(*arguments) == 2
    assert 'sweep: error: --scheduler: tcp://127.0.0.1:9: ' in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, 'distributed', None)
    assert sweep(*arguments) == 2
    assert 'needs dask.distributed: pip install "dm_ros[cluster]"' in capsys.readouterr().err
