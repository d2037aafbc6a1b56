# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Clutches that are pressed by actuators: what a force does, when, and what is refused."""

import dataclasses
import math

from mechanisms import random_self_locking
import numpy as np
import pytest

from dm_ros import SelfLockingParameters, Simulation
from dm_ros.energy import AuditedSimulation
from dm_ros.mechanism.self_locking import SelfLockingOde
from dm_ros.mechanism.variants import SELF_LOCKING, variants_of
from dm_ros.motion.models import LOSS_LAWS

VARIANTS = variants_of(SELF_LOCKING)
EACH = pytest.mark.parametrize('variant', VARIANTS)
EACH_LAW = pytest.mark.parametrize('loss_law', LOSS_LAWS)


def run(simulation, ticks, forces=(0.0, 0.0)):
    """Return the snapshots of the reference load under held forces."""
    load = simulation.mechanism.load
    return [simulation.step(load(n * simulation.dt), forces) for n in range(ticks)]


def motion(snapshots):
    """Return all that a force may change of snapshots, but the force itself."""
    return [snapshot[:-1] for snapshot in snapshots]


# What a force does


@EACH_LAW
@EACH
def test_a_force_of_as_many_satellites_is_their_preload_bit_for_bit(variant, loss_law):
    preload = 250.0
    p = SelfLockingParameters(N_1=0.0, N_2=0.0)
    pressed = Simulation(variant, parameters=p, loss_law=loss_law)
    loaded = Simulation(variant, parameters=dataclasses.replace(p, N_1=preload, N_2=preload),
                        loss_law=loss_law)
    assert p.n_s == 4   # a power of two
    assert (motion(run(pressed, 1500, (p.n_s * preload, p.n_s * preload)))
            == motion(run(loaded, 1500)))


@EACH_LAW
@EACH
def test_force_adds_its_friction_to_that_of_load_and_preload(variant, loss_law):
    p, forces = SelfLockingParameters(), (3000.0, 800.0)
    simulation = Simulation(variant, parameters=p, loss_law=loss_law,
                            initial_velocity=(60.0, 20.0))   # full slip
    for _ in range(3):
        before = simulation.snapshot().moment if variant == 'lsd_lagged' else None
        snapshot = simulation.step((300.0, -100.0, -150.0), forces)
        M = np.abs((before or snapshot.moment)[:2])
        full = [f * (math.tan(p.alpha) * M_k + R * (p.n_s * N + A)) for f, M_k, R, N, A in zip(
            p.f, M, (p.R_1, p.R_2), (p.N_1, p.N_2), forces, strict=True)]
        assert snapshot.moment[2:] == pytest.approx((full[0], -full[1]), rel=1e-9)


@EACH_LAW
def test_two_huge_forces_make_a_solid_shaft(loss_law):
    p = SelfLockingParameters(
        l_0=0.0, l_1=0.0, l_2=0.0, l_s=0.0, c_f1=1e3, c_f2=1e3,
        **dict.fromkeys(('eta_0B', 'eta_1G', 'eta_2G'), 1.0))
    simulation = Simulation('lsd_ode', parameters=p, loss_law=loss_law)
    for _ in range(200):
        snapshot = simulation.step((500.0, -300.0, 50.0), (1e6, 1e6))
    acceleration = np.array(snapshot.velocity[:3]) / simulation.time
    assert acceleration == pytest.approx([250.0 / (p.I_0 + p.I_1 + p.I_2)] * 3, rel=1e-6)


@EACH
def test_a_strong_and_steep_clutch_is_a_locker(variant):
    p = SelfLockingParameters(c_f1=1e4, c_f2=1e4, n_F1=9)
    simulation = Simulation(variant, parameters=p)
    for _ in range(500):
        snapshot = simulation.step((1000.0, -990.0, 0.0), (1e5, 1e5))
    _, front, rear, _ = snapshot.velocity
    assert abs(front - rear) < 1e-3


@EACH_LAW
def test_a_step_of_force_acts_in_its_own_tick(loss_law):
    simulation = Simulation('lsd_ode', loss_law=loss_law, initial_velocity=(60.0, 20.0))
    before = simulation.step((300.0, -100.0, -150.0)).moment
    after = simulation.step((300.0, -100.0, -150.0), (0.0, 2000.0)).moment
    p = simulation.parameters
    assert before[3] - after[3] == pytest.approx(2000.0 * p.f[1] * p.R_2, rel=0.1)


# The coast factor


