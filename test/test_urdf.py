# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The URDF is one that others load, and its gears mesh by the angles that are published."""

from pathlib import Path
from xml.etree import ElementTree

from mechanisms import random_self_locking, random_symmetric
import numpy as np
import pytest
from urdfs import check, in_yourdfpy, Moving, touching, vector

from dm_ros import SelfLockingParameters, Simulation, SymmetricParameters, VARIANTS
from dm_ros.files.parameter_file import read_parameter_file
from dm_ros.files.published import Published
from dm_ros.files.urdf import sizes, urdf
from dm_ros.mechanism.variants import MECHANISMS, variant_named
from dm_ros.settings import PREFIX
from dm_ros.tools.urdf import main

ROOT = Path(__file__).parents[1]
FILES = sorted(path for folder in ('config', 'config/presets')
               for path in (ROOT / folder).glob('*.yaml')
               if not path.stem.startswith('driveline'))   # more than one mechanism
PREFIXES = ('', 'rear_', 'car/axle.2-')


def described(mechanism, p=None, prefix=''):
    """Return the root element of a URDF."""
    return ElementTree.fromstring(urdf(mechanism, p or mechanism.parameters(), prefix))


def runs():
    """Yield (variant, parameters) of default and random mechanisms."""
    rng = np.random.default_rng(3)
    for variant in VARIANTS:
        yield variant, variant_named(variant).mechanism.parameters()
    for n in range(10):
        yield 'lsd_ode', random_self_locking(rng)
        p = random_symmetric(rng)
        yield 'symmetric_ode', p.changed({'symmetric.final_drive_ratio': (-1)**n * p.g_F,
                                          'symmetric.side_gear_radius': rng.uniform(0.01, 0.1)})


@pytest.mark.parametrize('number, run', list(enumerate(runs())))
def test_gears_that_touch_have_one_velocity_in_every_published_state(number, run):
    variant, p = run
    rng, prefix = np.random.default_rng(number), PREFIXES[number % 3]
    simulation = Simulation(variant, 0.01, p)
    mechanism, names = simulation.mechanism, [prefix + shaft for shaft in simulation.shafts]
    robot, size = described(mechanism, p, prefix), sizes(mechanism, p)
    for _ in range(20):
        snapshot = simulation.step(rng.normal(size=3) * 100)
        velocity = dict(zip(names, snapshot.velocity, strict=True))
        moving = Moving(robot, dict(zip(names, snapshot.position)), velocity)
        fastest = max(map(abs, snapshot.velocity))
        pairs = list(touching(mechanism, size, moving, prefix, p.n_s))
        assert len(pairs) == 2 * p.n_s + (mechanism.name == 'symmetric')
        for one, other, where in pairs:
            one, other = moving.velocity(one, where), moving.velocity(other, where)
            assert one == pytest.approx(other, abs=1e-13 * fastest * max(size.ring, 1.0))


def test_the_gears_would_not_mesh_with_a_sign_turned_round():
    simulation = Simulation('symmetric_ode', 0.01)
    mechanism = simulation.mechanism
    snapshot = simulation.step((10.0, -100.0, 20.0))
    for turned in ('satellite', 'pinion', 'left'):
        velocity = dict(zip(simulation.shafts, snapshot.velocity))
        velocity[turned] *= -1
        moving = Moving(described(mechanism), dict.fromkeys(velocity, 0.0), velocity)
        pairs = touching(mechanism, sizes(mechanism, SymmetricParameters()), moving, '', 2)
        assert any(np.abs(moving.velocity(one, where) - moving.velocity(other, where)).max() > 0.1
                   for one, other, where in pairs), turned


