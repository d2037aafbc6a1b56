# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The tool ``simulate`` with a driveline: its columns, its numbers, and what it refuses."""

import csv
import os
from pathlib import Path
import signal
import subprocess
import sys

from driveline.scenarios import DIFFERENTIALS
from interrupting import check_interrupt
import numpy as np
import pytest

from dm_ros import Driveline
from dm_ros.files.driveline_record import driveline_columns, driveline_row, DrivelineRecord
from dm_ros.tools.simulate import main

PAGE = Path(__file__).parents[1] / 'doc' / 'driveline.md'
WHEELS = 'front_left', 'front_right', 'rear_left', 'rear_right'
GOOD = ('time,rear_left_grip,input,front_left_brake\n0,0.3,300,0\n0.05,1,-20,150\n0.1,1,0,0\n')
# of an axle with clutches, in words of any layout
PLATES = {f'clutch.{side}.friction_surfaces': 4 for side in ('left', 'right')}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Run each test in a folder of its own that holds a good IN.csv."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'IN.csv').write_text(GOOD)
    return tmp_path


def simulate(*arguments, layout='awd'):
    return main(['--driveline', layout, '--torques', 'IN.csv', *map(str, arguments)])


def written(name='OUT.csv'):
    """Return the header of a file and its rows of numbers."""
    with open(name) as file:
        header, *rows = csv.reader(file)
    return header, [tuple(map(float, row)) for row in rows]


def parameter_file(values, node='/**'):
    """Write p.yaml; return its name."""
    with open('p.yaml', 'w') as file:
        file.write(f'{node}:\n  ros__parameters:\n')
        file.writelines(f'    {name}: {str(value).lower()}\n' for name, value in values.items())
    return 'p.yaml'


def random_rows(rng, car, count=12):
    """Return rows of values of some inputs of a car, by name."""
    spread = {'torque': (-200, 500), 'capacity': (0, 300), 'force': (0, 2000),
              'angle': (-0.1, 0.1), 'tangent': (-0.1, 0.1), 'share': (0.2, 1.2)}
    ports = {port.name: port for port in car.ports
             if port.name != 'wind' and (car.planar or port.name != 'steer')}
    names = [name for name in rng.permutation(list(ports))
             if rng.random() < 0.8 or name == 'input']
    return [{name: rng.uniform(*spread[ports[name].kind]) for name in names}
            for _ in range(count)]


def arguments_of(car, row):
    """Return the arguments of ``step`` for a row of values by name."""
    def wheels(what, otherwise):
        return tuple(row.get(f'{wheel}_{what}', otherwise) for wheel in WHEELS)
    return {'torque': row.get('input', 0.0), 'brakes': wheels('brake', 0.0),
            'clutch_forces': {clutch: row.get(f'{clutch}_clutch', 0.0) for clutch in car.clutches},
            'steer': row.get('steer', 0.0), 'grade': row.get('grade', 0.0),
            'grip': wheels('grip', 1.0), 'contact': wheels('contact', 1.0)}


@pytest.mark.parametrize('planar', [False, True])
@pytest.mark.parametrize('layout', DIFFERENTIALS)
def test_each_row_is_a_tick_of_the_library_bit_for_bit(layout, planar, capsys):
    """Under all kinds of inputs, in any order of columns, some of them left out."""
    values = {f'driveline.{name}.{parameter}': value for name in DIFFERENTIALS[layout]
              if name != 'centre' for parameter, value in PLATES.items()}
    car = Driveline(layout, planar, 0.002, values)
    car.reset(9.0)
    rows = random_rows(np.random.default_rng(len(layout) + planar), car)
    with open('IN.csv', 'w') as file:
        print('time', *rows[0], sep=',', file=file)
        for n, row in enumerate([*rows, rows[-1]]):
            print(n / 100, *row.values(), sep=',', file=file)
    assert simulate(*['--planar'] * planar, '--dt', 0.002, '--initial-speed', 9, '--params',
                    parameter_file(values), '--out', 'OUT.csv', layout=layout) == 0
    header, found = written()
    assert header == driveline_columns(car)
    column = {name: n for n, name in enumerate(header)}
    snapshots = [car.snapshot(), *(car.step(**arguments_of(car, row))
                                   for row in rows for _ in range(5))]
    assert len(found) == len(snapshots)
    for numbers, snapshot in zip(found, snapshots):
        def of(kind, names, numbers=numbers):
            return tuple(numbers[column[f'{kind}.{name}']] for name in names)
        assert numbers[0] == snapshot.time
        assert of('velocity', car.shafts) == snapshot.velocity
        assert of('position', car.shafts) == snapshot.position
        assert of('torque', car.connections) == snapshot.torque
        assert of('twist', car.connections) == snapshot.twist
        assert of('moment', car.moments) == snapshot.moment
        assert of('power_flow', car.differentials) == snapshot.power_flow
        assert of('load', WHEELS) == snapshot.wheel_load
        assert tuple(zip(of('longitudinal_slip', WHEELS),
                         of('lateral_slip', WHEELS))) == snapshot.slip
        assert tuple(zip(of('longitudinal_force', WHEELS),
                         of('lateral_force', WHEELS))) == snapshot.wheel_force
        assert tuple(numbers[column[name]] for name in (
            'x', 'y', 'yaw', 'longitudinal_speed', 'lateral_speed', 'yaw_rate',
            'longitudinal_acceleration', 'lateral_acceleration')) == (
                *snapshot.pose, *snapshot.twist_body, *snapshot.acceleration)
    assert of('clutch_force', car.clutches) == car.clutch_force and any(car.clutch_force)
    told = capsys.readouterr().err
    assert told.startswith('simulate: 60 ticks, 0.12 s, final speed ') and told.count('\n') == 1


