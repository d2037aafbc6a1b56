# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The energy that the torques bring is stored or lost, and the books say where."""

import dataclasses
from pathlib import Path
import re

from mechanisms import (
    BOTH,
    Flow,
    is_symmetric,
    lossless,
    PassiveFlow,
    random_self_locking,
    random_symmetric,
    self_locking_dissipation,
    self_locking_energy,
    self_locking_speeds,
    symmetric_dissipation,
    symmetric_energy,
    symmetric_speeds,
)
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

from dm_ros import SelfLockingParameters, Simulation, SymmetricParameters, VARIANTS
from dm_ros.energy import AuditedSimulation, Energy, rated_efficiency
from dm_ros.mechanism.clutched import full_friction
from dm_ros.mechanism.symmetric import SymmetricOde
from dm_ros.mechanism.variants import variant_named
from dm_ros.motion.adaptive import TOLERANCE
from dm_ros.motion.models import LOSS_LAWS

LSD = VARIANTS[2:]
EACH_VARIANT = pytest.mark.parametrize('variant', VARIANTS)
EACH_LAW = pytest.mark.parametrize('loss_law', LOSS_LAWS)
EXACT = 1e-12       # of the energy turned over in a tick: the symmetric variants
BOUND = 1e-9        # the self-locking ones
STEP_ERROR = 5e-6   # of the energy turned over: what the error of ClutchStep moves between terms


def mechanism_of(variant):
    """Return the functions of ``mechanisms`` for random parameters, speeds, energy and drag."""
    return ((random_symmetric, symmetric_speeds, symmetric_energy, symmetric_dissipation)
            if is_symmetric(variant) else
            (random_self_locking, self_locking_speeds, self_locking_energy,
             self_locking_dissipation))


def random_torques(seed, count=60, size=200.0):
    """Yield torques that are held for a while, and then jump in every tick."""
    rng = np.random.default_rng(seed)
    for n in range(count):
        if n % 10 == 0 or n > count / 2:
            torque = rng.normal(0, size, 3).tolist()
        yield torque


def loads(variant, seconds=10, rate=1000):
    return [variant_named(variant).mechanism.load(n / rate) for n in range(seconds * rate)]


def flat(energy):
    """Return work and losses as one array: all but ``scale``."""
    return np.array([*energy.work, energy.stored, energy.viscous, *energy.gears,
                     *energy.bearings, *energy.clutches, energy.numerical])


# The balance


@EACH_LAW
@pytest.mark.parametrize('substeps', [1, 3])
@EACH_VARIANT
def test_the_books_do_not_change_the_motion(variant, substeps, loss_law):
    plain, audited = (kind(variant, loss_law=loss_law, substeps=substeps)
                      for kind in (Simulation, AuditedSimulation))
    for torque in random_torques(1):
        snapshot = audited.step(torque)
        assert repr(tuple(snapshot)) == repr(tuple(plain.step(torque)))
        assert (snapshot.energy, snapshot.stored_energy) == (audited.tick, audited.stored_energy)


@EACH_LAW
@pytest.mark.parametrize('dt', [2e-4, 1e-3, 5e-3])
@EACH_VARIANT
def test_the_books_balance_in_every_tick_with_random_parameters(variant, dt, loss_law):
    bound = BOUND if variant in LSD else EXACT
    rng = np.random.default_rng(2)
    for seed in range(8):
        p = mechanism_of(variant)[0](rng)
        audit = AuditedSimulation(variant, dt, p, loss_law=loss_law, substeps=1 + seed % 2)
        for torque in random_torques(seed):
            audit.advance(torque)
            assert audit.tick.relative_residual < bound
        assert audit.total.relative_residual < bound
        assert 0.0 < audit.worst < bound


@EACH_LAW
@EACH_VARIANT
def test_the_books_balance_on_the_reference_load_locked_slipping_and_reversing(variant, loss_law):
    audit = AuditedSimulation(variant, loss_law=loss_law)
    for torque in loads(variant):
        audit.advance(torque)
        # what an error of a speed within the tolerance is worth
        momentum = 2 * audit.stored_energy / max(map(abs, audit.snapshot().velocity))
        assert abs(audit.tick.numerical) < 1e-5 * audit.tick.scale + TOLERANCE * momentum
    bound = BOUND if variant in LSD else EXACT
    assert audit.worst < bound and audit.total.relative_residual < bound
    assert abs(audit.total.numerical) < 1e-8 * audit.total.scale


