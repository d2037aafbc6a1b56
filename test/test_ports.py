# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Speed ports: an outside speed comes in by an elastic shaft, and its mean torque goes out."""

import dataclasses
import math

from mechanisms import (
    lossless,
    random_clutched_symmetric,
    random_self_locking,
    random_symmetric,
    relative_difference,
)
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from dm_ros import SelfLockingParameters, Simulation, SymmetricParameters, VARIANTS
from dm_ros.energy import AuditedSimulation
from dm_ros.mechanism.symmetric import in_slip, SymmetricOde
from dm_ros.mechanism.variants import variant_named
from dm_ros.motion.coupled import Equations, step
from dm_ros.motion.matrices import Exponential, Exponentials
from dm_ros.motion.models import LOSS_LAWS

EACH = pytest.mark.parametrize('variant', VARIANTS)
EACH_LAW = pytest.mark.parametrize('loss_law', LOSS_LAWS)
SHAFT = 1e4, 100.0   # N m/rad, N m s/rad
RANDOM = {'symmetric_ode': random_symmetric, 'symmetric_dae': random_clutched_symmetric,
          'lsd_ode': random_self_locking}


def ports_of(variant, *numbers, shaft=SHAFT):
    """Return speed ports at the inputs of a variant with these numbers."""
    inputs = variant_named(variant).mechanism.inputs
    return {inputs[n]: shaft for n in numbers}


def twists(simulation):
    """Return the twists, rad."""
    return simulation.state.x[2:]


# Exact where all is linear


@pytest.mark.parametrize('dt', [1e-3, 5e-3, 0.1])
@pytest.mark.parametrize('c, d', [(1e3, 0.0), (1e4, 100.0), (1e5, 1.0), (1e5, 1e3)])
def test_light_gears_on_stiff_shafts_move_as_the_exponential_of_all(c, d, dt):
    start, n = (50.0, 49.0), 30
    simulation = Simulation('symmetric_ode', dt, loss_law='paper', power_flow_deadband=1e12,
                            ports={'left': (c, d), 'right': (c, d)}, initial_velocity=start)
    r = in_slip(SymmetricOde(simulation.parameters).response(1))
    outputs, B = np.array([[1.0, 0.5], [1.0, -0.5]]), r.B[:, 1:]
    generator = np.zeros((7, 7))   # of y, twists, T_3, speeds outside
    generator[:2, :2], generator[:2, 2:4] = r.A - d * B @ outputs, c * B
    generator[:2, 4], generator[:2, 5:] = r.B[:, 0], d * B
    generator[2:4, :2], generator[2:4, 5:] = -outputs, np.eye(2)
    E, z = expm(generator * dt), np.array([49.5, 1.0, 0.0, 0.0])
    for k in range(n):
        inputs = 30.0, 50.0, 50.0 + k % 2
        simulation.step(inputs)
        z = (E @ [*z, *inputs])[:4]
    assert np.abs(np.subtract(simulation.state.x, z)).max() < 1e-8


