# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The equations of the driveline: numbers, identities, and the Jacobian."""

from driveline.scenarios import sign_speeds
from drivelines import example, GAPS, random_given, random_state, System
import numpy as np
import pytest

from dm_ros import SelfLockingParameters, Simulation, SymmetricParameters
from dm_ros.driveline import brake, shafts, tyre
from dm_ros.driveline.body import G, slope
from dm_ros.driveline.parameters import VehicleParameters
from dm_ros.driveline.road import Given

GIVEN = Given(350.0, (20.0, 0.0, 0.0, 150.0), 0.05, 0.08, (0.3, 1.0, 0.8, 0.9), (1.0,) * 4, 0.0)
STATE = [60, 58, -2, 16, 0.5, 17, -0.8, 16.2, 15.7, 16.4, 17.5,
         0.012, 0.006, 0.011, 0.012, 0.010, 0.017, 0.016, 1, 0.9, 0.95, 0.5,
         0.01, 0.02, 0.03, -0.01, 0.01, 0.015, -0.02, 0.005, 5, 0.2, 0.1, 1.5, 0.8]
LAYOUTS = ['fwd', 'rwd', 'awd', example('driveline_truck').tandem]
ids = [getattr(layout, '__name__', layout) for layout in LAYOUTS]


def near(numbers, relative=1e-9):
    return pytest.approx(numbers, rel=relative)


@pytest.fixture(scope='module')
def system():
    return System(parameters=sign_speeds('awd'), given=GIVEN, forces={'centre': (0.0, 500.0)})


def test_the_states_are_as_many_as_the_design_has():
    counts = {(layout, planar): len(System(layout, planar).layout)
              for layout in ('fwd', 'rwd', 'awd') for planar in (False, True)}
    assert counts == {('fwd', False): 20, ('fwd', True): 27, ('rwd', False): 20,
                      ('rwd', True): 27, ('awd', False): 28, ('awd', True): 35}


def test_accelerations_of_the_differentials_are_those_of_the_reference(system):
    rates = system.rates(STATE)
    assert rates[1:7] == near([2817.41998794, 4345.75146952, 1234.48432531, -4610.56610732,
                               1024.40761502, -4032.83053660])


def test_moments_of_the_differentials_are_those_of_the_reference(system):
    centre, _, rear = zip(system.assembly.differentials, system.at(STATE).train.points)
    moments = centre[0].internal_moments(centre[1])
    assert moments == near([145.089245615, 457.918109682, -10.3198270151, 296.914236064])
    assert rear[0].internal_moments(rear[1])[0] == near(460.273363480)


def test_wheels_and_body_are_those_of_the_reference(system):
    road = system.at(STATE).road
    assert road.omega == near([-108.040332874, -410.176134443, -433.208190190, 333.193678234])
    assert road.body == near([1.20134277079, -0.0797505547337, 0.323990820816])


def test_forces_loads_and_energy_are_those_of_the_reference(system):
    road = system.at(STATE).road
    assert [contact[0] for _, _, contact in road.tyres] == near(
        [610.423738994, 1553.4131172, 1858.00765713, -813.832919532])
    assert road.loads == near([3634.04593644, 4133.65883966, 3734.76682113, 4143.54101468])
    assert system.books(STATE)[0] == near(23973.1050863)


@pytest.mark.parametrize('seed', range(5))
def test_moments_of_each_differential_are_those_of_a_simulation_of_it_alone(seed):
    rng = np.random.default_rng(seed)
    forces = (0.0, rng.uniform(0, 2000))
    system = System(given=random_given(rng), forces={'centre': forces})
    x = random_state(rng, system.layout)
    train = system.at(x).train
    for differential, place, (*T, _, _), point in zip(
            system.assembly.differentials, system.layout.differentials, train.held,
            train.points):
        is_centre = differential.name == 'centre'
        kind = SelfLockingParameters if is_centre else SymmetricParameters
        p = differential.parameters
        table = kind(**{symbol: getattr(p, symbol) for symbol in kind.rows()})
        alone = Simulation('lsd_ode' if is_centre else 'symmetric_ode', parameters=table,
                           loss_law='passive')
        alone.state = alone.state._replace(
            x=tuple(x[place:place + 2].tolist()), held=tuple(T), force=forces if is_centre else ())
        moments = np.array(alone.snapshot().moment)
        found = np.array(differential.internal_moments(point))
        assert np.abs(found - moments).max() <= 1e-12 * np.abs(moments).max()


