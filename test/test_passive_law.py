# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The passive law: the paper's where all powers agree, and never a gain of energy elsewhere."""

import dataclasses
from math import atanh

from mechanisms import (
    Flow,
    is_symmetric,
    lossless,
    PassiveFlow,
    random_self_locking,
    random_symmetric,
    relative_difference,
    self_locking_lagrange,
    symmetric_lagrange,
)
import numpy as np
from properties import check_state, RANDOM, random_state
import pytest
from scipy.optimize import brentq

from dm_ros import SelfLockingParameters, Simulation, SymmetricParameters, VARIANTS
from dm_ros.energy import AuditedSimulation, rated_efficiency
from dm_ros.mechanism import clutched, passive
from dm_ros.mechanism.self_locking import SelfLockingDae, SelfLockingLagged, SelfLockingOde
from dm_ros.mechanism.symmetric import in_slip, SymmetricDae, SymmetricOde
from dm_ros.mechanism.variants import variant_named

EACH_VARIANT = pytest.mark.parametrize('variant', VARIANTS)
EACH_KIND = pytest.mark.parametrize('kind', RANDOM)
FORMULATIONS = {
    SymmetricOde: ('symmetric', 'symmetric with clutches'),
    SymmetricDae: ('symmetric', 'symmetric with clutches'),
    SelfLockingLagged: ('lsd',), SelfLockingOde: ('lsd',), SelfLockingDae: ('lsd',)}
EACH_FORMULATION = pytest.mark.parametrize('formulation, kind', [
    (formulation, kind) for formulation, kinds in FORMULATIONS.items() for kind in kinds])


def paper_response(formulation, p, flow):
    """Return the response of a formulation in (w, s)."""
    response = formulation(p).response(flow)
    return in_slip(response) if formulation in (SymmetricOde, SymmetricDae) else response

# by a root finder in extended precision, with mesh_sign_speed 0.1: speeds of the outputs, torques,
# accelerations of carrier and outputs, moments in the order of ``Simulation.moments``
SYMMETRIC_POINTS = {
    'pinion drives': (
        (100, 90), (30, -50, -45), (41.99041014593, -7419.002497655, 7502.983317947),
        (103.7267475935, 49.16119146507, 46.81367373458)),
    'outputs drive': (
        (60, 75), (-28, 52, 48), (-41.26047559631, 5923.922847881, -6006.443799074),
        (-102.2875490292, -50.94119388738, -49.07365988383)),
    'all torques brake': (
        (50, 45), (-10, -20, -18), (-741.1431193787, -3732.8688877, 2250.582648943),
        (-35.3919085832, 19.52584202042, 18.58848977456)),
    'left drives right': (
        (40, 30), (2, 6, -12), (1.076155675079, 26487.44959606, -26485.29728471),
        (6.563838708032, -1.227259072709, 7.300653018941)),
    'turning round': (
        (0.07, -0.15), (12, -20, -22), (8.270201138451, 2477.559496931, -2461.019094654),
        (43.01103001762, 20.61141213681, 21.56713496504)),
    'all torques drive': (
        (50, 45), (10, 20, 18), (693.8167519215, 3584.192269367, -2196.558765524),
        (33.0745076409, -19.35234539151, -18.39788057779)),
}
SELF_LOCKING_POINTS = {
    'carrier drives': (
        (100, 90), (300, -120, -150), (683.9274468814, -483.1091230345, 1461.951826825),
        (128.3798407221, 85.10783079964, 9.4089661054, -74.21856810394)),
    'outputs drive': (
        (-64, -60), (200, -90, -140), (-645.3420058951, 1321.12009624, -1956.316740652),
        (89.07583371868, 316.636258995, -7.263142743272, 187.9812960907)),
    'all torques brake': (
        (50, 50.3), (-60, -30, -50), (-3580.944922462, -3196.292687193, -3837.379745974),
        (12.87221243145, 54.75510384954, -1.914124794334, 26.46423533769)),
    'front drives rear': (
        (120, -40), (20, 80, -70), (709.2746988452, 1995.314333224, -148.0850574072),
        (-64.40999315582, 24.59306350297, 5.916498044701, -44.48404316407)),
    'turning round': (
        (0.06, -0.05), (100, -42, -59), (-20.82830255832, -178.5111286333, 84.29358149165),
        (42.69201227175, 49.7222495456, 1.220700994311, -9.900332951715)),
    'clutches drive the carrier': (
        (99, 100), (5, -10, 20), (356.4474939544, 439.101481158, 301.3448358186),
        (9.338150536399, 21.61540126529, -2.862318078523, 39.65104720489)),
}


