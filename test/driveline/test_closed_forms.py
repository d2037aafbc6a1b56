# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A driveline beside what can be written down: closed forms of steady motion."""

import math

from driveline.scenarios import DIFFERENTIALS
from drivelines import drive, NONE
import numpy as np
import pytest

from dm_ros import Driveline, SelfLockingParameters, SymmetricParameters
from dm_ros.driveline.body import G
from dm_ros.driveline.parameters import VehicleParameters

P, AXLE = VehicleParameters(), SymmetricParameters()
GENTLE = {'driveline.rolling_resistance': 0.0, 'driveline.drag_area': 0.0}


def lossless(layout):
    """Return the parameters of differentials that lose nothing."""
    result = {}
    for name in DIFFERENTIALS[layout]:
        kind = SelfLockingParameters if name == 'centre' else SymmetricParameters
        for full, row in kind.rows().values():
            if row.name.startswith(('efficiency', 'viscosity')):
                result[full.replace(kind.prefix, f'driveline.{name}', 1)] = (
                    1.0 if row.name.startswith('efficiency') else 0.0)
            if row.name.endswith('preload'):
                result[full.replace(kind.prefix, f'driveline.{name}', 1)] = 0.0
    return result


def rolling_on(car, seconds, **held):
    """Return the last snapshot."""
    *_, last = drive(car, held, [], seconds)
    return last


def effective_mass(layout):
    """Return 2 E/v^2, kg."""
    car = Driveline(layout, parameters={**lossless(layout), **GENTLE})
    car.reset(10.0)
    return car, 2 * car.stored_energy / 100.0


def test_the_mass_that_is_accelerated_is_that_of_all_that_turns():
    assert effective_mass('awd')[1] == pytest.approx(1864.6369, rel=1e-7)


@pytest.mark.parametrize('layout', ['fwd', 'rwd', 'awd'])
def test_a_lossless_car_accelerates_by_its_effective_mass(layout):
    car, mass = effective_mass(layout)
    torque = 5.0
    start = rolling_on(car, 2.0, torque=torque).twist_body[0]
    end = rolling_on(car, 1.0, torque=torque).twist_body[0]
    # but for the creep of the tyres, 3.5e-4 on one axle, and the rest of the oscillation
    assert end - start == pytest.approx(torque * AXLE.g_F / (P.R * mass), rel=6e-4)


@pytest.mark.parametrize('layout', ['fwd', 'rwd', 'awd'])
def test_a_lossless_car_coasts_down_a_slope_at_the_speed_that_drag_allows(layout):
    sine, cosine = math.sin(math.atan(0.08)), math.cos(math.atan(0.08))
    speed = math.sqrt(2 * P.m * G * (sine - P.C_rr * cosine) / (P.air * P.drag_area))
    car = Driveline(layout, parameters=lossless(layout))
    for beside, sign in ((0.9997, 1), (1.0003, -1)):   # it comes nearer from both sides
        car.reset(speed * beside, -0.08)
        begin = rolling_on(car, 2.0, grade=-0.08).twist_body[0]
        assert sign * (rolling_on(car, 0.5, grade=-0.08).twist_body[0] - begin) > 0.0


def test_the_centre_gives_forty_and_sixty():
    car = Driveline('awd')
    car.reset(10.0)
    moment = dict(zip(car.moments, rolling_on(car, 1.0, torque=300.0).moment))
    front, rear = moment['centre_front_mesh'], moment['centre_rear_mesh']
    assert front / (front + rear) == pytest.approx(0.4, rel=2e-3)


def test_in_a_bend_the_wheels_turn_as_their_radii():
    steer = 0.1
    car = Driveline('awd', planar=True, parameters={**lossless('awd'), **GENTLE})
    car.reset(1.0)
    wheels = np.array(rolling_on(car, 4.0, steer=steer).velocity[-4:])
    radius = P.L / math.tan(steer)   # of the middle of the rear axle
    radii = np.array([math.hypot(radius - y, x) for x in (P.L, 0.0)
                      for y in (P.track / 2, -P.track / 2)])
    assert wheels / wheels[-1] == pytest.approx(radii / radii[-1], rel=1e-3)