def test_the_file_is_that_of_a_record_of_the_same_run(folder):
    assert simulate('--dt', 0.01, '--out', 'OUT.csv') == 0
    car = Driveline('awd', dt=0.01)
    rows = [driveline_row(car.snapshot(), car.clutch_force)]
    for n in range(10):
        car_at = {'torque': 300.0, 'grip': (1.0, 1.0, 0.3, 1.0)} if n < 5 else {
            'torque': -20.0, 'brakes': (150.0, 0.0, 0.0, 0.0)}
        rows.append(driveline_row(car.step(**car_at), car.clutch_force))
    DrivelineRecord(car, rows).save_csv('RECORD.csv')
    assert (folder / 'OUT.csv').read_bytes() == (folder / 'RECORD.csv').read_bytes()


def test_columns_left_out_are_idle_and_idle_is_a_car_on_a_good_road(folder):
    """Grip and contact are 1 then; the same with all columns, and by a file of times alone."""
    (folder / 'IN.csv').write_text('time\n0\n0.1\n')
    assert simulate('--planar', '--initial-speed', 5, '--out', 'a.csv') == 0
    names = [port.name for port in Driveline('awd').ports if port.name != 'wind']
    idle = [float(name.endswith(('_grip', '_contact'))) for name in names]
    (folder / 'IN.csv').write_text('\n'.join(
        ','.join(map(str, row)) for row in (['time', *names], [0, *idle], [0.1, *idle])))
    assert simulate('--planar', '--initial-speed', 5, '--out', 'b.csv') == 0
    assert (folder / 'a.csv').read_bytes() == (folder / 'b.csv').read_bytes()
    header, rows = written('a.csv')
    loads = [rows[-1][n] for n, name in enumerate(header) if name.startswith('load.')]
    assert sum(loads) == pytest.approx(1600.0 * 9.81)


def test_before_the_first_row_all_is_idle(folder):
    (folder / 'IN.csv').write_text('time,input,front_left_contact\n0.05,300,0\n0.1,0,1\n')
    assert simulate('--dt', 0.01, '--out', 'OUT.csv') == 0
    header, rows = written()
    load, twist = (header.index(name) for name in ('load.front_left', 'twist.input'))
    assert [row[load] > 0.0 for row in rows] == [True] * 6 + [False] * 5
    assert [row[twist] == 0.0 for row in rows] == [True] * 6 + [False] * 5


def test_a_parameter_file_counts_as_for_the_node(folder):
    (folder / 'p.yaml').write_text(
        '/driveline:\n  ros__parameters:\n    layout: rwd\n    planar: true\n    rate: 50.0\n'
        '    initial_speed: 4.0\n    use_sim_time: true\n    driveline.mass: 1400.0\n'
        '    driveline:\n      shaft: {half: {gap: 0.03}}\n      rear.final_drive_ratio: 4.1\n')
    car = Driveline('rwd', True, 0.02, {
        'driveline.mass': 1400.0, 'driveline.shaft.half.gap': 0.03,
        'driveline.rear.final_drive_ratio': 4.1})
    (folder / 'IN.csv').write_text('time,steer,input\n0,0.02,200\n0.2,0,0\n')
    for speed, more in ((4.0, ()), (0.0, ('--initial-speed', 0)), (-2.0, ('--initial-speed', -2))):
        assert main(['--driveline', '--torques', 'IN.csv', '--params', 'p.yaml', '--out',
                     'OUT.csv', *map(str, more)]) == 0
        car.reset(speed)
        expected = [driveline_row(car.snapshot(), ()),
                    *(driveline_row(car.step(200.0, steer=0.02), ()) for _ in range(10))]
        assert written() == (driveline_columns(car), expected)


