# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Many differentials at once: the bits of single runs, all or none of the sets, failures apart."""

from dataclasses import astuple
from unittest import mock

from ensembles import ALL, CORE, LANES, runs_by_lanes, sets_of
import numpy as np
import pytest

from dm_ros import (
    core,
    Ensemble,
    SelfLockingParameters,
    Simulation,
    SymmetricParameters,
    VARIANTS,
)
from dm_ros.mechanism.sets import possible, table_of
from dm_ros.motion.models import LOSS_LAWS

TICKS = 30


@pytest.fixture(params=[*(f'C, {n} at once' for n in LANES), 'Python'])
def language(request):
    """Do it in this language."""
    language, *lanes = request.param.split()
    language = language.strip(',')
    with mock.patch.object(core, 'Ticker', CORE.Ticker if lanes else None), \
            mock.patch('dm_ros.ensemble.lanes_of', lambda _: int(lanes[0])):
        yield language


@pytest.mark.parametrize('loss_law', LOSS_LAWS)
@pytest.mark.parametrize('variant, clutched', [*((v, False) for v in VARIANTS),
                                               ('symmetric_ode', True)])
def test_each_member_moves_like_a_simulation_of_its_own(variant, clutched, loss_law, language):
    count = 11   # some are left over, however many go at once
    sets, rng = sets_of(variant, count, clutched), np.random.default_rng(5)
    more = {'loss_law': loss_law, 'substeps': 2, 'power_flow_deadband': 3.0}
    start = rng.normal(0, 50, (count, 2))
    ensemble = Ensemble(variant, sets, 0.002, initial_velocity=start, threads=3, **more)
    assert ensemble.language == language
    T = rng.normal(0, 100, (TICKS, count, 3))
    A = rng.uniform(0, 500, (TICKS, count, len(ensemble.clutches)))
    singles = [Simulation(variant, 0.002, p, initial_velocity=speeds, **more)
               for p, speeds in zip(sets, start.tolist())]
    ensemble.run(T[:9], A[:9])   # at once, or tick by tick
    for n in range(9, TICKS):
        ensemble.step(T[n], A[n])
    for simulation, torques, forces in zip(singles, T.swapaxes(0, 1), A.swapaxes(0, 1)):
        for torque, force in zip(torques, forces):
            simulation.advance(torque.tolist(), tuple(force.tolist()))
    told = [simulation.snapshot() for simulation in singles]
    for name in ALL:
        expected = np.array([getattr(snapshot, name) for snapshot in told], float)
        assert getattr(ensemble, name).tobytes() == expected.tobytes(), name
    assert ensemble.coarse_steps.tolist() == [s.coarse_steps for s in singles]
    assert ensemble.time == singles[0].time and not ensemble.failed.any()
    with pytest.raises(ValueError, match='read-only'):
        ensemble.velocity[:] = 7.0
    ensemble.reset()
    assert ensemble.ticks == 0 and not ensemble.position.any()
    assert ensemble.velocity[:, 1:3] == pytest.approx(start)


@pytest.mark.parametrize('variant, clutched', [('symmetric_ode', False), ('symmetric_ode', True),
                                               ('lsd_ode', False)])
def test_what_is_recorded_is_what_every_tick_reports(variant, clutched, language, monkeypatch):
    monkeypatch.setattr('dm_ros.ensemble.BLOCK', 8 * 20 * 5 * 4)   # of which 4 ticks make one
    count = 11
    sets = sets_of(variant, count, clutched)
    T = np.random.default_rng(2).normal(0, 100, (TICKS, count, 3))
    T[9:, 3] = 1e308
    recorded = Ensemble(variant, sets).run(T, record=ALL)
    ensemble = Ensemble(variant, sets)
    for n in range(TICKS):
        ensemble.step(T[n])
        for name in ALL:
            now = getattr(ensemble, name)
            assert recorded[name][n].tobytes() == now.tobytes(), (name, n)
    assert recorded['velocity'].shape == (TICKS, count, len(ensemble.shafts))
    assert ensemble.failed.nonzero()[0].tolist() == [3]