def independent(k, w_1, w_2):
    """Return carrier speed and slip of two output speeds."""
    return k.k_2 * w_1 + k.k_1 * w_2, w_1 - w_2


def accelerations(k, point):
    """Return those of carrier and outputs."""
    return np.array([point[0], point[0] + k.k_1 * point[1], point[0] - k.k_2 * point[1]])


def moments(k, point):
    """Return the moments in the order of ``Simulation.moments``."""
    _, _, F_1, F_2, M_1, M_2, M_F, *_ = point
    own = [M_F, M_1, M_2] if k.g_F else [M_1, M_2]
    return np.array([*own, F_1, F_2] if k.a_1 else own)


@pytest.mark.parametrize('kind, points', [(SymmetricParameters, SYMMETRIC_POINTS),
                                          (SelfLockingParameters, SELF_LOCKING_POINTS)],
                         ids=['symmetric', 'lsd'])
def test_accelerations_and_moments_are_those_of_a_root_finder(kind, points):
    for name, (speeds, torques, expected, expected_moments) in points.items():
        flow = PassiveFlow(kind(sign_speed=0.1), torques)
        point = flow.point(*independent(flow.k, *speeds))
        assert relative_difference(accelerations(flow.k, point), expected) < 1e-11, name
        assert relative_difference(moments(flow.k, point), expected_moments) < 1e-11, name


# Where all local powers agree it is the law of the paper


def agreeing(rng, kind, direction):
    """Return random parameters, output speeds and torques of a flow in which all powers agree."""
    symmetric = kind != 'lsd'
    while True:
        p = RANDOM[kind](rng)
        sign = rng.choice([-1.0, 1.0])
        w_1, w_2 = sign * rng.uniform(5, 100) * rng.uniform(0.7, 1.4, 2)
        size = direction * sign * rng.uniform(10, 400)
        share = (0.5 if symmetric else 1 / (1 + p.g_12)) * rng.uniform(0.9, 1.1)
        T = np.array([size, -size * share, -size * (1 - share)])
        T[0] *= rng.uniform(0.9, 1.2) / (p.g_F if symmetric else 1.0)
        flow = PassiveFlow(p, T)
        k = flow.k
        w, s = independent(k, w_1, w_2)
        point = flow.point(w, s)
        M_1, M_2, M_F = point[4:7]
        N_1 = k.mean_1 * M_1 + k.half_1 * abs(M_1) * np.sign(w_1)
        N_2 = k.mean_2 * M_2 + k.half_2 * abs(M_2) * np.sign(w_2)
        powers = [T[0] * w * (k.g_F or 1.0), M_1 * w_1, M_2 * w_2, (N_1 + N_2) * w]
        if symmetric:
            powers.append(M_F * w)
        beyond = min(map(abs, (w, w_1, w_2))) > passive.SATURATED * p.sign_speed
        if beyond and min(np.array(powers) * direction) > 0 and point[7][4]:
            return p, (w, s), T, flow


@pytest.mark.parametrize('direction', [1, -1])
@EACH_FORMULATION
def test_where_all_powers_agree_it_is_the_law_of_the_paper(formulation, kind, direction):
    rng, states, friction = np.random.default_rng(1), 0, None
    while states < 2000:
        p, (w, s), T, flow = agreeing(rng, kind, direction)
        if formulation is SelfLockingLagged:   # the friction of a step before
            M = np.abs(rng.normal(0, 100, 2))
            friction = tuple(np.array(clutched.full_friction(p)[0]) * M
                             + clutched.full_friction(p)[1])
            flow = PassiveFlow(p, T, friction)
            if flow.point(w, s)[7] != PassiveFlow(p, T).point(w, s)[7]:
                continue
        states += 1
        point = flow.point(w, s)
        r = paper_response(formulation, p, direction)
        paper = Flow(p, T, direction, friction, r).point(w, s)
        expected = accelerations(flow.k, paper)
        expected_moments = direction * (r.P @ (w, s) + r.Q @ T - r.W @ paper[2:4])
        if p.has_clutches:
            expected_moments = [*expected_moments, *paper[2:4]]
        # the terms that add up to an acceleration are as large as torque over inertia
        size = np.abs(T).max() / min(p.I_0, p.I_1, p.I_2) / 100
        error = np.abs(accelerations(flow.k, point) - expected).max()
        assert error < 1e-11 * max(np.abs(expected).max(), size)
        assert relative_difference(moments(flow.k, point), expected_moments) < 1e-11


