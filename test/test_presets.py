# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The presets do what their comments and ``doc/presets.md`` say."""

import math
from pathlib import Path
import re
import shlex

from mechanisms import BOTH
import pytest

from dm_ros.bias import friction_for, torque_bias
from dm_ros.files.parameter_file import read_parameter_file
from dm_ros.mechanism.variants import variant_named
from dm_ros.motion.models import LOSS_LAWS
from dm_ros.settings import make_simulation
from dm_ros.tools import bias, compare_variants, simulate

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / 'config' / 'presets'
PRESETS = sorted(path.stem for path in FOLDER.glob('*.yaml'))
PAGE = (ROOT / 'doc' / 'presets.md').read_text()
DRIVE, COAST = BOTH


def values_of(preset):
    return read_parameter_file(FOLDER / f'{preset}.yaml')


def table_of(preset):
    """Return the parameters of the mechanism of a preset."""
    values = values_of(preset)
    kind = variant_named(values['variant']).mechanism.parameters
    return kind().changed(kind.part_of(values))


def running(preset, law, dt=1e-3, **changes):
    """Return the simulation of a preset."""
    values = values_of(preset) | {'loss_law': law} | changes
    return make_simulation(values['variant'], values, dt)


def driving(p, torque, direction=DRIVE):
    """Return the torque on the pinion that makes one on the carrier."""
    return direction * torque / p.g_F / (p.eta_3B * p.eta_FG)**direction


def comments(preset):
    """Return the comment of a preset as lines without their marks."""
    lines = (FOLDER / f'{preset}.yaml').read_text().splitlines()
    return [line[1:].strip() for line in lines if line.startswith('#')]


def claims(preset):
    """Yield (arguments of ``bias``, what it is said to print as words)."""
    arguments, said = None, []
    for line in [*comments(preset), '']:
        if line.startswith('$ bias '):
            arguments, said = shlex.split(line)[2:], []
        elif line:
            said.append(line)
        elif arguments:
            yield arguments, ' '.join(said)
            arguments = None


def test_each_tells_its_source():
    assert PRESETS == ['actuated_axle', 'centre_40_60', 'geared_axle', 'locker', 'open_axle',
                       'plate_axle_1_5_way', 'plate_axle_1_way', 'plate_axle_2_way']
    for preset in PRESETS:
        assert any(line.startswith('Source: ') for line in comments(preset))
        assert all(len(line) < 100 for line in comments(preset))


@pytest.mark.parametrize('preset', PRESETS)
def test_its_comment_says_what_bias_prints(preset, capsys, monkeypatch):
    monkeypatch.chdir(FOLDER)
    told = list(claims(preset))
    assert told
    for arguments, said in told:
        assert arguments[:2] == ['--params', f'{preset}.yaml']
        assert bias.main(arguments) == 0
        assert ' '.join(capsys.readouterr().out.split()) == said


def test_a_comment_that_lies_would_be_found(capsys, monkeypatch):
    monkeypatch.chdir(FOLDER)
    (arguments, said), *_ = claims('plate_axle_2_way')
    bias.main([*arguments[:-1], '999'])
    assert ' '.join(capsys.readouterr().out.split()) != said


@pytest.mark.parametrize('preset', PRESETS)
def test_the_table_of_the_page_says_what_bias_prints(preset):
    cells = []
    for torque, direction in ((math.inf, DRIVE), (1000.0, DRIVE), (1000.0, COAST)):
        limits = torque_bias(table_of(preset), torque, direction)
        most = {side: f'{100 * max(split.share[i] for split in limits):.1f} %'
                for i, side in enumerate(table_of(preset).shafts)}
        left, right = most.values()
        cells.append(left if left == right
                     else ', '.join(f'{side} {share}' for side, share in most.items()))
    row, = re.findall(rf'^\| `{preset}` \| .*$', PAGE, re.MULTILINE)
    assert row.endswith(' | ' + ' | '.join(cells) + ' |')


@pytest.mark.parametrize('law', LOSS_LAWS)
@pytest.mark.parametrize('preset', PRESETS)
def test_it_runs_under_both_laws(preset, law):
    simulation = running(preset, law)
    for n in range(200):
        snapshot = simulation.step(simulation.mechanism.load(n * 1e-3))
    assert all(map(math.isfinite, snapshot.velocity + snapshot.moment))
    assert any(snapshot.velocity)


@pytest.mark.parametrize('preset', PRESETS)
def test_simulate_takes_the_variant_from_it(preset, tmp_path, capfd):
    inputs = running(preset, 'passive').inputs
    table = tmp_path / 'IN.csv'
    table.write_text(f'time,{",".join(inputs)}\n0,30,-10,-15\n0.05,0,0,0\n')
    common = ['--params', str(FOLDER / f'{preset}.yaml'), '--torques', str(table)]
    assert simulate.main(common) == 0
    alone = capfd.readouterr().out
    assert alone.count('\n') == 12
    assert simulate.main([*common, '--variant', values_of(preset)['variant']]) == 0
    assert capfd.readouterr().out == alone
    assert simulate.main(common[2:]) == 2
    assert '--variant' in capfd.readouterr().err


