# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The symmetric differential with clutches between its side gears and its carrier."""

import dataclasses
import math

from mechanisms import lossless, random_clutched_symmetric, relative_difference, symmetric_speeds
import numpy as np
import pytest

from dm_ros import SelfLockingParameters, Simulation, SymmetricParameters
from dm_ros.energy import AuditedSimulation
from dm_ros.mechanism.symmetric import SymmetricDae, SymmetricOde
from dm_ros.mechanism.variants import SYMMETRIC, variants_of
from dm_ros.motion.models import LOSS_LAWS

EACH = pytest.mark.parametrize('variant', variants_of(SYMMETRIC))
EACH_LAW = pytest.mark.parametrize('loss_law', LOSS_LAWS)
PLATES = SymmetricParameters(n_F1=4, n_F2=4, N_1=150.0, N_2=150.0, mu_1=0.1, mu_2=0.1)


def run(simulation, ticks, forces=(0.0, 0.0)):
    """Return the snapshots of the reference load under held forces."""
    load = simulation.mechanism.load
    return [simulation.step(load(n * simulation.dt), forces) for n in range(ticks)]


# Equations


@pytest.mark.parametrize('direction', [1, -1])
@pytest.mark.parametrize('formulation', [SymmetricOde, SymmetricDae])
def test_the_answer_satisfies_the_equation_of_each_element(formulation, direction):
    rng = np.random.default_rng(1)
    for _ in range(40):
        p, w = random_clutched_symmetric(rng), rng.normal(0, 60, 2)
        (T_3, T_1, T_2), (F_1, F_2) = rng.normal(0, 150, 3), rng.normal(0, 80, 2)
        r = formulation(p).response(direction)
        e_0, e_1, e_2, e_3, e_s = symmetric_speeds(
            p, *(r.A @ w + r.B @ (T_3, T_1, T_2) - r.C @ (F_1, F_2)))
        M_F, M_1, M_2 = r.P @ w + r.Q @ (T_3, T_1, T_2) - r.W @ (F_1, F_2)
        w_0, w_1, w_2, w_3, w_s = symmetric_speeds(p, *w)
        L_3, L_s = p.l_3 * w_3, p.l_s * w_s
        L_1, L_2 = p.l_1 * (w_1 - w_0), p.l_2 * (w_2 - w_0)
        reaction = (p.l_0 * w_0 - L_1 - L_2 - F_1 - F_2) / p.eta_0B
        inertial = (p.I_0 * e_0, p.I_1 * e_1, p.I_2 * e_2, p.I_3 * p.g_F * e_3,
                    p.n_s * p.I_s / p.g_2s * e_s)
        if direction == 1:
            external = (M_F * p.eta_FG - (M_1 + M_2) / p.eta_0B - reaction,
                        M_1 * p.eta_1G - L_1 - F_1 + T_1, M_2 * p.eta_2G - L_2 - F_2 + T_2,
                        T_3 * p.g_F - M_F / p.eta_3B - L_3 * p.g_F / p.eta_3B,
                        M_1 - M_2 - p.n_s / p.g_2s * L_s)
        else:
            external = (p.eta_1G * M_1 + p.eta_2G * M_2 - M_F / p.eta_0B - reaction,
                        T_1 - L_1 - F_1 - M_1, T_2 - L_2 - F_2 - M_2,
                        M_F * p.eta_FG + T_3 * p.g_F / p.eta_3B - L_3 * p.g_F / p.eta_3B,
                        p.eta_2G * M_2 - p.eta_1G * M_1 - p.n_s / p.g_2s * L_s)
        assert relative_difference(inertial, external) < 1e-9


