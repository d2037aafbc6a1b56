# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The URDF of a driveline is one that others load; it rolls and meshes as is published."""

from pathlib import Path
from xml.etree import ElementTree

from driveline.scenarios import DIFFERENTIALS
from drivelines import example
import numpy as np
import pytest
from urdfs import check, in_yourdfpy, Moving, touching, vector

from dm_ros import Driveline
from dm_ros.files.driveline_urdf import driveline_urdf
from dm_ros.files.published_driveline import PublishedDriveline
from dm_ros.files.urdf import sizes
from dm_ros.tools.urdf import main

CONFIG = Path(__file__).parents[1] / 'config'
PREFIXES = ('', 'car_', 'a/b.2-')
A, B, TRACK, RADIUS = 1.25, 1.40, 1.55, 0.32   # m, of the defaults
PLACES = {'front_left': (A, TRACK / 2), 'front_right': (A, -TRACK / 2),
          'rear_left': (-B, TRACK / 2), 'rear_right': (-B, -TRACK / 2)}
IN_FRONT = {'fwd': (), 'rwd': ('rear',), 'awd': ('rear',)}   # of these the pinion is in front


def described(car, prefix='', base='base_link'):
    """Return the root element of a URDF."""
    return ElementTree.fromstring(driveline_urdf(car, prefix, base))


def moving_with(car, snapshot, prefix=''):
    """Return the links as a snapshot has them."""
    names = [prefix + shaft for shaft in car.shafts]
    return Moving(described(car, prefix), dict(zip(names, snapshot.position, strict=True)),
                  dict(zip(names, snapshot.velocity, strict=True)))


def leading(robot):
    """Return the names of the joints that follow no other."""
    return [joint.get('name') for joint in robot.findall('joint') if joint.find('mimic') is None]


@pytest.mark.parametrize('prefix', PREFIXES)
@pytest.mark.parametrize('layout', DIFFERENTIALS)
def test_the_joints_are_those_of_joint_states_and_all_is_valid(layout, prefix):
    car = Driveline(layout)
    robot = described(car, prefix)
    check(robot)
    published = PublishedDriveline(car, prefix).names['joint_states']
    assert sorted(leading(robot)) == sorted(published)
    assert {joint.get('type') for joint in robot.findall('joint')} == {'continuous'}
    assert len(robot.findall('joint/mimic')) == sum(
        d.parameters.n_s - 1 for d in car.mechanisms.values())
    assert robot.find("link[@name='base_link']/visual/geometry/box") is not None


@pytest.mark.parametrize('layout', DIFFERENTIALS)
def test_wheels_that_roll_stand_still_where_they_touch_the_road(layout):
    """In base_link the road goes back at the speed of the car; its z is 0 at the ground."""
    car = Driveline(layout)
    car.reset(7.0)
    for _ in range(5):
        snapshot = car.step(grip=(1.0,) * 4)
    moving = moving_with(car, snapshot)
    for wheel, (x, y) in PLACES.items():
        _, place, *_ = moving.links[f'{wheel}_link']
        assert place == pytest.approx((x, y, RADIUS), abs=1e-12)
        omega = snapshot.velocity[car.shafts.index(wheel)]
        assert 7.0 < omega * RADIUS * 1.01 < 7.1
        assert moving.velocity(f'{wheel}_link', np.array((x, y, 0.0))) == pytest.approx(
            (-omega * RADIUS, 0.0, 0.0), abs=1e-12)


@pytest.mark.parametrize('layout', DIFFERENTIALS)
def test_gears_that_touch_have_one_velocity_in_every_published_state(layout):
    rng = np.random.default_rng(4)
    ratios = [3.7, -2.9]   # a ring gear on either side of the pinion
    for ratio in ratios:
        car = Driveline(layout, True, parameters={
            f'driveline.{name}.final_drive_ratio': ratio
            for name in DIFFERENTIALS[layout] if name != 'centre'})
        car.reset(5.0)
        for _ in range(10):
            snapshot = car.step(rng.normal() * 400, rng.uniform(0, 400, 4), {}, 0.05,
                                grip=rng.uniform(0.2, 1.0, 4))
        moving = moving_with(car, snapshot, 'car_')
        for name, differential in car.mechanisms.items():
            mechanism, p = differential.mechanism, differential.parameters
            before = 'car_' + ('centre_' if name == 'centre' else f'{name}_axle_')
            _, middle, *_ = moving.links[f'{before}carrier_link']
            size, way = sizes(mechanism, p), 1 if name in IN_FRONT[layout] else -1
            pairs = list(touching(mechanism, size, moving, before, p.n_s, middle, way))
            assert len(pairs) == 2 * p.n_s + (name != 'centre')
            for one, other, where in pairs:
                there = moving.velocity(one, where)
                assert there == pytest.approx(moving.velocity(other, where), abs=1e-12)
            assert max(np.abs(moving.velocity(*pair[:1], pair[2])).max() for pair in pairs) > 0.1