@EACH_LAW
@EACH_VARIANT
def test_at_rest_nothing_is_booked(variant, loss_law):
    audit = AuditedSimulation(variant, loss_law=loss_law)
    audit.advance((0, 0, 0))
    assert not flat(audit.tick).any() and audit.tick.relative_residual == 0.0 == audit.worst


# Each term against another way to it


def moments_on_elements(p, direction, L, T, M, F):
    """
    Return the moments on carrier, both outputs, pinion and satellites, (40), (52), (59), (60).

    Each times the speed below is a power: the satellites' is that of g_2s omega_s.
    """
    if isinstance(p, SymmetricParameters):
        (L_0, L_1, L_2, L_3, L_s), (T_3, T_1, T_2), (M_F, M_1, M_2) = L, T, M
        F_1 = F_2 = 0.0
        g_12 = 1.0
        if direction == 1:
            from_pinion = M_F * p.eta_FG
            pinion = T_3 * p.g_F - M_F / p.eta_3B - L_3 * p.g_F / p.eta_3B
        else:
            from_pinion = -M_F / p.eta_0B
            pinion = M_F * p.eta_FG + T_3 * p.g_F / p.eta_3B - L_3 * p.g_F / p.eta_3B
    else:
        (L_0, L_1, L_2, L_s), (T_0, T_1, T_2), (M_1, M_2), (F_1, F_2) = L, T, M, F
        g_12, pinion = p.g_12, 0.0
        from_pinion = T_0 if direction == 1 else T_0 / p.eta_0B
    drag = (L_0 - L_1 - L_2 - F_1 - F_2) / p.eta_0B
    if direction == 1:
        return np.array([
            from_pinion - (M_1 + M_2) / p.eta_0B - drag,
            M_1 * p.eta_1G - L_1 - F_1 + T_1,
            M_2 * p.eta_2G - L_2 - F_2 + T_2,
            pinion,
            M_1 * g_12 - M_2 - p.n_s / p.g_2s * L_s])
    return np.array([
        p.eta_1G * M_1 + p.eta_2G * M_2 + from_pinion - drag,
        T_1 - L_1 - F_1 - M_1,
        T_2 - L_2 - F_2 - M_2,
        pinion,
        p.eta_2G * M_2 - p.eta_1G * g_12 * M_1 - p.n_s / p.g_2s * L_s])


def lost_powers(p, direction, w, T, M, F):
    """Return work, viscous, gear, bearing and clutch powers as in a book, without ``stored``."""
    symmetric = isinstance(p, SymmetricParameters)
    speeds = (symmetric_speeds if symmetric else self_locking_speeds)(p, *w)
    w_0, w_1, w_2, *_, w_s = speeds
    relative = speeds - np.array([0, w_0, w_0, 0, 0][:len(speeds)])
    l_k = [p.l_0, p.l_1, p.l_2, *([p.l_3] if symmetric else []), p.l_s]
    row_speeds = np.array([w_0, w_1, w_2, w_0, p.g_2s * w_s])

    def loss(*etas):   # what the elements get more where these are 1
        ideal = dataclasses.replace(p, **dict.fromkeys(etas, 1.0))
        given = [moments_on_elements(q, direction, l_k * relative, T, M, F) for q in (ideal, p)]
        return (given[0] - given[1]) @ row_speeds

    dissipation = symmetric_dissipation if symmetric else self_locking_dissipation
    gears = (['eta_FG'] if symmetric else []) + ['eta_1G', 'eta_2G']
    bearings = (['eta_3B'] if symmetric else []) + ['eta_0B']
    clutches = [] if symmetric else [F[0] * (w_1 - w_0), F[1] * (w_2 - w_0)]
    driving = speeds[3] if symmetric else w_0
    return np.array([T[0] * driving, T[1] * w_1, T[2] * w_2, 2 * dissipation(p, *w),
                     *map(loss, gears), *map(loss, bearings), *clutches])