@EACH_LAW
@EACH
@pytest.mark.parametrize('alpha', [0.0, math.radians(20.0)])
def test_without_losses_it_is_the_self_locking_one_with_equal_radii(variant, loss_law, alpha):
    p = lossless(dataclasses.replace(PLATES, N_2=300.0, alpha=alpha))
    q = lossless(SelfLockingParameters(
        R_1=p.R, R_2=p.R, g_2s=p.g_2s, n_s=p.n_s, I_1=p.I_1, I_2=p.I_2, I_s=p.I_s,
        I_0=p.I_0 + p.g_F**2 * p.I_3, l_0=p.l_0 + p.g_F**2 * p.l_3, l_1=p.l_1, l_2=p.l_2,
        l_s=p.l_s, alpha=alpha, **{name: getattr(p, name) for name in (
            'n_F1', 'n_F2', 'mu_1', 'mu_2', 'c_f1', 'c_f2', 'R_F1', 'R_F2', 'N_1', 'N_2')}))
    start = (30.0, 28.0)
    one = Simulation(variant, parameters=p, loss_law=loss_law, initial_velocity=start)
    other = Simulation('lsd_ode', parameters=q, loss_law=loss_law, initial_velocity=start)
    for n in range(400):
        T = 60.0 * math.sin(n / 40), -50.0 - n / 10, 20.0 * math.cos(n / 25)
        forces = 50.0 * (n % 50), 800.0 * (n > 200)
        a = one.step(T, forces)
        b = other.step((p.g_F * T[0], *T[1:]), forces)
        assert a.velocity[:3] == pytest.approx(b.velocity[:3], rel=1e-9, abs=1e-6)
        # where a clutch turns round it is as steep as 100 N m for some 1e-6 rad/s
        assert a.moment[1:] == pytest.approx(b.moment, rel=1e-6, abs=1e-3)
        assert a.clutch_force == b.clutch_force


@EACH_LAW
def test_the_formulations_agree(loss_law):
    rng = np.random.default_rng(3)
    for _ in range(30):
        p = dataclasses.replace(random_clutched_symmetric(rng), c_1=rng.uniform(), c_2=0.5)
        start, T = tuple(rng.normal(0, 40, 2)), tuple(rng.normal(0, 100, 3))
        ode, dae = (Simulation(variant, 1e-3, p, loss_law=loss_law, initial_velocity=start)
                    for variant in ('symmetric_ode', 'symmetric_dae'))
        for _ in range(5):
            one, other = (s.step(T, (900.0, 400.0)) for s in (ode, dae))
        assert one.velocity == pytest.approx(other.velocity, rel=1e-7, abs=1e-7)
        assert one.moment == pytest.approx(other.moment, rel=1e-5, abs=1e-4)


@EACH_LAW
@EACH
def test_friction_is_that_of_load_preload_and_force(variant, loss_law):
    p, forces = PLATES, (3000.0, 800.0)
    simulation = Simulation(variant, 1e-6, p, loss_law=loss_law,
                            initial_velocity=(60.0, 20.0))   # full slip, which ends within 1 ms
    snapshot = simulation.step((60.0, -90.0, -100.0), forces)
    M = np.abs(snapshot.moment[1:3])
    full = [f * (math.tan(p.alpha) * M_k + p.R * (p.n_s * 150.0 + A))
            for f, M_k, A in zip(p.f, M, forces, strict=True)]
    assert snapshot.moment[3:] == pytest.approx((full[0], -full[1]), rel=1e-9)


@EACH_LAW
def test_two_huge_forces_make_a_solid_shaft(loss_law):
    p = dataclasses.replace(lossless(PLATES), l_0=0.0, l_1=0.0, l_2=0.0, l_3=0.0, l_s=0.0,
                            c_f1=1e3, c_f2=1e3)
    simulation = Simulation('symmetric_ode', parameters=p, loss_law=loss_law)
    for _ in range(200):
        snapshot = simulation.step((100.0, -150.0, 30.0), (1e6, 1e6))
    acceleration = np.array(snapshot.velocity[:3]) / simulation.time
    body = p.I_0 + p.I_1 + p.I_2 + p.g_F**2 * p.I_3
    assert acceleration == pytest.approx([(100.0 * p.g_F - 120.0) / body] * 3, rel=1e-6)