@pytest.mark.parametrize('mechanism', MECHANISMS.values(), ids=MECHANISMS)
def test_the_drawn_surfaces_touch_where_the_velocities_are_compared(mechanism):
    robot, size = described(mechanism), sizes(mechanism, mechanism.parameters())

    def first(link):
        visual = robot.find(f"link[@name='{link}_link']/visual")
        cylinder = visual.find('geometry/cylinder')
        z, length = vector(visual.find('origin'), 'xyz')[2], float(cylinder.get('length'))
        return float(cylinder.get('radius')), z - length / 2, z + length / 2

    radius, low, high = first('satellite')
    assert radius == pytest.approx(size.satellite, rel=1e-5)
    assert size.satellite == pytest.approx(
        mechanism.parameters().g_2s * size.crowns[1])
    middle = np.linalg.norm(vector(robot.find("joint[@name='satellite']/origin"), 'xyz'))
    for shaft, crown, way in zip(mechanism.outputs, size.crowns, (1, -1)):
        outer, *ends = first(shaft)
        assert min(way * end for end in ends) == pytest.approx(radius, rel=1e-5)
        assert middle + low < crown < min(outer, middle + high)
    if size.pinion:
        assert first('pinion')[0] == pytest.approx(size.pinion, rel=1e-5)
        assert size.pinion == pytest.approx(
            size.ring / abs(mechanism.parameters().g_F))
        boxes = [(vector(box.find('origin'), 'xyz'), vector(box.find('geometry/box'), 'size'))
                 for box in robot.findall("link[@name='carrier_link']/visual")
                 if box.find('geometry/box') is not None]
        faces = [size.side * place[2] - shape[2] / 2 for place, shape in boxes
                 if np.hypot(*place[:2]) == pytest.approx(size.ring, rel=1e-5)]
        assert len(faces) == 40 and faces == pytest.approx([size.pinion] * 40, rel=1e-4)


@pytest.mark.parametrize('prefix', PREFIXES)
@pytest.mark.parametrize('variant', VARIANTS)
def test_the_joints_are_those_of_joint_states_and_followers(variant, prefix):
    simulation = Simulation(variant)
    joints = described(simulation.mechanism, prefix=prefix).findall('joint')
    leaders = [joint.get('name') for joint in joints if joint.find('mimic') is None]
    assert sorted(leaders) == sorted(prefix + shaft for shaft in simulation.shafts)
    followers = [joint for joint in joints if joint.find('mimic') is not None]
    assert len(followers) == simulation.parameters.n_s - 1
    for joint in followers:
        assert joint.find('mimic').attrib == {
            'joint': f'{prefix}satellite', 'multiplier': '1', 'offset': '0'}
    assert {joint.get('type') for joint in joints} == {'continuous'}


def test_the_joints_have_the_names_that_the_node_publishes():
    for mechanism in MECHANISMS.values():
        published = Published(mechanism, 'rear_').names['joint_states']
        joints = described(mechanism, prefix='rear_').findall('joint')
        assert set(published) == {joint.get('name') for joint in joints
                                  if joint.find('mimic') is None}


def names(mechanism, p, prefix=''):
    """Return the names of links, of joints and of materials, each once."""
    robot = described(mechanism, p, prefix)
    found = [[e.get('name') for e in robot.findall(tag)] for tag in ('link', 'joint', 'material')]
    assert all(len(set(some)) == len(some) for some in found)
    return [name for some in found for name in some]


def test_names_of_two_prefixes_never_clash():
    # P n = Q m with P != Q makes n the end of m or m that of n
    every = set(names(MECHANISMS['symmetric'], SymmetricParameters(n_s=64))
                + names(MECHANISMS['lsd'], SelfLockingParameters(n_s=64)))
    assert len(every) > 130
    for name in every:
        assert not [other for other in every if other != name and other.endswith(name)], name
    for prefix in PREFIXES:
        for mechanism in MECHANISMS.values():
            p = mechanism.parameters()
            assert names(mechanism, p, prefix) == [prefix + n for n in names(mechanism, p)]


def extremes():
    """Yield (mechanism, parameters) at the ends of what is drawn."""
    for mechanism in MECHANISMS.values():
        for n_s in (1, 64):
            yield mechanism, mechanism.parameters(n_s=n_s)
    lsd, symmetric = SelfLockingParameters, SymmetricParameters
    for p in (lsd(R_1=1e-3, R_2=10.0, n_F1=0), lsd(g_2s=1e3), lsd(g_2s=1e-3), lsd(I_0=1e-300),
              lsd(n_F2=0), lsd(n_F1=0, n_F2=1000, mu_2=1e-3), lsd(R_F1=10.0, n_F1=0),
              lsd(R_F2=1e-300), lsd(R_F1=10.0, mu_1=1e-3)):
        yield MECHANISMS['lsd'], p
    for p in (symmetric(g_F=1e3), symmetric(g_F=-1e-3), symmetric(R=10.0), symmetric(R=1e-2),
              symmetric(n_F1=4), symmetric(n_F2=4, g_F=-3.0)):
        yield MECHANISMS['symmetric'], p


@pytest.mark.parametrize('mechanism, p', list(extremes()))
def test_extreme_mechanisms_are_valid_too(mechanism, p):
    check(described(mechanism, p))