@pytest.mark.parametrize('direction', BOTH)
@pytest.mark.parametrize('variant', VARIANTS[:2])
def test_each_term_of_the_symmetric_one_is_the_integral_of_its_power(variant, direction):
    nodes, weights = np.polynomial.legendre.leggauss(24)
    rng = np.random.default_rng(4)
    for _ in range(10):
        p, w, T = random_symmetric(rng), rng.normal(0, 60, 2), rng.normal(0, 150, 3)
        h = 10.0 ** rng.uniform(-4, -2)
        r = variant_named(variant).formulation(p).response(direction)
        generator = np.vstack([np.hstack([r.A, (r.B @ T)[:, None]]), np.zeros((1, 3))])
        expected = np.zeros(9)
        for node, weight in zip(h * (nodes + 1) / 2, h * weights / 2, strict=True):
            x = (expm(node * generator) @ [*w, 1.0])[:2]
            expected += weight * lost_powers(p, direction, x, T, r.P @ x + r.Q @ T, None)
        audit = AuditedSimulation(variant, h, p, loss_law='paper', initial_velocity=w)
        audit.state = audit.state._replace(power_flow=direction)
        audit.power_flow_deadband = 1e9   # the index stays
        audit.advance(T)
        booked = np.delete(flat(audit.tick), [3, 9 + 1])
        assert np.abs(booked - expected).max() < EXACT * audit.tick.scale
        stored = symmetric_energy(p, *audit.snapshot().velocity[1:3]) - symmetric_energy(p, *w)
        assert audit.tick.stored == pytest.approx(stored, abs=1e-12 * audit.stored_energy)


def exact_self_locking(p, w, T, direction, h):
    """Return the terms of a tick of ``lsd_ode`` by a fine integration, as in a book."""
    flow = Flow(p, T, direction)
    k = p.g_12 / (1 + p.g_12)

    def outputs(y):
        return np.array([y[0] + k * y[1], y[0] - (1 - k) * y[1]])

    def rates(_, z):
        dw, ds, *F, M_1, M_2 = flow.point(*z[:2])[:6]
        return [dw, ds, *lost_powers(p, direction, outputs(z), T, (M_1, M_2), F)]

    start = [(w[0] + p.g_12 * w[1]) / (1 + p.g_12), w[0] - w[1]]
    z = solve_ivp(rates, (0.0, h), start + [0.0] * 9, 'LSODA', rtol=1e-11, atol=1e-11).y[:, -1]
    stored = self_locking_energy(p, *outputs(z)) - self_locking_energy(p, *w)
    return np.array([*z[2:5], stored, *z[5:]])


@pytest.mark.parametrize('direction', BOTH)
@pytest.mark.parametrize('variant', ['lsd_ode', 'lsd_dae'])
def test_each_term_of_the_self_locking_one_is_that_of_a_fine_integration(variant, direction):
    rng = np.random.default_rng(5)
    cases = [(SelfLockingParameters(), w, T) for w, T in [
        ((30.0, 30.0), (300.0, -120.0, -180.0)),     # locked
        ((40.0, 20.0), (300.0, -100.0, -150.0)),     # slipping
        ((30.2, 29.8), (300.0, -250.0, 40.0))]]      # slip reverses
    cases += [(random_self_locking(rng), rng.normal(0, 30) + rng.normal(0, 3, 2),
               rng.normal(0, 200, 3)) for _ in range(12)]
    for p, w, T in cases:
        audit = AuditedSimulation(variant, 1e-3, p, loss_law='paper', initial_velocity=w)
        audit.state = audit.state._replace(power_flow=direction)
        audit.power_flow_deadband = 1e9   # the index stays
        audit.advance(T)
        exact = exact_self_locking(p, w, T, direction, 1e-3)
        assert np.abs(flat(audit.tick)[:-1] - exact).max() < STEP_ERROR * audit.tick.scale