@pytest.mark.parametrize('names', [('pinion',), ('left', 'right')])
def test_two_inertias_on_a_spring_swing_as_the_closed_form(names):
    # lossless, the outputs alike: all turns as one with the carrier, I; outside there is J
    p = lossless(SymmetricParameters(l_0=0.0, l_1=0.0, l_2=0.0, l_3=0.0, l_s=0.0))
    I = p.I_0 + p.I_1 + p.I_2 + p.g_F**2 * p.I_3   # noqa: E741
    c, J, dt = 2e4, 1.3, 1e-3
    ratio = p.g_F if names == ('pinion',) else 1.0
    audit = AuditedSimulation('symmetric_ode', dt, p, loss_law='paper', ports=dict.fromkeys(
        names, (c / ratio**2 / len(names), 0.0)))
    omega = math.sqrt(c / I)
    w, twist, outside = 0.0, 0.0, 10.0   # of the closed form, at the carrier
    speed = outside                      # of the simulated outside
    for _ in range(400):
        snapshot = audit.step([speed * ratio if name in names else 0.0 for name in audit.inputs])
        u, cos, sin = w - outside, math.cos(omega * dt), math.sin(omega * dt)
        end = outside + u * cos + twist * omega * sin
        twist = twist * cos - u / omega * sin
        torque, w = I * (end - w) / dt, end
        mean = sum(t * ratio for name, t in zip(audit.inputs, snapshot.torque) if name in names)
        assert mean == pytest.approx(torque, rel=1e-9, abs=1e-7)
        assert snapshot.velocity[0] == pytest.approx(w, rel=1e-9, abs=1e-8)
        speed -= dt * mean / J
        outside -= dt * torque / J
        # momentum is exchanged without loss
        assert I * snapshot.velocity[0] + J * speed == pytest.approx(10.0 * J, rel=1e-10)
    assert audit.total.lost == 0.0 and audit.worst < 1e-12
    # and over time it swings with the frequency of both inertias
    swings = np.sqrt(c * (1 / I + 1 / J)) * 400 * dt / (2 * math.pi)
    assert swings > 20


def test_finer_ticks_come_to_the_swing_of_two_inertias():
    p = lossless(SymmetricParameters(l_0=0.0, l_1=0.0, l_2=0.0, l_3=0.0, l_s=0.0))
    I, c, J = p.I_0 + p.I_1 + p.I_2 + p.g_F**2 * p.I_3, 2e4, 1.3   # noqa: E741
    errors = []
    for dt in (1e-3, 1e-4):
        simulation = Simulation('symmetric_ode', dt, p, loss_law='paper',
                                ports={'left': (c / 2, 0.0), 'right': (c / 2, 0.0)})
        outside, ticks = 10.0, round(0.05 / dt)
        for _ in range(ticks):
            snapshot = simulation.step((0.0, outside, outside))
            outside -= dt * sum(snapshot.torque) / J
        swing = 10.0 * J / (I + J) * (1 - math.cos(math.sqrt(c * (1 / I + 1 / J)) * 0.05))
        errors.append(abs(snapshot.velocity[0] - swing))
    assert errors[1] < 0.1 * errors[0] and errors[1] < 0.01 * swing


@pytest.mark.parametrize('h', [1e-6, 1e-3, 0.3])
def test_an_exponential_is_that_of_the_matrix_at_each_of_its_times(h):
    rng = np.random.default_rng(1)
    J = -np.diag([0.1, 3e3, 2e5, 4.0]) + rng.normal(0, 2.0, (4, 4))
    J[1, 2], J[2, 1] = 3e3, -4e3   # swings
    f, e = rng.normal(0, 1, 4), Exponential(J.tolist(), h)

    def exact(t):
        """Return the integral of e^(sJ) f, and its own integral, by one larger exponential."""
        generator = np.zeros((6, 6))
        generator[:4, :4], generator[:4, 4], generator[4, 5] = J, f, 1.0
        E = expm(generator * t)
        return E[:4, 4], E[:4, 5]
    way = e.way(f.tolist())
    assert relative_difference(way.end, exact(h)[0]) < 1e-10
    assert relative_difference(way.integral, exact(h)[1]) < 1e-10
    times, weights, ways = map(np.array, zip(*e.nodes(way, 1e-5)))
    assert weights.sum() == pytest.approx(1.0, rel=1e-12) and (np.diff(times) > 0.0).all()
    for t, at in zip(h * times, ways, strict=True):
        assert np.abs(at - exact(t)[0]).max() < 1e-9 * np.abs(exact(h)[0]).max()
    assert relative_difference(h * (weights @ ways), exact(h)[1]) < 1e-7
    assert relative_difference(e.solver, np.linalg.inv(3 * np.eye(4) - h * J)) < 1e-10


