# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The tool ``identify``: it finds parameters, knows how well, and says what it cannot know."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from scipy.signal import lfilter

from dm_ros import Simulation
from dm_ros.files.measured_drive import MeasuredDrive, read_measured_file
from dm_ros.files.parameter_file import read_parameter_file
from dm_ros.files.torque_table import TorqueTable
from dm_ros.mechanism.variants import SYMMETRIC, variant_named
from dm_ros.settings import known_rows
from dm_ros.tools import simulate
from dm_ros.tools.identification.fit import fit, parameter
from dm_ros.tools.identification.runs import Runs
from dm_ros.tools.identification.worth import for_one_independent, worth
from dm_ros.tools.identify import main

CARRIER = {'symmetric.inertia.carrier': 0.15, 'symmetric.viscosity.carrier': 0.02}
CLUTCH = {'lsd.inertia.carrier': 0.04, 'lsd.clutch.rear.friction_coefficient': 0.12,
          'lsd.clutch.rear.preload': 150.0}
VARIANT_OF = {'symmetric': 'symmetric_ode', 'lsd': 'lsd_ode'}
NOISE = 0.5   # rad/s


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """Run each test in a folder of its own."""
    # the tool as a process finds the package where this one does
    monkeypatch.setenv('PYTHONPATH', os.pathsep.join(path or os.getcwd() for path in sys.path))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def driven(variant, truth, ticks=60, dt=0.05, load=None, **more):
    """Return times, torques and speeds at these times, each an array, of a simulated drive."""
    simulation = Simulation(variant, dt, truth, **more)
    load = load or simulation.mechanism.load
    times = [n * dt for n in range(ticks + 1)]
    torques = [load(time) for time in times]
    speeds = [simulation.snapshot().velocity, *(
        simulation.step(row).velocity for row in torques[:-1])]
    return np.array(times), np.array(torques), np.array(speeds)


def measured(variant, truth, noise, shafts=None, **more):
    """Return the ``MeasuredDrive`` of a simulated drive with noise of its shape."""
    mechanism = variant_named(variant).mechanism
    times, torques, speeds = driven(variant, truth, **more)
    table = TorqueTable(tuple(times), tuple(map(tuple, torques)), (0.0,) * 3)
    shafts = shafts or mechanism.outputs
    return MeasuredDrive(table, times, {
        shaft: speeds[:, mechanism.shafts.index(shaft)] + noise(len(times))
        for shaft in shafts}, {})


def fitted(variant, names, drive, start=None, dt=0.05):
    """Return the ``Fit`` and its ``Worth``."""
    values = variant_named(variant).mechanism.parameters().named() | (start or {})
    parameters = [parameter(name, known_rows()[name], values[name]) for name in names]
    found = fit(Runs(variant, start or {}, drive, dt), parameters)
    return found, worth(found, drive, {})


def white(seed):
    random = np.random.default_rng(seed)
    return lambda count: NOISE * random.standard_normal(count)


def slow(seed, share=0.8):
    """Return noise that keeps a share of itself from time to time."""
    random = np.random.default_rng(seed)

    def noise(count):
        return lfilter([NOISE * (1 - share**2)**0.5], [1, -share],
                       random.standard_normal(count + 100))[100:]
    return noise


def write_log(path, variant, truth, noise, changed=lambda rows: rows, **more):
    """Write a drive with its measured speeds as a table of torques with columns beside."""
    mechanism = variant_named(variant).mechanism
    times, torques, speeds = driven(variant, truth, **more)
    outputs = [speeds[:, mechanism.shafts.index(shaft)] + noise(len(times))
               for shaft in mechanism.outputs]
    names = ['time', *mechanism.inputs, *(f'velocity.{shaft}' for shaft in mechanism.outputs)]
    rows = [names, *(list(map(repr, map(float, row)))
                     for row in np.column_stack((times, torques, *outputs)))]
    path.write_text('\n'.join(map(','.join, changed(rows))) + '\n')