def passive_powers(p, w, T, M, F):
    """Return the powers as ``lost_powers`` does, by the formulas of the passive law."""
    symmetric = isinstance(p, SymmetricParameters)
    speeds = (symmetric_speeds if symmetric else self_locking_speeds)(p, *w)
    dissipation = symmetric_dissipation if symmetric else self_locking_dissipation
    w_0, w_1, w_2, *w_3, _ = speeds
    sigma_0, sigma_1, sigma_2 = np.tanh(speeds[:3] / p.sign_speed)

    def positive(x):
        return max(x, 0.0)

    def mesh(eta, M, sigma):   # what goes in and what comes out
        return ((1 + eta) / 2 * M + (1 - eta) / 2 * abs(M) * sigma,
                (1 + eta) / 2 * M - (1 - eta) / 2 * abs(M) * sigma)

    *M_F, M_1, M_2 = M
    (N_1, S_1), (N_2, S_2) = mesh(p.eta_1G, M_1, sigma_1), mesh(p.eta_2G, M_2, sigma_2)
    gears = [(N_1 - S_1) * w_1, (N_2 - S_2) * w_2]
    bearings, clutches, C, driving = [], [], T[0], w_0
    if symmetric:
        N_F, C = mesh(p.eta_FG, *M_F, sigma_0)
        gears.insert(0, (N_F - C) * w_0)
        (driving,) = w_3
        d_3 = np.sign(driving)
        D_3 = (1 / p.eta_3B - 1) * abs(sigma_0) * d_3 * positive(
            positive(d_3 * N_F / p.g_F) + positive(-d_3 * T[0]) + d_3 * p.l_3 * driving)
        bearings.append(D_3 * driving)
    else:
        clutches = [F[0] * (w_1 - w_0), F[1] * (w_2 - w_0)]
    d = np.sign(w_0)
    drag = p.l_0 * w_0 - p.l_1 * (w_1 - w_0) - p.l_2 * (w_2 - w_0) - sum(F)
    D_0 = (1 / p.eta_0B - 1) * abs(sigma_0) * d * positive(
        positive(d * (N_1 + N_2)) + positive(-d * C) + d * drag)
    return np.array([T[0] * driving, T[1] * w_1, T[2] * w_2, 2 * dissipation(p, *w),
                     *gears, *bearings, D_0 * w_0, *clutches])


def exact_passive(p, w, T, h, friction=None):
    """Return the terms of a tick under the passive law by a fine integration, as in a book."""
    flow = PassiveFlow(p, T, friction)
    symmetric = isinstance(p, SymmetricParameters)
    k = flow.k
    energy = symmetric_energy if symmetric else self_locking_energy

    def outputs(y):
        return np.array([y[0] + k.k_1 * y[1], y[0] - k.k_2 * y[1]])

    def rates(_, z):
        dw, ds, F_1, F_2, M_1, M_2, M_F = flow.point(*z[:2])[:7]
        M = (M_F, M_1, M_2) if symmetric else (M_1, M_2)
        return [dw, ds, *passive_powers(p, outputs(z), T, M, (F_1, F_2))]

    start = [w[0] * k.k_2 + w[1] * k.k_1, w[0] - w[1]]
    z = solve_ivp(rates, (0.0, h), start + [0.0] * 9, 'DOP853', rtol=1e-12,
                  atol=1e-12).y[:, -1]
    return np.array([*z[2:5], energy(p, *outputs(z)) - energy(p, *w), *z[5:]])


@pytest.mark.parametrize('variant', VARIANTS)
def test_each_term_under_the_passive_law_is_the_integral_of_its_power(variant):
    rng = np.random.default_rng(6)
    symmetric = is_symmetric(variant)
    p = (SymmetricParameters if symmetric else SelfLockingParameters)()
    cases = [(p, w, np.array(T) / ((p.g_F, 1.0, 1.0) if symmetric else 1.0)) for w, T in [
        ((30.0, 30.0), (300.0, -120.0, -180.0)),     # locked
        ((40.0, 20.0), (300.0, -100.0, -150.0)),     # slipping
        ((30.2, 29.8), (300.0, -250.0, 40.0)),       # slip reverses
        ((-30.2, -29.8), (300.0, -250.0, -40.0)),    # the input torque brakes
        ((0.1, -0.05), (30.0, -12.0, -18.0)),        # nearly at rest
        ((0.4, 0.2), (-200.0, 50.0, 70.0))]]         # all turns round
    cases += [(mechanism_of(variant)[0](rng), rng.normal(0, 30) + rng.normal(0, 3, 2),
               rng.normal(0, 200, 3)) for _ in range(12)]
    for p, w, T in cases:
        audit = AuditedSimulation(variant, 1e-3, p, initial_velocity=w)
        friction = None
        if variant == 'lsd_lagged':   # it knows the moments at the start, without torques
            (phi, preload), M = full_friction(p), np.abs(audit.snapshot().moment[:2])
            friction = tuple(np.array(phi) * M + preload)
        audit.advance(T)
        exact = exact_passive(p, w, T, 1e-3, friction)
        # an error of the speeds within the tolerance is worth the last term
        bound = STEP_ERROR * audit.tick.scale + 1e-3 * TOLERANCE * np.abs(T).sum()
        assert np.abs(flat(audit.tick)[:-1] - exact).max() < bound
        assert min(exact[4:]) >= 0.0 <= min(flat(audit.tick)[4:-1])


