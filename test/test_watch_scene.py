# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What ``watch`` tells the page of a node is what the node is."""

from math import pi

from hypothesis import given
from hypothesis import strategies as st
from mechanisms import random_self_locking, random_symmetric
import numpy as np
import pytest

from dm_ros import Simulation, VARIANTS
from dm_ros.files.published import Published
from dm_ros.mechanism.variants import MECHANISMS
from dm_ros.watch.scene import drive_teeth, gears, satellite_teeth, Scene


def scene(variant='symmetric_ode', **values):
    return Scene('/differential', {'variant': variant, **{
        name.replace('__', '.'): value for name, value in values.items()}})


@pytest.mark.parametrize('variant', VARIANTS)
def test_the_names_are_those_of_the_simulation(variant):
    simulation, description = Simulation(variant), scene(variant).description
    for name in ('shafts', 'inputs', 'moments'):
        assert description[name] == getattr(simulation, name)
    assert list(description['meshes']) + list(description['clutches']) == list(simulation.moments)
    assert {*description['meshes'].values(), *description['clutches'].values()} <= set(
        simulation.shafts)


@pytest.mark.parametrize('variant', VARIANTS)
def test_a_tick_has_a_number_for_each_line_of_the_strips(variant):
    simulation, it = Simulation(variant), scene(variant)
    published = Published(simulation.mechanism)
    snapshot = simulation.step((30.0, -10.0, -5.0))
    arrays = published.arrays(snapshot)
    assert it.names == published.names
    moment, *force, flow = [effort or position for position, _, effort in arrays[1:]]
    parts = arrays[0], (moment,), *[array for array in arrays[2:-1]], (flow,)
    assert it.row(parts) == it.columns(arrays[0].velocity, arrays[0].effort, moment,
                                       *(force or [()]), flow)
    columns = dict(zip(
        [(strip['name'], series) for strip in it.description['strips']
         for series in strip['series']],
        it.columns(arrays[0].velocity, arrays[0].effort, moment, *(force or [()]), flow),
        strict=True))
    for shaft, speed in zip(simulation.shafts, snapshot.velocity):
        assert columns['speeds', shaft] == speed
    for shaft in simulation.mechanism.outputs:
        assert columns['slip', shaft] == columns['speeds', shaft] - columns['speeds', 'carrier']
    for name, torque in zip(simulation.inputs, (30.0, -10.0, -5.0)):
        assert columns['torques', name] == torque
    for name, moment in zip(simulation.moments, snapshot.moment):
        assert columns['moments', name] == moment
    assert columns['index', 'power_flow'] == snapshot.power_flow


def test_the_heat_that_the_page_multiplies_is_that_of_the_clutches():
    simulation = Simulation('lsd_ode', dt=0.001)
    for _ in range(500):
        snapshot = simulation.step((100.0, -60.0, -20.0))
    speed = dict(zip(simulation.shafts, snapshot.velocity))
    moment = dict(zip(simulation.moments, snapshot.moment))
    description = scene('lsd_ode').description
    heats = [moment[clutch] * (speed[shaft] - speed['carrier'])
             for clutch, shaft in description['clutches'].items()]
    assert min(heats) >= 0.0 and max(heats) > 1.0


@pytest.mark.parametrize('variant, crowns, satellite, drive', [
    ('symmetric_ode', [20, 20], 10, (28, 8)), ('lsd_ode', [16, 24], 10, None)])
def test_the_default_gears_have_their_true_ratios(variant, crowns, satellite, drive):
    drawn = scene(variant).description['gears']
    assert (drawn['crowns'], drawn['satellite'], drawn['exact']) == (crowns, satellite, True)
    assert (drawn['drive'] and (drawn['drive']['ring'], drawn['drive']['pinion'])) == drive


@given(st.floats(1.0, 6.0), st.floats(1.0, 6.0), st.integers(1, 6))
def test_teeth_are_whole_near_the_ratios_and_all_satellites_go_in(one, other, count):
    first, second, satellite = satellite_teeth((one, other), count)
    assert (first + second) % count == 0
    for teeth, ratio in ((first, one), (second, other)):
        assert teeth / satellite == pytest.approx(ratio, rel=0.12)


@given(st.floats(1.6, 6.0))
def test_ring_gear_and_pinion_are_near_their_ratio(ratio):
    ring, pinion = drive_teeth(ratio)
    assert ring / pinion == pytest.approx(ratio, rel=0.03)


@pytest.mark.parametrize('name, draw', [
    ('symmetric', random_symmetric), ('lsd', random_self_locking)])
def test_any_mechanism_is_drawn_or_says_why_not(name, draw):
    random = np.random.default_rng(1)
    for _ in range(200):
        p = draw(random)
        drawn = gears(MECHANISMS[name], p)
        assert 1 <= drawn['count'] <= min(p.n_s, 6)
        assert min(*drawn['crowns'], drawn['satellite']) >= 6
        # as many as there is room for, side by side
        assert drawn['count'] * drawn['satellite'] <= pi * sum(drawn['crowns']) / 2 * 1.2


def test_extreme_gears_are_told_and_too_small_ones_are_refused_in_words():
    assert not scene(symmetric__satellite_ratio=1e-3).description['gears']['exact']
    assert not scene(symmetric__satellite_count=64).description['gears']['exact']
    assert not scene(symmetric__final_drive_ratio=900.0).description['gears']['exact']
    small = scene(symmetric__side_gear_radius=1e-9).description
    assert small['gears'] is None and 'is not drawn' in small['not drawn']


def test_the_ring_gear_is_on_its_side():
    assert scene().description['gears']['drive']['side'] == 1.0
    mirrored = scene(symmetric__final_drive_ratio=-3.0).description['gears']['drive']
    assert mirrored['side'] == -1.0 and mirrored['ring'] == 3 * mirrored['pinion']


def test_what_can_be_commanded_has_its_kind_and_range():
    ports = {port['name']: port for port in scene(
        'lsd_ode', port__front__kind='speed', torque_limit=50.0,
        lsd__clutch__rear__actuator_limit=800.0).ports}
    assert list(ports) == ['carrier', 'front', 'rear', 'front_clutch', 'rear_clutch']
    assert (ports['carrier']['low'], ports['carrier']['high'], ports['carrier']['to']) == (
        -50.0, 50.0, 50.0)
    assert (ports['front']['kind'], ports['front']['unit']) == ('speed', 'rad/s')
    assert (ports['rear_clutch']['from'], ports['rear_clutch']['high']) == (0.0, 800.0)


def test_clutches_come_with_their_friction_surfaces():
    assert 'clutches' not in scene().names
    it = scene(symmetric__clutch__left__friction_surfaces=4)
    assert 'clutches' in it.names
    assert it.description['clutches'] == {'left_clutch': 'left', 'right_clutch': 'right'}
