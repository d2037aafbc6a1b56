# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The limits of the torque split are those at which the simulated shafts begin to slip."""

import dataclasses
import math
from pathlib import Path

from mechanisms import BOTH, PassiveFlow, random_self_locking, random_symmetric
import numpy as np
import pytest
from scipy.optimize import fsolve

from dm_ros import SelfLockingParameters, Simulation, SymmetricParameters
from dm_ros.bias import forces_for, friction_for, torque_bias
from dm_ros.mechanism.clutched import full_friction, slip_steepness
from dm_ros.tools.bias import main


def without_drag(p):
    return dataclasses.replace(p, **{f.name: 0.0 for f in dataclasses.fields(p)
                                     if f.name.startswith('l_')})


def axle(rng):
    """Return random parameters of a symmetric differential with clutches."""
    p = random_symmetric(rng)
    n_F1, n_F2 = (int(n) for n in rng.integers(1, 10, 2))
    R, R_F = p.R * rng.uniform(0.7, 1.4), p.R * rng.uniform(0.7, 1.4)
    limit = min(p.eta_1G, p.eta_2G) * p.eta_0B * R / R_F / math.tan(p.alpha)
    return dataclasses.replace(
        p, R=R, R_F1=R_F, R_F2=R_F, n_F1=n_F1, n_F2=n_F2, mu_1=rng.uniform(0, 0.9) * limit / n_F1,
        mu_2=rng.uniform(0, 0.9) * limit / n_F2, N_1=rng.uniform(0, 500), N_2=rng.uniform(0, 500),
        c_f1=rng.uniform(1, 8), c_f2=rng.uniform(1, 8))


def mechanisms(count=3, seed=1):
    """Yield parameters without viscous drag, those of Table 2 first, and a carrier torque."""
    rng = np.random.default_rng(seed)
    yield without_drag(SelfLockingParameters()), 300.0
    for kind in (random_self_locking, axle):
        for _ in range(count):
            p = without_drag(kind(rng))
            preload = sum(full_friction(p)[1])
            yield p, 2.0 * preload + rng.uniform(50, 300)   # enough to turn both shafts


def nearly_even(count):
    """Yield mechanisms whose gears do not split so unevenly that a force turns one limit round."""
    return ((p, torque) for p, torque in mechanisms(count) if 0.6 < p.g_12 < 1.7)


def driving_torque(p, torque, direction):
    """Return the torque on the driving shaft that makes one on the carrier."""
    if isinstance(p, SelfLockingParameters):
        return direction * torque
    losses = (p.eta_3B * p.eta_FG)**direction
    return direction * torque / p.g_F / losses


def turning(p, torque, split, direction, slip, ticks, far=math.inf, forces=(0.0, 0.0)):
    """
    Return the slips omega_1 - omega_2 over ticks of 1 ms, and the speeds at both ends.

    It ends early when the slip is as large as ``far``.
    """
    variant = 'lsd_ode' if isinstance(p, SelfLockingParameters) else 'symmetric_ode'
    simulation = Simulation(variant, 1e-3, p,
                            initial_velocity=(2000.0 + slip / 2, 2000.0 - slip / 2))
    start = simulation.snapshot().velocity
    torques = [driving_torque(p, torque, direction), *(-direction * side for side in split)]
    slips = [slip]
    for _ in range(ticks):
        velocity = simulation.step(torques, forces).velocity
        slips.append(velocity[1] - velocity[2])
        if abs(slips[-1]) >= far:
            break
    assert simulation.snapshot().power_flow == direction
    return slips, start, velocity


@pytest.mark.parametrize('direction', BOTH)
def test_the_shafts_slip_steadily_under_the_limits(direction):
    for p, torque in mechanisms():
        for split, sign in zip(torque_bias(p, torque, direction), (-1, 1), strict=True):
            # so much slip that tanh is 1
            _, start, end = turning(p, torque, split, direction, 800.0 * sign, 100)
            assert end == pytest.approx(start, abs=1e-6)


