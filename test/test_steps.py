# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The fixed-step integrators are right beside exact and adaptive solutions."""

import dataclasses

from mechanisms import (
    BOTH,
    Flow,
    PassiveFlow,
    random_self_locking,
    random_symmetric,
    relative_difference,
    self_locking_energy,
    symmetric_energy,
)
import numpy as np
import pytest
from scipy.integrate import odeint, solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

from dm_ros import SelfLockingParameters, Simulation, SymmetricParameters
from dm_ros.mechanism import clutched
from dm_ros.mechanism.symmetric import SymmetricOde
from dm_ros.motion import adaptive, held_torque
from dm_ros.motion.adaptive import PAPER, PASSIVE, rosenbrock_part
from dm_ros.motion.exponentials import apply_phi_2, complex_phi_2, held_propagator, phi_2
from dm_ros.motion.quadrature import rule_for, RULES

# The exact step


@pytest.mark.parametrize('h', [1e-4, 5e-3, 0.1, 1.0])
@pytest.mark.parametrize('direction', BOTH)
def test_held_torque_step_is_the_solution_of_an_adaptive_solver(direction, h):
    rng = np.random.default_rng(1)
    for _ in range(3):
        response = SymmetricOde(random_symmetric(rng)).response(direction)
        x, u = rng.normal(0, 50, 2), rng.normal(0, 20, 3)
        k = held_torque.held_torque_step(response.A, response.B, h)
        solution = solve_ivp(
            lambda t, z, A=response.A, b=response.B @ u: np.concatenate([A @ z[:2] + b, z[:2]]),
            (0, h), [*x, 0, 0], 'DOP853', rtol=1e-13, atol=1e-13).y[:, -1]
        speeds, integral = held_torque.step(k, x, u)
        assert relative_difference(speeds, solution[:2]) < 1e-11
        assert relative_difference(integral, solution[2:]) < 1e-11


@pytest.mark.parametrize('h', [1e-3, 0.1])
def test_two_half_steps_are_one_exact_step(h):
    rng = np.random.default_rng(2)
    for _ in range(10):
        r = SymmetricOde(random_symmetric(rng)).response(1)
        Phi, Gamma, Psi, Theta = held_propagator(r.A, r.B, h)
        half_Phi, half_Gamma, half_Psi, half_Theta = held_propagator(r.A, r.B, h / 2)
        assert relative_difference(half_Phi @ half_Phi, Phi) < 1e-13
        assert relative_difference(half_Phi @ half_Gamma + half_Gamma, Gamma) < 1e-13
        assert relative_difference(half_Psi + half_Psi @ half_Phi, Psi) < 1e-13
        assert relative_difference(2 * half_Theta + half_Psi @ half_Gamma, Theta) < 1e-13


# phi_2


def phi_2_by_expm(Z):
    """Return phi_2(Z) out of the exponential of (Z I 0; 0 0 I; 0 0 0)."""
    n = len(Z)
    big = np.zeros((3 * n, 3 * n))
    big[:n, :n], big[:n, n:2 * n], big[n:2 * n, 2 * n:] = Z, np.eye(n), np.eye(n)
    return expm(big)[:n, 2 * n:]


def with_eigenvalues(rng, high, low):
    V = np.array([[1, rng.uniform(-0.8, 0.8)], [rng.uniform(-0.8, 0.8), 1]])
    return V @ np.diag([high, low]) @ np.linalg.inv(V)


def rotation(rng, real, imaginary):
    V = np.array([[1, rng.uniform(-0.8, 0.8)], [rng.uniform(-0.8, 0.8), 1]])
    return V @ np.array([[real, imaginary], [-imaginary, real]]) @ np.linalg.inv(V)


