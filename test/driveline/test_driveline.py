# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A driveline in time: scenarios by their numbers, rest, mirror, order, stability, books."""

from functools import cache
import math

from driveline.scenarios import DIFFERENTIALS, in_order, ramp, SCENARIOS, sign_speeds
from drivelines import ALL, distances, drive, GAPS, NONE, run_of, until
import numpy as np
import pytest

from dm_ros import Driveline
from dm_ros.driveline.stepper import cuts

BODY, WHEELS, OTHERS = 2e-4, 5e-2, 1e-1   # m/s, rad/s, rad/s beside a stiff solver, at 1 kHz


@cache
def scenario(name):
    """Return the car of a scenario and the snapshots of its ticks."""
    car, (_, *run) = run_of(SCENARIOS[name])
    return car, run


def body_and_wheels(car, snapshot):
    """Return (v_x, v_y, r) and the speeds of the wheels."""
    return snapshot.twist_body, snapshot.velocity[-len(car.wheels):]


def test_both_front_wheels_on_ice_on_a_hill():
    car, run = scenario('hill_axle_ice')
    body, wheels = body_and_wheels(car, run[-1])
    assert body[0] == pytest.approx(2.51071, abs=BODY)
    assert wheels == pytest.approx([41.2470, 41.2470, 8.00380, 8.00380], abs=WHEELS)
    torque = dict(zip(car.connections, run[-1].torque))
    assert torque['front_propeller'] == pytest.approx(110.8, abs=0.1)
    assert torque['rear_propeller'] == pytest.approx(309.5, abs=0.1)


def test_the_front_axle_in_the_air():
    car, run = scenario('lift_front')
    body, wheels = body_and_wheels(car, run[-1])
    assert body[0] == pytest.approx(1.698557, abs=BODY / 10)
    assert wheels == pytest.approx([111.36633] * 2 + [5.36512928] * 2, abs=WHEELS / 10)


def test_a_stop_on_a_slope_rocks_back_and_is_held():
    car, run = scenario('stop_hold')
    v = np.array([snapshot.twist_body[0] for snapshot in run])
    x = np.array([snapshot.pose[0] for snapshot in run])
    rest = int(np.argmax(v <= 0.0))   # the first tick that ends at rest or behind
    assert car.dt * (rest + v[rest - 1] / (v[rest - 1] - v[rest])) == pytest.approx(
        2.71744, abs=1e-4)
    assert x.max() - x[rest:].min() == pytest.approx(17.3e-3, abs=1e-4)
    later = rest + 1000
    assert abs(v[later]) == pytest.approx(0.06e-3, abs=0.01e-3)
    assert abs(x[later + 10_000] - x[later]) == pytest.approx(2e-6, abs=5e-7)
    assert abs(v[-1]) < 1e-12


def test_tip_in_and_tip_out_through_backlash():
    car, run = scenario('tip')
    torque = np.array([s.torque[car.connections.index('rear_left_half')] for s in run])
    peak = int(torque.argmax())
    assert car.dt * (peak + 1) == pytest.approx(0.660, abs=1e-9)
    # the twist is the integral of speeds that are right to 0.1 rad/s where the gap closes
    assert torque[peak] == pytest.approx(1055.25, abs=0.1)
    assert torque[1600:1700].mean() == pytest.approx(590.9, rel=1e-3)
    assert torque[1700:].min() == pytest.approx(-465.17, abs=0.1)
    assert run[-1].twist_body[0] == pytest.approx(9.76355957, abs=BODY / 10)


def test_a_double_lane_change():
    car, run = scenario('lane')
    yaw = np.array([snapshot.twist_body[2] for snapshot in run])
    assert car.dt * (int(yaw.argmax()) + 1) == pytest.approx(0.820, abs=1e-9)
    assert (yaw.max(), yaw.min()) == pytest.approx((0.237863, -0.237590), abs=2e-6)
    assert run[-1].twist_body[0] == pytest.approx(22.309583, abs=BODY / 10)


@pytest.mark.parametrize('name, duration, better', [
    ('lift_front', 1.0, 10), ('tip', 0.8, 1), ('lane', 1.0, 10)])