def test_the_layout_of_the_command_line_counts_more_than_that_of_the_file(folder):
    assert simulate('--params', parameter_file({'layout': 'awd'}), '--out', 'OUT.csv',
                    layout='fwd') == 0
    assert written()[0] == driveline_columns(Driveline('fwd'))


def test_names_of_another_layout_are_told_in_one_line_and_passed_over(folder, capsys):
    assert simulate('--out', 'a.csv', layout='fwd') == 0
    capsys.readouterr()
    path = parameter_file({'driveline.centre.crown_radius.front': 0.05,
                           'driveline.rear.final_drive_ratio': 5.0, 'driveline.mass': 1600.0})
    assert simulate('--params', path, '--out', 'b.csv', layout='fwd') == 0
    warning, _ = capsys.readouterr().err.splitlines()
    assert warning == (
        'simulate: warning: 2 parameters of another layout than fwd count for nothing: '
        'driveline.centre.crown_radius.front, driveline.rear.final_drive_ratio')
    assert (folder / 'a.csv').read_bytes() == (folder / 'b.csv').read_bytes()


def test_a_file_for_another_node_is_told(capsys):
    path = parameter_file({'driveline.mass': 900.0}, '/car/driveline')
    assert simulate('--params', path, '--out', 'OUT.csv') == 0
    warning, _ = capsys.readouterr().err.splitlines()
    assert warning.endswith('p.yaml: nothing in it is for /driveline, but for /car/driveline')


def test_auto_takes_each_row_and_columns_can_be_ignored(folder, capsys):
    (folder / 'IN.csv').write_text('time,gear,input\n' + ''.join(
        f'{n / 1000},D,{n}\n' for n in range(21)))
    assert simulate('--ignore-columns', 'gear', '--out', 'OUT.csv') == 0
    assert '16 of 21 rows are never in force' in capsys.readouterr().err
    assert simulate('--ignore-columns', 'gear', '--dt', 'auto', '--out', 'OUT.csv') == 0
    assert len(written()[1]) == 21
    car = Driveline('awd')
    for n in range(20):
        last = car.step(float(n))
    assert written()[1][-1] == driveline_row(last, car.clutch_force)


def refused(folder, capfd, message, *arguments, layout='awd'):
    """Assert that the tool refuses in one line, and that no file changes."""
    before = {path: path.is_file() and path.read_bytes() for path in folder.iterdir()}
    assert simulate('--out', 'OUT.csv', '--plot', 'OUT.png', *arguments, layout=layout) == 2
    out, err = capfd.readouterr()
    assert not out and err.startswith(f'simulate: error: {message}') and err.count('\n') == 1
    assert {path: path.is_file() and path.read_bytes() for path in folder.iterdir()} == before


BAD_TABLES = {
    'IN.csv:1: the file is empty': '',
    "IN.csv:1: column 'time': missing, the columns are time and any of input, ": 'input\n1\n',
    "IN.csv:1: column 'left': unknown, the columns are time and any of input, front_left_brake, ":
        'time,left\n0,1\n1,2\n',
    "IN.csv:1: column 'wind': unknown": 'time,wind\n0,1\n1,2\n',
    "IN.csv:1: column 'front_left_clutch': unknown": 'time,front_left_clutch\n0,1\n1,2\n',
    "IN.csv:1: column 'input': it appears twice": 'time,input,input\n0,1,1\n1,2,2\n',
    "IN.csv:3: column 'input': 'x' is not a finite number": GOOD.replace('-20', 'x'),
    "IN.csv:3: column 'input': 'inf' is not a finite number": GOOD.replace('-20', 'inf'),
    "IN.csv:3: column 'input': '' is not a finite number": GOOD.replace('-20', ''),
    "IN.csv:3: column 'front_left_brake': there is no cell": GOOD.replace(',150', ''),
    "IN.csv:3: column 'front_left_brake': the capacity on front_left_brake is -150.0, it must not "
    'be below 0': GOOD.replace('150', '-150'),
    "IN.csv:2: column 'rear_left_grip': the share on rear_left_grip is 0.0, it must not be below "
    '1e-06': GOOD.replace('0,0.3', '0,0'),
    "IN.csv:3: column 'rear_right_contact': ": 'time,rear_right_contact\n0,1\n0.1,-0.1\n1,1\n',
    "IN.csv:2: column 'centre_rear_clutch': -1.0 N is negative, a clutch can only be pressed":
        'time,centre_rear_clutch\n0,-1\n1,0\n',
    "IN.csv:3: column 'steer': the angle on steer is 0.1, it must not be above 0: the body "
    'cannot turn unless it is planar (--planar)': 'time,steer\n0,0\n0.1,0.1\n1,0\n',
    "IN.csv:2: column 'grade': ": 'time,grade\n0,11\n1,0\n',
    "IN.csv:3: column 'time': 0.0 does not come after 0.0": GOOD.replace('0.05', '0'),
    "IN.csv:2: column 'time': -1.0 is negative": GOOD.replace('\n0,', '\n-1,'),
    "IN.csv:2: column 'time': a row with a time above 0": 'time,input\n0,1\n',
    'IN.csv: after 0': 'time,input\n0,1e308\n1,0\n',
}