MATRICES = {
    'small': lambda rng: rng.normal(0, 1e-3, (2, 2)),
    'medium': lambda rng: rng.normal(0, 3, (2, 2)),
    'stiff at 1 kHz': lambda rng: with_eigenvalues(rng, -0.1e-3, -50.0),
    'stiff at 1 Hz': lambda rng: with_eigenvalues(rng, -0.1, -5e4),
    'nearly equal': lambda rng: with_eigenvalues(rng, z := rng.uniform(-9, 0), z + 1e-9),
    'close': lambda rng: with_eigenvalues(rng, z := rng.uniform(-9, 0), z + 1.9e-4),
    'at the switch of the series': lambda rng: with_eigenvalues(rng, -0.0199, -0.0201),
    'equal': lambda rng: rng.uniform(-9, 0) * np.eye(2),
    'defective': lambda rng: np.array([[z := rng.uniform(-9, 0), rng.normal()], [0, z]]),
    'complex': lambda rng: rotation(rng, rng.uniform(-5, 0), rng.uniform(0.1, 5)),
    'nearly real': lambda rng: rotation(rng, rng.uniform(-5, 0), 1e-6),
    'zero': lambda rng: np.zeros((2, 2)),
}
MEETING = ('nearly equal', 'defective', 'nearly real')


@pytest.mark.parametrize('kind', MATRICES)
def test_phi_2_of_a_matrix_is_that_of_the_matrix_exponential(kind):
    rng = np.random.default_rng(3)
    for _ in range(20):
        Z, v = MATRICES[kind](rng), rng.normal(0, 1, 2)
        expected = phi_2_by_expm(Z)
        error = np.abs(apply_phi_2(*Z.ravel(), *v) - expected @ v).max()
        # where eigenvalues meet, a difference to both sides by 1e-3 stands for the derivative:
        # it errs by 1e-6/6 of the third derivative, which is at most 1/20
        meeting = 1e-6 / 120 * np.linalg.norm(Z - np.trace(Z) / 2 * np.eye(2)) * np.abs(v).max()
        assert error < 1e-10 * np.abs(expected).max() * np.abs(v).max() + (
            meeting if kind in MEETING else 0)


@pytest.mark.parametrize('z', [0.0, 1e-9, -1e-3, -0.0199999, -0.0200001, 0.02, -1.0, 3.0, -5e4,
                               0.01j, 0.01 + 0.02j, 0.03 + 0.04j, -2 + 7j])
def test_phi_2_of_a_number_is_its_series_or_definition(z):
    if abs(z) < 10:
        terms = [1 / 2]
        for k in range(3, 90):
            terms.append(terms[-1] * z / k)
        value = complex(*complex_phi_2(z.real, z.imag)) if z.imag else phi_2(z)
        assert value == pytest.approx(sum(terms), rel=2e-12)
    else:
        assert phi_2(z) == pytest.approx((np.exp(z) - 1 - z) / z**2, rel=1e-14)


def test_a_path_that_is_stiff_beyond_all_numbers_has_the_finest_rule():
    assert rule_for((-1e308, 0.0, 0.0, -1e308), 10.0) is RULES[-1]


# The adaptive step: one part

SLIPPING = SelfLockingParameters(c_f1=0.5, c_f2=0.5)
SLIPPING_TORQUE = (300.0, -100.0, -190.0)
TURNING = SymmetricParameters(sign_speed=3.0)    # the left shaft turns round, slowly


def slipping(law):
    """Return a flow that is curved all the way, and where to begin."""
    if law is PAPER:
        return Flow(SLIPPING, SLIPPING_TORQUE, 1), (40.0, 4.0)
    return PassiveFlow(SLIPPING, SLIPPING_TORQUE), (40.0, 4.0)


def turning(law):
    return PassiveFlow(TURNING, (2.0, -3.0, -3.5)), (2.0, 1.0)


CURVED = [(slipping, PAPER), (slipping, PASSIVE), (turning, PASSIVE)]
LENGTHS = {slipping: (4e-4, 2e-4, 1e-4), turning: (4e-3, 2e-3, 1e-3)}   # s, of one part
curved = pytest.mark.parametrize('make, law', CURVED, ids=['paper', 'passive', 'turning'])


def solution(flow, start, end):
    """Return the exact speeds and their integral."""
    return solve_ivp(lambda t, z: (*flow.point(*z[:2])[:2], *z[:2]), (0, end), [*start, 0, 0],
                     'DOP853', rtol=1e-13, atol=1e-14).y[:, -1]


def orders(errors):
    return np.log2(np.divide(errors[:-1], errors[1:]))