def test_every_tick_is_near_to_a_stiff_solver(name, duration, better):
    found = distances(until(SCENARIOS[name], duration))
    assert (found < [BODY / better, WHEELS / better, OTHERS]).all()


@pytest.mark.parametrize('name', SCENARIOS)
def test_the_books_close_and_load_changes_are_a_small_entry(name):
    car, _ = scenario(name)
    energy = car.energy
    assert energy.lost == pytest.approx(sum(car.losses.values()), rel=1e-12)
    turned_over = abs(energy.work) + energy.lost
    assert abs(energy.numerical) < 1e-5 * turned_over
    assert abs(energy.parametric) + abs(energy.jumps) < 3e-4 * turned_over


def test_no_loss_ever_gives_energy_back():
    car = Driveline('awd', planar=True, parameters=GAPS)
    car.reset(12.0, 0.05)
    rng, before = np.random.default_rng(1), car.losses
    for tick in range(600):
        if tick % 20 == 0:
            inputs = {'torque': rng.normal(0, 300), 'steer': rng.normal(0, 0.1),
                      'brakes': tuple(rng.uniform(0, 600, 4) * rng.integers(0, 2)),
                      'grip': tuple(rng.uniform(0.1, 1.0, 4)), 'wind': rng.normal(0, 10),
                      'clutch_forces': {'centre_rear': rng.uniform(0, 2000)}}
        car.step(**inputs)
        after = car.losses
        assert all(after[name] >= before[name] for name in after)
        before = after
    assert set(after) >= {'centre_front_mesh', 'front_final_drive', 'rear_pinion_bearing',
                          'front_left_half_shaft', 'rear_right_slip', 'front_left_brake',
                          'front_left_rolling', 'drag', 'centre_rear_clutch'}


def test_wind_from_behind_works_on_a_standing_car():
    car = Driveline('fwd', parameters={'driveline.rolling_resistance': 0.0})
    for _ in range(300):
        car.step(wind=-30.0)
    energy = car.energy
    assert car.snapshot().twist_body[0] > 0.0 and energy.input == energy.gravity == 0.0
    # what the wind takes from the air is more than the car gets of it
    assert energy.wind == pytest.approx(energy.stored + energy.lost, rel=1e-4)


def smooth(dt, **more):
    """Return a run of 0.4 s with whole ticks alone, from 15 m/s with steps of torque and steer."""
    car = Driveline('awd', True, dt, {'driveline.max_parts': 1, **more})
    car.reset(15.0)
    for _ in range(round(0.4 / dt)):
        snapshot = car.step(torque=100.0, steer=0.01)
    return car, np.array([*snapshot.twist_body, *snapshot.velocity[-4:], *snapshot.pose])


@pytest.mark.parametrize('jacobian_ticks', [0, 8])
def test_the_step_is_of_second_order(jacobian_ticks):
    kept = {'driveline.jacobian_ticks': jacobian_ticks}
    _, exact = smooth(1e-4)
    errors = [np.abs(smooth(dt, **kept)[1] - exact).max() for dt in (4e-3, 2e-3, 1e-3)]
    ratios = np.divide(errors[:-1], errors[1:])
    assert (ratios > 3.3).all() and (ratios < 5.0).all(), errors


def test_what_the_books_miss_is_of_second_order():
    errors = [abs(smooth(dt)[0].energy.numerical) for dt in (4e-4, 2e-4, 1e-4)]
    ratios = np.divide(errors[:-1], errors[1:])
    assert (ratios > 3.3).all() and (ratios < 5.0).all(), errors


def test_shafts_a_thousand_times_as_stiff_cost_next_to_nothing():
    stiff = {f'driveline.shaft.{kind}.stiffness': 1000 * value for kind, value in (
        ('input', 3e4), ('front_propeller', 2e4), ('rear_propeller', 1.5e4), ('half', 1e4))}
    hill, parts = SCENARIOS['hill_axle_ice'], []
    _, first = hill.changes[0]
    for parameters in ({}, stiff):
        car = Driveline(hill.layout, hill.planar, parameters=parameters)
        car.reset(hill.speed, first['grade'])
        parts.append([car.parts for _ in drive(car, {}, hill.changes, 2.0)])
    soft, hard = np.mean(parts, axis=1)
    assert np.median(parts[1]) == 1 and hard < 1.1 * soft