@EACH_FORMULATION
def test_it_stands_in_the_matrices_of_the_paper_with_its_own_efficiencies(formulation, kind):
    rng = np.random.default_rng(2)
    for _ in range(500):
        p, y, T = random_state(rng, kind)
        flow = PassiveFlow(p, T)
        k, point = flow.k, flow.point(*y)
        r = paper_response(formulation, p, passive.efficiencies(k, T[0], point))
        (_, _, sigma_0, sigma_1, sigma_2, _, _), (s_1, s_2, s_F, _, _) = point[8], point[7]
        n = np.array([k.mean_F + k.half_F * sigma_0 * s_F, k.mean_1 + k.half_1 * sigma_1 * s_1,
                      k.mean_2 + k.half_2 * sigma_2 * s_2])
        F, meshes = np.array(point[2:4]), len(r.P)
        e, N = r.A @ y + r.B @ T - r.C @ F, r.P @ y + r.Q @ T - r.W @ F
        assert relative_difference(e, point[:2]) < 1e-11
        assert relative_difference(N / n[-meshes:], moments(k, point)[:meshes]) < 1e-10


# Identities


@EACH_KIND
def test_at_any_state_there_is_one_solution_that_loses_and_has_the_symmetries(kind):
    rng = np.random.default_rng(3)
    for _ in range(600):
        check_state(rng, kind)


@EACH_KIND
def test_torque_and_moments_grow_together_without_drag_and_preload(kind):
    rng = np.random.default_rng(4)
    for _ in range(100):
        p, y, T = random_state(rng, kind)
        T += 1e-3   # not all zero
        nothing = {f.name: 0.0 for f in dataclasses.fields(p) if f.name.startswith(('l_', 'N_'))}
        p = dataclasses.replace(p, **nothing)
        one, ten = PassiveFlow(p, T).point(*y), PassiveFlow(p, 10 * T).point(*y)
        assert relative_difference(np.array(one[:7]) * 10, ten[:7]) < 1e-12


@EACH_KIND
def test_without_losses_it_is_lagrange_whatever_the_sign_speed(kind):
    rng = np.random.default_rng(5)
    for _ in range(200):
        p, y, T = random_state(rng, kind)
        p = lossless(p)
        flow = PassiveFlow(p, T)
        point = flow.point(*y)
        _, *outputs = accelerations(flow.k, y)
        outputs, F = np.array(outputs), point[2:4]
        expected = (self_locking_lagrange(p, outputs, T, F) if kind == 'lsd'
                    else symmetric_lagrange(p, outputs, (T[1], T[2], T[0]), F))
        assert relative_difference(accelerations(flow.k, point)[1:], expected) < 1e-11


@EACH_VARIANT
def test_without_losses_both_laws_are_one(variant):
    rng = np.random.default_rng(6)
    p = lossless((random_symmetric if is_symmetric(variant) else random_self_locking)(rng))
    pair = [Simulation(variant, parameters=p, loss_law=law) for law in ('passive', 'paper')]
    for T in np.repeat(rng.normal(0, 100, (15, 3)), 20, axis=0):
        one, other = (simulation.step(T) for simulation in pair)
        # the adaptive step allows itself an error, the exact one of the paper does not
        assert np.abs(np.subtract(one.velocity, other.velocity)).max() < 1e-3
        assert one.moment == pytest.approx(other.moment, abs=1e-2)


# Steady drives


@pytest.mark.parametrize('p, outputs, torque, share, reverse', [
    (SymmetricParameters(), (-40, -40), 24.3037, 0.9359, False),
    (SymmetricParameters(), (40, 40), -21.2476, 0.9341, True),
    (SymmetricParameters(), (-50, -50), 30.2545, 0.9398, False),
    (SymmetricParameters(), (50, 50), -26.6819, 0.9384, True),
    (SelfLockingParameters(), (-40, -60), 102.0202, 0.9802, False),
    (SelfLockingParameters(), (40, 60), -98.0050, 0.9801, True)])
def test_one_torque_holds_a_speed_with_the_share_that_is_told(
        p, outputs, torque, share, reverse):
    def acceleration(T):
        return PassiveFlow(p, (T, *outputs)).point(100.0, 0.0)[0]

    found = brentq(acceleration, *sorted((0.5 * torque, 2.0 * torque)), xtol=1e-12)
    assert found == pytest.approx(torque, abs=5e-5)
    power = found * getattr(p, 'g_F', 1.0), sum(outputs)
    ratio = -power[0] / power[1] if reverse else -power[1] / power[0]
    assert ratio == pytest.approx(share, abs=5e-5)
    torques = np.linspace(-3, 3, 400) * abs(torque)
    assert (np.diff([acceleration(T) for T in torques]) > 0).all()


