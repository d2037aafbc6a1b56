# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A driveline as the node drives it, without ROS: inputs, staleness, refusals, parameters."""

import logging

import pytest

from dm_ros import Driveline
from dm_ros.driveline_plant import all_rows, DrivelinePlant, make_driveline
from dm_ros.motion.held_inputs import Joints

LOG = logging.getLogger('test')
NAN = float('nan')


def plant_with(**parameters):
    return DrivelinePlant({name.replace('__', '.'): value for name, value in parameters.items()},
                          LOG)


def test_a_tick_is_that_of_the_library_under_the_same_inputs():
    plant = plant_with(rate=500.0, planar=True, initial_speed=8.0)
    car = Driveline('awd', True, 0.002)
    car.reset(8.0)
    names = ['input', 'front_right_brake', 'centre_rear_clutch', 'steer', 'grade',
             'rear_left_grip', 'rear_right_contact']
    values = [300.0, 20.0, 900.0, 0.03, 0.05, 0.4, 0.9]
    assert plant.take(names, values, 'test')
    for _ in range(40):
        expected = car.step(300.0, (0.0, 20.0, 0.0, 0.0), {'centre_rear': 900.0}, 0.03, 0.05,
                            (1.0, 1.0, 0.4, 1.0), (1.0, 1.0, 1.0, 0.9))
        assert plant.tick() == expected
    assert plant.ticks == plant.simulation.ticks == 40
    plant.reset()
    car.reset(8.0)
    assert plant.tick() == car.step()


def test_every_port_but_the_wind_has_a_topic_of_its_own():
    plant = plant_with()
    assert plant.single_topics['torque/input'] == 'input'
    assert plant.single_topics['brake/rear_left'] == 'rear_left_brake'
    assert plant.single_topics['clutch/centre_front'] == 'centre_front_clutch'
    assert plant.single_topics['grip/front_right'] == 'front_right_grip'
    assert plant.single_topics['contact/front_right'] == 'front_right_contact'
    assert {'steer', 'grade'} <= set(plant.single_topics)
    assert sorted(plant.single_topics.values()) == sorted(plant.inputs.names)
    assert sorted(plant.inputs.names) == sorted(set(plant.simulation.inputs) - {'wind'})


def test_torque_and_forces_grow_stale_and_what_keeps_a_car_safe_does_not():
    plant = plant_with(rate=100.0, torque_timeout=0.05)
    plant.take(['input', 'front_left_brake', 'centre_rear_clutch', 'grade', 'front_left_grip'],
               [200.0, 700.0, 500.0, 0.1, 0.3], 'test')
    before = plant.inputs.in_force(0)
    for _ in range(10):
        plant.tick()
    now = dict(zip(plant.inputs.names, plant.inputs.in_force(plant.simulation.ticks)))
    assert dict(zip(plant.inputs.names, before))['input'] == 200.0
    assert (now['input'], now['centre_rear_clutch']) == (0.0, 0.0)
    assert (now['front_left_brake'], now['grade'], now['front_left_grip']) == (700.0, 0.1, 0.3)
    assert plant.simulation.torque == 0.0 and plant.simulation.clutch_force == (0.0, 0.0)
    plant.notice()
    assert plant.stale.reason == 'input, centre_rear_clutch'


@pytest.mark.parametrize('names, joints, words', [
    (['input', 'wheel'], Joints([1.0, 1.0], [], []), "'wheel' is not one of input, front_left"),
    (['front_left_brake'], Joints([-1.0], [], []), 'must not be below 0'),
    (['front_left_grip'], Joints([], [], [0.0]), 'must not be below 1e-06'),
    (['steer'], Joints([], [], [0.1]), 'angle on steer is 0.1, it must not be above 0'),
    (['steer'], Joints([0.1], [], []), '1 names but 0 positions'),
    (['steer'], Joints([0.1], [], [NAN]), 'steer takes a position, its effort must be NaN'),
    (['input'], Joints([10.0], [], [0.5]), 'input takes no position, its position must be NaN'),
    (['input', 'grade'], Joints([10.0, NAN], [], [NAN, float('inf')]), 'inf'),
])
def test_a_bad_message_is_refused_whole_by_name(names, joints, words):
    plant = plant_with()
    plant.take(['input'], [50.0], 'test')
    assert not plant.take(names, joints, 'test', sparse=True)
    assert words in plant.refusing.reason
    assert plant.inputs.in_force(0)[0] == 50.0 and plant.inputs.refused == 1


