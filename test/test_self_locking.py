# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The three formulations of the self-locking differential are the equations of its elements."""

import itertools
import math

from mechanisms import (
    BOTH,
    Flow,
    lossless,
    mirrored_self_locking,
    random_self_locking,
    relative_difference,
    self_locking_dissipation,
    self_locking_energy,
    self_locking_lagrange,
    self_locking_speeds,
)
import numpy as np
import pytest
from scipy.optimize import brentq

from dm_ros import SelfLockingParameters
from dm_ros.mechanism import losses, self_locking
from dm_ros.mechanism.clutched import full_friction, solve_moments
from dm_ros.mechanism.self_locking import SelfLockingDae, SelfLockingLagged, SelfLockingOde
from dm_ros.motion.models import ClutchedModel

FORMULATIONS = [SelfLockingLagged, SelfLockingOde, SelfLockingDae]
IDENTITY = 1e-12   # relative: rounding
WRONG = 1e-4       # relative: beyond doubt no rounding


def cases(count=40, seed=1):
    """Yield random parameters, speeds (omega_1, omega_2), (T_0, T_1, T_2) and (F_1, F_2)."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield (random_self_locking(rng), rng.normal(0, 60, 2), rng.normal(0, 300, 3),
               rng.normal(0, 100, 2))


def slip_state(p, w):
    """Return y = (omega_0, omega_1 - omega_2)."""
    return np.array([self_locking_speeds(p, *w)[0], w[0] - w[1]])


def all_accelerations(p, dy):
    """Return (e_0, e_1, e_2, e_s) from d(omega_0, omega_1 - omega_2)/dt."""
    g = p.R_2 / p.R_1
    return self_locking_speeds(p, dy[0] + g / (1 + g) * dy[1], dy[0] - dy[1] / (1 + g))


def answer(formulation, p, direction, w, T, F):
    """Return (e_0, e_1, e_2, e_s) and (M_1, M_2) under given clutch moments."""
    r, y = formulation(p).response(direction), slip_state(p, w)
    return all_accelerations(p, r.A @ y + r.B @ T - r.C @ F), r.P @ y + r.Q @ T - r.W @ F


def viscous_moments(p, w):
    w_0, w_1, w_2, w_s = self_locking_speeds(p, *w)
    return p.l_0 * w_0, p.l_1 * (w_1 - w_0), p.l_2 * (w_2 - w_0), p.l_s * w_s


def friction_factors(p, w):
    """Return f_k, (55) and (58)."""
    w_0, w_1, w_2, _ = self_locking_speeds(p, *w)
    return (p.n_F1 * p.R_F1 / p.R_1 * p.mu_1 * math.tanh(p.c_f1 * (w_1 - w_0)),
            p.n_F2 * p.R_F2 / p.R_2 * p.mu_2 * math.tanh(p.c_f2 * (w_2 - w_0)))


def residual(p, direction, w, T, F, e, M):
    """Return the worst relative residual of (59), or of (60) as corrected."""
    (e_0, e_1, e_2, e_s), (M_1, M_2), (T_0, T_1, T_2), (F_1, F_2) = e, M, T, F
    L_0, L_1, L_2, L_s = viscous_moments(p, w)
    g_12 = p.R_2 / p.R_1
    inertial = p.I_0 * e_0, p.I_1 * e_1, p.I_2 * e_2, p.n_s * p.I_s / p.g_2s * e_s
    if direction == 1:
        moments = (
            T_0 - (M_1 + M_2) / p.eta_0B - (L_0 - L_1 - L_2 - F_1 - F_2) / p.eta_0B,
            M_1 * p.eta_1G - L_1 - F_1 + T_1,
            M_2 * p.eta_2G - L_2 - F_2 + T_2,
            M_1 * g_12 - M_2 - p.n_s / p.g_2s * L_s)
    else:
        moments = (
            p.eta_1G * M_1 + p.eta_2G * M_2 + T_0 / p.eta_0B
            - (L_0 - L_1 - L_2 - F_1 - F_2) / p.eta_0B,
            T_1 - L_1 - F_1 - M_1,
            T_2 - L_2 - F_2 - M_2,
            p.eta_2G * M_2 - p.eta_1G * g_12 * M_1 - p.n_s / p.g_2s * L_s)
    scale = max(np.abs(T).max(), np.abs(M).max(), np.abs(F).max(), np.abs(inertial).max())
    return np.abs(np.subtract(inertial, moments)).max() / scale


@pytest.mark.parametrize('direction', BOTH)
@pytest.mark.parametrize('formulation', FORMULATIONS)
def test_answer_satisfies_the_equation_of_each_element(formulation, direction):
    for p, w, T, F in cases():
        e, M = answer(formulation, p, direction, w, T, F)
        assert residual(p, direction, w, T, F, e, M) < IDENTITY


@pytest.mark.parametrize('direction', BOTH)
@pytest.mark.parametrize('formulation', [SelfLockingLagged, SelfLockingDae])
def test_all_variants_have_one_response(formulation, direction):
    for p, *_ in cases():
        for name, one, other in zip('ABCPQW', formulation(p).response(direction),
                                    SelfLockingOde(p).response(direction), strict=True):
            assert relative_difference(one, other) < IDENTITY, name


def test_speeds_of_all_elements_follow_from_the_output_shafts():
    for p, w, *_ in cases():
        speeds = self_locking_speeds(p, *w)
        assert relative_difference(self_locking.kinematics(p) @ w, speeds) < IDENTITY
        assert relative_difference(SelfLockingDae(p).lift() @ slip_state(p, w), speeds) < IDENTITY


@pytest.mark.parametrize('direction', BOTH)
def test_accelerations_of_the_constrained_system_keep_the_constraints(direction):
    for p, w, T, F in cases():
        G_D, g_T, g_L, g_F = SelfLockingDae(p).system(direction)
        x = np.linalg.solve(G_D, g_T @ T - g_L @ self_locking_speeds(p, *w) - g_F @ F)
        assert relative_difference(x[:4], self_locking_speeds(p, x[1], x[2])) < IDENTITY


@pytest.mark.parametrize('direction', BOTH)
@pytest.mark.parametrize('formulation', FORMULATIONS)
def test_exchange_of_front_and_rear_exchanges_the_answer(formulation, direction):
    for p, w, T, F in cases():
        e, M = answer(formulation, p, direction, w, T, F)
        e_m, M_m = answer(formulation, mirrored_self_locking(p), direction,
                          w[::-1], T[[0, 2, 1]], F[::-1])
        assert relative_difference(e_m, e[[0, 2, 1, 3]] * [1, 1, 1, -1]) < IDENTITY
        assert relative_difference(M_m, M[::-1]) < IDENTITY


@pytest.mark.parametrize('direction', BOTH)
@pytest.mark.parametrize('formulation', FORMULATIONS)
def test_without_losses_the_answer_is_that_of_lagrange(formulation, direction):
    for p, w, T, F in cases():
        p = lossless(p)
        e, _ = answer(formulation, p, direction, w, T, F)
        assert relative_difference(e[1:3], self_locking_lagrange(p, w, T, F)) < IDENTITY


@pytest.mark.parametrize('direction', BOTH)
def test_power_of_the_torques_is_stored_or_lost(direction):
    for p, w, T, F in cases():
        e, (M_1, M_2) = answer(SelfLockingOde, p, direction, w, T, F)
        w_0, w_1, w_2, _ = self_locking_speeds(p, *w)
        y = slip_state(p, w)
        kinetic = (self_locking_energy(p, *(w + e[1:3]))
                   - self_locking_energy(p, *(w - e[1:3]))) / 2
        lost = losses.self_locking(
            losses.self_locking_losses(p, direction), y[0]**2, y[0] * y[1], y[1]**2,
            *np.outer([*F, M_1, M_2], y).ravel(), T[0] * w_0)
        assert lost[0] == pytest.approx(2 * self_locking_dissipation(p, *w), rel=1e-12)
        scale = np.abs(T * (w_0, w_1, w_2)).sum() + abs(kinetic) + np.abs(lost).sum()
        assert abs(T @ (w_0, w_1, w_2) - kinetic - sum(lost)) < IDENTITY * scale


# The clutch friction


def random_flows(direction, count, seed):
    """Yield p, (omega_1, omega_2), T and (dw, ds, F_1, F_2, M_1, M_2) of the whole model."""
    rng = np.random.default_rng(seed)
    for _ in range(count // 20):
        p = random_self_locking(rng)
        for _ in range(20):
            T = rng.normal(0, 300, 3)
            w = rng.normal(0, 30) + rng.normal(0, 1, 2) * 10.0 ** rng.uniform(-3, 1)
            yield p, w, T, Flow(p, T, direction).point(*slip_state(p, w))[:6]


@pytest.mark.parametrize('direction', BOTH)
def test_flow_satisfies_the_equation_of_each_element_with_the_friction_of_the_clutches(direction):
    for p, w, T, (dw, ds, *F, M_1, M_2) in random_flows(direction, 1000, seed=3):
        M = M_1, M_2
        assert residual(p, direction, w, T, F, all_accelerations(p, (dw, ds)), M) < 1e-11
        expected = [f_k * (abs(M_k) * math.tan(p.alpha) + p.n_s * N_k * R_k) for f_k, M_k, N_k, R_k
                    in zip(friction_factors(p, w), M, (p.N_1, p.N_2), (p.R_1, p.R_2), strict=True)]
        assert np.abs(np.subtract(F, expected)).max() < 1e-11 * max(1, *np.abs(T), *np.abs(M))


@pytest.mark.parametrize('direction', BOTH)
def test_friction_opposes_the_slip_of_each_shaft_against_the_carrier(direction):
    for p, w, _, (_, _, F_1, F_2, _, _) in random_flows(direction, 1000, seed=4):
        w_0, w_1, w_2, _ = self_locking_speeds(p, *w)
        assert (w_1 - w_0) * (w_2 - w_0) < 0
        assert F_1 * (w_1 - w_0) > 0 and F_2 * (w_2 - w_0) > 0


@pytest.mark.parametrize('direction', BOTH)
def test_reversal_of_all_torques_and_speeds_reverses_the_flow(direction):
    for p, w, T, flow in random_flows(direction, 1000, seed=5):
        reversed_ = Flow(p, -T, direction).point(*slip_state(p, -w))[:6]
        assert relative_difference(reversed_, np.negative(flow)) < IDENTITY


def matching_patterns(z, W, x):
    """Return the moments of every sign pattern that agrees with its own solution."""
    found = []
    for signs in itertools.product((1, -1), repeat=2):
        M = np.linalg.solve(np.eye(2) + W @ np.diag(np.multiply(x, signs)), z)
        if (M * signs > 0).all():
            found.append(M)
    return found


@pytest.mark.parametrize('direction', BOTH)
def test_exactly_one_sign_pattern_of_the_moments_matches_and_is_found(direction):
    rng = np.random.default_rng(6)
    for _ in range(400):
        p = random_self_locking(rng, share=rng.choice([None, 0.999]))
        W = SelfLockingOde(p).response(direction).W
        for _ in range(10):
            z = rng.normal(0, 300, 2)
            x = np.array(p.f) * math.tan(p.alpha) * rng.choice([1, -1]) * [1, -1]
            x *= rng.choice([1.0, rng.uniform()])
            matching = matching_patterns(z, W, x)
            assert len(matching) == 1
            assert relative_difference(solve_moments(z, W, x), matching[0]) < 1e-9


@pytest.mark.parametrize('direction', BOTH)
def test_moments_solve_their_equation_also_where_they_vanish(direction):
    p = SelfLockingParameters()
    W, (phi, _) = SelfLockingOde(p).response(direction).W, full_friction(p)
    x = np.array([1, -1]) * phi
    for M in ([0.0, 0.0], [0.0, 5.0], [-5.0, 0.0]):
        z = M + W @ (x * np.abs(M))
        assert solve_moments(z, W, x) == pytest.approx(M, abs=1e-12)


@pytest.mark.parametrize('direction', BOTH)
def test_lagged_friction_is_that_of_the_given_moments(direction):
    for p, w, T, _ in random_flows(direction, 200, seed=7):
        model, before = ClutchedModel(SelfLockingLagged, p, 1e-3), (12.0, 34.0)
        _, _, end, _, point, _, _ = model.step(
            tuple(slip_state(p, w)), model.friction(before, (0.0, 0.0)), tuple(T), direction)
        g = p.R_2 / p.R_1
        w_end = end[0] + g / (1 + g) * end[1], end[0] - end[1] / (1 + g)
        F = [f_k * (abs(M_k) * math.tan(p.alpha) + p.n_s * N_k * R_k) for f_k, M_k, N_k, R_k
             in zip(friction_factors(p, w_end), before, (p.N_1, p.N_2), (p.R_1, p.R_2),
                    strict=True)]
        _, M = answer(SelfLockingOde, p, direction, w_end, T, F)
        assert point[2:6] == pytest.approx((*F, *M), rel=1e-9, abs=1e-9 * np.abs(T).max())
        assert model.remembered(point, direction) == (abs(point[4]), abs(point[5]))


@pytest.mark.parametrize('direction', BOTH)
def test_gears_part_the_torque_40_to_60_while_the_slip_stays(direction):
    p = SelfLockingParameters()
    flow = Flow(p, (300.0, -100.0, -200.0), direction)
    slip = brentq(lambda s: flow.point(10.0, s)[1], -1, 1)
    *_, F_1, F_2, M_1, M_2 = flow.point(10.0, slip)[:6]
    assert min(abs(F_1), abs(F_2)) > 1 and abs(slip) > 1e-3
    assert M_1 / (M_1 + M_2) == pytest.approx(0.4, abs=1e-3)


# Errata: what is printed fails an identity that the corrected form holds.


def printed_54(p):
    """Return L from omega_D with the second crown gear supported by the housing."""
    g_D = self_locking.kinematics(p)
    return self_locking.viscosities(p) @ (g_D - np.outer([0, 1, 0, 0], g_D[0]))


class Printed60(SelfLockingDae):
    def system(self, direction):
        G_D, *others = super().system(direction)
        if direction == -1:
            G_D[3, 5] *= self.p.n_s
        return G_D, *others


class Printed86(SelfLockingDae):
    def system(self, direction):
        G_D, g_T, g_L, g_F = super().system(direction)
        g_L[:, 0] += g_L[:, 2]   # takes the -1 out of the third row of e_omega
        return G_D, g_T, g_L, g_F


class Printed472(SelfLockingDae):
    def system(self, direction):
        G_D, g_T, g_L, g_F = super().system(direction)
        g_T[0, 0] = 1
        return G_D, g_T, g_L, g_F


ERRATA_PARAMETERS = SelfLockingParameters(eta_0B=0.95, l_2=0.5, eta_1G=0.93)
ERRATA_CASE = np.array([80.0, -50.0]), np.array([120.0, -70.0, 90.0]), np.array([11.0, -5.0])


@pytest.mark.parametrize('printed', [Printed60, Printed86, Printed472])
def test_erratum_printed_form_fails_the_equations_of_the_elements(printed):
    p, (w, T, F) = ERRATA_PARAMETERS, ERRATA_CASE
    assert residual(p, -1, w, T, F, *answer(printed, p, -1, w, T, F)) > WRONG
    assert residual(p, -1, w, T, F, *answer(SelfLockingDae, p, -1, w, T, F)) < IDENTITY


@pytest.mark.parametrize('printed', [Printed60, Printed86])
def test_erratum_printed_form_fails_lagrange(printed):
    p, (w, T, F) = lossless(ERRATA_PARAMETERS), ERRATA_CASE
    expected = self_locking_lagrange(p, w, T, F)
    assert relative_difference(answer(printed, p, -1, w, T, F)[0][1:3], expected) > WRONG
    assert relative_difference(answer(SelfLockingDae, p, -1, w, T, F)[0][1:3],
                               expected) < IDENTITY


@pytest.mark.parametrize('printed', [Printed60, Printed86, Printed472])
def test_erratum_printed_form_sets_the_variants_apart(printed):
    p, (w, T, F) = ERRATA_PARAMETERS, ERRATA_CASE
    e, _ = answer(SelfLockingOde, p, -1, w, T, F)
    assert relative_difference(answer(printed, p, -1, w, T, F)[0], e) > WRONG


def test_erratum_53_satellite_speed_follows_from_the_rear_shaft():
    for p, w, *_ in cases():
        w_0, w_1, w_2, w_s = self_locking_speeds(p, *w)
        assert relative_difference((w_2 - w_0) / p.g_2s, w_s) < IDENTITY
        assert relative_difference((w_1 - w_0) / p.g_2s, w_s) > WRONG   # as printed
        assert relative_difference(-(w_1 - w_0) / (p.g_2s * p.R_2 / p.R_1), w_s) < IDENTITY


@pytest.mark.parametrize('direction', BOTH)
@pytest.mark.parametrize('formulation', [SelfLockingLagged, SelfLockingOde])
def test_erratum_54_printed_support_of_the_rear_crown_gear_fails(
        formulation, direction, monkeypatch):
    p, (w, T, F) = ERRATA_PARAMETERS, ERRATA_CASE
    monkeypatch.setattr(self_locking, 'viscous', printed_54)
    assert residual(p, direction, w, T, F, *answer(formulation, p, direction, w, T, F)) > WRONG


def test_erratum_54_printed_support_of_the_rear_crown_gear_would_create_energy():
    p, w = SelfLockingParameters(l_0=1e-6, l_1=1e-6, l_s=1e-6), np.array([50.0, 10.0])
    w_0, w_1, w_2, w_s = self_locking_speeds(p, *w)

    def dissipated(L):   # L_1 and L_2 react on the carrier, (59)
        return (L[0] - L[1] - L[2]) * w_0 + L[1] * w_1 + L[2] * w_2 + p.n_s * L[3] * w_s

    assert dissipated(printed_54(p) @ w) < -0.1
    assert dissipated(self_locking.viscous(p) @ w) == pytest.approx(
        2 * self_locking_dissipation(p, *w))
    assert dissipated(self_locking.viscous(p) @ w) > 0


def test_erratum_54_speeds_of_all_elements_are_g_D_times_omega_D():
    g_D = self_locking.kinematics(SelfLockingParameters())
    with pytest.raises(ValueError):
        np.ones((2, 1)) @ g_D   # omega_D g_D, as printed
    assert g_D @ np.ones(2) == pytest.approx([1, 1, 1, 0])


def test_erratum_76_friction_reaches_all_four_equations_of_variant_2():
    for p, w, T, F in cases(5):
        G_D, eta_t, eta_l, eta_f = SelfLockingOde(p).system(-1)
        rest = eta_t @ T - eta_l @ viscous_moments(p, w)
        with pytest.raises(ValueError):
            rest - eta_f[:3] @ F   # three rows, as printed
        printed = np.linalg.solve(G_D, rest - np.vstack([eta_f[:3], [0, 0]]) @ F)
        corrected = np.linalg.solve(G_D, rest - eta_f @ F)
        for x, holds in ((printed, False), (corrected, True)):
            error = residual(p, -1, w, T, F, self_locking_speeds(p, *x[:2]), x[2:])
            assert error < IDENTITY if holds else error > WRONG


def test_erratum_85_friction_factors_act_as_a_diagonal_matrix():
    for p, w, _, F in cases(5):
        f_Z = np.array([0, 0, 0, 0, *friction_factors(p, w)])
        x = np.array([0, 0, 0, 0, *F])
        *_, g_F = SelfLockingDae(p).system(1)
        H = np.hstack([np.zeros((6, 4)), g_F])
        with pytest.raises(ValueError):
            H @ f_Z[:, None] @ np.diag(np.sign(x))   # as printed
        assert relative_difference(H @ np.diag(f_Z) @ np.diag(np.sign(x)) @ x,
                                   g_F @ (f_Z[4:] * np.abs(F))) < IDENTITY