def identify(variant, *arguments):
    return main(['--variant', variant, '--drive', 'LOG.csv', *arguments])


# what it finds

@pytest.mark.parametrize('seed', [102, 103, 105])
def test_a_fit_is_not_lost_where_a_clutch_locks_itself(folder, capsys, seed):
    """The first step from the defaults leads beyond: what is known of that keeps the fit off."""
    random = np.random.default_rng(seed)
    f, a = random.uniform(0.4, 2.0, 3), random.uniform(30.0, 120.0, 3)

    def load(time):
        swing = np.sin(2 * np.pi * f * time)
        return (a[0] * swing[0] + 100.0, -a[1] / 2 * abs(swing[1]) - 20.0,
                -a[2] / 2 * abs(swing[2]) - 20.0)
    truth = {'lsd.inertia.rear': 0.02, 'lsd.clutch.rear.friction_coefficient': 0.1,
             'lsd.clutch.front.preload': 250.0}
    write_log(folder / 'LOG.csv', 'lsd_ode', truth, white(seed), ticks=400, dt=0.005, load=load)
    assert identify('lsd_ode', '--report', 'R.json', '--fit', *truth) == 0
    report = json.loads((folder / 'R.json').read_text())
    for name, entry in report['parameters'].items():
        half = (entry['high'] - entry['low']) / 2   # 95 %: two standard errors
        assert abs(entry['estimate'] - truth[name]) < 2 * half < truth[name]


@pytest.mark.parametrize('truth', [CARRIER, CLUTCH], ids=['symmetric', 'lsd'])
def test_the_intervals_hold_the_truth_as_often_as_they_say(truth):
    """Of 40 noisy drives; both ends of what is plausible for 95 %."""
    variant = VARIANT_OF[next(iter(truth)).split('.')[0]]
    held = []
    for seed in range(40):
        drive = measured(variant, truth, white(seed), ticks=40)
        found, value = fitted(variant, truth, drive, {n: 1.1 * v for n, v in truth.items()})
        assert found.converged
        held.append([e.low <= truth[e.name] <= e.high for e in value.estimates])
    assert (np.mean(held, axis=0) >= 0.85).all()
    assert 0.85 <= np.mean(held) < 1.0


def test_intervals_are_wider_and_a_warning_comes_where_the_noise_is_slow():
    """As wide as independent noise makes them they hold the truth in less than two of three."""
    held, narrow, told = [], [], []
    for seed in range(20):
        drive = measured('symmetric_ode', CARRIER, slow(seed), ticks=200, dt=0.02)
        found, value = fitted('symmetric_ode', CARRIER, drive, dt=0.02)
        share = np.sqrt(sum(value.independent.values()) / sum(value.measured.values()))
        for e, p, inner in zip(value.estimates, found.parameters, found.inner):
            truth, half = p.inner(CARRIER[e.name]), (p.inner(e.high) - p.inner(e.low)) / 2
            held.append(abs(truth - inner) <= half)
            narrow.append(abs(truth - inner) <= half * share)
        told.append(sum('no independent noise' in line for line in value.warnings))
    assert np.mean(narrow) < 0.65 and np.mean(held) > 0.8
    assert np.mean(told) > 1.8   # of two columns


@pytest.mark.parametrize('share', [0.0, 0.5, 0.8])
def test_independent_residuals_are_counted_as_theory_has_it(share):
    counts = [for_one_independent(slow(seed, share)(4000)) for seed in range(20)]
    assert np.mean(counts) == pytest.approx((1 + share) / (1 - share), rel=0.1)


def test_the_fit_is_one_of_weighed_columns():
    """A column with a hundred times the noise spoils nothing."""
    drive = measured('symmetric_ode', CARRIER, white(1))
    drive.speeds['pinion'] = 100 * white(2)(61) + driven('symmetric_ode', CARRIER)[2][:, 3]
    _, alone = fitted('symmetric_ode', CARRIER, measured('symmetric_ode', CARRIER, white(1)))
    found, value = fitted('symmetric_ode', CARRIER, drive)
    assert found.noise == pytest.approx([0.5, 0.5, 50.0], rel=0.3)
    for one, other in zip(value.estimates, alone.estimates):
        assert one.value == pytest.approx(other.value, abs=0.1 * (other.high - other.low))


