# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
A driveline as a URDF made from its parameters: body, wheels, differentials, what is between them.

Its joints are its shafts, all of them continuous, as ``joint_states`` has their angles; a car that
rolls forward turns them by positive angles. The wheels are where the tyres meet the road, and the
front ones are not steered. Differentials are drawn as alone, see ``urdf``, in the axle they drive
or in the middle of what they drive; the input is a quarter of the wheelbase behind the front axle.
Elastic shafts are rods without their twist.
"""

from xml.etree.ElementTree import Element

from dm_ros.files.urdf import (
    add_differential,
    add_materials,
    ALONG,
    as_text,
    COLOURS,
    FORWARD,
    joint,
    Link,
    SMALLEST,
)

PAINTS = {**COLOURS, 'tyre': (0.13, 0.13, 0.14), 'body': (0.55, 0.62, 0.72, 0.3)}
LEFTWARD = ALONG['left']
AXES = {FORWARD: 0, LEFTWARD: 1}   # rpy that turns z there: which coordinate that is
# sizes over the radius of the wheels
FLANGE, ROD, TYRE, BODY = 0.3, 0.06, 0.6, 2.2


class Places:
    """Where the elements of a ``Driveline`` are, m."""

    def __init__(self, car, height):
        self._height = height
        self.ends = [end(x for x, _ in car.wheel_places.values()) for end in (min, max)]
        of_shaft = {shaft: name for name, differential in car.mechanisms.items()
                    for shaft in differential.shafts}
        # names of elements, at both ends of all connections
        self._connected = [tuple([of_shaft.get(shaft, shaft) for shaft in ends])
                           for ends in car.ends.values()]
        first, *_ = car.inertias
        rear, front = self.ends
        self._at = {**car.wheel_places, first: (front - (front - rear) / 4.0, 0.0)}

    def middle(self, element):
        """Return the middle of a wheel, an inertia or a differential."""
        return (*self._of(element), self._height)

    def _of(self, element):
        if element not in self._at:
            self._at[element] = 0.0, 0.0   # where nothing is driven, or it drives itself
            driven = [self._of(b) for a, b in self._connected if a == element]
            if driven:
                self._at[element] = tuple([sum(side) / len(driven) for side in zip(*driven)])
        return self._at[element]

    def way(self, differential):
        """Return +1 where what drives a differential is in front of it, -1 behind."""
        drivers = [self._of(a)[0] for a, b in self._connected if b == differential]
        return -1 if drivers and drivers[0] < self._of(differential)[0] else 1


def driveline_urdf(car, prefix='', base='base_link'):
    """
    Return a URDF as text.

    :param car: a ``Driveline``.
    :param prefix: before the names of links, joints and materials, but that of the root.
    :param base: the root link, on the ground below the centre of mass.
    :raises ValueError: where the parameters are too extreme to be drawn, or the root has the name
        of another link.
    """
    radius = car.parameters['driveline.wheel_radius']
    places = Places(car, radius)
    rear, front = places.ends
    track = 2.0 * max(y for _, y in car.wheel_places.values())
    for what, size in (('radius of the wheels', radius), ('wheelbase', front - rear),
                       ('track', track)):
        if size < SMALLEST:
            raise ValueError(f'a car whose {what} is {size:g} m is not drawn, only from '
                             f'{SMALLEST:g} m')
    robot = Element('robot', name=f'{prefix}driveline')
    add_materials(robot, prefix, PAINTS)
    height = BODY * radius
    Link(robot, prefix, '', base).shape(
        'box', 'body', ((front + rear) / 2.0, 0.0, radius + height / 2.0),
        size=(front - rear + 3.0 * radius, 0.8 * track, height))
    shafts = {}
    for name, inertia in car.inertias.items():
        shafts[name] = add_disc(robot, prefix, name, base, inertia, FLANGE * radius, 'pinion',
                                places.middle(name), FORWARD)
    for name, differential in car.mechanisms.items():
        mechanism = differential.mechanism
        before = differential.shafts[0].removesuffix(mechanism.shafts[0])
        shafts |= add_differential(robot, mechanism, differential.parameters, prefix, base, before,
                                   places.middle(name), places.way(name))
    for name in car.wheel_places:
        shafts[name] = add_disc(robot, prefix, name, base,
                                car.parameters['driveline.wheel_inertia'], radius, 'tyre',
                                places.middle(name), LEFTWARD)
    for ends in car.ends.values():
        add_rod(*(shafts[end] for end in ends), ROD * radius)
    if [link.get('name') for link in robot.findall('link')].count(base) > 1:
        raise ValueError(f'base_frame_id: {base!r} is the link of a shaft')
    return as_text(robot)


def add_disc(robot, prefix, name, parent, inertia, radius, colour, place, rpy):
    """Add the link and the joint of a disc with an inertia; return what ``add_rod`` takes."""
    link, half = Link(robot, prefix, name), TYRE * radius / 2.0
    link.inertial(inertia, radius, 2.0 * half)
    link.gear(colour, radius, -half, half)
    joint(robot, prefix, name, parent, place, rpy)
    return link, place, rpy


def add_rod(start, end, radius):
    """Add an elastic shaft to the link of its end, where that is in one line with its start."""
    (_, origin, _), (link, place, rpy) = start, end
    away = [a - b for a, b in zip(origin, place)]
    length = away.pop(AXES[rpy])
    if abs(length) > SMALLEST and all(abs(beside) < SMALLEST for beside in away):
        link.disc('line', radius, 0.0, length)