def test_steps_of_ten_milliseconds_stay_stable():
    ends = []
    for dt, parts in ((0.01, 1), (0.001, 4)):
        car = Driveline('awd', True, dt, {'driveline.max_parts': parts})
        car.reset(10.0)
        for _ in range(round(3.0 / dt)):
            snapshot = car.step(torque=300.0, steer=0.02)
        ends.append(np.array([*snapshot.twist_body, *snapshot.velocity[-4:]]))
    assert ends[0] == pytest.approx(ends[1], rel=2e-3)


@pytest.mark.parametrize('dt, max_parts', [(0.005, 1), (0.02, 4)])
def test_brakes_that_lock_within_a_step_make_next_to_no_energy(dt, max_parts):
    car = Driveline('awd', True, dt, {'driveline.max_parts': max_parts})
    car.reset(30.0)
    begin = car.stored_energy
    for snapshot in drive(car, {'brakes': (2000.0,) * 4}, [], 6.0):
        assert np.abs(snapshot.velocity).max() < 400.0
        assert np.abs(snapshot.slip).max() <= 1.0
    assert abs(snapshot.twist_body[0]) < 1.0
    assert abs(car.energy.numerical) < 0.01 * begin


@pytest.mark.parametrize('max_parts', range(1, 40))
def test_a_tick_is_tried_in_parts_that_are_bounded(max_parts):
    numbers = cuts(max_parts)
    assert numbers[0] == 1 and numbers[-1] == max_parts and sum(numbers) <= 2 * max_parts - 1


@pytest.mark.parametrize('max_parts', [1, 2, 3, 4, 7])
@pytest.mark.parametrize('tolerance', [1e-8, 1e-4, 2e-3])
def test_no_tick_takes_more_trials_than_the_bound(monkeypatch, max_parts, tolerance):
    invert, trials = np.linalg.inv, []
    monkeypatch.setattr(np.linalg, 'inv', lambda W: (trials.append(1), invert(W))[1])   # one each
    car = Driveline('rwd', parameters={
        **GAPS, 'driveline.max_parts': max_parts, 'driveline.tolerance': tolerance})
    car.reset(8.0)
    most = 0
    for _ in drive(car, {'torque': 400.0, 'brakes': (0.0, 0.0, 900.0, 0.0)}, [], 0.05):
        most = max(most, len(trials))
        trials.clear()
    assert most <= 2 * max_parts - 1
    assert max_parts == 1 or most > 1


def test_a_hard_tick_is_cut_and_a_quiet_one_is_not():
    car, run = scenario('tip')
    assert car.parts == 1
    car.reset(8.0)
    parts = []
    for _ in drive(car, {'torque': 400.0}, [], 0.1):
        parts.append(car.parts)
    assert set(parts) <= {1, 2, 4} and max(parts) > 1


def test_a_car_held_on_a_slope_does_not_creep():
    car = Driveline('rwd')
    car.reset(0.0, 0.15)
    positions = []
    for _ in range(20_000):
        positions.append(car.step(brakes=(900.0,) * 4, grade=0.15).pose[0])
    assert 1e-3 < abs(positions[-1]) < 0.05   # it has gone back into tyres and pads
    assert abs(car.snapshot().twist_body[0]) < 1e-12
    assert abs(positions[-1] - positions[-1000]) < 1e-12


def test_brakes_below_seven_tenths_do_not_creep_when_the_car_is_shaken():
    car = Driveline('rwd')
    car.reset(0.0, 0.05)
    held = {'brakes': (900.0,) * 4, 'grade': 0.05}

    def wheels_at_rest():
        *_, last = drive(car, held, [], 6.0)
        assert np.abs(last.velocity[-4:]).max() < 1e-5
        return np.array(last.position[-4:])
    before, moved = wheels_at_rest(), 0.0
    for tick in range(2000):
        snapshot = car.step(torque=40.0 * math.sin(0.05 * tick), **held)
        moved = max(moved, abs(snapshot.position[-1] - before[-1]))
    assert moved > 2e-4 and sum(car.losses[f'{wheel}_brake'] for wheel in car.wheels) > 0.0
    assert wheels_at_rest() == pytest.approx(before, abs=1e-6)