def test_inertias_about_the_axes_are_the_parameters():
    for mechanism in MECHANISMS.values():
        robot, named = described(mechanism), mechanism.parameters().named()
        for shaft in mechanism.shafts:
            inertia = robot.find(f"link[@name='{shaft}_link']/inertial/inertia")
            assert float(inertia.get('izz')) == named[f'{mechanism.name}.inertia.{shaft}']


def test_plates_are_drawn_where_there_are_clutches():
    def drawn(**changes):
        p = SymmetricParameters(mu_1=1e-3, mu_2=1e-3, **changes)
        return len(described(MECHANISMS['symmetric'], p).findall('.//cylinder'))
    without = drawn()
    assert [drawn(n_F1=n) - without for n in (1, 4, 11, 12, 1000)] == [2, 5, 12, 12, 12]
    assert drawn(n_F1=1, n_F2=3) - without == 6


@pytest.fixture
def printed(capsys):
    """Return what calls the command and returns the root of what it prints."""
    def call(*arguments):
        assert main(list(map(str, arguments))) == 0
        return ElementTree.fromstring(capsys.readouterr().out)
    return call


@pytest.mark.parametrize('path', FILES, ids=lambda path: path.stem)
def test_every_parameter_file_of_the_package_makes_a_valid_one(path, printed):
    robot = printed('--params', path)
    check(robot)
    is_lsd = any(name.startswith('lsd.') for name in read_parameter_file(path))
    assert (robot.find("joint[@name='rear']") is not None) == is_lsd


def test_command_takes_mechanism_and_prefix_from_the_file_or_the_options(printed, tmp_path):
    path = tmp_path / 'p.yaml'
    path.write_text('/**: {ros__parameters: {variant: lsd_dae, joint_prefix: mid_}}')
    for arguments, name in (
            ([], 'left'), (['--params', path], 'mid_rear'), (['--variant', 'lsd_ode'], 'rear'),
            (['--params', path, '--joint-prefix', ''], 'rear'),
            (['--params', path, '--prefix', 'a_', '--variant', 'symmetric_dae'], 'a_left')):
        assert printed(*arguments).find(f"joint[@name='{name}']") is not None, arguments


def test_command_writes_a_file(tmp_path, capsys):
    path = tmp_path / 'OUT.urdf'
    assert main(['--out', str(path)]) == 0
    assert capsys.readouterr() == ('', '')
    main([])
    assert path.read_text() == capsys.readouterr().out


@pytest.mark.parametrize('arguments, content, message', [
    (['--joint-prefix', '1st'], '', f"joint_prefix: '1st' is not allowed, it must be {PREFIX[1]}"),
    (['--out', 'none/OUT.urdf'], '', 'none/OUT.urdf: No such file'),
    (['--params', 'none.yaml'], '', 'none.yaml: No such file'),
    ([], 'lsd.crown_radius.rear: -1.0', 'lsd.crown_radius.rear: -1.0'),
    ([], 'lsd.crown_radiu.rear: 1.0', 'lsd.crown_radiu.rear'),
    ([], 'symmetric.side_gear_radius: 1.0e-300', 'a radius of 5e-301 m')])
def test_command_refuses_bad_input_in_one_line(arguments, content, message, tmp_path, capsys):
    if content:
        path = tmp_path / 'p.yaml'
        path.write_text(f'/**: {{ros__parameters: {{{content}}}}}')
        arguments = ['--params', str(path)]
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert not out and err.startswith('urdf: error: ') and message in err
    assert err.count('\n') == 1


@pytest.mark.parametrize('prefix', PREFIXES)
@pytest.mark.parametrize('mechanism', MECHANISMS.values(), ids=MECHANISMS)
def test_yourdfpy_loads_it_and_has_its_links_where_we_have(mechanism, prefix):
    robot = in_yourdfpy(urdf(mechanism, mechanism.parameters(), prefix))
    assert set(robot.actuated_joint_names) == {prefix + shaft for shaft in mechanism.shafts}
    assert robot.scene.extents.max() < 1.0   # m


def test_the_angles_of_a_run_mesh_as_the_speeds_do():
    # an angle is the integral of its speed: arcs that rolled on each other are of one length
    for variant in VARIANTS:
        simulation = Simulation(variant, 0.01)
        size = sizes(simulation.mechanism, simulation.parameters)
        for _ in range(100):
            snapshot = simulation.step((20.0, -30.0, 10.0))
        turned = dict(zip(simulation.shafts, snapshot.position))
        for shaft, radius, way in zip(simulation.mechanism.outputs, size.crowns, (1, -1)):
            assert -way * radius * (turned[shaft] - turned['carrier']) == pytest.approx(
                size.satellite * turned['satellite'], rel=1e-9)