def test_exponentials_that_come_again_are_kept_and_do_not_pile_up():
    kept = Exponentials()
    first = kept.of(np.eye(3).tolist(), 1e-3)
    assert kept.of(np.eye(3).tolist(), 1e-3) is first
    for n in range(500):
        kept.of((n * np.eye(3)).tolist(), 1e-3)
    assert len(kept) <= 64


# As accurate elsewhere as the torque ports


@EACH_LAW
@pytest.mark.parametrize('variant', RANDOM)
def test_random_couplings_move_as_a_stiff_solver_says_and_close_their_books(variant, loss_law):
    for case in range(7):
        rng = np.random.default_rng([VARIANTS.index(variant), LOSS_LAWS.index(loss_law), case])
        p, dt = RANDOM[variant](rng), float(rng.choice([1e-3, 5e-3]))
        chosen = sorted(rng.choice(3, int(rng.integers(1, 4)), replace=False))
        ports = ports_of(variant, *chosen)
        ports = {name: (10 ** rng.uniform(3, 5), 10 ** rng.uniform(1.5, 3)) for name in ports}
        audit = AuditedSimulation(variant, dt, p, loss_law=loss_law, ports=ports,
                                  power_flow_deadband=1e12,   # the index stays
                                  initial_velocity=tuple(rng.normal(0, 40, 2)))
        start = dict(zip(audit.shafts, audit.snapshot().velocity))
        outside = {name: start[name] for name in ports}
        z = np.array(audit.state.x)
        for _ in range(6):
            inputs = []
            for name in audit.inputs:
                if name in ports:
                    outside[name] += rng.normal(0, 1.0)
                inputs.append(outside.get(name, float(rng.normal(0, 60))))
            snapshot = audit.step(inputs)
            z, mean = reference(audit, z, inputs)
            if not audit.coarse_steps:
                assert np.abs(np.subtract(audit.state.x, z)[:2]).max() < 3e-4
                assert snapshot.torque == pytest.approx(mean, rel=1e-4, abs=0.05)
            energy = snapshot.energy
            assert energy.relative_residual < 1e-6
            assert min(energy.half_shafts) >= 0.0
            if loss_law == 'passive':
                assert min(energy.gears + energy.bearings + energy.clutches) >= 0.0


def reference(simulation, z, inputs):
    """Return z after a tick, by Radau's method, and the mean torques."""
    p, names = simulation.parameters, simulation.inputs
    k_1, k_2 = p.g_12 / (1 + p.g_12), 1 / (1 + p.g_12)
    ends = (getattr(p, 'g_F', 1.0), 0.0), (1.0, k_1), (1.0, -k_2)
    model, shafts = simulation._ticker.model.inner, list(simulation.ports.items())
    S = model.friction((), (0.0, 0.0))

    def slope(_, z):
        w, s, *phi = z[:2 + len(shafts)]
        T, turned = list(inputs), []
        for (name, (c, d)), twist in zip(shafts, phi):
            n = names.index(name)
            faster = inputs[n] - ends[n][0] * w - ends[n][1] * s
            T[n] = c * twist + d * faster
            turned.append(faster)
        return [*model.point((w, s), S, T, 1)[:2], *turned, *T]
    whole = solve_ivp(slope, (0.0, simulation.dt), [*z, 0.0, 0.0, 0.0], method='Radau',
                      rtol=1e-9, atol=1e-9).y[:, -1]
    return whole[:-3], whole[-3:] / simulation.dt


@EACH_LAW
@EACH
def test_the_mean_torque_held_on_a_torque_port_gives_the_same_momentum(variant, loss_law):
    heavy = {f'{variant_named(variant).mechanism.name}.inertia.{name}': 1.0
             for name in variant_named(variant).mechanism.outputs}
    coupled, plain = (Simulation(variant, parameters=heavy, loss_law=loss_law, ports=ports,
                                 initial_velocity=(30.0, 29.0))
                      for ports in (ports_of(variant, 1, 2), ()))
    for n in range(300):
        one = coupled.step((20.0, 30.0 + 0.3 * math.sin(n / 40), 29.0 + n / 400))
        other = plain.step(one.torque)
        assert other.velocity[:3] == pytest.approx(one.velocity[:3], abs=0.02)
    assert max(map(abs, one.torque[1:])) > 5.0


