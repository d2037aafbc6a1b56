# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A simulation is the mechanism in time: its interface, its identities and its refusals."""

import csv
import math
from pathlib import Path

from mechanisms import (
    is_symmetric,
    PassiveFlow,
    random_self_locking,
    random_symmetric,
    self_locking_speeds,
    symmetric_speeds,
)
import numpy as np
import pytest

from dm_ros import SelfLockingParameters, Simulation, Snapshot, SymmetricParameters, VARIANTS
from dm_ros.mechanism.clutched import full_friction
from dm_ros.motion.models import LOSS_LAWS

LSD = VARIANTS[2:]
EACH_VARIANT = pytest.mark.parametrize('variant', VARIANTS)
EACH_LAW = pytest.mark.parametrize('loss_law', LOSS_LAWS)
EACH_LSD = pytest.mark.parametrize('variant', LSD)


def torques(seed, count, size=200.0):
    """Return random torques that change now by steps and now in every tick."""
    rng = np.random.default_rng(seed)
    held = np.repeat(rng.normal(0, size, (count // 20 + 1, 3)), 20, axis=0)[:count]
    noisy = rng.normal(0, size / 10, (count, 3)) * (np.arange(count) // 50 % 2)[:, None]
    return (held + noisy).tolist()


def run(simulation, sequence):
    return [simulation.step(T) for T in sequence]


def names(variant):
    return ('left', 'right') if is_symmetric(variant) else ('front', 'rear')


# The interface


def test_variants_and_their_order_are_those_of_the_paper():
    assert VARIANTS == ('symmetric_ode', 'symmetric_dae', 'lsd_lagged', 'lsd_ode', 'lsd_dae')


@EACH_VARIANT
def test_names_are_those_of_the_interface(variant):
    simulation = Simulation(variant)
    if is_symmetric(variant):
        assert simulation.shafts == ('carrier', 'left', 'right', 'pinion', 'satellite')
        assert simulation.inputs == ('pinion', 'left', 'right')
        assert simulation.moments == ('final_drive', 'left_mesh', 'right_mesh')
    else:
        assert simulation.shafts == ('carrier', 'front', 'rear', 'satellite')
        assert simulation.inputs == ('carrier', 'front', 'rear')
        assert simulation.moments == ('front_mesh', 'rear_mesh', 'front_clutch', 'rear_clutch')
    assert simulation.outputs == names(variant)


@EACH_VARIANT
def test_snapshot_holds_plain_floats_in_the_order_of_the_names(variant):
    simulation = Simulation(variant)
    for snapshot in (simulation.snapshot(), simulation.step(np.array([30, -10, -12]))):
        assert Snapshot._fields == ('time', 'velocity', 'position', 'torque', 'moment',
                                    'power_flow', 'clutch_force')
        assert len(snapshot.velocity) == len(snapshot.position) == len(simulation.shafts)
        assert len(snapshot.torque) == len(simulation.inputs)
        assert len(snapshot.moment) == len(simulation.moments)
        numbers = (snapshot.time, *snapshot.velocity, *snapshot.position, *snapshot.torque,
                   *snapshot.moment, *snapshot.clutch_force)
        assert len(snapshot.clutch_force) == len(simulation.clutches)
        assert {type(n) for n in numbers} == {float}
        assert type(snapshot.power_flow) is int
    assert snapshot.torque == (30.0, -10.0, -12.0)
    assert snapshot == simulation.snapshot()


@EACH_VARIANT
def test_time_is_counted_in_ticks_and_does_not_drift(variant):
    simulation = Simulation(variant, dt=0.1)
    for n in range(1, 31):
        assert simulation.step((0, 0, 0)).time == simulation.time == n * 0.1
    assert sum([0.1] * 30) != 30 * 0.1


@EACH_LAW
@EACH_VARIANT
def test_equal_inputs_give_equal_bits_also_after_a_reset(variant, loss_law):
    sequence = torques(1, 200)
    first, second = (Simulation(variant, loss_law=loss_law, initial_velocity=(3.0, -4.0))
                     for _ in range(2))
    start = first.snapshot()
    once = repr(run(first, sequence))
    assert repr(run(second, sequence)) == once
    first.reset()
    assert repr(first.snapshot()) == repr(start)
    assert repr(run(first, sequence)) == once


@EACH_VARIANT
def test_reset_goes_back_to_the_start(variant):
    simulation = Simulation(variant, initial_velocity=(3.0, -4.0))
    run(simulation, torques(2, 50))
    simulation.reset()
    start = simulation.snapshot()
    assert (start.time, start.power_flow, simulation.coarse_steps) == (0.0, 1, 0)
    assert set(start.torque) == set(start.position) == {0.0}
    assert start.velocity[1:3] == pytest.approx((3.0, -4.0), rel=1e-15)


@EACH_VARIANT
@pytest.mark.parametrize('wrong, message', [
    ({'dt': 0}, 'dt: 0'), ({'dt': math.nan}, 'dt: nan'), ({'dt': '1'}, "dt: '1'"),
    ({'substeps': 0}, 'substeps: 0'), ({'substeps': 1.5}, 'substeps: 1.5'),
    ({'substeps': True}, 'substeps: True'),
    ({'power_flow_deadband': -1}, 'power_flow_deadband: -1'),
    ({'initial_velocity': (1,)}, 'initial_velocity: (1,)'),
    ({'initial_velocity': (1, math.inf)}, 'inf is not allowed'),
    ({'parameters': 5}, 'parameters: int'), ({'parameters': {'no.such': 1}}, 'no.such')])
def test_impossible_argument_is_refused_by_name(variant, wrong, message):
    with pytest.raises(ValueError) as refusal:
        Simulation(variant, **wrong)
    assert message in str(refusal.value)


def test_unknown_variant_and_parameters_of_the_other_mechanism_are_refused():
    with pytest.raises(ValueError, match='symmetric_ode, symmetric_dae, lsd_lagged'):
        Simulation('lsd')
    with pytest.raises(ValueError, match='SymmetricParameters is not SelfLockingParameters'):
        Simulation('lsd_ode', parameters=SymmetricParameters())


# Identities


@EACH_LAW
@EACH_VARIANT
def test_mechanism_at_rest_without_torque_stays_there_exactly(variant, loss_law):
    simulation = Simulation(variant, loss_law=loss_law)
    for snapshot in [simulation.snapshot(), *run(simulation, [(0, 0, 0)] * 100)]:
        numbers = (*snapshot.velocity, *snapshot.position, *snapshot.moment)
        assert set(numbers) == {0.0}
        assert snapshot.power_flow == 1


@EACH_LAW
@EACH_VARIANT
def test_speeds_and_angles_keep_the_kinematic_constraints(variant, loss_law):
    rng = np.random.default_rng(3)
    symmetric = is_symmetric(variant)
    for seed in range(3):
        p = random_symmetric(rng) if symmetric else random_self_locking(rng)
        speeds = symmetric_speeds if symmetric else self_locking_speeds
        simulation = Simulation(variant, parameters=p, loss_law=loss_law)
        for snapshot in run(simulation, torques(seed, 300)):
            for values in (snapshot.velocity, snapshot.position):
                expected = speeds(p, *values[1:3])
                assert values == pytest.approx(expected, rel=1e-13,
                                               abs=1e-13 * np.abs(expected).max())


@EACH_LAW
@pytest.mark.parametrize('one, other, bound', [
    ('symmetric_ode', 'symmetric_dae', 1e-12), ('lsd_ode', 'lsd_dae', 1e-9)])
def test_formulations_agree_over_a_thousand_ticks(one, other, bound, loss_law):
    sequence = torques(4, 1000)
    pair = [run(Simulation(variant, loss_law=loss_law), sequence) for variant in (one, other)]
    for field in ('velocity', 'position', 'moment'):
        a, b = (np.array([getattr(s, field) for s in snapshots]) for snapshots in pair)
        assert np.abs(a - b).max() < bound * np.abs(a).max()
    flows = [[s.power_flow for s in snapshots] for snapshots in pair]
    assert flows[0] == flows[1]
    assert set(flows[0]) == {1, -1}


@EACH_LAW
def test_lagged_formulation_nears_the_others_in_first_order_of_the_tick(loss_law):
    def after_60_ms(variant, dt):
        simulation = Simulation(variant, dt, loss_law=loss_law, initial_velocity=(30.0, 10.0))
        for _ in range(round(0.06 / dt)):
            snapshot = simulation.step((200.0, -70.0, -125.0))
        return np.array(snapshot.velocity)

    errors = [np.abs(after_60_ms('lsd_lagged', dt) - after_60_ms('lsd_ode', dt)).max()
              for dt in (1e-3, 5e-4, 2.5e-4)]
    assert errors[0] > 1e-3
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(1, abs=0.3)


@EACH_LAW
@EACH_VARIANT
def test_substeps_are_shorter_ticks_under_held_torques(variant, loss_law):
    fine = Simulation(variant, 0.001 / 4, loss_law=loss_law)
    coarse = Simulation(variant, 0.001, loss_law=loss_law, substeps=4)
    for T in torques(5, 100):
        for _ in range(4):
            expected = fine.step(T)
        got = coarse.step(T)
        assert repr(got[1:]) == repr(expected[1:])
        assert got.time == pytest.approx(expected.time, rel=1e-15)


@EACH_LAW
@EACH_VARIANT
def test_reversal_of_all_torques_reverses_everything_but_the_index(variant, loss_law):
    sequence = np.array(torques(6, 200))
    there, back = (run(Simulation(variant, loss_law=loss_law), sign * sequence)
                   for sign in (1, -1))
    for a, b in zip(there, back, strict=True):
        assert a.power_flow == b.power_flow
        for field in ('velocity', 'position', 'moment'):
            values = np.array(getattr(a, field))
            assert np.abs(values + getattr(b, field)).max() <= 1e-9 * np.abs(values).max()


@EACH_LAW
def test_constant_torques_give_the_motion_that_the_paper_gives_by_hand(loss_law):
    # (18)-(20) with Table 1, both shafts alike: (I_1Sigma + I_2Sigma) e = T_Sigma - L_Sigma
    I_sigma = (0.1 / 0.975 + 2 * 1.8e-4 / (0.975 * 0.995 * 0.99) + 1.56e-4 * 3.517**2 * 0.995)
    T_sigma = (-15 - 15) / (0.975 * 0.995 * 0.99) + 10 * 3.517 * 0.995
    l_sigma = 5e-3 / (0.975 * 0.995) + 1e-3 * 3.517**2
    assert T_sigma / I_sigma == pytest.approx(35.8, abs=0.1)
    start = 1.0   # near rest the meshes of the passive law give no loss yet
    for variant in VARIANTS[:2]:
        simulation = Simulation(variant, dt=0.01, loss_law=loss_law,
                                initial_velocity=(start, start))
        for n in range(1, 101):
            snapshot = simulation.step((10.0, -15.0, -15.0))
            w = start + (T_sigma / l_sigma - start) * -math.expm1(-l_sigma / I_sigma * 0.01 * n)
            assert snapshot.velocity == pytest.approx((w, w, w, 3.517 * w, 0), rel=1e-11, abs=1e-9)
            assert snapshot.power_flow == 1


# The state


@EACH_LAW
@EACH_VARIANT
def test_a_state_that_is_put_back_goes_on_bit_for_bit(variant, loss_law):
    simulation = Simulation(variant, loss_law=loss_law, substeps=2, initial_velocity=(3.0, -4.0))
    sequence = torques(11, 120)
    run(simulation, sequence[:60])
    simulation.parameters = {f'{simulation.mechanism.name}.inertia.carrier': 0.2}
    run(simulation, sequence[60:80])
    state, reported = simulation.state, simulation.snapshot()
    went_on = run(simulation, sequence[80:])
    simulation.state = state
    assert repr(simulation.snapshot()[1:]) == repr(reported[1:])   # time is counted in ticks
    assert repr([s[1:] for s in run(simulation, sequence[80:])]) == repr(
        [s[1:] for s in went_on])


@EACH_LAW
@EACH_VARIANT
def test_a_state_is_an_immutable_value_that_hides_nothing(variant, loss_law):
    one, other = (Simulation(variant, loss_law=loss_law) for _ in range(2))
    run(one, torques(12, 50))
    other.state = one.state
    assert hash(one.state) == hash(other.state) and one.state == other.state
    for _ in range(20):
        assert repr(one.step((30.0, -9.0, -12.0))[1:]) == repr(other.step((30.0, -9.0, -12.0))[1:])


@EACH_VARIANT
def test_after_a_change_of_parameters_the_reported_moments_are_the_new_ones(variant):
    simulation = Simulation(variant)
    before = run(simulation, torques(13, 90))[-1]
    prefix = simulation.mechanism.name
    mesh = 'left' if is_symmetric(variant) else 'front'
    simulation.parameters = {f'{prefix}.inertia.{mesh}': 0.05, f'{prefix}.viscosity.{mesh}': 0.5}
    after = simulation.snapshot()
    assert after.moment != before.moment
    twin = Simulation(variant, parameters=simulation.parameters)
    twin.state = simulation.state
    assert repr(twin.snapshot()[1:]) == repr(after[1:])
    state, p = simulation.state, simulation.parameters
    if variant == 'lsd_lagged':   # with the friction from what it remembers
        friction = tuple(phi * M + S for phi, M, S in zip(
            full_friction(p)[0], state.memory, full_friction(p)[1], strict=True))
        _, _, *F, M_1, M_2 = PassiveFlow(p, state.torque, friction).point(*state.x)[:6]
        expected = (M_1, M_2, *F)
    else:   # as at the end of a tick that leads next to nowhere
        tiny = Simulation(variant, 1e-12, p, power_flow_deadband=1e9)   # the index stays
        tiny.state = state
        expected = tiny.step(after.torque).moment
    assert np.abs(np.subtract(after.moment, expected)).max() < 1e-6 * max(map(abs, after.moment))


# What the paper's law gave before, tick by tick: numbers, not a comparison with itself


def test_the_reference_loads_give_what_they_always_gave():
    text = (Path(__file__).parent / 'reference_loads.csv').read_text()
    rows = list(csv.reader(text.splitlines()))
    assert len(rows) == 40
    for variant in VARIANTS:
        simulation = Simulation(variant, loss_law='paper')
        load = simulation.mechanism.load
        mine = {int(row[1]): np.array(row[2:], float) for row in rows if row[0] == variant}
        for n in range(max(mine)):
            snapshot = simulation.step(load(n / 1000))
            if n + 1 in mine:
                got = [*snapshot.velocity, *snapshot.position, *snapshot.moment,
                       snapshot.power_flow]
                largest = np.abs(mine[n + 1]).max()
                assert np.abs(got - mine[n + 1]).max() < 1e-12 * largest, (variant, n)


# The power-flow index and the moments


def input_ratio(variant):
    """Return the speed of the input shaft over that of the carrier."""
    return 3.517 if is_symmetric(variant) else 1.0


@EACH_VARIANT
def test_index_is_decided_from_the_torques_in_force_and_the_speeds_before_the_tick(variant):
    ratio = input_ratio(variant)
    simulation = Simulation(variant, loss_law='paper', initial_velocity=(10.0, 10.0))
    for load, index in ((9.9, 1), (10.1, -1), (9.9, 1), (-10.1, -1), (-9.9, 1)):
        w_0, w_1, w_2 = simulation.snapshot().velocity[:3]
        outputs = load * w_0 / (w_1 + w_2)   # together they have load/10 of the input power
        assert simulation.step((10.0 / ratio, outputs, outputs)).power_flow == index


@EACH_VARIANT
def test_index_starts_direct_and_stays_where_no_power_flows(variant):
    simulation = Simulation(variant, loss_law='paper')
    assert simulation.step((0, 0, 0)).power_flow == 1
    assert simulation.step((0, 1e-3, 1e-3)).power_flow == 1   # at rest when it was decided
    assert simulation.step((0, 1e-3, 1e-3)).power_flow == -1
    for _ in range(5):
        assert simulation.step((0, 0, 0)).power_flow == -1


@EACH_VARIANT
def test_dead_band_keeps_the_index(variant):
    simulation = Simulation(variant, loss_law='paper', power_flow_deadband=5.0,
                            initial_velocity=(10.0, 10.0))
    assert simulation.step((0.0, 0.2, 0.2)).power_flow == 1    # 4 W
    assert simulation.step((0.0, 0.4, 0.4)).power_flow == -1   # 8 W
    ratio = input_ratio(variant)
    assert simulation.step((0.4 / ratio, 0, 0)).power_flow == -1
    assert simulation.step((0.8 / ratio, 0, 0)).power_flow == 1
    simulation.power_flow_deadband = 0.0
    assert simulation.step((0.0, 0.01, 0.01)).power_flow == -1


@EACH_VARIANT
def test_under_the_passive_law_the_index_tells_whether_the_input_torque_gives_power(variant):
    ratio = input_ratio(variant)
    simulation = Simulation(variant, power_flow_deadband=5.0, initial_velocity=(10.0, 10.0))
    for torque, index in ((-0.4, 1), (-0.6, -1), (0.0, -1), (0.4, -1), (0.6, 1), (-0.4, 1)):
        assert simulation.step((torque / ratio, -9.0, 8.0)).power_flow == index   # 4 W and 6 W
    # the sign of a creep says nothing
    slow = Simulation(variant, initial_velocity=(0.019, 0.019))
    assert slow.step((-1e-6, 0.0, 0.0)).power_flow == 1
    fast = Simulation(variant, initial_velocity=(0.021, 0.021))
    assert fast.step((-1e-6, 0.0, 0.0)).power_flow == -1


@EACH_LAW
@EACH_VARIANT
@pytest.mark.parametrize('drive', [300.0, 100.0])
@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_mesh_moment_is_positive_when_the_mechanism_drives_the_shaft(
        variant, drive, sign, loss_law):
    ratio = input_ratio(variant)
    simulation = Simulation(variant, loss_law=loss_law, initial_velocity=(40.0, 40.0))
    for _ in range(10):
        snapshot = simulation.step(np.array([drive / ratio, -100.0, -100.0]) * sign)
    meshes = dict(zip(simulation.moments, snapshot.moment, strict=True))
    meshes = {k: v for k, v in meshes.items() if not k.endswith('clutch')}
    # the carrier turns forward all the while: 100 N m drive and brake
    brakes = drive < 200.0 if loss_law == 'paper' else sign < 0.0
    assert snapshot.velocity[0] > 0.0
    assert snapshot.power_flow == (-1 if brakes else 1)
    assert all(v * sign > 0 for v in meshes.values()), meshes


@EACH_LAW
@EACH_VARIANT
def test_mesh_moment_is_negative_when_the_shaft_drives_the_mechanism(variant, loss_law):
    ratio = 3.517 if is_symmetric(variant) else 1.0
    simulation = Simulation(variant, loss_law=loss_law, initial_velocity=(20.0, 20.0))
    for _ in range(20):
        snapshot = simulation.step((-100.0 / ratio, 60.0, 60.0))
    assert snapshot.power_flow == -1
    assert all(v < 0 for k, v in zip(simulation.moments, snapshot.moment, strict=True)
               if not k.endswith('clutch'))


# Change and refusal


@EACH_LAW
@EACH_VARIANT
def test_change_of_parameters_leaves_output_speeds_and_all_angles_where_they_are(
        variant, loss_law):
    rng = np.random.default_rng(7)
    simulation = Simulation(variant, loss_law=loss_law)
    for seed in range(5):
        before = run(simulation, torques(seed, 60))[-1]
        symmetric = is_symmetric(variant)
        p = random_symmetric(rng) if symmetric else random_self_locking(rng)
        simulation.parameters = p
        after = simulation.snapshot()
        assert simulation.parameters is p
        assert after.position == before.position
        assert after.velocity[1:3] == pytest.approx(before.velocity[1:3], rel=1e-13)
        speeds = symmetric_speeds if symmetric else self_locking_speeds
        assert after.velocity == pytest.approx(speeds(p, *after.velocity[1:3]), rel=1e-12)
        assert (after.time, after.power_flow) == (before.time, before.power_flow)
        # the angles go on from there with the new speeds
        step = np.subtract(simulation.step((0, 0, 0)).position, after.position)
        middle = np.add(simulation.snapshot().velocity, after.velocity) / 2 * simulation.dt
        assert np.abs(step - middle).max() < 0.05 * np.abs(middle).max() + 1e-3


@EACH_LAW
@EACH_VARIANT
def test_change_is_that_of_a_simulation_made_with_the_new_parameters(variant, loss_law):
    p = (random_symmetric if is_symmetric(variant) else random_self_locking)(
        np.random.default_rng(8))
    start = dict(loss_law=loss_law, initial_velocity=(12.0, -5.0))
    changed, made = Simulation(variant, **start), Simulation(variant, parameters=p, **start)
    changed.parameters = p
    changed.reset()
    assert repr(run(changed, torques(9, 100))) == repr(run(made, torques(9, 100)))


@EACH_VARIANT
def test_part_of_the_parameters_changes_by_name(variant):
    simulation = Simulation(variant)
    prefix = simulation.mechanism.name
    simulation = Simulation(variant, parameters={f'{prefix}.inertia.carrier': 0.2})
    simulation.parameters = {f'{prefix}.viscosity.carrier': 0.3}
    assert (simulation.parameters.I_0, simulation.parameters.l_0) == (0.2, 0.3)


@EACH_VARIANT
@pytest.mark.parametrize('bad', [{'symmetric.inertia.left': -1, 'lsd.inertia.front': -1},
                                 {'no.such': 1}, 'text', 7, [1]])
def test_bad_parameters_leave_the_state_untouched(variant, bad):
    simulation, twin = Simulation(variant), Simulation(variant)
    sequence = torques(10, 40)
    run(simulation, sequence), run(twin, sequence)
    with pytest.raises(ValueError):
        simulation.parameters = bad
    with pytest.raises(ValueError):
        simulation.substeps = 0
    with pytest.raises(ValueError):
        simulation.power_flow_deadband = math.nan
    assert repr(simulation.snapshot()) == repr(twin.snapshot())
    assert repr(run(simulation, sequence)) == repr(run(twin, sequence))


@EACH_LAW
@EACH_VARIANT
@pytest.mark.parametrize('bad', [
    (math.nan, 0, 0), (0, math.inf, 0), (0, 0, -math.inf), (1, 2), (1, 2, 3, 4), (), None, 5.0,
    ('a', 'b', 'c'), 'abc', (None, 1, 2), (1j, 0, 0), ([1], 2, 3), (1e308, 1e308, 1e308),
    (-1e308, 1e308, 1.7e308), (10 ** 400, 0, 0)])
def test_bad_torques_are_refused_and_leave_the_state_untouched(variant, bad, loss_law):
    simulation, twin = (Simulation(variant, loss_law=loss_law) for _ in range(2))
    sequence = torques(11, 30)
    run(simulation, sequence), run(twin, sequence)
    with pytest.raises(ValueError, match='^torques: '):
        for _ in range(20):   # the huge ones lead out of range at the latest after some ticks
            before = repr(simulation.snapshot())
            simulation.step(bad)
            run(twin, [bad])
    assert repr(simulation.snapshot()) == before == repr(twin.snapshot())
    assert repr(run(simulation, sequence)) == repr(run(twin, sequence))


# Whatever is asked of it


@EACH_LSD
@pytest.mark.parametrize('rate', [100, 1000, 10000])
@pytest.mark.parametrize('size', [10.0, 1e3, 1e5])
def test_no_speed_leaves_the_bound_that_energy_sets(variant, rate, size):
    # Friction and drag only take energy E = 1/2 sum I_k omega_k^2 away, so that
    # d sqrt(2 E)/dt <= sqrt(sum T_k^2/I_k), and |omega_k| <= sqrt(2 E/I_k). A bearing or mesh
    # loss that the index puts on the wrong side adds at most what the efficiencies take.
    p = SelfLockingParameters()
    inertia = np.array([p.I_0, p.I_1, p.I_2])
    gain = 1 / (p.eta_0B * p.eta_1G)**2
    simulation, impulse = Simulation(variant, 1 / rate), 0.0
    rng = np.random.default_rng(12)
    T = np.zeros(3)
    for n in range(150):
        if n % 30 < 15 or n % 5 == 0:
            T = rng.uniform(-size, size, 3)
        snapshot = simulation.step(T)
        impulse += np.sqrt((T**2 / inertia).sum()) / rate
        assert np.isfinite([*snapshot.velocity, *snapshot.position, *snapshot.moment]).all()
        assert (np.abs(snapshot.velocity[:3]) <= gain * impulse / np.sqrt(inertia)).all()


@EACH_LAW
@EACH_LSD
@pytest.mark.parametrize('rate', [100, 1000, 10000])
def test_locked_clutch_comes_to_rest_and_does_not_chatter(variant, rate, loss_law):
    simulation = Simulation(variant, 1 / rate, loss_law=loss_law, initial_velocity=(1.0, -1.0))
    for _ in range(rate // 2):
        simulation.step((0.0, 0.0, 0.0))
    slips = []
    for _ in range(20):
        _, front, rear, _ = simulation.step((0.0, 0.0, 0.0)).velocity
        slips.append(abs(front - rear))
    assert slips == sorted(slips, reverse=True)
    assert slips[0] < 1e-6