def test_at_rest_on_the_level_nothing_moves_at_all():
    car = Driveline('awd', planar=True)
    for _ in range(100):
        snapshot = car.step()
    assert not any((*snapshot.velocity, *snapshot.position, *snapshot.torque, *snapshot.pose,
                    *snapshot.twist_body))


def test_the_mirrored_run_is_the_run_mirrored():
    def run(steer, swap):
        car = Driveline('awd', planar=True, parameters=GAPS)
        car.reset(15.0)
        brakes, grip = (100.0, 0.0, 30.0, 300.0), (0.5, 1.0, 0.8, 1.0)
        for _ in range(500):
            snapshot = car.step(torque=200.0, steer=steer,
                                brakes=tuple([brakes[n] for n in swap]),
                                grip=tuple([grip[n] for n in swap]))
        return snapshot
    one, other = run(0.03, (0, 1, 2, 3)), run(-0.03, (1, 0, 3, 2))
    v_x, v_y, r = other.twist_body
    assert (v_x, -v_y, -r) == pytest.approx(one.twist_body, abs=1e-9)
    wheels = other.velocity[-4:]
    assert [wheels[n] for n in (1, 0, 3, 2)] == pytest.approx(one.velocity[-4:], abs=1e-8)
    x, y, yaw = other.pose
    assert (x, -y, -yaw) == pytest.approx(one.pose, abs=1e-9)


def test_backlash_only_pushes():
    car, run = scenario('tip')
    gaps = {'input': 0.01, 'rear_left_half': 0.0175, 'rear_right_half': 0.0175}
    inside = 0
    for snapshot in run:
        for name, T, phi in zip(car.connections, snapshot.torque, snapshot.twist):
            if abs(phi) <= gaps[name]:
                inside += 1
                assert T == 0.0
            else:
                assert T * phi >= 0.0
    assert inside > 30


@pytest.mark.parametrize('jacobian_ticks', [0, 8])
def test_equal_inputs_give_equal_bits_also_after_a_reset(jacobian_ticks):
    def run(car):
        car.reset(5.0, 0.02)
        changes = in_order(ramp('torque', 0.0, 400.0, 4, 0.05, 0.1),
                           ramp('brakes', NONE, (600.0,) * 4, 5, 0.1, 0.15))
        return list(drive(car, {'grip': (0.2, 1.0, 1.0, 1.0)}, changes, 0.3)), car.energy
    car = Driveline('awd', True, parameters={'driveline.jacobian_ticks': jacobian_ticks})
    assert run(car) == run(Driveline(
        'awd', True, parameters={'driveline.jacobian_ticks': jacobian_ticks})) == run(car)


def test_who_drives_is_told_of_each_differential():
    car = Driveline('awd')
    car.reset(10.0)
    flows = [list(drive(car, {'torque': torque}, [], 0.5))[-1].power_flow
             for torque in (200.0, -60.0)]
    assert flows == [(1, 1, 1), (-1, -1, -1)]


def test_an_actuator_follows_its_command_up_to_its_limit():
    car = Driveline('awd', parameters={
        'driveline.centre.clutch.rear.actuator_time_constant': 0.01,
        'driveline.centre.clutch.front.actuator_limit': 300.0})
    for _ in range(10):
        car.step(clutch_forces={'centre_rear': 1000.0, 'centre_front': 1000.0})
    assert car.clutch_force == pytest.approx((300.0, 1000.0 * (1 - math.exp(-1.0))))


