# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What a driveline refuses, in which words; after a refusal the old state goes on."""

from fractions import Fraction
import math

import pytest

from dm_ros import Driveline
from dm_ros.driveline.layouts import HALF, wheels

NAN, INF = math.nan, math.inf


@pytest.fixture(scope='module')
def car():
    car = Driveline('awd', planar=True)
    car.reset(10.0)
    car.step(torque=100.0)
    return car


@pytest.mark.parametrize('inputs, words', [
    ({'torque': NAN}, ['torque: the torque on input is nan']),
    ({'torque': -INF}, ['torque: the torque on input is -inf']),
    ({'torque': '5'}, ["torque: '5' is not allowed", 'a number']),
    ({'torque': True}, ['torque: True is not allowed']),
    ({'torque': None}, ['torque: None is not allowed']),
    ({'brakes': (0.0, -1.0, 0.0, 0.0)},
     ['brakes: the capacity on front_right_brake is -1.0', 'must not be below 0']),
    ({'brakes': (0.0, 0.0, NAN, 0.0)}, ['brakes: the capacity on rear_left_brake is nan']),
    ({'brakes': (1.0, 1.0)}, ['brakes: (1.0, 1.0) must be 4 numbers', 'front_left, front_right']),
    ({'brakes': 5.0}, ['brakes: 5.0 must be 4 numbers']),
    ({'clutch_forces': {'centre_rear': -1.0}},
     ['clutch_forces: the force on centre_rear_clutch is -1.0', 'must not be below 0']),
    ({'clutch_forces': {'rear_left': 1.0}},
     ["clutch_forces: 'rear_left' is not one of centre_front, centre_rear"]),
    ({'clutch_forces': (1.0, 2.0)}, ['clutch_forces: (1.0, 2.0) must be {clutch: N}']),
    ({'clutch_forces': {'centre_rear': NAN}}, ['force on centre_rear_clutch is nan']),
    ({'steer': 1.5}, ['steer: the angle on steer is 1.5', 'must not be above 1']),
    ({'steer': NAN}, ['steer: the angle on steer is nan']),
    ({'grade': 11.0}, ['grade: the tangent on grade is 11.0', 'must not be above 10']),
    ({'grip': (1.0, 1.0, 1.0, 0.0)}, ['grip: the share on rear_right_grip is 0.0']),
    ({'grip': (1.0, -1.0, 1.0, 1.0)}, ['grip: the share on front_right_grip is -1.0']),
    ({'contact': (-0.1, 1.0, 1.0, 1.0)},
     ['contact: the share on front_left_contact is -0.1', 'must not be below 0']),
    ({'contact': (1.0, 1.0, INF, 1.0)}, ['contact: the share on rear_left_contact is inf']),
    ({'wind': NAN}, ['wind: the head wind on wind is nan']),
    ({'torque': 1e300}, ['lead out of the range of floating point numbers']),
    ({'wind': 1e200}, ['lead out of the range of floating point numbers']),
])
@pytest.mark.parametrize('jacobian_ticks', [0, 8])
def test_bad_inputs_are_refused_by_name_and_the_old_state_goes_on(inputs, words, jacobian_ticks):
    kept = {'driveline.jacobian_ticks': jacobian_ticks}
    car, other = (Driveline('awd', planar=True, parameters=kept) for _ in range(2))
    for one in (car, other):
        one.reset(10.0)
        one.step(torque=100.0)
    before = car.snapshot(), car.energy, car.losses
    with pytest.raises(ValueError) as error:
        car.step(**inputs)
    assert all(word in str(error.value) for word in words), str(error.value)
    assert (car.snapshot(), car.energy, car.losses) == before
    for torque in (120.0, 120.0, -50.0):
        assert car.step(torque=torque) == other.step(torque=torque)
    assert car.energy == other.energy


def test_a_longitudinal_body_cannot_steer():
    with pytest.raises(ValueError, match='steer: 0.1 is not allowed, it must be 0'):
        Driveline('awd').step(steer=0.1)


def test_clutches_are_refused_where_there_are_none():
    with pytest.raises(ValueError, match="'front_left' is not allowed, there is no clutch"):
        Driveline('fwd').step(clutch_forces={'front_left': 1.0})


def test_whatever_is_a_number_is_taken(car):
    one, other = Driveline(), Driveline()
    assert one.step(torque=Fraction(1, 2), brakes=[1, 2, 3, 4]) == other.step(
        torque=0.5, brakes=(1.0, 2.0, 3.0, 4.0))