def test_what_simulate_writes_gives_its_parameters_back(folder):
    write_log(folder / 'LOG.csv', 'lsd_ode', {}, white(0))
    (folder / 'p.yaml').write_text('/**: {ros__parameters: {%s}}' % ', '.join(
        f'{name}: {value}' for name, value in CLUTCH.items()))
    assert simulate.main(['--variant', 'lsd_ode', '--params', 'p.yaml', '--torques', 'LOG.csv',
                          '--ignore-columns', 'velocity.front,velocity.rear',
                          '--out', 'OUT.csv']) == 0
    assert main(['--variant', 'lsd_ode', '--drive', 'OUT.csv', '--out', 'FITTED.yaml',
                 '--fit', *CLUTCH]) == 0
    found = read_parameter_file('FITTED.yaml')
    assert found.pop('variant') == 'lsd_ode' and found == pytest.approx(CLUTCH, rel=1e-5)


def test_a_bag_gives_its_parameters_back(folder, capsys):
    pytest.importorskip('rosbags', reason='bags need rosbags: the extra bag')
    write_log(folder / 'IN.csv', 'lsd_ode', {}, white(0), lambda rows: [row[:4] for row in rows])
    (folder / 'p.yaml').write_text(
        '/**: {ros__parameters: {initial_velocity.front: 9.0, initial_velocity.rear: 8.0, '
        'lsd.inertia.carrier: 0.05}}')
    assert simulate.main(['--variant', 'lsd_ode', '--params', 'p.yaml', '--torques', 'IN.csv',
                          '--bag', 'BAG']) == 0
    assert main(['--variant', 'lsd_ode', '--drive', 'BAG', '--out', 'FITTED.yaml',
                 '--fit', 'lsd.inertia.carrier']) == 0
    assert read_parameter_file('FITTED.yaml') == {
        'variant': 'lsd_ode', 'lsd.inertia.carrier': pytest.approx(0.05, rel=1e-5)}
    assert 'warning' not in capsys.readouterr().err


def test_the_fitted_file_makes_simulate_run_as_the_fit_and_keeps_what_was_given(folder, capsys):
    write_log(folder / 'LOG.csv', 'symmetric_ode', CARRIER, white(3))
    (folder / 'p.yaml').write_text(
        '/**: {ros__parameters: {rate: 20.0, use_sim_time: true, joint_prefix: "no", '
        'symmetric.viscosity.carrier: 1.0e-5}}')
    assert identify('symmetric_ode', '--params', 'p.yaml', '--out', 'FITTED.yaml',
                    '--report', 'R.json', '--plot', 'P.png', '--fit', *CARRIER) == 0
    out, err = capsys.readouterr()
    assert not err and 'symmetric.inertia.carrier' in out
    values = read_parameter_file('FITTED.yaml')
    report = json.loads((folder / 'R.json').read_text())
    estimates = {name: entry['estimate'] for name, entry in report['parameters'].items()}
    assert values == {'rate': 20.0, 'use_sim_time': True, 'joint_prefix': 'no',
                      'variant': 'symmetric_ode', **estimates}
    assert (folder / 'P.png').read_bytes().startswith(b'\x89PNG')
    assert report['converged'] and not report['warnings']
    assert np.diag(report['correlation']) == pytest.approx(1.0)
    assert report['residuals']['velocity.left']['rms'] == pytest.approx(NOISE, rel=0.3)
    for name, entry in report['parameters'].items():
        assert entry['low'] < entry['alone_low'] < entry['estimate'] < entry['high']
        assert entry['start'] == (1e-5 if 'viscosity' in name else 0.1)