def test_clutches_of_an_axle_lock_it():
    def speeds(force):
        plates = {'driveline.front.clutch.left.friction_surfaces': 16,
                  'driveline.front.pressure_angle': 0.0}
        car = Driveline('fwd', parameters=plates)
        assert car.clutches == ('front_left', 'front_right')
        run = drive(car, {'torque': 200.0, 'grip': (0.1, 1.0, 1.0, 1.0),
                          'clutch_forces': {'front_left': force}}, [], 1.0)
        *_, last = run
        return last.velocity[-4:-2]
    (spinning, slow), (left, right) = speeds(0.0), speeds(15_000.0)
    assert spinning > 5 * slow and left == pytest.approx(right, rel=0.2)


def test_names_and_numbers_of_a_snapshot():
    car = Driveline('awd', planar=True)
    snapshot = car.step(torque=10.0)
    assert car.shafts == (
        'input', 'centre_carrier', 'centre_front', 'centre_rear', 'centre_satellite',
        *[f'{end}_axle_{shaft}' for end in ('front', 'rear')
          for shaft in ('carrier', 'left', 'right', 'pinion', 'satellite')],
        'front_left', 'front_right', 'rear_left', 'rear_right')
    assert car.connections == (
        'input', 'front_propeller', 'rear_propeller', 'front_left_half', 'front_right_half',
        'rear_left_half', 'rear_right_half')
    assert car.moments[:5] == ('centre_front_mesh', 'centre_rear_mesh', 'centre_front_clutch',
                               'centre_rear_clutch', 'front_final_drive')
    assert car.clutches == ('centre_front', 'centre_rear')
    assert car.inputs[:6] == ('input', 'front_left_brake', 'front_right_brake', 'rear_left_brake',
                              'rear_right_brake', 'centre_front_clutch')
    for names, numbers in ((car.shafts, snapshot.velocity), (car.shafts, snapshot.position),
                           (car.connections, snapshot.torque), (car.connections, snapshot.twist),
                           (car.moments, snapshot.moment), (car.wheels, snapshot.slip),
                           (car.wheels, snapshot.wheel_force), (car.wheels, snapshot.wheel_load),
                           (DIFFERENTIALS['awd'], snapshot.power_flow)):
        assert len(names) == len(numbers)
    assert snapshot.time == car.time == 0.001 and car.snapshot() == snapshot


def test_a_reset_rolls_freely():
    for layout, g_F in (('fwd', 3.517), ('rwd', 3.517), ('awd', 3.517)):
        car = Driveline(layout)
        car.step(torque=100.0)
        car.reset(8.0, -0.1)
        speeds = dict(zip(car.shafts, car.snapshot().velocity))
        assert speeds['input'] == pytest.approx(g_F * 8.0 / 0.32, rel=1e-12)
        assert speeds['rear_left'] == 25.0
        assert not any(car.snapshot().twist) and not any(map(any, car.snapshot().slip))
        assert car.time == 0.0 and car.snapshot().pose == (0.0, 0.0, 0.0)
        assert car.energy[:3] == (0.0, 0.0, 0.0) and not any(car.losses.values())


def test_positions_are_the_integrals_of_the_speeds():
    car, run = scenario('lane')
    way = np.array([[snapshot.velocity[0], snapshot.velocity[-1]] for snapshot in run])
    turned = car.dt * (way.sum(0) - way[-1] / 2 + [22.0 / 0.32 * 3.517 / 2, 22.0 / 0.32 / 2])
    position = run[-1].position
    assert (position[0], position[-1]) == pytest.approx(tuple(turned), rel=1e-9)


def test_a_keeping_jacobian_goes_the_same_way():
    tight = scenario('lane')[1][:1500]
    _, (_, *kept) = run_of(until(SCENARIOS['lane'], 1.5),
                           parameters={'driveline.jacobian_ticks': 8})
    assert max(abs(a.twist_body[2] - b.twist_body[2]) for a, b in zip(tight, kept)) < 2e-5


def test_contact_and_grip_default_to_the_whole_road():
    one, other = Driveline(), Driveline()
    assert one.step(torque=50.0) == other.step(50.0, NONE, {}, 0.0, 0.0, ALL, ALL, 0.0)


def test_sign_speed_reaches_all_differentials():
    car = Driveline('awd', parameters=sign_speeds('awd', 0.5))
    assert [value for name, value in car.parameters.items()
            if name.endswith('mesh_sign_speed')] == [0.5] * 3