@pytest.mark.parametrize('direction', BOTH)
def test_jacobian_is_the_slope_of_the_slope_under_the_law_of_the_paper(direction):
    rng = np.random.default_rng(4)
    for _ in range(100):
        flow = Flow(random_self_locking(rng), rng.normal(0, 300, 3), direction)
        y, d = np.array([rng.normal(0, 30), rng.normal(0, 0.3)]), 1e-5
        differences = np.array([
            np.subtract(flow.point(*(y + e))[:4], flow.point(*(y - e))[:4]) / (2 * d)
            for e in d * np.eye(2)]).T
        J, gradient = (np.reshape(m, (2, 2)) for m in flow.jacobian(*y))
        assert relative_difference(J, differences[:2]) < 1e-6
        assert relative_difference(gradient, differences[2:]) < 1e-6


@pytest.mark.parametrize('random', [random_symmetric, random_self_locking])
def test_jacobian_is_the_slope_of_the_slope_under_the_passive_law(random):
    rng = np.random.default_rng(4)
    seen = 0
    for _ in range(300):
        p = dataclasses.replace(random(rng), sign_speed=10.0 ** rng.uniform(-1, 1))
        flow = PassiveFlow(p, rng.normal(0, 200, 3))
        y, d = np.array([rng.normal(0, 3), rng.normal(0, 1)]), 1e-5
        near = [flow.point(*(y + e)) for e in d * np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])]
        if len({(point[7], y[0] > 0) for point in near}) > 1:
            continue   # across a kink
        seen += 1
        differences = np.transpose([np.subtract(near[n][:2], near[n + 1][:2]) / (2 * d)
                                    for n in (0, 2)])
        J, _ = flow.jacobian(*y)
        assert relative_difference(np.reshape(J, (2, 2)), differences) < 1e-5
    assert seen > 290


@pytest.mark.parametrize('order', [2, 3])
@curved
def test_error_of_fixed_parts_falls_with_the_order(make, law, order):
    flow, start = make(law)
    end, errors = 0.04, []
    exact = solution(flow, start, end)[:2]
    for parts in (64, 128, 256, 512):
        y, h = np.array(start), end / parts
        for _ in range(parts):
            d, _, c = rosenbrock_part(law, flow.k, flow.u, *y, flow.point(*y),
                                      flow.jacobian(*y)[0], h)
            y = y + d + (np.array(c) if order == 3 else 0)
        errors.append(np.abs(y - exact).max())
    assert ((orders(errors) > order - 0.3) & (orders(errors) < order + 0.3)).all()


@curved
def test_integral_over_one_part_errs_with_the_fifth_power_of_its_length(make, law):
    flow, start = make(law)
    errors = []
    for h in LENGTHS[make]:
        _, integral, _, _, parts = flow.step(start, h, tolerance=1.0)
        assert len(parts) == 1
        errors.append(np.abs(integral - solution(flow, start, h)[2:]))
    assert (orders(errors) > 4.5).all()   # 4 without h c/4


FULL_SLIP = {'direct': lambda T: Flow(SelfLockingParameters(), T, 1),
             'reverse': lambda T: Flow(SelfLockingParameters(), T, -1),
             'passive': lambda T: PassiveFlow(SelfLockingParameters(), T)}


@pytest.mark.parametrize('h', [1e-3, 0.1])
@pytest.mark.parametrize('law', FULL_SLIP)
@pytest.mark.parametrize('slip', [2000.0, -2000.0])
def test_step_of_a_fully_slipping_clutch_is_exact(slip, law, h):
    flow, y = FULL_SLIP[law]((300.0, -120.0, -180.0)), np.array([50.0, slip])
    A = np.reshape(flow.jacobian(*y)[0], (2, 2))
    z = np.zeros((5, 5))   # (integral, y, 1)
    z[:2, 2:4], z[2:4, 2:4], z[2:4, 4] = np.eye(2), A, flow.point(*y)[:2] - A @ y
    exact = expm(z * h) @ [0, 0, *y, 1]
    assert exact[3] * slip > 0 and abs(exact[3]) > 20   # slips fully up to the end
    got, integral, _, coarse, _ = flow.step(y, h)
    assert relative_difference(got, exact[2:4]) < 1e-12
    assert relative_difference(integral, exact[:2]) < 1e-12
    assert not coarse