@EACH_LAW
def test_the_formulations_agree(loss_law):
    load = [(60.0 * math.sin(n / 9), 20.0 + n / 10, 19.0 + math.sin(n / 5)) for n in range(150)]
    for pair in (('symmetric_ode', 'symmetric_dae'), ('lsd_ode', 'lsd_dae')):
        one, other = (Simulation(v, loss_law=loss_law, ports=ports_of(v, 1, 2),
                                 initial_velocity=(20.0, 19.0)) for v in pair)
        for inputs in load:
            a, b = one.step(inputs), other.step(inputs)
            assert a.velocity == pytest.approx(b.velocity, abs=1e-5)
            assert a.moment == pytest.approx(b.moment, rel=1e-4, abs=1e-2)


@EACH_LAW
def test_speeds_on_all_ports_and_all_turned_round_is_the_same_backwards(loss_law):
    ports = ports_of('lsd_ode', 0, 1, 2)
    one = Simulation('lsd_ode', loss_law=loss_law, ports=ports, initial_velocity=(20.0, 18.0))
    other = Simulation('lsd_ode', loss_law=loss_law, ports=ports, initial_velocity=(-20.0, -18.0))
    for n in range(150):
        inputs = 19.0 + n / 30, 20.0 + math.sin(n / 9), 18.0 - n / 50
        a, b = one.step(inputs), other.step([-value for value in inputs])
        assert np.abs(np.add(a.velocity, b.velocity)).max() < 1e-9
        assert np.abs(np.add(a.torque, b.torque)).max() < 1e-6


# Free and taken up


@EACH_LAW
@EACH
def test_a_free_port_is_a_port_without_torque(variant, loss_law):
    plain = Simulation(variant, loss_law=loss_law, initial_velocity=(30.0, 29.0))
    free = Simulation(variant, loss_law=loss_law, initial_velocity=(30.0, 29.0),
                      ports=ports_of(variant, 1))
    for n in range(100):
        one = plain.step((20.0 + n, 0.0, -30.0))
        other = free.step((20.0 + n, None, -30.0))
        assert other.torque == (20.0 + n, 0.0, -30.0) and twists(free) == (0.0,)
        assert other.velocity == pytest.approx(one.velocity, abs=1e-3)


@EACH
def test_a_twist_is_forgotten_and_taken_up_again_from_zero_without_a_jump(variant):
    ports = ports_of(variant, 1)
    audit = AuditedSimulation(variant, ports=ports, initial_velocity=(30.0, 30.0))
    started = audit.stored_energy
    for _ in range(50):
        audit.step((20.0, 29.0, -30.0))
    (twist,), (stiffness, _) = twists(audit), SHAFT
    assert abs(twist) > 1e-4
    free = audit.step((0.0, None, 0.0))
    assert twists(audit) == (0.0,) and free.torque == (0.0, 0.0, 0.0)
    # what the twist had stored is no work and no loss
    assert audit.stored_by_changes == pytest.approx(-stiffness * twist**2 / 2, rel=1e-9)
    for _ in range(20):
        free = audit.step((0.0, None, 0.0))
    state, speed = audit.state, free.velocity[1]
    without = audit.step((0.0, None, 0.0)).velocity
    audit.state = state
    again = audit.step((0.0, speed, 0.0))
    assert np.abs(np.subtract(again.velocity, without))[:3].max() < 0.1
    assert abs(twists(audit)[0]) < 1e-4 and abs(again.torque[1]) < 5.0
    assert audit.stored_energy == pytest.approx(
        started + audit.total.stored + audit.stored_by_changes, rel=1e-9)
    assert audit.worst < 1e-7