def random_states(seed, count):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        p = dataclasses.replace(random_self_locking(rng), c_1=rng.uniform(0, 1),
                                c_2=rng.uniform(0, 1))
        yield p, tuple(rng.normal(0, 40, 2)), tuple(rng.normal(0, 200, 3))


@EACH_LAW
@pytest.mark.parametrize('variant', ['lsd_ode', 'lsd_dae'])
def test_friction_has_its_coast_factor_while_the_mesh_moment_is_negative(variant, loss_law):
    seen = set()
    for p, speeds, T in random_states(5, 100):
        simulation = Simulation(variant, 1e-4, p, loss_law=loss_law, initial_velocity=speeds)
        snapshot = simulation.step(T)
        slip = -snapshot.velocity[3] * p.g_2s * (1 + p.g_12)
        steep = np.tanh([p.c_f1 * p.g_12 / (1 + p.g_12) * slip, -p.c_f2 / (1 + p.g_12) * slip])
        for M, F, f, R, N, c, t in zip(
                snapshot.moment[:2], snapshot.moment[2:], p.f, (p.R_1, p.R_2), (p.N_1, p.N_2),
                (p.c_1, p.c_2), steep, strict=True):
            share = c if M < 0.0 else 1.0
            assert F == pytest.approx(
                f * t * (abs(M) * math.tan(p.alpha) * share + R * p.n_s * N), rel=1e-8, abs=1e-9)
            seen.add(M < 0.0)
    assert seen == {True, False}


@EACH_LAW
def test_the_formulations_agree_also_with_coast_factors_and_forces(loss_law):
    for p, speeds, T in random_states(6, 60):
        ode, dae = (Simulation(variant, 1e-3, p, loss_law=loss_law, initial_velocity=speeds)
                    for variant in ('lsd_ode', 'lsd_dae'))
        for _ in range(5):
            one, other = (s.step(T, (900.0, 400.0)) for s in (ode, dae))
        assert one.velocity == pytest.approx(other.velocity, rel=1e-7, abs=1e-7)
        assert one.moment == pytest.approx(other.moment, rel=1e-5, abs=1e-4)


@pytest.mark.parametrize('drive, more', [(1.0, True), (-1.0, False)])
def test_a_one_way_differential_locks_under_power_and_not_on_the_overrun(drive, more):
    p = SelfLockingParameters(N_1=0.0, N_2=0.0, c_1=0.0, c_2=0.0)
    simulation = Simulation('lsd_ode', parameters=p, initial_velocity=(40.0, 40.0))
    for _ in range(50):
        snapshot = simulation.step((drive * 300.0, -drive * 110.0, -drive * 190.0))
    friction = np.abs(snapshot.moment[2:])
    assert (friction > 1.0).any() if more else (friction == 0.0).all()


@EACH_LAW
def test_the_moments_have_one_solution_with_any_coast_factor(loss_law):
    # continuity is the witness: a small step of the torques never makes the moments jump
    for p, speeds, T in random_states(8, 30):
        simulation = Simulation('lsd_ode', 1e-9, p, loss_law=loss_law, initial_velocity=speeds)
        if loss_law == 'paper':
            simulation.power_flow_deadband = 1e9   # the index would make them jump
        start, moments = simulation.state, []
        for scale in np.linspace(-1.0, 1.0, 401):
            simulation.state = start
            moments.append(simulation.step([scale * t for t in T]).moment)
        jumps = np.abs(np.diff(moments, axis=0)).max(axis=0)
        assert (jumps < 0.05 * np.ptp(moments, axis=0) + 1e-6).all()


# Lag and limit


def test_a_force_rises_with_the_time_constant_of_its_actuator():
    p = SelfLockingParameters(tau_1=0.05, tau_2=0.2)
    simulation = Simulation('lsd_ode', 1e-3, p, substeps=2)
    rising = [simulation.step((0.0, 0.0, 0.0), (1000.0, 500.0)).clutch_force for _ in range(200)]
    falling = [simulation.step((0.0, 0.0, 0.0)).clutch_force for _ in range(100)]
    t = np.arange(1, 201)[:, None] * 1e-3 / np.array([0.05, 0.2])
    assert np.array(rising) == pytest.approx((1 - np.exp(-t)) * [1000.0, 500.0], rel=1e-11)
    assert np.array(falling) == pytest.approx(np.exp(-t[:100]) * rising[-1], rel=1e-11)
    assert rising[49][0] == pytest.approx(632.1, abs=0.1)   # one time constant