@pytest.mark.skipif(not LANES, reason='the core in C is not built')
@pytest.mark.parametrize('loss_law', LOSS_LAWS)
@pytest.mark.parametrize('variant, clutched', [('symmetric_ode', False), ('symmetric_ode', True),
                                               ('lsd_ode', False)])
def test_how_many_go_at_once_changes_no_bit(variant, clutched, loss_law):
    first, *others = runs_by_lanes(variant, clutched, loss_law, seed=0)
    assert others and all(run == first for run in others)


def test_what_cannot_be_recorded_is_refused_by_name():
    ensemble = Ensemble('lsd_ode', [{}])
    with pytest.raises(ValueError, match="record: 'speed' is not one of velocity, position"):
        ensemble.run(np.zeros((2, 3)), record=('speed',))
    assert ensemble.ticks == 0
    assert ensemble.run(np.zeros((0, 3)), record=('moment',))['moment'].shape == (0, 1, 4)


def test_one_torque_is_for_all_and_threads_change_nothing(language):
    masses = {'lsd.inertia.rear': np.linspace(0.005, 0.5, 600)}
    runs = []
    for threads in (1, 2, 5):
        ensemble = Ensemble('lsd_ode', masses, threads=threads)
        for _ in range(3):
            ensemble.step((60.0, -10.0, -30.0), (100.0, 0.0))
        runs.append(ensemble.velocity.tobytes())
    assert len(set(runs)) == 1
    assert np.all(np.diff(np.abs(ensemble.velocity[:, 0])) < 0.0)   # the heavier, the slower
    assert ensemble.clutch_force.tolist() == [[100.0, 0.0]] * 600


def test_a_member_that_leaves_the_range_of_numbers_fails_alone(language):
    ensemble = Ensemble('symmetric_ode', [{}] * 3, loss_law='paper')
    T = np.zeros((3, 3))
    T[1] = 1e308
    for _ in range(50):
        ensemble.step(T)
    assert ensemble.failed.tolist() == [False, True, False]
    assert np.isnan(ensemble.velocity[1]).all() and not ensemble.velocity[[0, 2]].any()
    ensemble.reset()
    assert not ensemble.failed.any() and not ensemble.velocity.any()


@pytest.mark.parametrize('sets, words', [
    ([{}, {'lsd.inertia.rear': -1.0}],
     r'parameters\[1\]: lsd.inertia.rear: -1.0 is not allowed, it must be in \(0, 1e\+06\]'),
    ({'lsd.inertia.rear': [1.0, 1.0, np.nan]}, r'parameters\[2\]: lsd.inertia.rear: nan'),
    ({'lsd.satellite_count': [4, 2.5]}, r'parameters\[1\]: lsd.satellite_count: 2.5'),
    ([{'lsd.satellite_count': True}], r'parameters\[0\]: lsd.satellite_count: True'),
    ([{'lsd.inertia.rear': '1'}], r"parameters\[0\]: lsd.inertia.rear: '1' is not allowed"),
    ([{'lsd.inertia.rare': 1.0}], r'parameters\[0\]: lsd.inertia.rare: there is no such'),
    ({'lsd.inertia.rare': 1.0}, 'lsd.inertia.rare: there is no such parameter'),
    ({'lsd.inertia.rear': ['a']}, 'parameters: an array of numbers for each name'),
    ({'lsd.inertia.rear': [1.0], 'lsd.inertia.front': [1.0, 2.0]}, 'arrays must be of one length'),
    ([], 'there must be one set at least'),
    (3, 'int is not a sequence of sets or a mapping of arrays'),
    ([3], r'parameters\[0\]: int is not SelfLockingParameters or a mapping'),
    ([{}, {'lsd.clutch.rear.friction_coefficient': 5.0}],
     r'^parameters\[1\]: lsd.clutch.rear: the clutch locks itself'),
    ([SelfLockingParameters()] * 2 + [SelfLockingParameters(
        I_0=1e-300, I_1=1e-300, I_2=1e-300, I_s=1e-300)],
     r'parameters\[2\]: lsd: the equations of these parameters have no finite solution'),
])
def test_all_sets_are_checked_and_the_bad_one_is_named(sets, words, language):
    with pytest.raises(ValueError, match=words):
        Ensemble('lsd_ode', sets)