def test_the_fitted_file_has_the_rate_that_the_fit_had(folder):
    write_log(folder / 'LOG.csv', 'symmetric_ode', CARRIER, white(3))
    assert identify('symmetric_ode', '--dt', '0.05', '--out', 'F.yaml', '--fit', *CARRIER) == 0
    assert read_parameter_file('F.yaml')['rate'] == 20.0


def test_equal_drives_give_equal_bytes(folder):
    write_log(folder / 'LOG.csv', 'symmetric_ode', CARRIER, white(3))
    for name in 'ab':
        assert identify('symmetric_ode', '--out', f'{name}.yaml', '--report', f'{name}.json',
                        '--plot', f'{name}.png', '--fit', *CARRIER) == 0
    for kind in ('yaml', 'json', 'png'):
        assert (folder / f'a.{kind}').read_bytes() == (folder / f'b.{kind}').read_bytes()


def test_the_speeds_at_the_start_can_be_fitted(folder, capsys):
    start = {'initial_velocity.left': 20.0, 'initial_velocity.right': 30.0}
    write_log(folder / 'LOG.csv', 'symmetric_ode', {}, white(4),
              initial_velocity=tuple(start.values()))
    arguments = '--report', 'R.json', '--fit', 'symmetric.inertia.carrier'
    assert identify('symmetric_ode', *arguments) == 0
    err = capsys.readouterr().err
    assert 'set initial_velocity.left, or fit it' in err and 'initial_velocity.right' in err
    assert identify('symmetric_ode', *arguments, *(f'{name}=0:100' for name in start)) == 0
    assert 'warning' not in capsys.readouterr().err
    found = json.loads((folder / 'R.json').read_text())['parameters']
    for name, truth in {**start, 'symmetric.inertia.carrier': 0.1}.items():
        half = (found[name]['high'] - found[name]['low']) / 2
        assert abs(found[name]['estimate'] - truth) < 1.5 * half


def test_speeds_may_be_measured_at_any_time(folder):
    """Empty cells are no measurements, and between ticks the run is linear."""
    def thinned(rows):
        kept = [rows[0]]
        for n, row in enumerate(rows[1:]):
            late = repr(float(row[0]) + 0.02) if n % 2 else row[0]
            kept.append([late, *row[1:4], row[4] if n % 3 else '', '' if n % 3 == 1 else row[5]])
        return kept
    write_log(folder / 'LOG.csv', 'symmetric_ode', {}, white(5), thinned)
    drive = read_measured_file('LOG.csv', SYMMETRIC)
    assert np.isnan(drive.speeds['left']).sum() == 21
    speeds, = Runs('symmetric_ode', {}, drive, 0.01).speeds([{}])
    ticks = dict(enumerate(drive.table.held(0.01)))
    simulation = Simulation('symmetric_ode', 0.01)
    run = [simulation.snapshot().velocity[1:3]] + [
        simulation.step(torques).velocity[1:3] for torques in ticks.values()]
    expected = [np.interp(drive.times, np.arange(len(run)) * 0.01, column) for column in zip(*run)]
    np.testing.assert_allclose(speeds, expected, atol=1e-9)


# what it says that it cannot

def warnings_of(variant, names, drive, **more):
    _, value = fitted(variant, names, drive, **more)
    return value


def test_parameters_that_act_as_one_are_named_with_how_they_may_change():
    names = 'lsd.clutch.rear.friction_coefficient', 'lsd.clutch.rear.radius'
    truth = {names[0]: 0.12, 'lsd.inertia.carrier': 0.04}
    value = warnings_of('lsd_ode', [*names, 'lsd.inertia.carrier'],
                        measured('lsd_ode', truth, white(1)))
    line, = value.warnings
    assert line.startswith(f'{names[0]} and {names[1]}: this drive cannot tell them apart')
    assert value.correlation[0, 1] == pytest.approx(-1.0, abs=1e-6)
    first, second = (float(line.split(f'{name} by ')[1].split(' %')[0]) for name in names)
    assert first * second < 0.0 and max(abs(first), abs(second)) == 10.0
    for e in value.estimates[:2]:   # their product is known all the same
        assert e.high - e.low > 100 * (e.alone_high - e.alone_low)