@pytest.mark.parametrize('message', BAD_TABLES)
def test_a_bad_table_is_refused_by_file_line_and_column(folder, capfd, message):
    (folder / 'OUT.csv').write_text('precious')
    (folder / 'IN.csv').write_text(BAD_TABLES[message])
    refused(folder, capfd, message)


@pytest.mark.parametrize('hint, content', [
    ('; it has semicolons, write commas', GOOD.replace(',', ';')),
    ("; write input for 'Input [Nm]'", GOOD.replace('input', 'Input [Nm]')),
    ('; --ignore-columns "gear" passes over', GOOD.replace('input', 'gear')),
    ("; write time for 't_s', in s", GOOD.replace('time', 't_s'))])
def test_a_header_has_a_hint_what_it_may_be(folder, capfd, hint, content):
    (folder / 'IN.csv').write_text(content)
    assert simulate() == 2
    err = capfd.readouterr().err
    assert hint in err and err.startswith('simulate: error: IN.csv:1:') and err.count('\n') == 1


def test_the_angle_that_may_be_steered_is_that_of_the_car(folder, capfd):
    (folder / 'IN.csv').write_text('time,steer\n0,0.9\n0.1,0\n')
    assert simulate('--planar', '--out', 'OUT.csv') == 0
    (folder / 'IN.csv').write_text('time,steer\n0,1.1\n0.1,0\n')
    capfd.readouterr()
    refused(folder, capfd, "IN.csv:2: column 'steer': the angle on steer is 1.1, it must not be "
            'above 1\n', '--planar')


@pytest.mark.parametrize('message, arguments', [
    ('--variant: a driveline is made of several differentials', ['--variant', 'lsd_ode']),
    ('--loss-law: a driveline has the passive law alone', ['--loss-law', 'passive']),
    ('--bag: no bag of a driveline is written or read', ['--bag', 'bag']),
    ('--node: no bag of a driveline is written or read', ['--node', '/driveline']),
    ('--initial-speed: nan is not allowed, it must be in [-1000, 1000]',
     ['--initial-speed', 'nan']),
    ('dt: 0.0', ['--dt', '0']), ('dt: nan', ['--dt', 'nan']),
    ('IN.csv: time: ticks of 5 s', ['--dt', '5']),
    ('none.yaml: No such file', ['--params', 'none.yaml']),
    ('none/OUT.csv: No such file', ['--out', 'none/OUT.csv'])])
def test_arguments_that_make_no_sense_are_refused_by_name(folder, capfd, message, arguments):
    refused(folder, capfd, message, *arguments)


def test_a_bag_is_not_read(folder, capfd):
    (folder / 'BAG').mkdir()
    (folder / 'BAG' / 'metadata.yaml').write_text('')
    refused(folder, capfd, 'BAG: no bag of a driveline is written or read', '--torques', 'BAG')


def test_an_input_is_not_overwritten(folder, capfd):
    refused(folder, capfd, f'{folder / "IN.csv"}: given for two files', '--out', 'IN.csv')


@pytest.mark.parametrize('values, message', [
    ({'driveline.mas': 1.0}, 'driveline.mas: there is no such parameter'),
    ({'symmetric.inertia.left': 1.0}, 'symmetric.inertia.left: there is no such parameter'),
    ({'driveline.mass': -1.0}, 'driveline.mass: -1.0 is not allowed, it must be in (0, 1e+06]'),
    ({'driveline.mass': 1600}, 'driveline.mass: 1600 is an integer, it must be a double'),
    ({'layout': 'xwd'}, "layout: 'xwd' is not allowed, it must be one of fwd, rwd, awd"),
    ({'planar': 1}, 'planar: 1 is an integer, it must be a bool'),
    ({'use_sim_time': 1}, 'use_sim_time: 1 is an integer'),
    ({'driveline.rear.final_drive_ratio': 0.0}, 'driveline.rear.final_drive_ratio: 0.0'),
    ({'driveline.tyre.damping': 100.0}, 'driveline.tyre.damping: damping times low_speed is')])