def test_clutches_and_none_are_not_mixed(language):
    with pytest.raises(ValueError, match=r'parameters\[1\]: symmetric.clutch: sets with'):
        Ensemble('symmetric_ode', {'symmetric.clutch.left.friction_surfaces': [0, 2]})


@pytest.mark.parametrize('torques, forces, words', [
    ((1.0, 2.0), None, r'torques: they have the shape \(2,\), it must be \(3,\) or \(2, 3\)'),
    ([(1.0, 2.0, 3.0)] * 3, None, r'the shape \(3, 3\), it must be \(3,\) or \(2, 3\)'),
    ((1.0, 2.0, np.inf), None, 'torques: rear: inf is not allowed'),
    ('abc', None, 'torques: they must be numbers, for carrier, front, rear'),
    ((0.0,) * 3, (-1.0, 0.0), 'front: -1.0 is not allowed, it must be finite and at least 0'),
    ((0.0,) * 3, (1.0,), 'clutch_forces: they have the shape'),
])
def test_bad_inputs_are_named_and_nothing_moves(torques, forces, words, language):
    ensemble = Ensemble('lsd_ode', [{}] * 2)
    with pytest.raises(ValueError, match=words):
        ensemble.step(torques, forces)
    assert ensemble.ticks == 0 and not ensemble.velocity.any()


def test_what_is_for_all_is_checked_as_by_a_simulation(language):
    for more, words in (({'dt': 0.0}, '^dt: 0.0'), ({'substeps': 0}, 'substeps: 0'),
                        ({'loss_law': 'none'}, 'loss_law'), ({'threads': 0}, 'threads: 0'),
                        ({'threads': 2.5}, 'threads: 2.5'), ({'threads': 'a'}, "threads: 'a'"),
                        ({'initial_velocity': (1e7, 0.0)}, 'initial_velocity: front: 10000000.0'),
                        ({'variant': 'x'}, "variant: 'x'")):
        with pytest.raises(ValueError, match=words):
            Ensemble(**{'variant': 'lsd_ode', 'parameters': [{}], **more})


@pytest.mark.parametrize('kind', [SelfLockingParameters, SymmetricParameters])
def test_the_sets_that_are_possible_are_those_that_a_table_takes(kind):
    rng, count = np.random.default_rng(4), 400
    numbers = np.tile(np.array(astuple(kind()), float), (count, 1))
    p = {symbol: numbers[:, n] for n, symbol in enumerate(kind.rows())}
    p['alpha'][:] = rng.choice([0.0, 0.2, 0.5], count)
    for n in '12':
        p[f'n_F{n}'][:] = rng.integers(0, 4, count)
        gain = 3 * np.tan(0.2) * p[f'R_F{n}'] / p.get(f'R_{n}', p.get('R'))
        p[f'mu_{n}'][:] = rng.choice([0.5, 1 - 1e-15, 1.0, 1.5], count) * 0.99 * 0.995 / gain
    if 'g_F' in p:
        p['g_F'][::7] = 0.0
    found = possible(kind, numbers)
    assert 0.1 < found.mean() < 0.9
    for n, is_possible in enumerate(found):
        try:
            table_of(kind, numbers, n)
        except ValueError:
            assert not is_possible, n
        else:
            assert is_possible, n