@pytest.mark.parametrize('arguments, words', [
    ({'layout': '4wd'}, ["layout: '4wd' is not one of fwd, rwd, awd"]),
    ({'layout': None}, ['layout: None is not one of fwd, rwd, awd']),
    ({'planar': 1}, ['planar: 1 is not allowed']),
    ({'dt': 0.0}, ['dt: 0.0 is not allowed', 'positive']),
    ({'dt': NAN}, ['dt: nan is not allowed']),
    ({'parameters': [1]}, ['parameters: list is not a mapping']),
    ({'parameters': {'driveline.mas': 1.0}}, ['driveline.mas: there is no such parameter']),
    ({'parameters': {'driveline.mass': -1.0}}, ['driveline.mass: -1.0', '(0, 1e+06]']),
    ({'parameters': {'driveline.mass': NAN}}, ['driveline.mass: nan']),
    ({'parameters': {'driveline.max_parts': 2.5}}, ['driveline.max_parts: 2.5', 'an integer']),
    ({'parameters': {'driveline.shaft.half.gap': -0.1}}, ['driveline.shaft.half.gap: -0.1']),
    ({'parameters': {'driveline.tyre.damping': 4.0}},
     ['driveline.tyre.damping: damping times low_speed is 1', '0.75']),
    ({'parameters': {'driveline.brake.damping': 5.0}},
     ['driveline.brake.damping: damping times low_speed is 1.25']),
    ({'parameters': {'driveline.front.final_drive_ratio': 0.0}},
     ['driveline.front.final_drive_ratio: 0.0', 'must not be 0']),
    ({'parameters': {'driveline.centre.clutch.rear.friction_coefficient': 9.0}},
     ['driveline.centre.clutch.rear', 'locks itself']),
    ({'layout': 'fwd', 'parameters': {'driveline.rear.satellite_count': 2}},
     ['driveline.rear.satellite_count: there is no such parameter in this layout']),
    ({'parameters': {'driveline.front.inertia.carrier': 1e-6,
                     'driveline.front.viscosity.carrier': 1e6,
                     'driveline.front.efficiency.carrier_bearing': 1e-320}},
     ['driveline.front: the equations of these parameters have no finite solution']),
])
def test_bad_arguments_are_refused_by_name(arguments, words):
    with pytest.raises(ValueError) as error:
        Driveline(**arguments)
    assert all(word in str(error.value) for word in words), str(error.value)


@pytest.mark.parametrize('speed, grade, words', [
    (NAN, 0.0, 'speed: nan'), (1e4, 0.0, 'speed: 10000.0'), (0.0, INF, 'grade: inf')])
def test_a_bad_reset_is_refused(speed, grade, words):
    car = Driveline()
    before = car.step(torque=100.0)
    with pytest.raises(ValueError, match=words):
        car.reset(speed, grade)
    assert car.snapshot() == before


def no_input(car):
    wheels(car, 'front', 1.0, is_front=True)
    wheels(car, 'rear', -1.0, is_front=False)


def no_rear(car):
    car.input()
    wheels(car, 'front', 1.0, is_front=True)


def twice(car):
    car.axle('rear')
    car.axle('rear')


def two_connections(car):
    rear, (left, right) = car.axle('rear'), wheels(car, 'rear', -1.0, is_front=False).values()
    car.connect('half', rear.left, left, HALF)
    car.connect('half', rear.right, right, HALF)


def two_kinds(car):
    rear, (left, right) = car.axle('rear'), wheels(car, 'rear', -1.0, is_front=False).values()
    car.connect('left', rear.left, left, HALF)
    car.connect('right', rear.right, right, HALF._replace(stiffness=5.0))


def no_inertia(car):
    car.inertia('case', 0.0)


def strange_flange(car):
    car.connect('input', car.input(), ('rear', 'pinion'), HALF)


def no_shaft(car):
    car.connect('input', car.input(), car.axle('rear').pinion, None)


@pytest.mark.parametrize('layout, words', [
    (no_input, 'layout: there is no input'), (no_rear, 'no wheel carries the rear'),
    (twice, 'two elements rear'), (two_connections, 'two connections half'),
    (two_kinds, 'two kinds have one name'), (no_inertia, 'the inertia of case is 0.0'),
    (strange_flange, 'input: there is no flange'), (no_shaft, 'input: None is no Shaft')])
def test_a_layout_that_is_none_is_refused(layout, words):
    with pytest.raises(ValueError, match=words):
        Driveline(layout)