def test_state_substeps_reset_and_parameters_know_the_twist():
    def load(n):
        return 60.0 + n % 17, 20.0 + n % 3, None if n % 40 > 35 else 19.0
    ports = {'front': (2e4, 50.0), 'rear': (1e4, 100.0)}
    simulation = Simulation('lsd_lagged', ports=ports, substeps=2, initial_velocity=(20.0, 19.0))
    for n in range(70):
        simulation.step(load(n))
    state, seen = simulation.state, simulation.snapshot()
    first = [simulation.step(load(n)) for n in range(70, 110)]
    simulation.state = state
    assert simulation.snapshot()[1:] == seen[1:]
    again = [simulation.step(load(n)) for n in range(70, 110)]
    assert [s[1:] for s in first] == [s[1:] for s in again]

    twisted = twists(simulation)
    simulation.ports = {'front': (4e4, 10.0), 'rear': (1e4, 100.0)}
    assert simulation.ports == {'front': (4e4, 10.0), 'rear': (1e4, 100.0)}
    simulation.parameters = {'lsd.inertia.front': 0.01}
    assert twists(simulation) == twisted and any(twisted)
    simulation.reset()
    assert twists(simulation) == (0.0, 0.0)
    assert simulation.snapshot().torque == (0.0, 0.0, 0.0)


def test_equal_inputs_give_equal_bits():
    def run():
        simulation = Simulation('lsd_ode', ports=ports_of('lsd_ode', 0, 2),
                                initial_velocity=(20.0, 19.0))
        return [simulation.step((20.0 + n % 5, -60.0, 19.0)) for n in range(300)]
    assert repr(run()) == repr(run())


def test_several_substeps_agree_with_one_and_report_the_mean_torque():
    one, other = (Simulation('symmetric_ode', 5e-3, ports=ports_of('symmetric_ode', 1, 2),
                             substeps=n, initial_velocity=(20.0, 20.0)) for n in (1, 8))
    for n in range(60):
        inputs = 30.0, 20.0 + n / 50, 20.0 + n / 80
        a, b = one.step(inputs), other.step(inputs)
        assert a.velocity == pytest.approx(b.velocity, abs=1e-4)
        assert a.torque == pytest.approx(b.torque, abs=1e-2)


def test_a_force_presses_a_clutch_also_beside_speed_ports():
    p = SelfLockingParameters(N_1=0.0, N_2=0.0)
    torques = []
    for force in (0.0, 3e3):
        simulation = Simulation('lsd_ode', parameters=p, ports=ports_of('lsd_ode', 1, 2),
                                initial_velocity=(22.0, 18.0))
        for _ in range(200):
            snapshot = simulation.step((100.0, 22.0, 18.0), (force, force))
        torques.append(snapshot.torque)
    assert snapshot.clutch_force == (3e3, 3e3)
    # the outside drives the shaft that runs ahead the more, and gets it back from the other
    assert torques[1][1] - torques[0][1] > 50.0 and torques[1][2] - torques[0][2] < -50.0


# Energy


@EACH_LAW
@EACH
def test_the_books_have_twist_and_damping_and_close(variant, loss_law):
    ports = ports_of(variant, 1, 2)
    audit = AuditedSimulation(variant, loss_law=loss_law, ports=ports,
                              initial_velocity=(20.0, 20.0))
    started, clock = audit.stored_energy, 0.0
    outside = 0.0
    for n in range(400):
        clock = n * audit.dt
        inputs = (15.0 * math.sin(7 * clock), 20.0 + math.sin(30 * clock), 20.0 + 2 * clock)
        snapshot = audit.step(inputs)
        outside += sum(t * w for t, w in zip(snapshot.torque[1:], inputs[1:])) * audit.dt
    assert audit.worst < 1e-7 and audit.half_shaft_names == tuple(ports)
    assert min(audit.total.half_shafts) > 0.0
    # work on a speed port is its mean torque times the speed outside
    assert sum(audit.total.work[1:]) == pytest.approx(outside, rel=1e-9)
    twist = sum(c / 2 * phi**2 for (c, _), phi in zip(ports.values(), twists(audit)))
    x = audit.state.x[:2]
    assert audit.stored_energy == pytest.approx(
        audit._ticker.books.meter._inner.stored_energy(x) + twist, rel=1e-12)
    assert audit.stored_energy - started == pytest.approx(audit.total.stored, rel=1e-9)
    if loss_law == 'passive':
        assert not any(energy for _, energy in audit.returned.values())
        assert audit.total.numerical == pytest.approx(0.0, abs=1e-4 * audit.total.scale)