@pytest.mark.parametrize('direction', BOTH)
def test_the_limits_know_forces_and_coast_factors(direction):
    for p, torque in mechanisms():
        p = dataclasses.replace(p, c_1=0.4, c_2=0.1)
        forces = tuple(0.3 * torque / f / R for f, R in zip(p.f, (p.R_1, p.R_2), strict=True))
        limits = torque_bias(p, 3 * torque, direction, forces)
        for split, plain, sign in zip(limits, torque_bias(p, 3 * torque, direction), (-1, 1),
                                      strict=True):
            _, start, end = turning(p, 3 * torque, split, direction, 800.0 * sign, 100,
                                    forces=forces)
            assert end == pytest.approx(start, abs=1e-6)
            assert abs(split.share[0] - plain.share[0]) > 0.01


@pytest.mark.parametrize('direction', BOTH)
def test_the_shafts_stay_together_within_the_limits_and_part_beyond_them(direction):
    try_the_limits(direction, mechanisms())


@pytest.mark.parametrize('torque, off', [(10.0, 0.4), (29.0, 0.05), (31.0, 1e-6), (300.0, 1e-6)])
def test_below_30_n_m_the_preload_turns_both_gear_moments_round_and_the_formula_is_off_a_little(
        torque, off):
    p = without_drag(SelfLockingParameters())
    for direction in BOTH:
        worst, turned = 0.0, 0
        for split, sign in zip(torque_bias(p, torque, direction), (-1, 1), strict=True):

            def point(outputs, sign=sign, direction=direction):
                flow = PassiveFlow(p, (direction * torque, *(-direction * outputs)))
                return flow.point(2000.0, 800.0 * sign)

            # linear but for the signs: two outputs that leave carrier and slip as they are
            steady = fsolve(lambda outputs, point=point: point(outputs)[:2], split, xtol=1e-12)
            worst = max(worst, np.abs(steady - split).max())
            M_1, M_2 = point(steady)[4:6]
            assert M_1 * M_2 > 0.0
            turned += M_1 * direction < 0.0
        assert worst < off
        assert turned == (torque < 30.0)


def try_the_limits(direction, mechanisms):
    """Split the torque of each mechanism within its limits and beyond."""
    for p, torque in mechanisms:
        steep = 1 / min(map(abs, slip_steepness(p)))   # rad/s of slip for tanh(1)
        limits = torque_bias(p, torque, direction)
        for share in (-0.1, 0.1, 0.5, 0.9, 1.1):   # from rear to front lagging
            split = [share * a + (1 - share) * b for a, b in zip(*limits, strict=True)]
            slips, *_ = turning(p, torque, split, direction, 0.0, 5000, far=20 * steep)
            if 0.0 < share < 1.0:
                assert abs(slips[-1]) < 5 * steep
            else:
                assert abs(slips[-1]) >= 20 * steep
                assert slips[-1] * (share - 0.5) < 0.0


def test_table_2_shifts_a_large_torque_to_58_percent_front_and_70_percent_rear():
    front_lagging, rear_lagging = torque_bias(SelfLockingParameters())
    assert front_lagging.share.front == pytest.approx(0.583, abs=5e-4)
    assert rear_lagging.share.rear == pytest.approx(0.704, abs=5e-4)


@pytest.mark.parametrize('direction', BOTH)
def test_a_large_torque_nears_the_limit_without_preload(direction):
    for p, _ in mechanisms():
        limits = torque_bias(p, direction=direction)
        without = torque_bias(dataclasses.replace(p, N_1=0.0, N_2=0.0), 123.0, direction)
        large = torque_bias(p, 1e9, direction)
        for limit, one, other in zip(limits, without, large, strict=True):
            assert one.share == pytest.approx(limit.share, rel=1e-12)
            assert other.share == pytest.approx(limit.share, abs=1e-5)


