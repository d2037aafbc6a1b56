# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What ``watch`` tells the page of a driveline is what its car is and does."""

from math import atan, hypot, isfinite, tan

import numpy as np
import pytest

from dm_ros import Driveline
from dm_ros.files.published_driveline import PublishedDriveline
from dm_ros.mechanism.variants import VARIANTS
from dm_ros.watch.commands import Commands
from dm_ros.watch.scenes import known_names, scene_of

LAYOUTS = 'fwd', 'rwd', 'awd'
WHEELS = 'front_left', 'front_right', 'rear_left', 'rear_right'


class Car:
    """A driveline, its scene, and what the scene tells of its ticks."""

    def __init__(self, layout='awd', planar=True, speed=0.0, dt=0.001, **parameters):
        parameters = {f'driveline.{name}'.replace('__', '.'): value
                      for name, value in parameters.items()}
        self.car = Driveline(layout, planar, dt, parameters)
        self.car.reset(speed)
        self.scene = scene_of('/driveline', {
            'layout': layout, 'planar': planar, 'rate': 1.0 / dt, **parameters})
        self._published = PublishedDriveline(self.car)

    def parts(self, snapshot):
        """Return what the topics have of a tick."""
        car = self.car
        arrays = dict(zip(self._published.names, self._published.arrays(
            snapshot, car.torque, car.slip_speed, car.clutch_force)))
        return (*[tuple(arrays[topic]) for topic in self.scene.names],
                (snapshot.pose, snapshot.twist_body))

    def told(self, ticks=1, **inputs):
        """Advance and return the last ``Snapshot`` and what is told of it."""
        for _ in range(ticks):
            snapshot = self.car.step(**inputs)
        return snapshot, self.scene.told(self.parts(snapshot), snapshot.position)


def test_a_node_is_known_by_its_parameters():
    for layout in LAYOUTS:
        description = scene_of('/car', {'layout': layout}).description
        assert (description['kind'], description['layout']) == ('driveline', layout)
    for variant in VARIANTS:
        description = scene_of('/car', {'variant': variant}).description
        assert (description['kind'], description['variant']) == ('differential', variant)
    names = known_names()
    assert {'layout', 'variant', 'driveline.track', 'lsd.satellite_ratio'} <= names
    assert set(Driveline().parameters) <= names


@pytest.mark.parametrize('planar', [False, True])
@pytest.mark.parametrize('layout', LAYOUTS)
def test_the_names_are_those_of_the_driveline_and_of_its_topics(layout, planar):
    it = Car(layout, planar)
    car, description = it.car, it.scene.description
    assert description['wheels'] == car.wheels == WHEELS
    assert description['connections'] == car.connections
    assert [one['name'] for one in description['differentials']] == list(car.differentials)
    for one in description['differentials']:
        assert {one['input'], *one['outputs']} <= set(car.shafts)
        assert one['input'] in car.driven_by
    assert list(it.scene.flows) == [f'power_flow/{name}' for name in car.differentials]
    prefixed = scene_of('/car', {'layout': layout, 'joint_prefix': 'my_', 'base_frame_id': 'car'})
    published = PublishedDriveline(car, 'my_', 'car')
    assert prefixed.names == {topic: published.names[topic] for topic in prefixed.names}
    assert prefixed.frame == published.frame == prefixed.odometry[1]


def test_the_wheels_are_where_the_car_has_them():
    description = Car(front_distance=1.1, rear_distance=1.7, track=1.4).scene.description
    assert dict(zip(description['wheels'], description['places'])) == {
        'front_left': (1.1, 0.7), 'front_right': (1.1, -0.7),
        'rear_left': (-1.7, 0.7), 'rear_right': (-1.7, -0.7)}
    assert description['weight'] == pytest.approx(1600 * 9.81)


@pytest.mark.parametrize('planar', [False, True])
@pytest.mark.parametrize('layout', LAYOUTS)
def test_a_tick_has_a_number_for_each_line_of_the_strips(layout, planar):
    it = Car(layout, planar, 10.0)
    snapshot, _ = it.told(300, torque=200.0, steer=0.03 if planar else 0.0)
    strips = {strip['name']: strip for strip in it.scene.description['strips']}
    assert {name: strip['unit'] for name, strip in strips.items()} == {
        'wheels': 'rad/s', 'body': 'm/s', **({'yaw': 'rad/s'} if planar else {}),
        'halves': 'N m', 'shafts': 'N m'}
    columns = dict(zip([series for strip in strips.values() for series in strip['series']],
                       it.scene.row(it.parts(snapshot)), strict=True))
    for wheel in WHEELS:
        assert columns[wheel] == snapshot.velocity[it.car.shafts.index(wheel)]
    for connection, torque in zip(it.car.connections, snapshot.torque):
        assert columns[connection] == torque != 0.0
    twist = dict(zip(('forward', 'sideways', 'yaw_rate'), snapshot.twist_body))
    assert {name: columns[name] for name in columns if name in twist} == {
        name: twist[name] for name in (list(twist) if planar else ['forward'])}


def test_forces_loads_and_torques_are_those_of_the_snapshot():
    it = Car(speed=12.0)
    snapshot, told = it.told(200, torque=300.0, steer=0.05)
    assert [tuple(force) for force in told['force']] == list(snapshot.wheel_force)
    assert [tuple(slip) for slip in told['slip']] == list(snapshot.slip)
    assert told['load'] == list(snapshot.wheel_load)
    assert told['torque'] == list(snapshot.torque)
    assert (tuple(told['pose']), tuple(told['twist'])) == (snapshot.pose, snapshot.twist_body)