def test_without_damping_and_losses_nothing_is_lost():
    p = lossless(dataclasses.replace(SelfLockingParameters(), n_F1=0, n_F2=0, l_0=0.0, l_1=0.0,
                                     l_2=0.0, l_s=0.0))
    audit = AuditedSimulation('lsd_ode', parameters=p, ports=ports_of('lsd_ode', 0, 1, 2,
                                                                      shaft=(3e4, 0.0)))
    for n in range(300):
        audit.step((10.0 * math.sin(n / 30), 1.0, -2.0))
    assert abs(audit.total.lost) < 1e-12 * audit.total.scale
    assert audit.worst < 1e-10 and abs(audit.total.stored) > 1.0


# Bounds and bad input


def test_a_tick_takes_a_bounded_number_of_parts_and_says_when_it_was_coarse(monkeypatch):
    monkeypatch.setattr('dm_ros.motion.coupled.MOST_TRIALS', 3)
    simulation = AuditedSimulation('lsd_ode', 5e-3, ports=ports_of('lsd_ode', 1, shaft=(1e5, 0.0)),
                                   initial_velocity=(20.0, -20.0))
    for n in range(20):
        snapshot = simulation.step((200.0, 20.0 - 2.0 * n, -100.0))
        assert all(map(math.isfinite, (*snapshot.velocity, *snapshot.torque, *snapshot.moment)))
        # it makes no energy
        assert snapshot.energy.numerical > -1e-6 * snapshot.energy.scale
    assert simulation.coarse_steps > 0


def test_what_would_grow_beyond_all_numbers_within_a_tick_is_taken_in_parts():
    # light gears at rest, of which one begins to give power as soon as it turns
    p = SymmetricParameters(I_0=0.01, I_1=2e-4, I_2=3e-4, I_3=2e-3, eta_3B=0.5, eta_FG=0.5,
                            eta_0B=0.4, eta_1G=0.4, sign_speed=0.009)
    audit = AuditedSimulation('symmetric_ode', 1.5e-3, p,
                              ports=ports_of('symmetric_ode', 1, shaft=(1e5, 0.0)))
    for _ in range(5):
        snapshot = audit.step((6.0, -10.0, -500.0))
        assert snapshot.energy.relative_residual < 1e-6
    assert audit.coarse_steps == 0 and snapshot.velocity[2] < -10.0


def test_the_last_resort_obeys_the_equations_at_its_end():
    simulation = Simulation('lsd_ode', 5e-3, ports=ports_of('lsd_ode', 1, 2))
    model = simulation._ticker.model
    inputs = [120.0, 3.0, -2.0]
    equations = Equations(model._law, model.inner.coefficients_of(1), model.half_shafts, inputs,
                          model.friction((), (0.0, 0.0)))
    z = equations.state(1.0, 2.0, (0.001, -0.002))
    for h in (1e-5, 1e-3, 0.1):
        end = equations.euler(z, h)
        slope = np.array(equations.at(end).slope)
        assert np.abs(np.subtract(end, z) - h * slope).max() < 1e-6