@pytest.mark.parametrize('variant, torque, outputs', [
    ('symmetric_ode', 22.227, (-40.0, -40.0)), ('lsd_ode', 99.005, (-40.0, -60.0))])
def test_what_the_law_of_the_paper_holds_for_nothing_slows_down(variant, torque, outputs):
    for law, slows in (('paper', False), ('passive', True)):
        simulation = Simulation(variant, loss_law=law, initial_velocity=(100.0, 100.0))
        simulation.state = simulation.state._replace(power_flow=-1)   # index of less input power
        for _ in range(1000):
            snapshot = simulation.step((torque, *outputs))
        assert (snapshot.velocity[0] < 90.0) == slows


# What the law of the paper gets wrong


@EACH_VARIANT
def test_balanced_torques_leave_a_mechanism_at_rest_exactly(variant):
    symmetric = is_symmetric(variant)
    ratio = SymmetricParameters().g_F
    T = (100.0, -50 * ratio, -50 * ratio) if symmetric else (300.0, -120.0, -180.0)
    passive_one, paper = (Simulation(variant, loss_law=law) for law in ('passive', 'paper'))
    for _ in range(3000):
        snapshot = passive_one.step(T)
        paper.advance(T)
        assert np.abs(snapshot.velocity).max() < 1e-9
    assert abs(paper.snapshot().velocity[0]) > 100.0


@pytest.mark.parametrize('variant, ratio, shares', [
    ('symmetric_ode', SymmetricParameters().g_F, (0.5, 0.5)), ('lsd_ode', 1.0, (0.4, 0.6))])
def test_a_load_that_is_held_creeps_as_foretold(variant, ratio, shares):
    p = variant_named(variant).mechanism.parameters(sign_speed=0.1)
    p = dataclasses.replace(p, **{   # drag and preload hold, too
        f.name: 0.0 for f in dataclasses.fields(p) if f.name.startswith('l_')})
    etas = [getattr(p, name) for name in ('eta_FG', 'eta_1G') if hasattr(p, name)]
    bearings = [getattr(p, name) for name in ('eta_0B', 'eta_3B') if hasattr(p, name)]

    def transmitted(sigma):
        """Return T_out/T_in of a mechanism that turns as one."""
        product = 1.0
        for eta in etas:
            product *= ((1 + eta) - (1 - eta) * sigma) / ((1 + eta) + (1 - eta) * sigma)
        for eta in bearings:
            product /= 1 + (1 / eta - 1) * sigma
        return product

    for q in (0.3, 0.5, 0.9):   # of what can hold
        simulation = Simulation(variant, parameters=p)
        load = -100.0 * (1 - q * (1 - transmitted(1.0)))
        T = (100.0 / ratio, *(load * share for share in shares))
        for _ in range(3000):
            snapshot = simulation.step(T)
        sigma = brentq(lambda s, load=load: transmitted(s) + load / 100.0, 0.0, 1.0, xtol=1e-14)
        creep = 0.1 * atanh(sigma)
        assert snapshot.velocity[0] == pytest.approx(creep, rel=1e-4)
        assert creep == pytest.approx(0.1 * atanh(q), rel=0.03)   # as a rule of thumb


@pytest.mark.parametrize('variant, T, creep', [
    ('symmetric_ode', (100.0 / 3.517, -97.3373 / 2, -97.3373 / 2), 0.068406),
    ('lsd_ode', (100.0, -0.4 * 99.1030, -0.6 * 99.1030), 0.068966)])
def test_the_creep_of_the_defaults(variant, T, creep):
    p = variant_named(variant).mechanism.parameters(sign_speed=0.1)
    simulation = Simulation(variant, parameters=p)
    for _ in range(3000):
        snapshot = simulation.step(T)
    assert snapshot.velocity[0] == pytest.approx(creep, rel=1e-2)


def resisting(rng):
    """Return a load of one shaft that only resists: function of its speed, N m."""
    friction, drag, blunt = rng.uniform(0, 30), rng.uniform(0, 0.5), 10.0 ** rng.uniform(-2, 0.5)
    return lambda w: -friction * np.tanh(w / blunt) - drag * w