@pytest.mark.parametrize('speed, steer', [(15.0, 0.07), (15.0, -0.3), (-4.0, 0.2), (0.02, 0.4)])
def test_the_wheels_are_turned_as_they_are_steered(speed, steer):
    it = Car(speed=speed)
    _, told = it.told(40, steer=steer)
    L, half = 1.25 + 1.40, 1.55 / 2
    wanted = [atan(tan(steer) / (1 - y * tan(steer) / L)) for y in (half, -half)]
    assert told['steer'] == pytest.approx([*wanted, 0.0, 0.0], abs=1e-9)


def test_a_car_that_stands_keeps_the_angle_that_was_seen():
    it = Car(speed=1.0)
    _, before = it.told(10, steer=0.2)
    assert before['steer'][0] > 0.2
    snapshot, told = it.told(12_000, steer=0.2, brakes=(900.0,) * 4)
    assert hypot(*snapshot.twist_body[:2]) < 1e-7
    assert told['steer'] == pytest.approx(before['steer'])


@pytest.mark.parametrize('speed, torque, brake', [(15.0, 400.0, 0.0), (15.0, 0.0, 700.0),
                                                  (0.0, 800.0, 0.0), (15.0, 0.0, 9000.0)])
def test_the_grip_of_the_road_is_found_and_what_is_used_of_it(speed, torque, brake):
    it, grips = Car(speed=speed, tyre__load_sensitivity=0.0), (0.08, 1.0, 0.5, 0.9)
    _, told = it.told(250, torque=torque, brakes=(brake,) * 4, grip=grips)
    assert told['grip'] == pytest.approx(grips, rel=1e-6)
    for force, load, grip, used in zip(told['force'], told['load'], grips, told['used']):
        assert used == pytest.approx(hypot(*force) / (grip * load), rel=1e-6)
    assert max(told['used']) > 0.7 and max(told['used']) <= 1.0 + 1e-9
    _, told = it.told(1, torque=torque, brakes=(brake,) * 4, grip=(0.7, *grips[1:]))
    assert told['grip'][0] == pytest.approx(0.7, rel=1e-6)   # at once


def test_a_wheel_in_the_air_has_no_grip_to_tell_and_one_that_only_rolls_none_either():
    it = Car(speed=5.0, rolling_resistance=0.0, drag_area=0.0)
    _, told = it.told(5, contact=(0.0, 1.0, 1.0, 1.0))
    assert told['grip'] == [None] * 4
    assert told['used'][0] == 0.0
    assert told['used'][1:] == pytest.approx(
        [hypot(*force) / load for force, load in zip(told['force'][1:], told['load'][1:])])


@pytest.mark.parametrize('layout', LAYOUTS)
def test_what_goes_into_a_differential_and_does_not_come_out_is_its_loss(layout):
    it, work = Car(layout, planar=False), 0.0
    for n in range(5000):   # from rest to rest: nothing stays in what turns
        snapshot, told = it.told(
            torque=400.0 * min(n / 200, 1.0) if n < 1000 else 0.0, grip=(0.3, 1.0, 1.0, 1.0),
            brakes=(1500.0 * min(max(n - 1000, 0) / 300, 1.0),) * 4)
        work += it.car.dt * np.array([power[0] - sum(power[1:]) for power in told['power']])
    assert max(map(abs, snapshot.velocity)) < 0.1
    for differential, work_of_one in zip(it.car.differentials, work):
        lost = sum(it.car.losses[name] for name in it.car.kinds_of_loss[differential])
        assert lost > 50.0 and work_of_one == pytest.approx(lost, rel=0.02)


def test_power_that_goes_in_is_torque_times_speed_and_passes_from_one_to_the_next():
    it = Car(planar=False, speed=10.0)
    snapshot, told = it.told(1500, torque=300.0)
    centre, front, rear = told['power']
    torque = dict(zip(it.car.connections, snapshot.torque))
    speed = dict(zip(it.car.shafts, snapshot.velocity))
    assert centre[0] == torque['input'] * speed['centre_carrier']
    assert centre[1:] == [torque['front_propeller'] * speed['centre_front'],
                          torque['rear_propeller'] * speed['centre_rear']]
    assert front[1:] == [torque[f'front_{side}_half'] * speed[f'front_axle_{side}']
                         for side in ('left', 'right')]
    for into, (driven, *_) in zip(centre[1:], (front, rear)):   # nothing is lost in a shaft
        assert driven == pytest.approx(into, rel=1e-3)
    for power in told['power']:
        assert 0.9 * power[0] < sum(power[1:]) < power[0]
    it.scene.take_flow('power_flow/front', -1)
    assert it.scene.told(it.parts(snapshot), snapshot.position)['flow'] == [None, -1, None]


def test_what_can_be_commanded_has_its_range_and_what_stands_for_zero():
    ports = {port['name']: port for port in Car(planar=True).scene.ports}
    assert list(ports) == [
        'input', *[f'{wheel}_brake' for wheel in WHEELS],
        *[f'centre_{side}_clutch' for side in ('front', 'rear')], 'steer', 'grade',
        *[f'{wheel}_{what}' for what in ('grip', 'contact') for wheel in WHEELS]]
    for port in ports.values():
        assert isfinite(port['low']) and isfinite(port['high'])   # what JSON has
        assert port['low'] <= port['zero'] <= port['to'] <= port['high']
        assert port['from'] == (-port['to'] if port['low'] < 0.0 else 0.0)
    assert {name for name, port in ports.items() if port['zero']} == {
        f'{wheel}_{what}' for what in ('grip', 'contact') for wheel in WHEELS}
    assert 'steer' not in {port['name'] for port in Car(planar=False).scene.ports}
    commands = Commands()
    commands.begin(list(ports.values()))
    commands.zero('me')
    assert commands.values['rear_left_grip'] == 1.0 and commands.values['steer'] == 0.0