def test_a_bad_parameter_is_refused_by_file_and_name(folder, capfd, values, message):
    refused(folder, capfd, f'p.yaml: {message}', '--params', parameter_file(values))


@pytest.mark.parametrize('option', [['--planar'], ['--initial-speed', '0']])
def test_what_only_a_driveline_has_is_refused_without_one(folder, capfd, option):
    assert main(['--variant', 'lsd_ode', '--torques', 'IN.csv', *option]) == 2
    assert capfd.readouterr().err == (
        f'simulate: error: {option[0]}: only a driveline has that, see --driveline\n')


def test_many_ticks_are_told_before_and_too_many_are_refused(folder, capfd, monkeypatch):
    monkeypatch.setattr('dm_ros.tools.simulate.MANY_TICKS', 99)
    monkeypatch.setattr('dm_ros.tools.simulate.MOST_TICKS', 199)
    assert simulate('--dt', 0.001, '--out', 'OUT.csv') == 0
    told, _ = capfd.readouterr().err.splitlines()
    words = 'simulate: 100 ticks of 0.001 s, about '
    assert told.startswith(words) and told.endswith(' kB of CSV')
    size = float(told.removeprefix(words).split()[0]) * 1e3
    assert size / 1.5 < (folder / 'OUT.csv').stat().st_size < size * 1.5
    refused(folder, capfd, 'IN.csv: time: 200 ticks of 0.0005 s, about ', '--dt', 0.0005)


def test_the_table_of_the_page_runs_and_its_wheels_on_ice_spin(folder):
    """On the road again all roll as one, until a brake holds one of them."""
    lines = PAGE.read_text().splitlines()
    begin = next(n for n, line in enumerate(lines) if line.startswith('    time,input,'))
    table = [line.strip() for line in lines[begin:lines.index('', begin)]]
    (folder / 'IN.csv').write_text('\n'.join(table))
    assert simulate('--dt', 0.001, '--out', 'OUT.csv') == 0
    header, rows = written()
    assert len(rows) == 4001
    left, right, brake = (header.index(f'velocity.{wheel}') for wheel in (
        'front_left', 'front_right', 'rear_left'))
    assert rows[1499][left] > 2.0 * rows[1499][right]
    assert rows[2999][left] == pytest.approx(rows[2999][right], rel=0.01)
    assert rows[3200][brake] < 0.1 < 5.0 < rows[3200][right]


def test_the_page_names_all_columns():
    text = PAGE.read_text()
    text = text[text.index('## Tools'):text.index('## Limits')]
    for name in driveline_columns(Driveline('awd')):
        assert f'`{name.partition(".")[0]}' in text, name


def test_draws_a_picture_alone_and_equal_runs_equal_ones(folder, capfd):
    for name in ('a', 'b'):
        assert simulate('--planar', '--plot', f'{name}.png') == 0
    assert (folder / 'a.png').read_bytes().startswith(b'\x89PNG')
    assert (folder / 'a.png').read_bytes() == (folder / 'b.png').read_bytes()
    assert not capfd.readouterr().out and not list(folder.glob('*.csv'))[1:]


@pytest.mark.skipif(not os.path.exists('/dev/full'), reason='needs /dev/full')
def test_a_full_disk_is_named(folder, capfd):
    refused(folder, capfd, '/dev/full: No space left on device', '--out', '/dev/full')


def test_without_a_file_the_csv_goes_to_stdout(folder, capfd):
    assert simulate('--out', 'OUT.csv') == 0
    capfd.readouterr()
    assert simulate() == 0
    assert capfd.readouterr().out == (folder / 'OUT.csv').read_text()


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_leaves_nothing_behind(folder, number):
    (folder / 'IN.csv').write_text(GOOD.replace('\n0.1,', '\n5e3,'))
    check_interrupt(number, folder, sys.executable, '-m', 'dm_ros.tools.simulate', '--driveline',
                    'awd', '--torques', 'IN.csv')


def test_the_tool_loads_neither_ros_nor_matplotlib(monkeypatch):
    monkeypatch.setenv('PYTHONPATH', os.pathsep.join(path or os.getcwd() for path in sys.path))
    check = ('import sys\nfrom dm_ros.tools.simulate import main\n'
             'assert main("--driveline awd --torques IN.csv --out OUT.csv".split()) == 0\n'
             'assert not {"rclpy", "matplotlib"} & set(sys.modules), sys.modules')
    subprocess.run([sys.executable, '-c', check], check=True)