def test_a_sum_of_three_is_named_whole():
    """With one speed for both outputs nothing tells the inertias of a sum."""
    names = [f'symmetric.inertia.{shaft}' for shaft in ('carrier', 'left', 'right')]

    def even(time):
        torque = 40.0 * np.sin(3.0 * time) + 15.0
        return torque / 3.0, -0.5 * torque, -0.5 * torque
    start = {'symmetric.inertia.left': 0.1, 'symmetric.inertia.right': 0.1}
    value = warnings_of('symmetric_ode', names, measured(
        'symmetric_ode', start, white(2), ['carrier'], load=even), start=start)
    assert any('cannot tell them apart' in line and all(name in line for name in names)
               for line in value.warnings)


def test_the_same_parameters_are_told_apart_by_a_better_drive():
    names = [f'symmetric.inertia.{shaft}' for shaft in ('carrier', 'left', 'right')]
    start = {'symmetric.inertia.left': 0.1, 'symmetric.inertia.right': 0.1}
    value = warnings_of('symmetric_ode', names,
                        measured('symmetric_ode', start, white(2)), start=start)
    assert not any('cannot tell' in line for line in value.warnings)


def test_a_parameter_that_does_not_matter_is_named():
    """Where nothing slips, the satellites do not turn."""
    def even(time):
        return 10.0, -15.0, -15.0
    value = warnings_of('symmetric_ode', ['symmetric.inertia.carrier',
                                          'symmetric.viscosity.satellite'],
                        measured('symmetric_ode', {}, white(2), load=even))
    line, = value.warnings
    assert line.startswith('symmetric.viscosity.satellite: it hardly matters in this drive')
    first, second = value.estimates
    assert first.high - first.low < 0.1 * first.value
    assert (second.low, second.high) == (0.0, 1e6)


@pytest.mark.filterwarnings('error')
def test_where_nothing_matters_the_start_is_left_as_it_is():
    names = ['symmetric.viscosity.left', 'symmetric.viscosity.satellite']
    found, value = fitted('symmetric_ode', names, measured(
        'symmetric_ode', {}, white(2), load=lambda time: (0.0, 0.0, 0.0)))
    assert found.estimates == {name: pytest.approx(1e-3, abs=1e-15) for name in names}
    assert [line.split(':')[0] for line in value.warnings] == names


@pytest.mark.parametrize('limits, word', [('0.01:0.12', 'more'), ('0.17:1', 'less')])
def test_an_estimate_at_a_limit_is_named(folder, capsys, limits, word):
    write_log(folder / 'LOG.csv', 'symmetric_ode', {'symmetric.inertia.carrier': 0.15}, white(1))
    (folder / 'p.yaml').write_text(
        '/**: {ros__parameters: {symmetric: {inertia.carrier: %s}}}' % limits.split(':')[0])
    assert identify('symmetric_ode', '--params', 'p.yaml', '--fit',
                    f'symmetric.inertia.carrier={limits}') == 0
    assert (f'identify: warning: symmetric.inertia.carrier: it ends at its limit, '
            f'{limits.split(":")[word == "more"]} kg m^2, the drive asks for {word}'
            ) in capsys.readouterr().err


def test_columns_that_were_not_measured_independently_are_named():
    drive = measured('symmetric_ode', CARRIER, white(1))
    drive.speeds['carrier'] = (drive.speeds['left'] + drive.speeds['right']) / 2
    found, value = fitted('symmetric_ode', CARRIER, drive)
    assert sum('too narrow' in line for line in value.warnings) == 2


def test_impossible_mechanisms_are_kept_out_and_leave_the_others_as_they_are():
    drive = measured('lsd_ode', CLUTCH, white(1))
    runs = Runs('lsd_ode', {}, drive, 0.05)
    name = 'lsd.clutch.rear.friction_coefficient'   # 0.31 locks itself
    speeds = runs.speeds([{name: 0.1}, {name: 0.31}, {name: 0.2}])
    assert np.isnan(speeds[1]).all()
    assert np.array_equal(speeds[[0, 2]], [*runs.speeds([{name: 0.1}]),
                                           *runs.speeds([{name: 0.2}])])


