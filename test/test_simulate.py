# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The tool ``simulate``: its files, its numbers, and how it refuses bad input."""

from decimal import Decimal
import math
import os
import signal
import subprocess
import sys

from interrupting import check_interrupt
import numpy as np
import pytest

from dm_ros import Simulation, VARIANTS
from dm_ros.files.torque_table import read_torque_file, TorqueTable
from dm_ros.mechanism.variants import SYMMETRIC, variant_named
from dm_ros.tools.simulate import main

GOOD = 'time,pinion,left,right\n0,10,-15,-16\n0.5,-10,15,16\n1,0,0,0\n'
TOOL = [sys.executable, '-m', 'dm_ros.tools.simulate', '--variant', 'symmetric_ode']


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Run each test in a folder of its own that holds a good IN.csv."""
    # the tool as a process finds the package where this one does
    monkeypatch.setenv('PYTHONPATH', os.pathsep.join(path or os.getcwd() for path in sys.path))
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'IN.csv').write_text(GOOD)
    return tmp_path


def simulate(*arguments, variant='symmetric_ode'):
    return main(['--variant', variant, '--torques', 'IN.csv', *arguments])


def table(name='OUT.csv'):
    return np.genfromtxt(name, delimiter=',', names=True, deletechars='')


def write_profile(variant, seconds=5.0):
    """Write the built-in load, a row each 10 ms, as IN.csv."""
    with open('IN.csv', 'w') as file:
        print('time', *Simulation(variant).inputs, sep=',', file=file)
        for n in range(round(seconds * 100) + 1):
            print(n / 100, *variant_named(variant).mechanism.load(n / 100), sep=',', file=file)


@pytest.mark.parametrize('variant', VARIANTS)
def test_output_is_what_the_library_computes(variant):
    write_profile(variant, 1.0)
    assert simulate('--out', 'OUT.csv', '--dt', '0.01', variant=variant) == 0
    simulation = Simulation(variant, 0.01)
    load = simulation.mechanism.load
    snapshots = [simulation.snapshot(), *(simulation.step(load(n / 100)) for n in range(100))]
    rows = np.array([np.hstack(snapshot) for snapshot in snapshots])
    with open('OUT.csv') as file:
        header = file.readline()
    assert header.strip().split(',') == [
        'time', *(f'{kind}.{name}' for kind, names in (
            ('velocity', simulation.shafts), ('position', simulation.shafts),
            ('torque', simulation.inputs), ('moment', simulation.moments)) for name in names),
        'power_flow', *(f'clutch_force.{name}' for name in simulation.clutches)]
    # 17 digits: bit for bit
    assert np.array_equal(np.loadtxt('OUT.csv', delimiter=',', skiprows=1), rows)


def test_power_flow_is_written_as_an_integer():
    assert simulate('--out', 'OUT.csv') == 0
    with open('OUT.csv') as file:
        assert {line.strip().rsplit(',', 1)[1] for line in list(file)[1:]} == {'1', '-1'}


def test_without_a_file_the_csv_goes_to_stdout_and_the_summary_to_stderr(capfd):
    assert simulate('--out', 'OUT.csv') == 0
    capfd.readouterr()
    assert simulate() == 0
    out, err = capfd.readouterr()
    with open('OUT.csv') as file:
        assert out == file.read()
    assert err.startswith('simulate: 200 ticks, 1 s, final speeds in rad/s: carrier ')
    assert err.count('\n') == 1


def test_equal_runs_give_equal_bytes(folder):
    write_profile('lsd_ode')
    for name in ('a', 'b'):
        assert simulate('--out', f'{name}.csv', '--plot', f'{name}.png', variant='lsd_ode') == 0
    for suffix in ('csv', 'png'):
        assert (folder / f'a.{suffix}').read_bytes() == (folder / f'b.{suffix}').read_bytes()


@pytest.mark.parametrize('variants', [('symmetric_ode', 'symmetric_dae'), ('lsd_ode', 'lsd_dae')])
def test_formulations_of_one_mechanism_agree(variants):
    write_profile(variants[0])
    rows = []
    for variant in variants:
        assert simulate('--out', f'{variant}.csv', variant=variant) == 0
        rows.append(np.array(table(f'{variant}.csv')[-1].item()))
    names = table(f'{variants[0]}.csv').dtype.names
    speeds = [i for i, name in enumerate(names) if name.startswith('velocity')]
    assert len(speeds) >= 4
    np.testing.assert_allclose(rows[1][speeds], rows[0][speeds], rtol=1e-9)


def test_the_parameter_file_counts():
    with open('p.yaml', 'w') as file:
        file.write('/**: {ros__parameters: {rate: 50.0, substeps: 4, power_flow_deadband: 3.0, '
                   'symmetric.inertia.carrier: 0.2, initial_velocity: {left: 7.0, right: 8.0}}}')
    assert simulate('--params', 'p.yaml', '--out', 'OUT.csv') == 0
    simulation = Simulation('symmetric_ode', 1 / 50, {'symmetric.inertia.carrier': 0.2},
                            substeps=4, power_flow_deadband=3.0, initial_velocity=(7.0, 8.0))
    for n in range(50):
        sign = 1 if n < 25 else -1
        last = simulation.step((sign * 10, sign * -15, sign * -16))
    out = table()
    assert len(out) == 51 and out['velocity.left'][0] == 7.0
    assert tuple(out[-1])[:6] == (last.time, *last.velocity)


def test_the_tick_length_of_the_command_line_counts_more_than_that_of_the_file():
    with open('p.yaml', 'w') as file:
        file.write('/**: {ros__parameters: {rate: 50.0}}')
    assert simulate('--params', 'p.yaml', '--dt', '0.1', '--out', 'OUT.csv') == 0
    assert len(table()) == 11


@pytest.mark.parametrize('dt', [0.1, 0.01, 0.001, 0.005, 1 / 3, 1 / 30, 1 / 7, 0.7, 1e-4])
@pytest.mark.parametrize('digits', [17, 6])
def test_rows_on_multiples_of_the_tick_start_with_their_tick(dt, digits):
    """Also where the quotient, as 0.3/0.1, misses the integer, or a time has six decimals."""
    times = [float(f'{n * dt:.{digits}f}') for n in range(3000)]
    held = TorqueTable(tuple(times), tuple((n, 0, 0) for n in range(3000)),
                       (0.0, 0.0, 0.0)).held(dt)
    assert [torques[0] for torques in held] == list(range(2999))
    assert [held.at(n)[0] for n in range(3005)] == [*range(3000), *[2999] * 5]


def test_a_row_between_ticks_waits_for_the_next_tick():
    times, torques = (0.0, 0.25, 0.31, 0.34, 0.6), tuple((n,) for n in range(5))
    held = TorqueTable(times, torques, (0.0,)).held(0.1)
    assert [n for n, in held] == [0, 0, 0, 1, 3, 3]


def test_before_the_first_row_the_torques_are_zero():
    held = TorqueTable((0.2, 0.4), ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0)), (0.0, 0.0, 0.0)).held(0.1)
    assert list(held) == [(0.0, 0.0, 0.0)] * 2 + [(1.0, 2.0, 3.0)] * 2 and len(held) == 4


@pytest.mark.parametrize('end, ticks', [(0.3, 3), (0.349, 3), (0.351, 4), (1e5, 1_000_000)])
def test_the_last_time_ends_the_run(end, ticks):
    held = TorqueTable((0.0, end), ((1.0,), (2.0,)), (0.0,)).held(0.1)
    assert len(held) == sum(1 for _ in held) == ticks


@pytest.mark.parametrize('begin', ['1748873654', '1748873654.123', '1748873654123.25', '1000.5'])
def test_a_file_that_begins_at_an_epoch_begins_the_run(folder, capfd, begin):
    """Its rows are on their ticks, though a double has few digits left at an epoch."""
    rows = [(Decimal(begin) + n * Decimal('0.0001'), n) for n in range(500)]
    (folder / 'IN.csv').write_text('time,pinion,left,right\n' + ''.join(
        f'{time},{n},-1,-1\n' for time, n in rows))
    assert simulate('--out', 'OUT.csv', '--dt', '0.0001') == 0
    assert list(table()['torque.pinion'][1:]) == list(range(499))
    told, summary = capfd.readouterr().err.splitlines()
    assert told.startswith(f'simulate: IN.csv: time 0 is {float(begin)!r} s in the file')
    assert ('in ms, divide them by 1000' in told) == (begin == '1748873654123.25')
    assert summary.startswith('simulate: 499 ticks, 0.0499 s')


def test_a_file_that_begins_a_little_later_holds_zeros_until_then(folder, capfd):
    (folder / 'IN.csv').write_text('time,pinion,left,right\n1000,10,-15,-16\n1001,0,0,0\n')
    assert simulate('--out', 'OUT.csv', '--dt', '0.5') == 0
    assert list(table()['torque.pinion']) == [0.0] * 2001 + [10.0] * 2
    assert capfd.readouterr().err.count('\n') == 1


def test_times_of_an_epoch_that_do_not_increase_are_refused(folder, capfd):
    (folder / 'IN.csv').write_text('time,pinion,left,right\n1748873654.5,1,2,3\n'
                                   '1748873654.75,1,2,3\n1748873654.75,1,2,3\n')
    refused(folder, capfd, "IN.csv:4: column 'time': 0.25 after 1748873654.5 s does not come "
            'after 0.25 after 1748873654.5 s')


def test_a_file_of_an_epoch_needs_a_second_row(folder, capfd):
    (folder / 'IN.csv').write_text('time,pinion,left,right\n1748873654,10,-15,-16\n')
    refused(folder, capfd, "IN.csv:2: column 'time': a row with a time above 1748873654 must")


def test_many_ticks_are_told_before_and_too_many_are_refused(folder, capfd, monkeypatch):
    (folder / 'IN.csv').write_text('time,pinion,left,right\n0,1,2,3\n1748873654,1,2,3\n')
    refused(folder, capfd, 'IN.csv: time: 349774730800 ticks of 0.005 s, about 107 TB of CSV, '
            'run only with --yes', '--out', 'OUT.csv')
    (folder / 'IN.csv').write_text(GOOD)
    monkeypatch.setattr('dm_ros.tools.simulate.MANY_TICKS', 999)
    monkeypatch.setattr('dm_ros.tools.simulate.MOST_TICKS', 1999)
    assert simulate('--dt', '0.001', '--out', 'OUT.csv') == 0
    told, _ = capfd.readouterr().err.splitlines()
    words = 'simulate: 1000 ticks of 0.001 s, about '
    assert told.startswith(words) and told.endswith(' kB of CSV')
    size = float(told.removeprefix(words).split()[0]) * 1e3
    assert size / 1.5 < os.path.getsize('OUT.csv') < size * 1.5
    refused(folder, capfd, 'IN.csv: time: 2000 ticks of 0.0005 s, about ', '--dt', '0.0005')
    assert simulate('--dt', '0.0005', '--yes', '--plot', 'OUT.png') == 0
    assert ' kB of memory\n' in capfd.readouterr().err


def write_times(folder, times):
    (folder / 'IN.csv').write_text('time,pinion,left,right\n' + ''.join(
        f'{time},{n},-1,-1\n' for n, time in enumerate(times)))


LOGS = {   # times, further arguments, rows never in force, what takes all
    '1 kHz': ([f'{n / 1000:.3f}' for n in range(601)], [], 480, '0.001'),
    '60 Hz in ms': ([f'{n / 60:.3f}' for n in range(601)], ['--dt', str(1 / 60)], 200, '0.016'),
    'jitter': ([0.0, 0.011, 0.0123, 0.03, 0.0309, 0.05], [], 1, '0.0009'),
    'the end': ([0.0, 0.012, 0.0172], ['--dt', '0.01'], 1, '0.00468')}


@pytest.mark.parametrize('log', LOGS)
def test_rows_that_are_never_in_force_are_counted_and_auto_takes_all(folder, capfd, log):
    times, arguments, lost, dt = LOGS[log]
    write_times(folder, times)
    assert simulate('--out', 'OUT.csv', *arguments) == 0
    told, _ = capfd.readouterr().err.splitlines()
    assert told.startswith(f'simulate: IN.csv: {lost} of {len(times)} rows are never in force')
    named = told.split('--dt ')[1].split()[0]
    assert named == dt
    assert {*table()['torque.pinion'][1:]} < {*range(len(times) - 1)}
    assert simulate('--out', 'OUT.csv', '--dt', named) == 0
    assert capfd.readouterr().err.count('\n') == 1
    assert {*table()['torque.pinion'][1:]} == {*range(len(times) - 1)}
    (folder / 'p.yaml').write_text(
        f'/**: {{ros__parameters: {{rate: {1 / float((arguments or ["", 0.005])[1])}}}}}')
    assert simulate('--out', 'AUTO.csv', '--dt', 'auto', '--params', 'p.yaml') == 0
    assert capfd.readouterr().err.count('\n') == 1
    assert (folder / 'AUTO.csv').read_bytes() == (folder / 'OUT.csv').read_bytes()


def test_auto_is_the_default_where_that_takes_all(folder):
    assert simulate('--out', 'OUT.csv') == 0
    assert simulate('--out', 'AUTO.csv', '--dt', 'auto') == 0
    assert (folder / 'AUTO.csv').read_bytes() == (folder / 'OUT.csv').read_bytes()
    write_times(folder, [0, 1e-3])   # a whole run in less than half a default tick
    assert simulate('--out', 'AUTO.csv', '--dt', 'auto') == 0
    assert len(table('AUTO.csv')) == 2


@pytest.mark.parametrize('seed', range(200))
def test_each_table_has_a_tick_that_takes_all_its_rows(seed):
    random = np.random.default_rng(seed)
    digits = int(random.integers(2, 7))
    times = sorted({round(float(time), digits) for time in
                    np.cumsum(random.exponential(10.0**-random.integers(0, 4), 50))})
    rows = TorqueTable(tuple(times), tuple((n,) for n in range(len(times))), (-1,))
    dt = rows.tick_for_all(1.0)
    taken = [n for n, in rows.held(dt)]
    assert {*taken} - {-1} == {*range(len(times) - 1)}
    assert dt == 1.0 or dt > 0.59 * min(np.diff(times))


def test_columns_can_be_ignored(folder):
    assert simulate('--out', 'a.csv') == 0
    header, *rows = GOOD.splitlines()
    (folder / 'IN.csv').write_text('\n'.join(
        [f'gear,{header},v,v,', *(f'D,{row},,x,' for row in rows)]))
    assert simulate('--out', 'b.csv', '--ignore-columns', 'gear, v,') == 0
    assert (folder / 'a.csv').read_bytes() == (folder / 'b.csv').read_bytes()


@pytest.mark.parametrize('message, ignored', [
    ("IN.csv:1: column 'left': it is needed and cannot be ignored", 'left'),
    ("IN.csv:1: column 'lift': it is not there to be ignored", 'lift')])
def test_what_cannot_be_ignored_is_told(folder, capfd, message, ignored):
    refused(folder, capfd, message, '--ignore-columns', ignored)


HINTS = {
    'it has semicolons, write commas, and decimal points': GOOD.replace(',', ';'),
    'it has tabs, write commas': GOOD.replace(',', '\t'),
    'it has spaces, write commas': GOOD.replace(',', '  '),
    "IN.csv:3: column 'time': '0,5' is not a finite number; write a decimal point, not a comma":
        GOOD.replace('0.5', '"0,5"'),
    "IN.csv:2: column 5: '-15' has no header; if commas are its decimal signs, write points":
        'time,pinion,left,right\n0,0,10,0,-15,0,-16,0\n',
    "IN.csv:2: column 'time': 's' is not a finite number; if this row has the units, take it out":
        GOOD.replace('\n', '\ns,N m,N m,N m\n', 1),
    "IN.csv:2: column 'time': '' is not a finite number; if this row has the units":
        GOOD.replace('\n', '\n,Nm,Nm,Nm\n', 1),
    '; --ignore-columns "gear,v" passes over what is unknown':
        GOOD.replace('pinion', 'gear,pinion,v'),
    '; --ignore-columns "" passes over': GOOD.replace('right', 'right,'),
    "column 'Time [ms]': unknown, the columns are time, pinion, left, right; write time for "
    "'Time [ms]', in s": GOOD.replace('time', 'Time [ms]'),
    "; write time for 't_s', in s": GOOD.replace('time', 't_s'),
    "; write left for 'torque.left'": GOOD.replace('left', 'torque.left'),
    "'12:00:01' is not a finite number; a time is in seconds": GOOD.replace('0.5', '12:00:01'),
    'if its times are in ms, divide them by 1000':
        'time,pinion,left,right\n' + ''.join(f'{10 * n},1,2,3\n' for n in range(6000)),
    'if its times are in ns, divide them by 1e9':
        'time,pinion,left,right\n' + ''.join(f'{10**7 * n},1,2,3\n' for n in range(60)),
}


@pytest.mark.parametrize('hint', HINTS)
def test_an_error_has_a_hint_what_the_file_may_be(folder, capfd, hint):
    (folder / 'IN.csv').write_text(HINTS[hint])
    assert simulate('--out', 'OUT.csv') == 2
    err = capfd.readouterr().err
    assert hint in err and err.startswith('simulate: error: IN.csv:') and err.count('\n') == 1
    assert not (folder / 'OUT.csv').exists()


@pytest.mark.parametrize('times, unit', [
    (range(0, 1000, 10), 'ms'), (range(0, 4000), 'ms'), (range(0, 100_000, 1000), 'us'),
    (range(0, 1800), ''), (range(0, 40, 10), '')])
def test_a_run_whose_times_may_be_in_another_unit_says_so(folder, capfd, times, unit):
    """A drive cycle has a row each second, for half an hour; four rows may have any times."""
    write_times(folder, times)
    assert simulate('--out', 'OUT.csv', '--dt', '1') == 0
    err = capfd.readouterr().err
    assert (f'IN.csv: it lasts {times[-1]} s; if its times are in {unit}, divide' in err
            if unit else err.count('\n') == 1)


def test_reads_what_spreadsheets_write(folder):
    (folder / 'x.csv').write_bytes(
        b'\xef\xbb\xbf"right", time,"left",pinion\r\n 3,0,2, 1e0\r\n\r\n6,"1",5,4\r\n,,,\r\n')
    assert read_torque_file('x.csv', SYMMETRIC.ports) == TorqueTable(
        (0.0, 1.0), ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0)), (0.0, 0.0, 0.0))


FORCED = ('time,rear_clutch,carrier,front,rear\n0,0,300,-100,-150\n0.1,2000,300,-100,-150\n'
          '0.2,500.5,30,-100,-15\n0.3,0,0,0,0\n')


@pytest.mark.parametrize('variant', ['lsd_lagged', 'lsd_ode', 'lsd_dae'])
def test_forces_on_clutches_are_read_from_their_columns(folder, variant):
    (folder / 'IN.csv').write_text(FORCED)
    (folder / 'lag.yaml').write_text(
        '/**: {ros__parameters: {lsd.clutch.rear.actuator_time_constant: 0.01}}')
    assert simulate('--out', 'OUT.csv', '--dt', '0.01', '--params', 'lag.yaml',
                    variant=variant) == 0
    simulation = Simulation(variant, 0.01, {'lsd.clutch.rear.actuator_time_constant': 0.01})
    expected = [simulation.snapshot()] + [
        simulation.step(torques, (0.0, force)) for torques, force in (
            ((300, -100, -150), 0.0), ((300, -100, -150), 2000.0), ((30, -100, -15), 500.5))
        for _ in range(10)]
    rows = np.loadtxt('OUT.csv', delimiter=',', skiprows=1)
    assert np.array_equal(rows, [np.hstack(snapshot) for snapshot in expected])
    assert 1900.0 < table()['clutch_force.rear'].max() < 2000.0


def test_a_file_without_forces_is_one_with_forces_of_zero(folder):
    write_profile('lsd_ode', 1.0)
    assert simulate('--out', 'a.csv', variant='lsd_ode') == 0
    header, *rows = (folder / 'IN.csv').read_text().splitlines()
    (folder / 'IN.csv').write_text('\n'.join(
        [f'{header},front_clutch', *(f'{row},0' for row in rows)]))
    assert simulate('--out', 'b.csv', variant='lsd_ode') == 0
    assert (folder / 'a.csv').read_bytes() == (folder / 'b.csv').read_bytes()


@pytest.mark.parametrize('message, change', [
    ("IN.csv:3: column 'rear_clutch': -2000.0 N is negative", ('2000', '-2000')),
    ("IN.csv:3: column 'rear_clutch': 'nan' is not a finite number", ('2000', 'nan')),
    ("IN.csv:1: column 'left_clutch': unknown, the columns are time, carrier, front, rear, "
     'front_clutch (if wanted)', ('rear_clutch', 'left_clutch')),
    ("IN.csv:1: column 'front': missing", ('front,', 'front_clutch,'))])
def test_a_column_of_forces_that_cannot_be_is_refused_by_line_and_column(
        folder, capfd, message, change):
    (folder / 'IN.csv').write_text(FORCED.replace(*change, 1))
    refused(folder, capfd, message, '--out', 'OUT.csv', '--variant', 'lsd_ode')


def test_a_clutch_that_is_not_there_has_no_column(folder, capfd):
    (folder / 'IN.csv').write_text(GOOD.replace('right', 'right,left_clutch'))
    refused(folder, capfd, "IN.csv:1: column 'left_clutch': unknown", '--out', 'OUT.csv')


BAD_TABLES = {
    'IN.csv:1: the file is empty': '',
    "IN.csv:1: column 'time': missing": 'pinion,left,right\n1,2,3\n',
    "IN.csv:1: column 'right': missing": 'time,pinion,left\n0,1,2\n1,1,2\n',
    "IN.csv:1: column 'front': unknown": 'time,pinion,left,right,front\n0,1,2,3,4\n',
    "IN.csv:1: column '': unknown": 'time,pinion,left,right,\n0,1,2,3,\n',
    "IN.csv:1: column 'left': it appears twice": 'time,pinion,left,left,right\n',
    "IN.csv:1: column 'time': a row with a time above 0 must end": 'time,pinion,left,right\n',
    "IN.csv:2: column 'time': a row": 'time,pinion,left,right\n0,1,2,3\n',
    "IN.csv:3: column 'left': 'abc' is not a finite number": GOOD.replace(',15', ',abc'),
    "IN.csv:3: column 'left': '' is not a finite": GOOD.replace(',15', ','),
    "IN.csv:3: column 'left': 'nan' is not a finite": GOOD.replace(',15', ',nan'),
    "IN.csv:3: column 'left': '-inf' is not a finite": GOOD.replace(',15', ',-inf'),
    "IN.csv:3: column 'left': '1e999' is not a finite": GOOD.replace(',15', ',1e999'),
    "IN.csv:3: column 'left': '1_5' is not a finite": GOOD.replace(',15', ',1_5'),
    "IN.csv:3: column 'time': 'x' is not a finite": GOOD.replace('0.5', 'x'),
    "IN.csv:3: column 'time': 0.0 does not come after 0.0": GOOD.replace('0.5', '0'),
    "IN.csv:4: column 'time': 1.0 does not come after 1.5": GOOD.replace('0.5', '1.5'),
    "IN.csv:2: column 'time': -1.0 is negative": GOOD.replace('\n0,', '\n-1,'),
    "IN.csv:3: column 'right': there is no cell": GOOD.replace(',15,16', ',15'),
    "IN.csv:3: column 5: '17' has no header": GOOD.replace(',16', ',16,17'),
    "IN.csv:4: column 'left': 'x\\ny' is not": GOOD.replace(',15', ',"x\ny"'),
    'IN.csv:2: unexpected end of data': 'time,pinion,left,right\n"',
}


@pytest.mark.parametrize('message', BAD_TABLES)
def test_a_bad_table_is_refused_by_file_line_and_column(folder, message, capfd):
    (folder / 'IN.csv').write_text(BAD_TABLES[message])
    refused(folder, capfd, message, '--out', 'OUT.csv', '--plot', 'OUT.png')


def refused(folder, capfd, message, *arguments):
    """Assert that the tool refuses in one line, and that no file changes."""
    before = {path: path.is_file() and path.read_bytes() for path in folder.iterdir()}
    assert simulate(*arguments) == 2
    out, err = capfd.readouterr()
    assert not out and err.startswith(f'simulate: error: {message}') and err.count('\n') == 1
    assert {path: path.is_file() and path.read_bytes() for path in folder.iterdir()} == before


@pytest.mark.parametrize('message, arguments', [
    ('dt: 0.0', ['--dt', '0']),
    ('dt: nan', ['--dt', 'nan']),
    ('IN.csv: time: ticks of 5 s', ['--dt', '5']),
    ('IN.csv: time: ticks of 1e-30 s', ['--dt', '1e-30']),
    ('none.yaml: No such file', ['--params', 'none.yaml']),
    ('none/OUT.csv: No such file', ['--out', 'none/OUT.csv']),
    ('.: Is a directory', ['--out', '.']),
    ('none/OUT.png: No such file', ['--plot', 'none/OUT.png']),
])
def test_bad_arguments_are_refused(folder, capfd, message, arguments):
    (folder / 'OUT.csv').write_text('precious')
    refused(folder, capfd, message, '--out', 'OUT.csv', *arguments)


def test_an_input_is_not_overwritten(folder, capfd):
    refused(folder, capfd, f'{folder / "IN.csv"}: given for two files', '--out', 'IN.csv')


def test_a_bad_parameter_is_refused_by_file_and_name(folder, capfd):
    (folder / 'p.yaml').write_text('/**: {ros__parameters: {symmetric.inertia.left: -1.0}}')
    refused(folder, capfd, 'p.yaml: symmetric.inertia.left: -1.0 is not allowed',
            '--out', 'OUT.csv', '--params', 'p.yaml')


@pytest.mark.parametrize('content, message', [
    (None, 'IN.csv: No such file'), (b'\xff\xfe', 'IN.csv: not a text file in UTF-8')])
def test_an_unreadable_table_is_refused(folder, capfd, content, message):
    (folder / 'IN.csv').unlink()
    if content:
        (folder / 'IN.csv').write_bytes(content)
    refused(folder, capfd, message, '--out', 'OUT.csv')


def test_a_run_that_leaves_the_range_of_numbers_leaves_no_file(folder, capfd):
    (folder / 'OUT.csv').write_text('precious')
    (folder / 'IN.csv').write_text(GOOD.replace('-10', '-1e308').replace('15', '1e308'))
    refused(folder, capfd, 'IN.csv: after ', '--out', 'OUT.csv', '--plot', 'OUT.png')


@pytest.mark.skipif(not os.path.exists('/dev/full'), reason='needs /dev/full')
def test_a_full_disk_is_named(folder, capfd):
    refused(folder, capfd, '/dev/full: No space left on device', '--out', '/dev/full')


def test_a_pipe_or_device_is_written_to_not_replaced(capfd):
    assert simulate('--out', '/dev/stdout') == 0
    assert capfd.readouterr().out.startswith('time,')
    assert simulate('--out', '/dev/null') == 0
    assert not os.path.isfile('/dev/null')


def test_a_link_stays_a_link(folder):
    (folder / 'there').mkdir()
    (folder / 'OUT.csv').symlink_to('there/OUT.csv')
    assert simulate('--out', 'OUT.csv') == 0
    assert (folder / 'OUT.csv').is_symlink() and len(table('there/OUT.csv')) == 201


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_leaves_nothing_behind(folder, number):
    (folder / 'IN.csv').write_text(GOOD.replace('\n1,', '\n5e3,'))
    check_interrupt(number, folder, *TOOL, '--torques', 'IN.csv')


def test_a_reader_that_leaves_ends_it_quietly(folder):
    (folder / 'IN.csv').write_text(GOOD.replace('\n1,', '\n5e3,'))
    process = subprocess.Popen([*TOOL, '--torques', 'IN.csv'], stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, text=True)
    process.stdout.readline()
    process.stdout.close()
    assert process.wait(timeout=60.0) == 128 + signal.SIGPIPE
    with process.stderr as stderr:
        assert not stderr.read()


@pytest.mark.parametrize('variant', ['symmetric_dae', 'lsd_lagged'])
def test_draws_a_picture_alone(folder, variant, capfd):
    write_profile(variant, 1.0)
    assert simulate('--plot', 'OUT.png', variant=variant) == 0
    assert (folder / 'OUT.png').read_bytes().startswith(b'\x89PNG')
    assert not capfd.readouterr().out and not (folder / 'OUT.csv').exists()


def test_a_missing_matplotlib_is_told_before_the_run(folder, capfd, monkeypatch):
    monkeypatch.setitem(sys.modules, 'matplotlib.figure', None)
    refused(folder, capfd, 'a picture needs matplotlib: pip install "dm_ros[plot]"',
            '--plot', 'OUT.png')
    assert simulate('--out', 'OUT.csv') == 0


def test_argparse_errors_have_the_exit_code_2(capsys):
    for arguments in (['--variant', 'other'], ['--dt', 'abc'], []):
        with pytest.raises(SystemExit) as error:
            main(arguments)
        assert error.value.code == 2
    with pytest.raises(SystemExit) as error:
        main(['--help'])
    assert error.value.code == 0 and 'OUT.csv has the columns' in capsys.readouterr().out


def test_the_tool_loads_neither_ros_nor_matplotlib():
    check = ('import sys, dm_ros.tools.simulate; '
             'assert not {"rclpy", "matplotlib"} & set(sys.modules), sys.modules')
    subprocess.run([sys.executable, '-c', check], check=True)


def test_speeds_stay_finite_over_a_whole_built_in_run():
    write_profile('lsd_ode', 10.0)
    assert simulate('--out', 'OUT.csv', variant='lsd_ode') == 0
    assert all(math.isfinite(value) for row in table() for value in row)