def test_the_jacobian_is_the_slope_of_the_slope():
    rng = np.random.default_rng(5)
    for variant, make in RANDOM.items():
        for loss_law in LOSS_LAWS:
            simulation = Simulation(variant, parameters=make(rng), loss_law=loss_law,
                                    ports=ports_of(variant, 0, 1, 2))
            model = simulation._ticker.model
            equations = Equations(model._law, model.inner.coefficients_of(1), model.half_shafts,
                                  (30.0, 20.0, 10.0), model.friction((), (0.0, 0.0)))
            z = equations.state(20.0, 3.0, (0.01, -0.02, 0.005))
            J, n = np.array(equations.jacobian(equations.at(z))), len(z)
            for i in range(n):
                d = np.eye(n)[i] * 1e-6
                column = np.subtract(equations.at((z + d).tolist()).slope,
                                     equations.at((z - d).tolist()).slope) / 2e-6
                assert np.abs(J[:, i] - column).max() < 1e-5 * np.abs(J).max()


def test_a_step_of_no_half_shaft_is_one_of_the_adaptive_kind():
    simulation = Simulation('lsd_ode', ports=ports_of('lsd_ode', 1))
    model = simulation._ticker.model
    equations = Equations(model._law, model.inner.coefficients_of(1), [], [90.0, -20.0, -30.0],
                          model.friction((), (0.0, 0.0)))
    z, integral, _, coarse, _ = step(equations, equations.state(5.0, 1.0, ()), 1e-3, 1e-5,
                                     Exponentials())
    plain = Simulation('lsd_ode', 1e-3)
    plain.state = plain.state._replace(x=(5.0, 1.0))
    plain.step((90.0, -20.0, -30.0))
    assert z == pytest.approx(plain.state.x, abs=1e-4) and not coarse
    assert integral == pytest.approx(plain.state.turned, abs=1e-7)


@pytest.mark.parametrize('ports, words', [
    ({'wheel': SHAFT}, "ports: 'wheel' is not one of pinion, left, right"),
    ({'left': 5.0}, 'ports: left: 5.0 must be two numbers, stiffness and damping'),
    (['left'], "ports: ['left'] must be {shaft: (stiffness, damping)}"),
    ({'left': (0.0, 1.0)}, 'port.left.stiffness: 0.0 is not allowed'),
    ({'left': (1e4, -1.0)}, 'port.left.damping: -1.0 is not allowed'),
    ({'left': (1e4, math.nan)}, 'port.left.damping: nan is not allowed')])
def test_what_is_no_port_is_refused_by_name(ports, words):
    with pytest.raises(ValueError) as error:
        Simulation('symmetric_ode', ports=ports)
    assert words in str(error.value)


@pytest.mark.parametrize('inputs, words', [
    ((1.0, math.nan, 2.0), 'the speed on left is nan'),
    ((1.0, math.inf, 2.0), 'the speed on left is inf'),
    ((1.0, 2e6, 2.0), 'the speed on left is 2000000.0, it must not be above 1e+06'),
    ((None, 1.0, 2.0), 'None is not allowed on pinion, it takes a torque'),
    ((1.0, 2.0), 'must be 3 numbers, for pinion, left, right'),
    ((1.0, 'x', 2.0), "(1.0, 'x', 2.0) must be 3 numbers"), (5.0, '5.0 must be 3 numbers')])
def test_what_cannot_come_in_is_refused_and_changes_nothing(inputs, words):
    simulation = Simulation('symmetric_ode', ports={'left': SHAFT})
    simulation.step((10.0, 5.0, -3.0))
    before = simulation.snapshot(), simulation.state
    with pytest.raises(ValueError, match='torques: ') as error:
        simulation.step(inputs)
    assert words in str(error.value)
    assert (simulation.snapshot(), simulation.state) == before


def test_which_ports_take_a_speed_cannot_change_while_it_runs():
    simulation = Simulation('symmetric_ode', ports={'left': SHAFT})
    for ports in ({}, {'right': SHAFT}, {'left': SHAFT, 'right': SHAFT}):
        with pytest.raises(ValueError, match='cannot change while it runs'):
            simulation.ports = ports
    assert simulation.ports == {'left': SHAFT}
    with pytest.raises(ValueError, match='is nan'):
        Simulation('symmetric_ode').step((math.nan, 0.0, 0.0))