def test_without_friction_and_losses_the_gears_alone_split_40_to_60():
    p = SelfLockingParameters(mu_1=0.0, mu_2=0.0, eta_0B=1.0, eta_1G=1.0, eta_2G=1.0)
    for direction in BOTH:
        for split in torque_bias(p, 300.0, direction):
            assert split == pytest.approx((120.0, 180.0))


def with_friction(p, friction):
    """Return the parameters with clutches that have the given x_k."""
    return dataclasses.replace(p, **{
        f'mu_{k}': x / math.tan(p.alpha) / getattr(p, f'n_F{k}')
        * getattr(p, f'R_{k}') / getattr(p, f'R_F{k}')
        for k, x in (('1', friction.front), ('2', friction.rear))})


def test_friction_for_the_limits_of_a_mechanism_is_its_own():
    rng = np.random.default_rng(2)
    for _ in range(40):
        p = random_self_locking(rng)
        most, least = torque_bias(p)
        friction = friction_for(p, most.share.front, least.share.rear)
        own = [math.tan(p.alpha) * f_k for f_k in p.f]
        assert friction[:2] == pytest.approx(own, rel=1e-9, abs=1e-9)
        assert friction.admissible


def test_70_and_85_percent_need_stronger_clutches_than_those_of_table_2_and_are_admissible():
    p = SelfLockingParameters()
    friction = friction_for(p, 0.70, 0.85)
    assert friction.admissible
    f = friction.front / math.tan(p.alpha), friction.rear / math.tan(p.alpha)
    assert f == pytest.approx((1.607, 1.484), abs=5e-4)   # doc/bias.md
    assert p.f == pytest.approx((0.15, 1.35))
    assert [x_k / own for x_k, own in zip(f, p.f)] == pytest.approx((10.7, 1.10), rel=5e-3)
    stronger = with_friction(p, friction)   # is not refused
    front_lagging, rear_lagging = torque_bias(stronger)
    assert front_lagging.share.front == pytest.approx(0.70)
    assert rear_lagging.share.rear == pytest.approx(0.85)


def test_the_example_of_the_docs_reaches_70_and_85_percent():
    p = SelfLockingParameters(n_F1=11, n_F2=10)
    front_lagging, rear_lagging = torque_bias(p)
    assert front_lagging.share.front == pytest.approx(0.705, abs=5e-4)
    assert rear_lagging.share.rear == pytest.approx(0.855, abs=5e-4)


@pytest.mark.parametrize('torque', [100, 300, 1000, math.inf])
def test_the_docs_give_the_limits_of_table_2(torque):
    cells = ['large' if math.isinf(torque) else str(torque)]
    for direction in (1, -1):
        for side in (0, 1):
            shares = sorted(100 * split.share[side] for split in
                            torque_bias(SelfLockingParameters(), torque, direction))
            cells.append('{:.1f} % to {:.1f} %'.format(*shares))
    text = (Path(__file__).parents[1] / 'doc' / 'bias.md').read_text()
    assert '| ' + ' | '.join(cells) + ' |' in text


def test_friction_that_would_lock_the_mechanism_is_told():
    p = SelfLockingParameters()
    for shares in ((0.999, 0.999), (0.2, 0.9), (0.95, 0.3)):
        friction = friction_for(p, *shares)
        assert not friction.admissible
        with pytest.raises(ValueError, match='locks itself|not allowed'):
            with_friction(p, friction)


@pytest.mark.parametrize('shares', [(0.0, 0.8), (0.7, 1.0), (0.3, 0.6), (math.nan, 0.8)])
def test_shares_that_are_none_are_refused(shares):
    with pytest.raises(ValueError, match='shares'):
        friction_for(SelfLockingParameters(), *shares)


@pytest.mark.parametrize('torque', [0.0, -3.0, math.nan])
def test_torque_that_does_not_drive_is_refused(torque):
    with pytest.raises(ValueError, match='torque'):
        torque_bias(SelfLockingParameters(), torque)


def test_torque_too_small_against_the_preload_is_refused():
    with pytest.raises(ValueError, match='does not turn'):
        torque_bias(SelfLockingParameters(eta_1G=0.8, eta_2G=0.8), 0.1)