@pytest.mark.parametrize('layout', LAYOUTS, ids=ids)
@pytest.mark.parametrize('planar', [False, True])
def test_the_jacobian_is_what_differences_say(layout, planar):
    rng = np.random.default_rng(7)
    for parameters in ({}, GAPS):
        system = System(layout, planar, parameters)
        wheels = len(system.assembly.wheels)
        for _ in range(10):
            system.given = random_given(rng, wheels, planar)
            x = random_state(rng, system.layout)
            J, size = system.jacobian(x), len(x) - len(x[system.layout.A])
            assert not J[:, system.layout.A].any()
            numeric = np.empty((len(x), size))
            for n in range(size):
                h = np.zeros(len(x))
                h[n] = 1e-6 * max(0.1, abs(x[n]))
                numeric[:, n] = (system.rates(x + h) - system.rates(x - h)) / (2 * h[n])
            scale = np.abs(numeric).max(axis=1, keepdims=True) + 1e-6
            assert (np.abs(J[:, :size] - numeric) / scale).max() < 1e-5


@pytest.mark.parametrize('layout', LAYOUTS, ids=ids)
@pytest.mark.parametrize('planar', [False, True])
@pytest.mark.parametrize('gaps', [{}, GAPS], ids=['tight', 'gaps'])
def test_work_is_stored_or_lost_and_no_loss_gives_energy(layout, planar, gaps):
    rng = np.random.default_rng(11)
    system = System(layout, planar, gaps)
    p, wheels = system.assembly.vehicle, len(system.assembly.wheels)
    for _ in range(20):
        given = system.given = random_given(rng, wheels, planar)
        x = random_state(rng, system.layout)
        point = system.at(x)
        _, parametric, lost = system.books(x)
        h = 1e-7
        grown = (system.books(x + h * point.rates)[0] - system.books(x - h * point.rates)[0]) / (
            2 * h)
        v_x = x[system.layout.body.start]
        work = (given.torque * x[0] - p.m * G * slope(given.grade)[0] * v_x
                + point.road.drag * given.wind)
        terms = np.array([work, parametric, -grown, *-lost])
        assert abs(terms.sum()) < 1e-7 * np.abs(terms).sum()
        assert lost.min() >= 0.0


def mirrored(system, x):
    """Return the state with left and right exchanged."""
    names, result = list(system.layout.names), np.array(x, float)
    swap = {'left': 'right', 'right': 'left'}
    for n, name in enumerate(names):
        other = name
        for side in swap:
            if side in name:
                other = name.replace(side, swap[side])
        result[n] = x[names.index(other)]
        if name.startswith('alpha') or name in ('v_y', 'r', 'A_y', 's.front', 's.rear'):
            result[n] = -result[n]
    return result


def mirrored_given(given):
    def swapped(values):
        return tuple([values[n] for n in (1, 0, 3, 2)])
    return given._replace(steer=-given.steer, brakes=swapped(given.brakes),
                          grip=swapped(given.grip), contact=swapped(given.contact))


def test_left_and_right_exchanged_give_the_exchanged_rates():
    rng = np.random.default_rng(3)
    for _ in range(20):
        given = random_given(rng)
        one, other = System(given=given), System(given=mirrored_given(given))
        x = random_state(rng, one.layout)
        rates = one.rates(x)
        found = mirrored(one, other.rates(mirrored(one, x)))
        assert np.abs(found - rates).max() <= 1e-13 * np.abs(rates).max()