@pytest.mark.parametrize('drive, more', [(1.0, True), (-1.0, False)])
def test_a_one_way_axle_locks_under_power_and_not_on_the_overrun(drive, more):
    p = dataclasses.replace(PLATES, N_1=0.0, N_2=0.0, c_1=0.0, c_2=0.0)
    simulation = Simulation('symmetric_ode', parameters=p, initial_velocity=(40.0, 40.0))
    for _ in range(50):
        snapshot = simulation.step((drive * 100.0, -drive * 150.0, -drive * 190.0))
    friction = np.abs(snapshot.moment[3:])
    assert (friction > 1.0).any() if more else (friction == 0.0).all()


# With and without


@EACH_LAW
@EACH
def test_without_surfaces_nothing_of_a_clutch_matters(variant, loss_law):
    plain = Simulation(variant, loss_law=loss_law)
    other = Simulation(variant, loss_law=loss_law, parameters=dataclasses.replace(
        PLATES, n_F1=0, n_F2=0, alpha=0.5, R=0.05, c_1=0.0))
    assert other.clutches == () and other.moments == plain.moments
    assert run(plain, 800, ()) == run(other, 800, ())


@EACH_LAW
@EACH
def test_clutches_without_friction_are_no_clutches(variant, loss_law):
    plain = Simulation(variant, loss_law=loss_law)
    loose = Simulation(variant, loss_law=loss_law,
                       parameters=dataclasses.replace(PLATES, mu_1=0.0, mu_2=0.0))
    assert loose.moments == (*plain.moments, 'left_clutch', 'right_clutch')
    for one, other in zip(run(plain, 800, ()), run(loose, 800, (500.0, 0.0))):
        assert one.velocity == pytest.approx(other.velocity, abs=2e-4)
        assert other.moment[3:] == (0.0, 0.0)


def test_it_has_its_clutches_from_the_start():
    plain, clutched = Simulation('symmetric_ode'), Simulation('symmetric_ode', parameters=PLATES)
    before = plain.step((50.0, -20.0, -20.0))
    with pytest.raises(ValueError, match='symmetric.clutch: .* at the start'):
        plain.parameters = {'symmetric.clutch.left.friction_surfaces': 2}
    assert plain.snapshot() == before and plain.clutches == ()
    clutched.parameters = dict.fromkeys(
        [f'symmetric.clutch.{side}.friction_surfaces' for side in ('left', 'right')], 0)
    assert clutched.step((50.0, -20.0, -20.0)).moment[3:] == (0.0, 0.0)
    assert clutched.clutches == ('left', 'right')


def test_clutches_that_lock_themselves_are_refused_by_name():
    with pytest.raises(ValueError, match=r'symmetric\.clutch\.right: the clutch locks itself'):
        SymmetricParameters(n_F2=12, mu_2=0.15)


# Books


@EACH_LAW
@EACH
def test_the_books_close_while_forces_and_signs_change(variant, loss_law):
    p = dataclasses.replace(PLATES, tau_1=0.02, c_1=0.5, c_2=0.0)
    audit = AuditedSimulation(variant, 1e-3, p, loss_law=loss_law)
    load = audit.mechanism.load
    for n in range(1500):
        audit.step(load(n * 1e-3), (2e3 * (n % 300 > 150), 1e3 * (1 + math.sin(n / 50))))
    assert audit.worst < 1e-8
    assert audit.clutch_names == ('left_clutch', 'right_clutch')
    assert min(audit.total.clutches) > 0.0
    if loss_law == 'passive':
        assert not any(energy for _, energy in audit.returned.values())


@EACH_LAW
def test_random_clutches_and_forces_lose_and_close_their_books(loss_law):
    rng = np.random.default_rng(11)
    for _ in range(25):
        p, T = random_clutched_symmetric(rng), tuple(rng.normal(0, 150, 3))
        audit = AuditedSimulation('symmetric_ode', 1e-3, p, loss_law=loss_law,
                                  initial_velocity=tuple(rng.normal(0, 40, 2)))
        for _ in range(10):
            energy = audit.step(T, tuple(rng.uniform(0, 5e3, 2))).energy
            assert min(energy.clutches) >= -1e-12 * energy.scale
            assert energy.relative_residual < 1e-8
            if loss_law == 'passive':
                assert min(energy.gears + energy.bearings) >= 0.0