# What force it takes


@pytest.mark.parametrize('direction', BOTH)
@pytest.mark.parametrize('pressed', [(1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (0.3, 2.0)])
def test_the_force_for_a_share_makes_it_a_limit(direction, pressed):
    needed = 0
    for p, torque in nearly_even(count=40):
        p = dataclasses.replace(p, c_1=0.4, c_2=0.1)
        sides = p.shafts
        for index, side in enumerate(sides):
            low, high = sorted(s.share[index] for s in torque_bias(p, torque, direction))
            for share in (0.0, 0.02, 0.5, 0.9, 1.0):
                forces = forces_for(p, side, share, torque, direction, pressed)
                if low <= share <= high:
                    assert forces == (0.0, 0.0)
                    continue
                needed += 1
                assert min(forces) >= 0.0 < max(forces)
                assert forces[0] * pressed[1] == pytest.approx(forces[1] * pressed[0])
                limits = sorted(s.share[index]
                                for s in torque_bias(p, torque, direction, forces))
                assert limits[share > high] == pytest.approx(share, abs=1e-12)
    assert needed > 100


@pytest.mark.parametrize('direction', BOTH)
def test_the_shafts_slip_steadily_at_the_share_that_a_force_reaches(direction):
    for p, torque in nearly_even(count=6):
        for index, side in enumerate(p.shafts):
            forces = forces_for(p, side, 0.95, torque, direction, (1.0, 1.0))
            if not any(forces):
                continue
            share = [0.05, 0.05]
            share[index] = 0.95
            limits = torque_bias(p, torque, direction, forces)
            split, sign = max(zip(limits, (-1, 1), strict=True), key=lambda x: x[0][index])
            assert split == pytest.approx([sum(split) * s for s in share])
            _, start, end = turning(p, torque, split, direction, 800.0 * sign, 100, forces=forces)
            assert end == pytest.approx(start, abs=1e-6)


def test_no_force_on_a_clutch_without_surfaces_helps():
    p = SymmetricParameters(n_F1=8)
    assert forces_for(p, 'right', 0.8, 300.0, pressed=(0.0, 1.0)) is None
    assert forces_for(SymmetricParameters(), 'right', 0.8, 300.0) is None
    alone = forces_for(p, 'right', 0.8, 300.0, pressed=(1.0, 0.0))
    # the clutch takes half of the difference from the left and gives it to the carrier
    assert forces_for(p, 'right', 0.8, 300.0) == pytest.approx((alone[0], alone[0]))


@pytest.mark.parametrize('arguments, message', [
    (('left', 0.8, 300.0), 'front, rear'), (('rear', 1.1, 300.0), 'share: 1.1'),
    (('rear', math.nan, 300.0), 'share: nan'), (('rear', 0.8, math.inf), 'torque: inf')])
def test_impossible_shares_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        forces_for(SelfLockingParameters(), *arguments)


def test_an_open_symmetric_differential_splits_evenly_whatever_it_loses():
    for direction in BOTH:
        for limit in torque_bias(SymmetricParameters(), 300.0, direction):
            assert limit.share == pytest.approx((0.5, 0.5))
            assert sum(limit) == pytest.approx(300.0 * (0.99 * 0.995) ** direction)


# The command


def test_command_says_the_limits_in_two_lines(capsys):
    assert main([]) == 0
    out = capsys.readouterr().out
    assert out.splitlines() == [
        'this parameter set can send 25.8 % to 65.0 % of 300 N m to the front '
        'and 35.0 % to 74.2 % to the rear',
        'this parameter set can send 29.6 % to 58.3 % of a large torque to the front '
        'and 41.7 % to 70.4 % to the rear']
    text = (Path(__file__).parents[1] / 'doc' / 'bias.md').read_text()
    for line in out.splitlines():
        assert f'    {line}\n' in text


@pytest.mark.parametrize('arguments, line', [
    (['--share-to', 'rear', '80'],
     '80 % of 300 N m can go to the rear by pressing the rear clutch with 721 N, or the front '
     'clutch with 4079 N, or both clutches with 613 N each'),
    (['--share-to', 'rear', '70 %'],
     '70 % of 300 N m can go to the rear without any force: 35.0 % to 74.2 %')])
def test_command_says_what_force_it_takes(arguments, line, capsys):
    assert main(arguments) == 0
    assert capsys.readouterr().out == f'{line}\n'
    assert f'    {line}\n' in (Path(__file__).parents[1] / 'doc' / 'bias.md').read_text()


def test_command_tells_when_no_force_or_none_that_is_allowed_is_enough(capsys, tmp_path):
    assert main(['--mechanism', 'symmetric', '--share-to', 'left', '60']) == 0
    assert 'to the left by no force' in capsys.readouterr().out
    path = tmp_path / 'p.yaml'
    path.write_text('/**: {ros__parameters: {lsd.clutch.rear.actuator_limit: 700.0}}')
    ask = ['--params', str(path), '--share-to', 'rear']
    main([*ask, '80'])   # both are pressed alike, and the front one has no such limit
    assert ('by pressing the front clutch with 4079 N, or both clutches with 613 N each'
            in capsys.readouterr().out)
    path.write_text('/**: {ros__parameters: {lsd.clutch.rear.actuator_limit: 700.0, '
                    'lsd.clutch.front.actuator_limit: 600.0}}')
    main([*ask, '80'])
    assert 'only with forces above actuator_limit: the rear' in capsys.readouterr().out


def test_command_takes_the_mechanism_from_the_file(capsys, tmp_path):
    path = tmp_path / 'p.yaml'
    for text, side in (('symmetric.clutch.left.friction_surfaces: 4', 'left'),
                       ('lsd.clutch.rear.preload: 1.0', 'rear'), ('rate: 100.0', 'rear'),
                       ('{variant: symmetric_dae, lsd.pressure_angle: 0.3}', 'left')):
        text = text if text.startswith('{') else f'{{{text}}}'
        path.write_text(f'/**: {{ros__parameters: {text}}}')
        main(['--params', str(path)])
        assert f'to the {side}' in capsys.readouterr().out
        main(['--params', str(path), '--mechanism', 'lsd'])
        assert 'to the rear' in capsys.readouterr().out


def test_command_reads_parameters_and_the_direction(capsys, tmp_path):
    path = tmp_path / 'p.yaml'
    path.write_text('/**: {ros__parameters: {lsd: {clutch: {front: {friction_surfaces: 2}}}}}')
    assert main(['--params', str(path), '--torque', '1000', '--reverse']) == 0
    out = capsys.readouterr().out
    assert 'of 1000 N m that brakes the carrier from the front' in out
    main(['--torque', '1000', '--reverse'])
    assert capsys.readouterr().out != out


@pytest.mark.parametrize('arguments, message', [
    (['--torque', '0'], '--torque: 0.0'), (['--torque', 'nan'], '--torque: nan'),
    (['--torque', 'inf'], '--torque: inf'), (['--share-to', 'rear', '120'], 'from 0 to 100'),
    (['--share-to', 'rear', 'all'], 'from 0 to 100'),
    (['--share-to', 'left', '60'], 'front, rear'),
    (['--mechanism', 'symmetric', '--forces', '0', '10'], '--forces: there are no clutches'),
    (['--params', 'nowhere.yaml'], 'nowhere.yaml: No such')])
def test_command_refuses_bad_input_in_one_line(arguments, message, capsys):
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert not out and err.startswith('bias: error: ') and message in err
    assert err.count('\n') == 1


def test_command_names_an_impossible_parameter(tmp_path, capsys):
    path = tmp_path / 'p.yaml'
    path.write_text('/**: {ros__parameters: {lsd.clutch.rear.friction_surfaces: 90}}')
    assert main(['--params', str(path)]) == 2
    assert 'lsd.clutch.rear' in capsys.readouterr().err