def test_with_holding_torques_everything_stands_still():
    """Both axles pull, the brakes hold less than 0.7 of their capacity, on a slope."""
    grade, brakes = 0.15, (900.0, 900.0, 700.0, 700.0)
    front, kappa = 40.0, None   # N m on each front half-shaft
    system = System(planar=False)
    p, layout = system.assembly.vehicle, system.layout
    tables = {d.name: d.parameters for d in system.assembly.differentials}
    # at rest no mesh loses: torque is split as without losses
    g_F, g_R = tables['front'].g_F, tables['rear'].g_F
    front_shaft = 2 * front / g_F
    rear_shaft = tables['centre'].g_12 * front_shaft
    rear, torque = rear_shaft * g_R / 2, front_shaft + rear_shaft
    sine, _ = slope(grade)
    system.given = Given(torque, brakes, 0.0, grade, (1.0,) * 4, (1.0,) * 4, 0.0)
    x = np.zeros(len(layout))
    shaft_torques = [torque, front_shaft, rear_shaft, front, front, rear, rear]
    x[layout.twists] = [T / c.p.stiffness
                        for T, c in zip(shaft_torques, system.assembly.connections)]
    x[layout.A] = G * sine
    low, high = 0.0, 0.1   # the slip that carries the weight, by bisection
    for _ in range(100):
        kappa = (low + high) / 2
        x[layout.kappa] = kappa
        pull = sum(contact[0] for _, _, contact in system.at(x).road.tyres)
        low, high = (kappa, high) if pull < p.m * G * sine else (low, kappa)
    road = system.at(x).road
    x[layout.pads] = [(T - p.R * contact[0]) / T_cap for T, (_, _, contact), (T_cap, _)
                      in zip([front, front, rear, rear], road.tyres, road.brakes)]
    assert np.abs(x[layout.pads]).max() < 0.7 and kappa > 0.005
    assert np.abs(system.rates(x)).max() < 1e-9   # of accelerations of light gears, rad/s^2


def test_no_force_exceeds_the_friction_of_the_road():
    rng = np.random.default_rng(5)
    p = VehicleParameters(c_d=3.0, v_low=0.25)   # as much damping as is allowed
    k = tyre.coefficients(p)
    for _ in range(3000):
        V_x, U, V_y = rng.normal(0, 10.0 ** rng.uniform(-2, 1), 3)
        mu, F_z = rng.uniform(0.05, 1.2), 4000.0
        kappa, alpha = rng.normal(0, 10.0 ** rng.uniform(-3, 0), 2)
        F_x, F_y, *_ = tyre.contact(k, mu, F_z, kappa, alpha, U, V_x, V_y)
        assert np.hypot(F_x, F_y) <= mu * F_z * (1 + 1e-12)


def test_the_energy_of_a_carcass_is_the_integral_of_its_force():
    k = tyre.coefficients(VehicleParameters())
    carcass = tyre.Carcass(k)
    nodes, weights = np.polynomial.legendre.leggauss(200)
    for rho in (1e-6, 1e-3, 0.5, 3.0, 40.0, 1e3):
        t = (nodes + 1) / 2 * np.arcsinh(rho / k.C)
        integral = weights @ (np.sin(k.C * np.arctan(np.sinh(t))) * k.C * np.cosh(t)) * (
            np.arcsinh(rho / k.C) / 2)
        assert carcass.integral(rho) == pytest.approx(integral, rel=1e-12)


def test_backlash_never_pulls():
    rng = np.random.default_rng(2)
    for _ in range(2000):
        phi, rate = rng.normal(0, 0.03), rng.normal(0, 100)
        found = shafts.torques([(8000.0, 20.0, 0.0175, 0, 1)], [phi], [rate, 0.0])
        _, (spring,), (damping,) = found
        if abs(phi) <= 0.0175:
            assert spring == damping == 0.0
        else:
            assert (spring + damping) * phi >= 0.0
        assert damping * rate >= 0.0


def test_a_sliding_brake_has_its_capacity_and_a_resting_one_is_a_spring():
    p = VehicleParameters()
    assert brake.friction(p.pad, p.c_b, p.w_low, 30.0, 1.0) == (1.0, 0.0, 30.0)
    assert brake.friction(p.pad, p.c_b, p.w_low, 0.0, 0.4) == (0.4, 0.0, 0.0)