@pytest.mark.parametrize('variant', VARIANTS[:2])
def test_while_no_sign_changes_the_symmetric_terms_are_exact_under_the_passive_law(variant):
    rng = np.random.default_rng(7)
    for sign in (1, -1):
        for _ in range(6):
            p, w = random_symmetric(rng), sign * rng.uniform(400, 500, 2)
            T = rng.uniform(-1, 1, 3) * (30.0, 50.0, 50.0)
            audit = AuditedSimulation(variant, 1e-3, p, initial_velocity=w)
            audit.advance(T)
            exact = exact_passive(p, w, T, 1e-3)
            assert np.abs(flat(audit.tick)[:-1] - exact).max() < 1e-11 * audit.tick.scale
            assert abs(audit.tick.numerical) < EXACT * audit.tick.scale


# What is never negative, and what is nothing


@EACH_LAW
@EACH_VARIANT
def test_drag_and_clutches_take_energy_in_every_tick(variant, loss_law):
    rng = np.random.default_rng(6)
    for seed in range(5):
        audit = AuditedSimulation(variant, parameters=mechanism_of(variant)[0](rng),
                                  loss_law=loss_law)
        for torque in random_torques(seed):
            audit.advance(torque)
            assert min(audit.tick.viscous, *audit.tick.clutches, 0.0) >= 0.0
        assert min(audit.total.viscous, *audit.total.clutches, 1.0) > 0.0


@EACH_LAW
@EACH_VARIANT
def test_a_mechanism_without_losses_loses_nothing(variant, loss_law):
    rng = np.random.default_rng(7)
    p = lossless(mechanism_of(variant)[0](rng))
    drag = {f.name: 0.0 for f in dataclasses.fields(p) if f.name.startswith(('l_', 'mu_'))}
    audit = AuditedSimulation(variant, parameters=dataclasses.replace(p, **drag),
                              loss_law=loss_law)
    for torque in random_torques(8):
        audit.advance(torque)
        assert audit.tick.lost == 0.0
        assert abs(audit.tick.numerical) < BOUND * audit.tick.scale
        assert sum(audit.tick.work) == pytest.approx(audit.tick.stored,
                                                     abs=BOUND * audit.tick.scale)


# The total


@EACH_LAW
@EACH_VARIANT
def test_the_total_is_the_sum_of_the_ticks_and_power_is_their_rate(variant, loss_law):
    audit = AuditedSimulation(variant, 0.002, loss_law=loss_law, initial_velocity=(20.0, 10.0))
    start, total, returned = audit.stored_energy, 0.0, 0.0
    for torque in random_torques(9):
        audit.advance(torque)
        assert type(audit.tick) is Energy
        assert flat(audit.power) == pytest.approx(flat(audit.tick) / 0.002)
        total = total + flat(audit.tick)
        returned = returned - np.minimum(audit.tick.gears + audit.tick.bearings, 0.0)
    assert flat(audit.total) == pytest.approx(total, rel=1e-12, abs=1e-12 * audit.total.scale)
    assert audit.stored_energy == pytest.approx(start + audit.total.stored)
    assert tuple(audit.returned) == audit.gear_names + audit.bearing_names
    assert [r.energy for r in audit.returned.values()] == pytest.approx(returned)
    least, most = (0, 1) if loss_law == 'passive' else (1, 60)   # ticks with energy returned
    assert all(least <= r.ticks < most for r in audit.returned.values())