def test_one_message_brings_efforts_and_positions():
    plant = plant_with(planar=True)
    assert plant.take(['input', 'steer', 'rear_left_contact', 'rear_left_brake'],
                      Joints([100.0, NAN, NAN, NAN], [], [NAN, 0.1, 0.5, NAN]), 'test',
                      sparse=True)
    held = dict(zip(plant.inputs.names, plant.inputs.in_force(0)))
    assert (held['input'], held['steer'], held['rear_left_contact'], held['rear_left_brake']) == (
        100.0, 0.1, 0.5, 0.0)


def test_a_demand_beyond_its_limit_is_clamped_and_counted():
    plant = plant_with(torque_limit=400.0, driveline__centre__clutch__rear__actuator_limit=900.0)
    plant.take(['input', 'rear_left_brake', 'centre_rear_clutch'], [-1e3, 1e3, 1e4], 'test')
    held = dict(zip(plant.inputs.names, plant.inputs.in_force(0)))
    assert (held['input'], held['rear_left_brake'], held['centre_rear_clutch']) == (
        -400.0, 400.0, 900.0)
    assert plant.clamping.count == 1


def test_parameters_change_while_it_runs_and_the_car_goes_on_as_it_moves():
    plant = plant_with(initial_speed=10.0)
    for _ in range(20):
        before = plant.tick()
    stored, car = plant.simulation.stored_energy, plant.simulation
    plant.adopt(plant.prepared({'driveline.mass': 1800.0, 'torque_timeout': 1.0}))
    now = plant.simulation.snapshot()
    assert (now.velocity, now.position, now.pose, now.twist_body, now.time) == (
        before.velocity, before.position, before.pose, before.twist_body, before.time)
    assert plant.simulation is not car and plant.values['driveline.mass'] == 1800.0
    # 200 kg more at the same speed, which no work has brought
    more = plant.simulation.stored_energy - stored
    assert more == pytest.approx(100.0 * before.twist_body[0] ** 2, rel=1e-2)
    assert plant.simulation.energy.jumps == pytest.approx(more, rel=1e-9)
    energy = plant.simulation.energy
    plant.tick()
    assert plant.simulation.ticks == 21
    after = plant.simulation.energy
    assert after.lost > energy.lost and abs(after.numerical - energy.numerical) < 1e-3


@pytest.mark.parametrize('changes, words', [
    ({'driveline.mass': -1.0}, r'driveline.mass: -1.0 is not allowed, it must be in \(0, 1e'),
    ({'driveline.mas': 1.0}, 'driveline.mas: there is no such parameter'),
    ({'layout': 'fwd'}, 'layout: it cannot be changed while it runs'),
    ({'driveline.rear.clutch.left.friction_surfaces': 4}, 'clutches cannot come or go'),
    ({'driveline.mass': 1700.0, 'rate': 1.0}, 'rate: it cannot be changed'),
])
def test_a_change_that_cannot_be_is_refused_and_nothing_changes(changes, words):
    plant = plant_with()
    before = plant.values
    with pytest.raises(ValueError, match=words):
        plant.prepared(changes)
    assert plant.values == before


def test_a_tick_out_of_the_range_of_numbers_is_refused_and_the_state_stays():
    plant = plant_with(torque_limit=1e9)
    plant.inputs.limits = (float('inf'),) * len(plant.inputs.limits)
    before = plant.tick()
    plant.take(['input'], [1e300], 'test')
    assert plant.tick() == before and plant.out_of_range.count == 1
    plant.take(['input'], [0.0], 'test')
    assert plant.tick().time > before.time


def test_a_file_of_another_layout_gives_what_this_one_has():
    values = dict(make_driveline({}).parameters)
    car = make_driveline({**values, 'layout': 'fwd', 'driveline.mass': 900.0})
    assert car.parameters['driveline.mass'] == 900.0 and 'driveline.rear.satellite_count' in values
    assert not [name for name in car.parameters if '.rear.' in name]
    assert set(car.parameters) < set(all_rows())


def test_the_books_are_told_and_balance():
    plant = plant_with(initial_speed=5.0)
    plant.take(['input', 'front_left_brake'], [300.0, 100.0], 'test')
    for _ in range(200):
        plant.tick()
    complaints, values = plant.told_of_energy()
    energy, losses = plant.simulation.energy, plant.simulation.losses
    assert not complaints and float(values['work of the input [J]']) > 0.0
    kinds = [float(value) for key, value in values.items() if key.startswith('lost in ')]
    assert sum(kinds) == pytest.approx(sum(losses.values()), rel=1e-4)
    assert sum(losses.values()) == pytest.approx(energy.lost, rel=1e-12)