def test_step_beyond_its_bound_of_work_is_coarse_stable_and_says_so():
    torque, start, h = (3000.0, -1000.0, -1900.0), (10.0, -30.0), 0.05
    for flow in (Flow(SelfLockingParameters(), torque, 1),
                 PassiveFlow(SelfLockingParameters(), torque)):
        bounded = flow.law._replace(most_trials=2)
        (w, slip), _, _, coarse, _ = adaptive.step(bounded, flow.k, flow.u, start, h)
        (w_fine, slip_fine), _, _, fine, _ = flow.step(start, h)
        assert (coarse, fine) == (True, False)
        assert abs(slip - slip_fine) < 30 and abs(w - w_fine) < 0.2 * abs(w_fine - 10)


@pytest.mark.parametrize('law', FULL_SLIP)
def test_parts_lead_from_the_start_to_the_end_of_the_step(law):
    flow, start = FULL_SLIP[law]((400.0, -250.0, -100.0)), (10.0, 3.0)
    end, integral, point, _, parts = flow.step(start, 5e-3)
    assert len(parts) > 1
    at, whole, turned = np.array(start), 0.0, 0.0
    for y, f, J, _, h, d, c, angle, straight, here, there in parts:
        assert not straight and at == pytest.approx(y, rel=1e-14)
        assert f == here[:2] and here[:6] == pytest.approx(flow.point(*y)[:6], rel=1e-12)
        assert J == pytest.approx(flow.jacobian(*y)[0], rel=1e-12)
        assert abs(c[0]) + abs(c[1]) <= (
            adaptive.TOLERANCE + flow.law.relative * np.abs(d).sum())
        at = at + d + c
        assert there[:6] == pytest.approx(flow.point(*at)[:6], rel=1e-9, abs=1e-9)
        whole, turned = whole + h, turned + np.array(angle)
    assert whole == pytest.approx(5e-3, rel=1e-14)
    assert at == pytest.approx(end, rel=1e-14) and turned == pytest.approx(integral, rel=1e-14)
    assert there == point


def test_error_estimate_sees_a_slip_that_reverses_within_one_part():
    # frozen friction, steep: with parts of 0.16 ms the forward estimate vanishes by chance
    # while the slip crosses the whole of tanh
    p = SelfLockingParameters(c_f1=50.0, c_f2=50.0)
    y, torque = (-20.95807993, 0.04110333), (-178.7980973, -51.90204872, 6.36334593)
    friction = tuple(
        a * M + b for a, M, b in zip(clutched.full_friction(p)[0], (17.81272556, 26.71951208),
                                     clutched.full_friction(p)[1], strict=True))
    for flow in (Flow(p, torque, 1, friction), PassiveFlow(p, torque, friction)):
        exact = solve_ivp(lambda t, y, flow=flow: flow.point(*y)[:2], (0, 1e-3), y, 'Radau',
                          rtol=1e-11, atol=1e-11).y[:, -1]
        got, _, _, coarse, _ = flow.step(y, 1e-3)
        assert not coarse
        assert np.abs(got - exact).max() < 1e-3


# The last resort of the law of the paper


@pytest.mark.parametrize('torque', [(400.0, -160.0, -240.0), (3000.0, -1000.0, -1900.0)])
@pytest.mark.parametrize('direction', BOTH)
def test_backward_euler_solves_its_equation_and_nears_rest_of_slip_whatever_the_step(
        torque, direction):
    flow = Flow(SelfLockingParameters(), torque, direction)

    def rest_of_slip(w):
        return brentq(lambda s: flow.point(w, s)[1], -50, 50, xtol=1e-14)

    for distance in (-5.0, -0.1, 1e-3, 0.1, 5.0):
        for h in 10.0 ** np.arange(-4.0, 2):
            start = rest_of_slip(10.0) + distance
            (w, slip), _ = flow.last_resort((10.0, start), h)
            rest = rest_of_slip(w)
            assert abs(slip - rest) < abs(start - rest)
            # brentq stops at 1e-12 rad/s, where the slope is steep
            assert slip - start == pytest.approx(
                h * flow.point(w, slip)[1], rel=1e-6, abs=1e-6 * h)


def test_backward_euler_reaches_the_steady_state_in_one_long_step():
    flow = Flow(SelfLockingParameters(), (30.0, -10.0, -19.0), 1)
    y = 150.0, 0.0
    for _ in range(30):
        y, _ = flow.last_resort(y, 1e6)
    assert flow.point(*y)[:2] == pytest.approx((0, 0), abs=1e-3)