@EACH_LAW
@EACH_VARIANT
def test_parameters_may_change_between_ticks(variant, loss_law):
    audit = AuditedSimulation(variant, loss_law=loss_law, initial_velocity=(20.0, 10.0))
    start = audit.stored_energy
    for n, torque in enumerate(random_torques(10)):
        if n == 20:
            before = audit.stored_energy
            prefix = audit.parameters.prefix
            audit.parameters = {f'{prefix}.inertia.carrier': 0.5,
                                f'{prefix}.efficiency.carrier_bearing': 0.9}
            assert audit.stored_by_changes == pytest.approx(audit.stored_energy - before)
            assert audit.stored_by_changes != 0.0
            audit.substeps = 2
        audit.advance(torque)
        assert audit.tick.relative_residual < BOUND
    assert audit.stored_energy == pytest.approx(
        start + audit.total.stored + audit.stored_by_changes)


@EACH_VARIANT
def test_a_snapshot_keeps_its_energy_whatever_is_replaced_in_it(variant):
    audit = AuditedSimulation(variant, initial_velocity=(20.0, 10.0))
    snapshot = audit.step((30.0, -10.0, -20.0))
    changed = snapshot._replace(time=7.0)
    assert type(changed) is type(snapshot)
    assert changed.time == 7.0 and changed[1:] == snapshot[1:]
    assert (changed.energy, changed.stored_energy) == (audit.tick, audit.stored_energy)


@EACH_LAW
@EACH_VARIANT
def test_a_state_that_is_put_back_changes_what_is_stored_without_work(variant, loss_law):
    audit = AuditedSimulation(variant, loss_law=loss_law, initial_velocity=(20.0, 10.0))
    start, state = audit.stored_energy, audit.state
    for torque in random_torques(12):
        audit.advance(torque)
    audit.state = state
    assert audit.stored_energy == start
    assert audit.stored_by_changes == pytest.approx(-audit.total.stored)


@EACH_LAW
@EACH_VARIANT
def test_reset_clears_the_books(variant, loss_law):
    audit = AuditedSimulation(variant, loss_law=loss_law, initial_velocity=(20.0, 10.0))
    runs = []
    for _ in range(2):
        for torque in random_torques(11):
            audit.advance(torque)
        runs.append((audit.tick, audit.total, audit.returned, audit.worst))
        audit.reset()
        assert not flat(audit.tick).any() and not flat(audit.total).any()
        assert audit.worst == audit.stored_by_changes == 0.0
        assert {(r.ticks, r.energy) for r in audit.returned.values()} == {(0, 0.0)}
    assert repr(runs[0]) == repr(runs[1])


@EACH_LAW
@EACH_VARIANT
def test_refused_torques_leave_the_books_as_they_are(variant, loss_law):
    audit = AuditedSimulation(variant, loss_law=loss_law)
    audit.advance((30.0, -10.0, -20.0))
    before = audit.tick, audit.total, audit.worst
    out_of_range = [(1e308, 0.0, 0.0)] if variant in LSD else []
    for wrong in ((1.0, 2.0), *out_of_range):
        with pytest.raises(ValueError, match='torques'):
            audit.advance(wrong)
        assert (audit.tick, audit.total, audit.worst) == before


# Efficiency


def steady_drive(p, direction):
    """Return the books of a tick at 100 rad/s, all shafts alike, with the torque that holds it."""
    variant = 'symmetric_ode' if isinstance(p, SymmetricParameters) else 'lsd_ode'
    symmetric = isinstance(p, SymmetricParameters)
    outputs = np.array([-40.0, -40.0] if symmetric else [-40.0, -60.0]) * direction
    ratio = p.g_F if symmetric else 1.0

    def audited(torque):
        audit = AuditedSimulation(variant, 1e-3, p, initial_velocity=(100.0, 100.0))
        audit.state = audit.state._replace(power_flow=direction)
        audit.power_flow_deadband = 1e9   # the index stays
        for _ in range(20):
            audit.advance((torque, *outputs))
        return audit

    balanced = -outputs.sum() / ratio
    ends = sorted([0.5 * balanced, 2.0 * balanced])
    torque = brentq(lambda T: audited(T).tick.stored, *ends, xtol=1e-13)
    return audited(torque)