@pytest.mark.parametrize('ratio', [3.7, -2.9])
@pytest.mark.parametrize('layout', DIFFERENTIALS)
def test_pinions_are_towards_what_drives_them_and_their_ring_gears_where_they_touch(layout, ratio):
    names = [name for name in DIFFERENTIALS[layout] if name != 'centre']
    car = Driveline(layout, parameters={
        f'driveline.{name}.final_drive_ratio': ratio for name in names})
    robot = described(car)
    moving = Moving(robot, *[dict.fromkeys(car.shafts, 0.0)] * 2)
    for name in names:
        differential = car.mechanisms[name]
        size = sizes(differential.mechanism, differential.parameters)
        way = 1 if name in IN_FRONT[layout] else -1
        middle, pinion = (moving.links[f'{name}_axle_{shaft}_link'][1]
                          for shaft in ('carrier', 'pinion'))
        assert pinion - middle == pytest.approx((way * size.ring, 0.0, 0.0), abs=1e-12)
        ring = [vector(origin, 'xyz') for origin in robot.findall(
            f"link[@name='{name}_axle_carrier_link']/visual/origin")]
        sides = [z for x, y, z in ring if np.hypot(x, y) == pytest.approx(size.ring, rel=1e-5)]
        assert len(sides) == 40 and all(z * way * size.side > size.pinion for z in sides)


@pytest.mark.parametrize('layout', DIFFERENTIALS)
def test_what_an_elastic_shaft_connects_lies_in_one_line(layout):
    car = Driveline(layout)
    moving = Moving(described(car), *[dict.fromkeys(car.shafts, 0.0)] * 2)
    for start, end in car.ends.values():
        (one, here, *_), (other, there, *_) = (moving.links[f'{s}_link'] for s in (start, end))
        axis = one.apply((0.0, 0.0, 1.0))
        assert axis == pytest.approx(other.apply((0.0, 0.0, 1.0)), abs=1e-12)
        assert np.cross(there - here, axis) == pytest.approx(np.zeros(3), abs=1e-12)
        assert abs((there - here) @ axis) > 0.1   # m


def test_differentials_are_in_their_axles_and_the_centre_between_them():
    car = Driveline('awd')
    moving = Moving(described(car), *[dict.fromkeys(car.shafts, 0.0)] * 2)
    at = {name: moving.links[f'{name}_carrier_link'][1]
          for name in ('front_axle', 'centre', 'rear_axle')}
    assert at['front_axle'] == pytest.approx((A, 0.0, RADIUS), abs=1e-12)
    assert at['rear_axle'] == pytest.approx((-B, 0.0, RADIUS), abs=1e-12)
    assert -B < at['centre'][0] < moving.links['input_link'][1][0] < A


def test_inertias_about_the_axes_are_the_parameters():
    car = Driveline('awd')
    robot, p = described(car), car.parameters
    expected = {'input': p['driveline.input_inertia'],
                **dict.fromkeys(car.wheels, p['driveline.wheel_inertia'])}
    for name in DIFFERENTIALS['awd']:
        shafts = car.mechanisms[name].mechanism.shafts
        before = name if name == 'centre' else f'{name}_axle'
        expected |= {f'{before}_{shaft}': p[f'driveline.{name}.inertia.{shaft}']
                     for shaft in shafts}
    assert expected.keys() == set(car.shafts)
    for shaft, inertia in expected.items():
        found = robot.find(f"link[@name='{shaft}_link']/inertial/inertia")
        assert float(found.get('izz')) == inertia


def test_names_of_two_prefixes_never_clash():
    for tag in ('link', 'joint', 'material'):
        # P n = Q m with P != Q makes n the end of m or m that of n
        every = {e.get('name') for layout in DIFFERENTIALS
                 for e in described(Driveline(layout)).findall(tag)} - {'base_link'}
        assert len(every) > 8
        for name in every:
            assert not [other for other in every if other != name and other.endswith(name)], name
        car = Driveline('awd')
        plain, prefixed = ([e.get('name') for e in described(car, prefix).findall(tag)]
                           for prefix in ('', 'car_'))
        assert prefixed == [name if name == 'base_link' else f'car_{name}' for name in plain]


@pytest.mark.parametrize('name, value', [
    ('wheel_radius', 1e-5), ('wheel_radius', 10.0), ('track', 1e-5), ('front_distance', 1e-300),
    ('wheel_inertia', 1e-300), ('input_inertia', 1e6), ('centre.satellite_count', 64),
    ('rear.clutch.left.friction_surfaces', 4), ('front.final_drive_ratio', -1e-3),
    ('height', 0.0)])