def test_a_fit_goes_up_to_where_mechanisms_are_impossible_and_no_further():
    truth = {'lsd.clutch.rear.friction_coefficient': 0.29}
    drive = measured('lsd_ode', truth, white(1))
    found, value = fitted('lsd_ode', truth, drive, {next(iter(truth)): 0.05})
    assert found.estimates == pytest.approx(truth, rel=0.05)


# what it refuses

START = 'symmetric.inertia.carrier'
BAD = {   # words: (arguments, change of LOG.csv)
    'LOG.csv:1: no column has a measured speed, such as velocity.left': (
        [START], ('velocity.', 'x.')),
    "LOG.csv:1: column 'velocity.front': there is no such shaft, the symmetric differential has "
    'carrier, left, right': ([START], ('velocity.left', 'velocity.front')),
    "LOG.csv:1: column 'speed': unknown, the columns are time, pinion, left, right; "
    '--ignore-columns "speed" passes over': ([START], ('velocity.left', 'speed')),
    "LOG.csv:1: column 'time;pinion;left;right;velocity.left;velocity.right': unknown, the "
    'columns are time, pinion, left, right; it has semicolons': ([START], (',', ';')),
    "LOG.csv:1: column 'velocity.left': it appears twice": (
        [START], ('velocity.right', 'velocity.left')),
    "LOG.csv:1: column 'speed': it is not there to be ignored": (
        [START, '--ignore-columns', 'speed'],),
    "LOG.csv:2: column 'velocity.left': 'x' is not a finite number": (
        [START], None, 'x'),
    "LOG.csv:1: column 'left': missing": ([START], (',left', ',velocity.carrier')),
    '--fit: symmetric.inertia.front: there is no such parameter of the symmetric differential': (
        ['symmetric.inertia.front'],),
    '--fit: lsd.inertia.rear: there is no such parameter': (['lsd.inertia.rear'],),
    '--fit: rate: there is no such parameter': (['rate'],),
    '--fit: symmetric.satellite_count: a number of things cannot be fitted': (
        ['symmetric.satellite_count'],),
    f'--fit: {START}: given twice': ([START, START],),
    "--fit: '1' is no range, it must be LOW:HIGH": ([f'{START}=1'],),
    f'--fit: {START}: the limit -1.0 is not allowed, it must be in (0, 1e+06]': (
        [f'{START}=-1:1'],),
    f'--fit: {START}: the limit nan is not allowed': ([f'{START}=nan:1'],),
    f'--fit: {START}: the limits 2.0 and 1.0 leave nothing': ([f'{START}=2:1'],),
    f'--fit: {START}: it starts at 0.1, outside of 1.0 to 2.0': ([f'{START}=1:2'],),
    '--fit: symmetric.clutch.left.preload: it starts at 0, so its size is not known; give its '
    'range, symmetric.clutch.left.preload=LOW:HIGH': (['symmetric.clutch.left.preload'],),
    'dt: 0.0 is not allowed': ([START, '--dt', '0'],),
    '--node: only a bag has nodes': ([START, '--node', 'x'],),
}


@pytest.mark.parametrize('words', BAD)
def test_bad_input_is_refused_in_one_line_and_nothing_is_left_behind(folder, capsys, words):
    arguments, change, cell = (*BAD[words], None, None)[:3]
    write_log(folder / 'LOG.csv', 'symmetric_ode', {}, white(1), ticks=4, changed=lambda rows: [
        [cell if cell and n == 1 and k == 4 else entry for k, entry in enumerate(row)]
        for n, row in enumerate(rows)])
    text = (folder / 'LOG.csv').read_text()
    (folder / 'LOG.csv').write_text(text.replace(*change) if change else text)
    before = {path: path.read_bytes() for path in folder.iterdir()}
    extra = [] if '--out' in arguments else ['--out', 'FITTED.yaml']
    assert identify('symmetric_ode', '--report', 'R.json', *extra, '--fit', *arguments) == 2
    out, err = capsys.readouterr()
    assert not out and err.startswith(f'identify: error: {words}') and err.count('\n') == 1
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