def test_a_neutral_car_yaws_as_geometry_says():
    steer = 0.002
    car = Driveline('rwd', planar=True, parameters={**lossless('rwd'), **GENTLE})
    car.reset(20.0)
    v, _, r = rolling_on(car, 3.0, steer=steer).twist_body
    assert r == pytest.approx(v * steer / P.L, rel=2e-3)


def test_a_brake_on_one_side_yaws_the_car():
    car = Driveline('fwd', planar=True, parameters={**lossless('fwd'), **GENTLE})
    car.reset(20.0)
    snapshot = rolling_on(car, 2.0, brakes=(0.0, 0.0, 20.0, 0.0))
    moment = sum(-y * force[0] for y, force in zip(
        (P.track / 2, -P.track / 2) * 2, snapshot.wheel_force))
    v, _, r = snapshot.twist_body
    assert moment == pytest.approx(20.0 / P.R * P.track / 2, rel=0.01)
    assert r == pytest.approx(v * moment / (P.K_y * P.m * G * P.a * P.b), rel=0.01)


def test_locked_wheels_slide_as_the_tyre_says():
    car = Driveline('rwd', parameters={'driveline.drag_area': 0.0})
    car.reset(25.0)
    rolling_on(car, 1.0, brakes=(9000.0,) * 4, grip=(0.8,) * 4)
    before = car.snapshot()
    after = car.step(brakes=(9000.0,) * 4, grip=(0.8,) * 4)
    assert np.abs(after.velocity[-4:]).max() < 0.05
    force = 0.0
    for load in before.wheel_load:
        mu = 0.8 * max(0.2, 1 - P.k_mu * (load / P.load_0 - 1))
        force += mu * load * math.sin(P.C * math.atan(P.K_x / mu / P.C))
    slowed = (before.twist_body[0] - after.twist_body[0]) / car.dt
    assert slowed == pytest.approx(force / P.m, rel=1e-3)


def test_loads_carry_the_car_and_move_as_it_accelerates():
    car = Driveline('awd', planar=True)
    car.reset(20.0)
    run = list(drive(car, {'torque': 100.0, 'steer': 0.02}, [], 2.0))
    snapshot = run[-1]
    f_x, f_y = run[-1 - round(P.load_time / car.dt)].acceleration   # the lag of what grows evenly
    front_left, front_right, rear_left, rear_right = snapshot.wheel_load
    assert sum(snapshot.wheel_load) == pytest.approx(P.m * G, rel=1e-12)
    assert front_left + front_right == pytest.approx(P.m * (G * P.b - f_x * P.h) / P.L, rel=1e-4)
    across = front_right - front_left + rear_right - rear_left
    assert across == pytest.approx(2 * P.m * f_y * P.h / P.track, rel=1e-3)
    assert (front_right - front_left) / across == pytest.approx(P.roll_share, rel=1e-9)


def test_the_way_in_a_bend_is_an_arc():
    car = Driveline('fwd', planar=True, parameters={**lossless('fwd'), **GENTLE})
    car.reset(5.0)
    run = list(drive(car, {'steer': 0.2}, [], 3.0))
    begin, end = run[999], run[-1]
    v_x, v_y, _ = begin.twist_body
    (x_0, y_0, yaw_0), (x_1, y_1, yaw_1) = begin.pose, end.pose
    turned = yaw_1 - yaw_0
    radius = 2.0 * math.hypot(v_x, v_y) / turned   # 2 s, and the speed hardly falls
    assert turned > 0.5
    assert math.hypot(x_1 - x_0, y_1 - y_0) == pytest.approx(
        2.0 * radius * math.sin(turned / 2.0), rel=0.01)
    assert math.atan2(y_1 - y_0, x_1 - x_0) == pytest.approx(
        yaw_0 + turned / 2.0 + math.atan2(v_y, v_x), abs=0.01)


def test_no_brakes_is_what_zero_brakes_are():
    car = Driveline()
    assert car.step() == (car.reset(), car.step(brakes=NONE))[1]