@pytest.mark.parametrize('direction', BOTH)
@pytest.mark.parametrize('p', [SymmetricParameters(), SelfLockingParameters()])
def test_measured_efficiency_is_the_rated_one_without_drag_and_less_with_it(p, direction):
    without = dataclasses.replace(p, **{
        f.name: 0.0 for f in dataclasses.fields(p) if f.name.startswith('l_')})
    assert steady_drive(without, direction).tick.efficiency == pytest.approx(
        rated_efficiency(p), rel=1e-9)
    measured = steady_drive(p, direction).tick.efficiency
    assert rated_efficiency(p) - 0.05 < measured < rated_efficiency(p) - 1e-3


def test_erratum_37_both_meshes_count():
    p = SymmetricParameters(eta_1G=0.9, eta_2G=0.98)
    without = dataclasses.replace(p, l_0=0.0, l_1=0.0, l_2=0.0, l_3=0.0, l_s=0.0)
    printed = p.eta_3B * p.eta_FG * p.eta_0B * (p.eta_1G + p.eta_1G) / 2
    assert abs(printed - rated_efficiency(p)) > 0.01
    # equal gear moments: the shafts part for a moment, but one tick from equal speeds will do
    r = SymmetricOde(without).response(1)
    load = 40.0
    M = load / (p.eta_1G + p.eta_2G) * 2
    T = np.array([-p.eta_1G * M, -p.eta_2G * M])   # (T_1, T_2) that keep both shafts steady
    T_3 = 2 * M / (p.eta_0B * p.eta_FG * p.eta_3B * p.g_F)
    assert np.abs(r.B @ [T_3, *T]).max() < 1e-9
    audit = AuditedSimulation('symmetric_ode', 1e-3, without, initial_velocity=(50.0, 50.0))
    audit.advance((T_3, *T))
    assert audit.tick.efficiency == pytest.approx(rated_efficiency(p), rel=1e-12)


def test_efficiency_is_none_where_no_power_goes_through():
    audit = AuditedSimulation('symmetric_ode')
    assert audit.tick.efficiency is None
    audit.advance((10.0, 5.0, 5.0))   # all drive
    assert audit.tick.efficiency is None


# Where the loss factors of the paper give energy back


def test_a_carrier_that_drives_with_a_little_less_than_the_load_gains_energy():
    audit = AuditedSimulation('lsd_ode', loss_law='paper', initial_velocity=(100.0, 100.0))
    audit.advance((1970.6, -800.0, -1200.0))
    assert audit.snapshot().power_flow == -1   # though the carrier drives
    assert audit.tick.efficiency > 1.01
    assert max(*audit.tick.gears, *audit.tick.bearings) < 0.0


@pytest.mark.parametrize('variant', ['symmetric_ode', 'lsd_ode'])
def test_energy_comes_back_where_the_side_that_the_index_names_takes_power(variant):
    audit = AuditedSimulation(variant, loss_law='paper')
    ticks, back = np.zeros(2, int), np.zeros(2)
    for torque in loads(variant):
        audit.advance(torque)
        tick = audit.tick
        lost = sum(tick.gears) + sum(tick.bearings)
        if lost < 0.0:
            driving = (tick.work[0] if audit.snapshot().power_flow > 0
                       else tick.work[1] + tick.work[2])
            ticks[int(driving < 0.0)] += 1
            back[int(driving < 0.0)] -= lost
    assert ticks.sum() > 2500 and ticks[1] / ticks.sum() > 0.98   # doc/energy.md
    assert back[1] / back.sum() > 0.999


@pytest.mark.parametrize('variant', ['symmetric_ode', 'lsd_ode'])
def test_the_docs_say_how_often_and_how_much_energy_comes_back(variant):
    audit = AuditedSimulation(variant, loss_law='paper')
    for torque in loads(variant):
        audit.advance(torque)
    text = (Path(__file__).parents[1] / 'doc' / 'energy.md').read_text()
    table = text.split(f'| `{variant}` | net loss')[1].split('\n\n')[0]
    net = dict(zip(audit.returned, audit.total.gears + audit.total.bearings, strict=True))
    for name, (ticks, energy) in audit.returned.items():
        row = re.search(rf'^\| `{name}` \| (.*) \| (.*) \| (.*) \|$', table, re.MULTILINE)
        documented = [float(cell.replace(',', '')) for cell in row.groups()]
        assert documented == pytest.approx([net[name], ticks, energy], rel=2e-3)