def test_the_centre_reaches_70_and_85_percent_at_any_torque():
    p = table_of('centre_40_60')
    assert p.g_12 == pytest.approx(1.5)
    wanted = friction_for(p, 0.70, 0.85)
    own = [math.tan(p.alpha) * f_k for f_k in p.f]
    assert own == pytest.approx([wanted.front, wanted.rear], rel=1e-3)
    for torque in (10.0, 1000.0, math.inf):
        front_lagging, rear_lagging = torque_bias(p, torque)
        assert front_lagging.share.front == pytest.approx(0.70, abs=5e-4)
        assert rear_lagging.share.rear == pytest.approx(0.85, abs=5e-4)


def test_the_geared_axle_has_the_torque_bias_ratio_that_it_tells():
    told, = re.findall(r'a torque bias ratio of ([\d.]+)', ' '.join(comments('geared_axle')))
    on_the_page, = re.findall(r'`geared_axle`.* a torque bias ratio of ([\d.]+)', PAGE)
    ratio = max(torque_bias(table_of('geared_axle'))[0]) / min(
        torque_bias(table_of('geared_axle'))[0])
    assert told == on_the_page == f'{ratio:.2f}'
    assert 2.5 <= ratio <= 3.0


def test_the_plate_axles_differ_in_their_coast_factors_alone():
    tables = [table_of(f'plate_axle_{way}_way') for way in ('1', '1_5', '2')]
    for p, ramp in zip(tables, (90, 60, 45), strict=True):
        coast = math.tan(math.radians(90 - ramp)) / math.tan(p.alpha)
        assert p.c_1 == p.c_2 == pytest.approx(coast, abs=1e-3)
    assert len({tuple(v for k, v in p.named().items() if 'coast_factor' not in k)
                for p in tables}) == 1


@pytest.mark.parametrize('law', LOSS_LAWS)
@pytest.mark.parametrize('way, holds', [('1', 0.44), ('1_5', 0.32), ('2', 0.22)])
def test_the_ways_hold_alike_on_drive_and_differ_on_coast(way, holds, law):
    def slip(share, direction):
        p = table_of(f'plate_axle_{way}_way')
        simulation = running(f'plate_axle_{way}_way', law, **{
            'initial_velocity.left': 100.0, 'initial_velocity.right': 100.0})
        total = sum(torque_bias(p, 1000.0, direction)[0])
        split = [-direction * share * total, -direction * (1 - share) * total]
        for _ in range(300):
            snapshot = simulation.step((driving(p, 1000.0, direction), *split))
            assert snapshot.power_flow == direction
            far = abs(snapshot.velocity[1] - snapshot.velocity[2])
            if far > 100.0:
                break
        return far

    assert slip(0.22, DRIVE) < 2.0 and slip(0.21, DRIVE) > 100.0
    assert slip(holds, COAST) < 2.0 and slip(holds - 0.01, COAST) > 100.0


@pytest.mark.parametrize('law', LOSS_LAWS)
def test_the_actuated_axle_holds_the_share_for_which_bias_tells_the_force(law):
    p = table_of('actuated_axle')
    force, = [int(force) for _, said in claims('actuated_axle')
              for force in re.findall(r'with (\d+) N$', said)]
    total = sum(torque_bias(p, 1000.0)[0])
    for factor, holds in ((1.01, True), (0.99, False)):
        simulation = running('actuated_axle', law)
        assert simulation.clutches == ('left', 'right')
        for _ in range(500):   # the lag of the actuator comes first
            simulation.step((0.0, 0.0, 0.0), (factor * force, 0.0))
        for _ in range(500):
            velocity = simulation.step((driving(p, 1000.0), -0.2 * total, -0.8 * total),
                                       (factor * force, 0.0)).velocity
        slip = velocity[1] - velocity[2]
        assert 0.0 < slip < 3.0 if holds else slip > 30.0


@pytest.mark.parametrize('speed', [0.0, 50.0])
@pytest.mark.parametrize('variant', ['symmetric_ode', 'symmetric_dae'])
@pytest.mark.parametrize('law', LOSS_LAWS)
def test_the_locker_creeps_below_1e_3_rad_s_at_1000_n_m_while_it_is_pressed(variant, law, speed):
    p = table_of('locker')
    for sign in BOTH:
        simulation = running('locker', law, variant=variant, **{
            'initial_velocity.left': speed, 'initial_velocity.right': speed})
        torques = driving(p, 1200.0), -600.0 - 500.0 * sign, -600.0 + 500.0 * sign
        for _ in range(500):
            velocity = simulation.step(torques, (20_000.0, 0.0)).velocity
            assert abs(velocity[1] - velocity[2]) < 1e-4
        for _ in range(10):   # let go, it is an open axle
            velocity = simulation.step(torques, (0.0, 0.0)).velocity
        assert (velocity[1] - velocity[2]) * sign < -100.0


@pytest.mark.parametrize('difference, holds', [(2950.0, True), (3050.0, False)])
def test_the_locker_slips_above_3000_n_m(difference, holds):
    simulation = running('locker', 'passive')
    for _ in range(100):
        velocity = simulation.step((0.0, difference / 2, -difference / 2),
                                   (20_000.0, 0.0)).velocity
    assert (abs(velocity[1] - velocity[2]) < 1e-3) == holds


def test_the_papers_comparison_refuses_a_symmetric_one_with_clutches(capsys, tmp_path):
    assert compare_variants.main(['--params', str(FOLDER / 'locker.yaml'), '--out',
                                  str(tmp_path / 'out')]) == 2
    assert 'friction_surfaces must be 0' in capsys.readouterr().err