def test_a_force_beyond_the_limit_is_that_of_the_limit():
    simulation = Simulation('lsd_ode', parameters={'lsd.clutch.rear.actuator_limit': 700.0})
    assert simulation.step((0.0, 0.0, 0.0), (900.0, 900.0)).clutch_force == (900.0, 700.0)
    simulation.parameters = {'lsd.clutch.front.actuator_limit': 100.0}
    assert simulation.step((0.0, 0.0, 0.0), (900.0, 900.0)).clutch_force == (100.0, 700.0)


def test_force_goes_on_with_the_state_and_ends_with_a_reset():
    p = SelfLockingParameters(tau_1=0.05, tau_2=0.2)
    simulation = Simulation('lsd_lagged', parameters=p)
    run(simulation, 40, (2000.0, 1000.0))
    state = simulation.state
    first = motion(run(simulation, 40, (100.0, 3000.0)))
    forces = simulation.snapshot().clutch_force
    simulation.state = state
    again = run(simulation, 40, (100.0, 3000.0))
    assert [s[1:] for s in motion(again)] == [s[1:] for s in first]
    assert again[-1].clutch_force == forces
    simulation.reset()
    assert simulation.snapshot().clutch_force == (0.0, 0.0)


# What is refused


@pytest.mark.parametrize('forces, words', [
    ((-1.0, 0.0), 'the force on front_clutch is -1.0, it must not be below 0'),
    ((0.0, math.inf), 'the force on rear_clutch is inf'),
    ((math.nan, 0.0), 'the force on front_clutch is nan'),
    ((1.0,), 'must be 2 numbers, for front_clutch, rear_clutch'),
    (5.0, 'must be 2 numbers'),
    (('x', 0.0), 'must be 2 numbers')])
def test_what_is_no_force_is_refused_by_name_and_changes_nothing(forces, words):
    simulation = Simulation('lsd_ode')
    simulation.step((300.0, -100.0, -150.0), (10.0, 20.0))
    before = simulation.snapshot()
    with pytest.raises(ValueError, match='clutch_forces: ') as error:
        simulation.step((300.0, -100.0, -150.0), forces)
    assert words in str(error.value)
    assert simulation.snapshot() == before


def test_a_differential_without_clutches_takes_no_force():
    simulation = Simulation('symmetric_ode')
    for none in ((), (0.0, 0.0), [0, 0]):
        assert simulation.clutches == () == simulation.step((1.0, 0.0, 0.0), none).clutch_force
    for forces in ((5.0, 0.0), None, 5.0):
        with pytest.raises(ValueError, match='clutch_forces: .* there is no clutch'):
            simulation.step((1.0, 0.0, 0.0), forces)


# Books


@EACH_LAW
@EACH
def test_the_books_close_while_forces_and_signs_change(variant, loss_law):
    p = SelfLockingParameters(tau_1=0.02, c_1=0.5, c_2=0.0)
    audit = AuditedSimulation(variant, 1e-3, p, loss_law=loss_law)
    load = audit.mechanism.load
    for n in range(1500):
        audit.step(load(n * 1e-3), (2e3 * (n % 300 > 150), 1e3 * (1 + math.sin(n / 50))))
    assert audit.worst < 1e-8
    assert min(audit.total.clutches) > 0.0
    if loss_law == 'passive':
        assert not any(energy for _, energy in audit.returned.values())


@EACH_LAW
def test_random_clutches_and_forces_lose_and_close_their_books(loss_law):
    rng = np.random.default_rng(11)
    for p, speeds, T in random_states(12, 25):
        audit = AuditedSimulation('lsd_ode', 1e-3, p, loss_law=loss_law, initial_velocity=speeds)
        for _ in range(10):
            energy = audit.step(T, tuple(rng.uniform(0, 5e3, 2))).energy
            assert min(energy.clutches) >= -1e-12 * energy.scale
            assert energy.relative_residual < 1e-8
            if loss_law == 'passive':
                assert min(energy.gears + energy.bearings) >= 0.0


def test_the_response_of_the_paper_knows_its_direction():
    # in reverse flow the paper's M > 0 is a shaft that drives: there the coast factor acts
    from dm_ros.mechanism import clutched
    p = SelfLockingParameters(c_1=0.25, c_2=0.5)
    for direction in (1, -1):
        k = clutched.coefficients(p, SelfLockingOde(p).response(direction), direction=direction)
        full = clutched.full_friction(p)[0]
        coasting = full[0] * 0.25, full[1] * 0.5
        assert (k.phi_1, k.phi_2) == (full if direction == 1 else coasting)
        assert (k.psi_1, k.psi_2) == (coasting if direction == 1 else full)
