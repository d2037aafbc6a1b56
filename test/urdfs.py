# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What the tests of URDFs share: whether one is valid, how its links move, where gears touch."""

import io
from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dm_ros.files.urdf import ALONG

Z = np.array((0.0, 0.0, 1.0))


def vector(element, name):
    return np.array([float(word) for word in element.get(name).split()])


def pose(origin):
    """Return the rotation and the place that an origin tells."""
    return Rotation.from_euler('xyz', vector(origin, 'rpy')), vector(origin, 'xyz')


class Moving:
    """The links of a URDF while its joints move: (rotation, place, angular velocity, velocity)."""

    def __init__(self, robot, position, velocity):
        """:param position: of the joints by name, rad; velocity: rad/s."""
        joints = robot.findall('joint')
        children = {joint.find('child').get('link') for joint in joints}
        root, = (link.get('name') for link in robot.findall('link')
                 if link.get('name') not in children)
        self.links = {root: (Rotation.identity(), np.zeros(3), np.zeros(3), np.zeros(3))}
        while joints:
            joint = next(j for j in joints if j.find('parent').get('link') in self.links)
            joints.remove(joint)
            mimic = joint.find('mimic')
            name = joint.get('name') if mimic is None else mimic.get('joint')
            rotation, place, omega, v = self.links[joint.find('parent').get('link')]
            turn, offset = pose(joint.find('origin'))
            axis = vector(joint.find('axis'), 'xyz')
            arm = rotation.apply(offset)
            rotation *= turn
            self.links[joint.find('child').get('link')] = (
                rotation * Rotation.from_rotvec(position[name] * axis), place + arm,
                omega + velocity[name] * rotation.apply(axis), v + np.cross(omega, arm))

    def velocity(self, link, point):
        """Return the velocity of the point of a link that is at a place now, m/s."""
        _, place, omega, v = self.links[link]
        return v + np.cross(omega, point - place)


def touching(mechanism, size, moving, prefix, satellites, middle=(0.0, 0.0, 0.0), way=1):
    """
    Yield (link, link, where) of all gears that touch.

    :param middle: where the middle of the differential is, m; way: +1 where its pinion is in
        front, else -1.
    """
    middle = np.array(middle)
    along = Rotation.from_euler('xyz', ALONG[mechanism.outputs[0]]).apply(Z)
    for n in range(satellites):
        name = f'{prefix}satellite{f"_{n + 1}" * (n > 0)}_link'
        outwards = moving.links[name][0].apply(Z)
        for shaft, radius, side in zip(mechanism.outputs, size.crowns, (1, -1)):
            yield name, f'{prefix}{shaft}_link', (
                middle + radius * outwards + side * size.satellite * along)
    if size.pinion:
        yield f'{prefix}pinion_link', f'{prefix}carrier_link', (
            middle + way * np.array((size.ring, size.side * size.pinion, 0.0)))


def check(robot):
    """Assert that a URDF is a tree of valid links whose names are all there."""
    links = [link.get('name') for link in robot.findall('link')]
    joints = robot.findall('joint')
    children = [joint.find('child').get('link') for joint in joints]
    assert len(links) == len(set(links)) == len(joints) + 1
    assert len(set(children)) == len(children) and set(children) < set(links)
    assert {joint.find('parent').get('link') for joint in joints} < set(links)
    materials = {material.get('name') for material in robot.findall('material')}
    assert {e.get('name') for e in robot.iterfind('.//visual/material')} <= materials
    for link in robot.findall('link'):
        inertial = link.find('inertial')
        # KDL wants none in the root
        assert (inertial is None) == (link.get('name') not in children)
        if inertial is not None:
            assert 0 < float(inertial.find('mass').get('value')) < np.inf
            ixx, iyy, izz = (float(inertial.find('inertia').get(n)) for n in ('ixx', 'iyy', 'izz'))
            assert min(ixx, iyy, izz) > 0 and ixx + iyy >= izz and ixx == iyy < np.inf
    for shape in robot.iterfind('.//geometry/*'):
        for name in shape.attrib:
            assert all(0 < size < np.inf for size in vector(shape, name)), shape.attrib


def in_yourdfpy(text):
    """Return a URDF as yourdfpy loads it, once it has shown that its links are where ours are."""
    yourdfpy = pytest.importorskip('yourdfpy')
    robot = yourdfpy.URDF.load(io.BytesIO(text.encode()))
    assert robot.validate() and not robot.errors
    rng = np.random.default_rng(5)
    position = {name: rng.uniform(-9, 9) for name in robot.actuated_joint_names}
    robot.update_cfg(position)
    moving = Moving(ElementTree.fromstring(text), position, dict.fromkeys(position, 0.0))
    for link, (rotation, place, *_) in moving.links.items():
        transform = robot.get_transform(link)
        assert transform[:3, :3] == pytest.approx(rotation.as_matrix(), abs=1e-12)
        assert transform[:3, 3] == pytest.approx(place, abs=1e-12)
    return robot