# The last resort of the passive law


@curved
def test_the_last_resort_is_of_first_order(make, law):
    flow, start = make(law)
    end, errors = 0.02, []
    exact = solution(flow, start, end)[:2]
    for parts in (40, 80, 160):
        y = start
        for _ in range(parts):
            y, _ = flow.last_resort(y, end / parts)
        errors.append(np.abs(np.subtract(y, exact)).max())
    assert ((orders(errors) > 0.8) & (orders(errors) < 1.2)).all()


@pytest.mark.parametrize('random, energy', [(random_symmetric, symmetric_energy),
                                            (random_self_locking, self_locking_energy)])
def test_the_last_resort_makes_no_energy_and_loses_what_is_lost_at_its_end(random, energy):
    rng = np.random.default_rng(5)
    for _ in range(60):
        p = random(rng)
        T, h = rng.normal(0, 10.0 ** rng.uniform(0, 4), 3), 10.0 ** rng.uniform(-5, 1)
        flow = PassiveFlow(p, T)
        k = flow.k
        y = rng.normal(0, 50) * rng.integers(0, 2), rng.normal(0, 10)
        (w, s), integral = flow.last_resort(y, h)
        assert integral == (h * w, h * s)
        stored = energy(p, w + k.k_1 * s, w - k.k_2 * s) - energy(
            p, y[0] + k.k_1 * y[1], y[0] - k.k_2 * y[1])
        work = h * (T[0] * (k.g_F or 1.0) * w + T[1] * (w + k.k_1 * s) + T[2] * (w - k.k_2 * s))
        # the rest is the energy of the way itself, lost to the step
        way = energy(p, *(w - y[0] + x * (s - y[1]) for x in (k.k_1, -k.k_2)))
        lost = h * sum(flow.lost(w, s))
        scale = abs(work) + abs(stored) + lost
        assert min(flow.lost(w, s)) >= 0.0
        assert stored <= work + 1e-9 * scale
        assert stored + way + lost == pytest.approx(work, abs=1e-7 * scale)


# Whole trajectories


class Reference:
    """A differential by LSODA to 1e-10, tick by tick on its own state."""

    def __init__(self, variant, loss_law, p, h):
        self.p, self.h, self.lagged = p, h, variant == 'lsd_lagged'
        self.loss_law, self.direction, self.y, self.M = loss_law, 1, np.zeros(2), (0.0, 0.0)

    def friction(self):
        """Return the friction of the lagged variant, which knows only the last M; else None."""
        if self.lagged:
            phi, preload = clutched.full_friction(self.p)
            return tuple(a * abs(m) + b for a, m, b in zip(phi, self.M, preload, strict=True))

    def flow(self, T):
        if self.loss_law == 'passive':
            return PassiveFlow(self.p, T, self.friction())
        w_0, w_1, w_2 = self.speeds(self.y)
        power_in, power_out = abs(T[0] * w_0), abs(T[1] * w_1 + T[2] * w_2)
        if power_in or power_out:
            self.direction = 1 if power_in > power_out else -1
        return Flow(self.p, T, self.direction, self.friction())

    def step(self, T):
        """Return the speeds of carrier and both outputs, and their integrals over the tick."""
        flow = self.flow(T)

        def f(t, z):
            return (*flow.point(z[0], z[1])[:2], z[0], z[1])

        def J(t, z):
            (a, b, c, d), _ = flow.jacobian(z[0], z[1])
            return [[a, b, 0, 0], [c, d, 0, 0], [1, 0, 0, 0], [0, 1, 0, 0]]

        z = odeint(f, [*self.y, 0, 0], [0, self.h], Dfun=J, tfirst=True, rtol=1e-10, atol=1e-10,
                   mxstep=50000)[-1]
        self.y = z[:2]
        self.M = flow.point(*self.y)[4:6]
        return self.speeds(self.y), self.speeds(z[2:])

    def speeds(self, y):
        g = getattr(self.p, 'g_12', 1.0)
        return np.array([y[0], y[0] + g / (1 + g) * y[1], y[0] - y[1] / (1 + g)])


def steps(rng, count, dt, part=(0.1, 0.7)):
    """Yield torques to 1,000 N m that change by steps, parted at random: locked and slipping."""
    for n in range(count):
        if n % 25 == 0:
            T_0, front = rng.uniform(-1000, 1000), rng.uniform(*part)
            load = -T_0 * rng.uniform(0.9, 1.1)
        yield T_0, load * front, load * (1 - front)