@EACH_VARIANT
def test_from_rest_to_rest_less_comes_out_than_went_in(variant):
    rng = np.random.default_rng(8)
    for _ in range(6):
        audit = AuditedSimulation(variant, parameters={
            f'{variant_named(variant).mechanism.name}.inertia.{shaft}': rng.uniform(0.2, 2.0)
            for shaft in variant_named(variant).mechanism.outputs})
        loads = resisting(rng), resisting(rng)
        work = np.zeros(3)
        given = taken = 0.0
        snapshot = audit.snapshot()
        for n in range(4000):
            if n % 250 == 0:   # the input drives and brakes, and then lets go
                drive = rng.uniform(-150, 200) if n < 2000 else 0.0
            speeds = snapshot.velocity[1:3]
            stop = -20.0 * snapshot.velocity[0] if n >= 2000 else 0.0
            T = (drive + stop, *(load(w) for load, w in zip(loads, speeds)))
            if is_symmetric(variant):
                T = (T[0] / audit.parameters.g_F, *T[1:])
            snapshot = audit.step(T)
            work = np.array(snapshot.energy.work)
            given += np.maximum(work, 0.0).sum()
            taken -= np.minimum(work, 0.0).sum()
            assert not any(r.ticks for r in audit.returned.values())
        assert audit.stored_energy < 1e-3 * given
        assert taken < given - audit.stored_energy


@EACH_VARIANT
def test_without_torque_the_kinetic_energy_falls(variant):
    rng = np.random.default_rng(9)
    for _ in range(10):
        p = (random_symmetric if is_symmetric(variant) else random_self_locking)(rng)
        audit = AuditedSimulation(variant, parameters=p, initial_velocity=rng.normal(0, 30, 2))
        before = audit.stored_energy
        for _ in range(100):
            audit.advance((0.0, 0.0, 0.0))
            assert audit.stored_energy < before or before < 1e-9
            before = audit.stored_energy


# Where energy goes, and the index


def test_losses_of_the_reference_loads():
    expected = {'symmetric_ode': (1030.2, 286.0, 161.8, 204.7, 200.7),
                'lsd_ode': (829.0, 1331.4, 1042.5)}
    for variant, losses in expected.items():
        mechanism = variant_named(variant).mechanism
        audit = AuditedSimulation(variant, parameters=mechanism.parameters(sign_speed=0.1))
        for n in range(10_000):
            audit.advance(mechanism.load(n / 1000))
        assert audit.total.gears + audit.total.bearings == pytest.approx(
            losses, rel=1e-4, abs=0.05)
        assert {tuple(r) for r in audit.returned.values()} == {(0, 0.0)}


def test_a_governed_cruise_needs_more_than_it_gives():
    p = SymmetricParameters(I_1=1.0, I_2=1.0)
    simulation = Simulation('symmetric_ode', parameters=p, initial_velocity=(20.0, 20.0))
    integral, snapshot = 50.0, simulation.snapshot()
    for _ in range(20_000):
        error = 20.0 - snapshot.velocity[0]
        integral += 10.0 * error * 0.001
        snapshot = simulation.step((10.0 * error + integral, -100.0, -100.0))
    assert snapshot.torque[0] == pytest.approx(59.6, abs=0.05)
    out_over_in = 200.0 / (snapshot.torque[0] * p.g_F)
    assert out_over_in == pytest.approx(0.954, abs=1e-3) and out_over_in < rated_efficiency(p)


def test_both_mechanisms_agree_where_they_are_the_same():
    # without final drive and clutches, with equal crown gears: the carrier as the input
    p = SymmetricParameters()
    q = SelfLockingParameters(
        R_1=0.05, R_2=0.05, g_2s=p.g_2s, n_s=p.n_s, I_0=p.I_0 + p.I_3 * p.g_F**2, I_1=p.I_1,
        I_2=p.I_2, I_s=p.I_s, l_0=p.l_0 + p.l_3 * p.g_F**2, l_1=p.l_1, l_2=p.l_2, l_s=p.l_s,
        mu_1=0.0, mu_2=0.0, N_1=0.0, N_2=0.0, eta_0B=p.eta_0B)
    p = dataclasses.replace(p, eta_FG=1.0, eta_3B=1.0)
    q = dataclasses.replace(q, eta_0B=1.0)
    p = dataclasses.replace(p, eta_0B=1.0)
    rng = np.random.default_rng(10)
    for _ in range(200):
        y, T = (rng.normal(0, 20), rng.normal(0, 20)), rng.normal(0, 50, 3)
        one = PassiveFlow(p, T).point(*y)
        other = PassiveFlow(q, T * (p.g_F, 1.0, 1.0)).point(*y)
        assert relative_difference(one[:2], other[:2]) < 1e-10
        assert relative_difference(one[4:6], other[4:6]) < 1e-10