def test_extreme_cars_are_valid_too(name, value):
    check(described(Driveline('awd', parameters={f'driveline.{name}': value})))


def test_a_layout_of_ones_own_is_valid_too():
    truck = example('driveline_truck')
    car = Driveline(truck.tandem, parameters=truck.TRUCK)
    robot = described(car)
    check(robot)
    assert sorted(leading(robot)) == sorted(car.shafts)


@pytest.mark.parametrize('prefix', PREFIXES)
@pytest.mark.parametrize('layout', DIFFERENTIALS)
def test_yourdfpy_loads_it_and_has_its_links_where_we_have(layout, prefix):
    car = Driveline(layout)
    robot = in_yourdfpy(driveline_urdf(car, prefix))
    assert robot.base_link == 'base_link'
    assert set(robot.actuated_joint_names) == {prefix + shaft for shaft in car.shafts}
    low, high = robot.scene.bounds
    assert -0.03 * RADIUS < low[2] < 0.0 and high[2] < 4 * RADIUS
    assert A + RADIUS < high[0] < A + 2 * RADIUS and -B - 2 * RADIUS < low[0] < -B - RADIUS


@pytest.fixture
def printed(capsys):
    """Return what calls the command and returns the root of what it prints."""
    def call(*arguments):
        assert main(list(map(str, arguments))) == 0
        return ElementTree.fromstring(capsys.readouterr().out)
    return call


def test_command_takes_layout_prefix_and_root_from_the_file_or_the_options(printed, tmp_path):
    path = tmp_path / 'p.yaml'
    path.write_text('/**: {ros__parameters: {layout: rwd, joint_prefix: mid_, '
                    'base_frame_id: chassis, driveline.track: 1.7}}')
    for arguments, prefix, root, layout in (
            (['--driveline'], '', 'base_link', 'awd'),
            (['--driveline', '--params', path], 'mid_', 'chassis', 'rwd'),
            (['--driveline', 'fwd', '--planar'], '', 'base_link', 'fwd'),
            (['--driveline', '--params', path, '--prefix', ''], '', 'chassis', 'rwd')):
        robot = printed(*arguments)
        assert sorted(leading(robot)) == sorted(prefix + s for s in Driveline(layout).shafts)
        assert robot.find('link').get('name') == root
        y = vector(robot.find(f"joint[@name='{prefix}rear_left']/origin"), 'xyz')[1]
        assert y == (0.85 if path in arguments else TRACK / 2)


def test_the_parameter_file_of_the_package_makes_that_of_the_defaults(printed):
    path = CONFIG / 'driveline_awd.yaml'
    assert ElementTree.tostring(printed('--driveline', 'awd', '--params', path)) == (
        ElementTree.tostring(described(Driveline('awd'))))


@pytest.mark.parametrize('arguments, content, message', [
    (['--variant', 'lsd_ode'], '', '--variant: a driveline is made of several differentials'),
    (['--ros2-control'], '', '--ros2-control: it drives the node differential alone'),
    (['--joint-prefix', '1st'], '', "--joint-prefix: '1st' is not allowed, it must be nothing"),
    (['--out', 'none/OUT.urdf'], '', 'none/OUT.urdf: No such file'),
    ([], 'driveline.track: -1.0', 'driveline.track: -1.0 is not allowed'),
    ([], 'lsd.crown_radius.rear: 1.0', 'lsd.crown_radius.rear: there is no such parameter'),
    ([], 'driveline.track: 1.0e-7', 'a car whose track is 1e-07 m is not drawn'),
    ([], 'driveline.rear.side_gear_radius: 1.0e-300', 'a gear with a radius of 5e-301 m'),
    ([], 'base_frame_id: rear_axle_satellite_2_link',
     "base_frame_id: 'rear_axle_satellite_2_link' is the link of a shaft")])
def test_command_refuses_bad_input_in_one_line(arguments, content, message, tmp_path, capsys):
    if content:
        path = tmp_path / 'p.yaml'
        path.write_text(f'/**: {{ros__parameters: {{{content}}}}}')
        arguments = ['--params', str(path)]
    assert main(['--driveline', 'awd', *arguments]) == 2
    out, err = capsys.readouterr()
    assert not out and err.startswith('urdf: error: ') and message in err
    assert err.count('\n') == 1


def test_planar_is_refused_without_a_driveline(capsys):
    assert main(['--planar']) == 2
    assert capsys.readouterr().err == (
        'urdf: error: --planar: only a driveline has that, see --driveline\n')