def reversals(rng, count, dt, part=(-0.2, 1.0)):
    """Yield loads that swing from one output to the other and back, over the locked stretch."""
    for n in range(count):
        swing = np.interp(np.sin(2 * np.pi * 12.3 * n * dt), (-1, 1), part)
        T_0 = 700 * np.cos(2 * np.pi * 3.1 * n * dt)
        yield T_0, -T_0 * swing + 5, -T_0 * (1 - swing) - 3


def rests(rng, count, dt, part=None):
    """Yield bursts of torque between stretches of none, until slip has died away."""
    for n in range(count):
        yield (0.0, 0.0, 0.0) if n // 30 % 2 else tuple(rng.normal(0, 200, 3))


def noise(rng, count, dt, part=None):
    """Yield torques that are new in every tick."""
    for _ in range(count):
        yield tuple(rng.uniform(-1000, 1000, 3))


def holds(rng, count, dt, part=(0.4, 0.4)):
    """Yield torques that balance but for a part of the losses, long enough to come to rest."""
    for n in range(count):
        if n % 60 == 0:
            T_0, share = rng.uniform(-1000, 1000), rng.uniform(-0.6, 1.1)
        load = -T_0 * (1 - 0.006 * share)
        yield T_0, load * part[0], load * (1 - part[0])


LOADS = [steps, reversals, rests, noise, holds]


def largest_errors(simulation, reference, torques):
    """Return the worst of speeds (rad/s), of slip and of turn in one tick (rad)."""
    worst, position = np.zeros(3), np.zeros(3)
    for T in torques:
        snapshot = simulation.step(T)
        speeds, integral = reference.step(T)
        error = np.abs(snapshot.velocity[:3] - speeds).max()
        slip = np.subtract(*snapshot.velocity[1:3]) - np.subtract(*speeds[1:])
        turn = np.abs(snapshot.position[:3] - position - integral).max()
        worst = np.maximum(worst, (error, abs(slip), turn))
        position = np.array(snapshot.position[:3])
        if reference.loss_law == 'paper':
            assert snapshot.power_flow == reference.direction
    return worst


@pytest.mark.parametrize('loss_law', ['paper', 'passive'])
@pytest.mark.parametrize('variant', ['lsd_ode', 'lsd_lagged'])
@pytest.mark.parametrize('steepness', [2.0, 4.0, 50.0])
@pytest.mark.parametrize('rate, count', [(1000, 300), (200, 120)])
@pytest.mark.parametrize('torques', LOADS)
def test_clutch_follows_an_adaptive_solver_at_every_tick(
        torques, rate, count, steepness, variant, loss_law):
    p = SelfLockingParameters(c_f1=steepness, c_f2=steepness)
    simulation = Simulation(variant, 1 / rate, p, loss_law=loss_law)
    reference = Reference(variant, loss_law, p, 1 / rate)
    speeds, slip, turn = largest_errors(
        simulation, reference, torques(np.random.default_rng(7), count, 1 / rate))
    assert simulation.coarse_steps == 0
    assert max(speeds, slip) < 1e-3 and turn < 1e-5


@pytest.mark.parametrize('sign_speed', [1e-3, 0.02, 0.1])
@pytest.mark.parametrize('rate, count', [(1000, 300), (200, 120)])
@pytest.mark.parametrize('torques', LOADS)
def test_symmetric_follows_an_adaptive_solver_at_every_tick(torques, rate, count, sign_speed):
    p = SymmetricParameters(sign_speed=sign_speed)
    simulation = Simulation('symmetric_ode', 1 / rate, p)
    reference = Reference('symmetric_ode', 'passive', p, 1 / rate)
    part = {steps: (0.45, 0.55), reversals: (0.48, 0.52), holds: (0.5, 0.5)}.get(torques)
    speeds, slip, turn = largest_errors(simulation, reference, (
        (T_0 / 3.517, T_1, T_2) for T_0, T_1, T_2 in torques(
            np.random.default_rng(7), count, 1 / rate, part)))
    assert simulation.coarse_steps == 0
    assert max(speeds, slip) < 2e-4 and turn < 1e-5