def test_a_file_for_two_things_is_refused(folder, capsys):
    write_log(folder / 'LOG.csv', 'symmetric_ode', {}, white(1), ticks=4)
    assert identify('symmetric_ode', '--out', 'LOG.csv', '--fit', START) == 2
    assert capsys.readouterr().err.endswith('LOG.csv: given for two files\n')


def test_fewer_measurements_than_parameters_are_refused(folder, capsys):
    write_log(folder / 'LOG.csv', 'symmetric_ode', {}, white(1), ticks=1, changed=lambda rows: [
        row if n < 2 else [*row[:4], '', ''] for n, row in enumerate(rows)])
    assert identify('symmetric_ode', '--fit', *CARRIER) == 2
    assert capsys.readouterr().err == (
        'identify: error: LOG.csv: 2 measured speeds are too few for 2 parameters\n')


def test_a_column_without_measurements_is_refused(folder, capsys):
    write_log(folder / 'LOG.csv', 'symmetric_ode', {}, white(1), ticks=4, changed=lambda rows: [
        row if n < 1 else [*row[:5], ''] for n, row in enumerate(rows)])
    assert identify('symmetric_ode', '--fit', START) == 2
    assert "LOG.csv: column 'velocity.right': nothing was measured" in capsys.readouterr().err
    assert identify('symmetric_ode', '--ignore-columns', 'velocity.right', '--fit', START) == 0


def test_a_speed_port_is_refused(folder, capsys):
    write_log(folder / 'LOG.csv', 'symmetric_ode', {}, white(1), ticks=4)
    (folder / 'p.yaml').write_text('/**: {ros__parameters: {port.left.kind: speed}}')
    assert identify('symmetric_ode', '--params', 'p.yaml', '--fit', START) == 2
    assert 'error: port.left.kind: speed: a fit is to torques alone' in capsys.readouterr().err


def test_lag_cannot_be_fitted_to_forces_behind_it(folder, capsys):
    (folder / 'LOG.csv').write_text(
        'time,torque.carrier,torque.front,torque.rear,velocity.front,clutch_force.rear\n'
        '0,0,0,0,0,0\n0.1,30,-10,-10,1,50\n0.2,30,-10,-10,2,60\n')
    assert identify('lsd_ode', '--fit', 'lsd.clutch.rear.actuator_time_constant=0:1') == 2
    assert 'the forces of the drive are those in force' in capsys.readouterr().err
    assert identify('lsd_ode', '--fit', 'lsd.inertia.carrier') == 0


def test_a_row_as_simulate_writes_it_has_the_torques_until_its_time(folder):
    (folder / 'LOG.csv').write_text(
        'time,torque.pinion,torque.left,torque.right,velocity.left,position.left\n'
        '5,9,9,9,0,0\n5.5,1,2,3,1,0\n6.5,4,5,6,,7\n')
    drive = read_measured_file('LOG.csv', SYMMETRIC)
    assert drive.table == TorqueTable((0.0, 0.5, 1.5), ((1, 2, 3), (4, 5, 6), (4, 5, 6)),
                                      (0.0, 0.0, 0.0))
    assert drive.times.tolist() == [0.0, 0.5, 1.5]
    np.testing.assert_array_equal(drive.speeds['left'], [0.0, 1.0, np.nan])


def test_it_runs_as_a_program_and_its_help_is_plain():
    told = subprocess.run([sys.executable, '-m', 'dm_ros.commands', 'identify', '--help'],
                          capture_output=True, text=True, check=True).stdout
    assert 'NAME[=LOW:HIGH]' in told and 'FITTED.yaml' in told
