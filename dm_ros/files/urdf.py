# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
A mechanism as a URDF made from its parameters, whose gears mesh by the published angles.

Each part is a link whose z axis is the axis it turns about; each joint is continuous about it.
Carrier, output shafts and pinion turn against the housing, satellites against the carrier, as
``joint_states`` has their angles. Gears are drawn as their pitch surfaces: crown gears touch the
cylinders of the satellites from both sides, ring gear and pinion touch each other.
"""

from math import atan2, copysign, cos, hypot, pi, sin
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from dm_ros.files.ros2_control import add_ros2_control

# rpy that turns z to where the first output shaft points: x is forward, y left, z up
ALONG = {'left': (-pi / 2, 0.0, 0.0), 'front': (0.0, pi / 2, 0.0)}
FORWARD = (0.0, pi / 2, 0.0)
COLOURS = {'first': (0.25, 0.45, 0.70), 'second': (0.30, 0.60, 0.45),
           'satellite': (0.90, 0.60, 0.20), 'carrier': (0.62, 0.62, 0.66),
           'pinion': (0.55, 0.40, 0.65), 'line': (0.15, 0.15, 0.17), 'mark': (0.85, 0.10, 0.10)}
SMALLEST = 1e-6    # m, radius of a gear that is drawn
MOST_PLATES = 12   # of a clutch that are drawn
SPOKES = 8         # lines on a gear, of which one is the mark
BARS = 4           # of the carrier


class Sizes(NamedTuple):
    """Sizes in m; those of the radii are pitch radii."""

    crowns: tuple      # radii of the two crown gears
    satellite: float   # radius
    width: float       # of a tooth, about
    case: float        # radius of the carrier
    plates: tuple      # number of those of each clutch
    ring: float        # radius of the ring gear
    pinion: float      # radius; 0 without final drive
    side: float        # +1 where the ring gear is on the side of the first output shaft, else -1

    def places(self, k):
        """Return where along the axle the plates of clutch k begin, from the middle."""
        first = self.satellite + 1.4 * self.width
        return [first + 0.3 * self.width * n for n in range(self.plates[k])]

    def reach(self, k):
        """Return where crown gear k and its plates end."""
        return self.satellite + (1.5 + 0.3 * self.plates[k]) * self.width


def sizes(mechanism, p):
    """Return the ``Sizes`` of a ``Mechanism`` with some parameters."""
    crowns, satellite = (p.R_1, p.R_2), p.g_2s * p.R_2
    if min(*crowns, satellite) < SMALLEST:
        raise ValueError(f'a gear with a radius of {min(*crowns, satellite):g} m is not drawn, '
                         f'only from {SMALLEST:g} m')
    width = 0.35 * min(crowns)
    plates = [1.2 * radius for radius, n in ((p.R_F1, p.n_F1), (p.R_F2, p.n_F2)) if n]
    case = max(max(crowns) + width, *plates, 0.0)
    drawn = tuple(min(n + 1, MOST_PLATES) if n else 0 for n in (p.n_F1, p.n_F2))
    has_final_drive = 'final_drive' in mechanism.gears
    ring = 2.2 * case
    return Sizes(crowns, satellite, width, case, drawn, ring,
                 ring / abs(p.g_F) if has_final_drive else 0.0,
                 -copysign(1.0, p.g_F) if has_final_drive else 0.0)


def exact(*values):
    """Return numbers as XML has them, to the last bit: by them gears mesh."""
    return ' '.join(map(repr, values))


def brief(*values):
    """Return numbers as XML has them, as exactly as an eye sees."""
    return ' '.join(f'{round(value, 12) + 0.0:.6g}' for value in values)


def link_name(prefix, name):
    """Return the name of the link of a part."""
    return f'{prefix}{name}_link'


class Link:
    """A link under construction; z is the axis that it turns about."""

    def __init__(self, robot, prefix, name, full_name=None):
        """:param full_name: what it is called, if not by prefix and name."""
        self._prefix = prefix
        self._element = SubElement(robot, 'link', name=full_name or link_name(prefix, name))

    def inertial(self, inertia, radius, height, middle=0.0):
        """
        Give it the mass of a solid disc with this inertia about z.

        :param inertia: kg m^2; radius, height: of the disc, m; middle: where it is on z, m.
        """
        mass = 2.0 * inertia / radius / radius
        across = inertia / 2.0 + mass * height / 12.0 * height
        element = SubElement(self._element, 'inertial')
        SubElement(element, 'origin', xyz=exact(0.0, 0.0, middle), rpy='0 0 0')
        SubElement(element, 'mass', value=exact(mass))
        SubElement(element, 'inertia', ixx=exact(across), ixy='0', ixz='0', iyy=exact(across),
                   iyz='0', izz=exact(inertia))

    def shape(self, kind, colour, xyz, rpy=(0.0, 0.0, 0.0), **size):
        """Add a box (``size``) or a cylinder along z (``radius``, ``length``), all in m."""
        visual = SubElement(self._element, 'visual')
        SubElement(visual, 'origin', xyz=brief(*xyz), rpy=brief(*rpy))
        SubElement(SubElement(visual, 'geometry'), kind,
                   {name: brief(*values) for name, values in size.items()})
        SubElement(visual, 'material', name=self._prefix + colour)

    def rod(self, colour, radius, start, end):
        """Add a cylinder from one point to another."""
        x, y, z = (b - a for a, b in zip(start, end))
        self.shape('cylinder', colour, [(a + b) / 2 for a, b in zip(start, end)],
                   (0.0, atan2(hypot(x, y), z), atan2(y, x)), radius=(radius,),
                   length=(hypot(x, y, z),))

    def disc(self, colour, radius, low, high):
        """Add a cylinder between two places on the axis."""
        self.shape('cylinder', colour, (0.0, 0.0, (low + high) / 2), radius=(radius,),
                   length=(abs(high - low),))

    def gear(self, colour, radius, low, high):
        """Add a disc with radial lines, one of them the mark, that are seen from all sides."""
        self.disc(colour, radius, low, high)
        for n in range(SPOKES):
            angle, length = 2 * pi * n / SPOKES, 0.55 * radius
            middle = 1.02 * radius - length / 2
            self.shape('box', 'line' if n else 'mark',
                       (middle * cos(angle), middle * sin(angle), (low + high) / 2),
                       (0.0, 0.0, angle),
                       size=(length, (0.06 if n else 0.12) * radius, abs(high - low) * 1.05))

    def hoop(self, colour, radius, low, high, depth, count=40):
        """Add a ring of boxes, one of them the mark; depth: across the ring, m."""
        for n in range(count):
            angle = 2 * pi * n / count
            self.shape('box', colour if n else 'mark',
                       (radius * cos(angle), radius * sin(angle), (low + high) / 2),
                       (0.0, 0.0, angle), size=(depth, 2.1 * pi * radius / count,
                                                abs(high - low)))


def draw_shaft(link, size, k, colour, friction_radius):
    """Draw output shaft k, 0 or 1, with crown gear and plates; its axis is that of the axle."""
    way = 1 - 2 * k
    face, crown = size.satellite, size.crowns[k] + size.width / 2
    end = max(size.reach(0), size.reach(1), size.pinion + size.width) + 1.2 * max(size.crowns)
    link.gear(colour, crown, way * face, way * (face + size.width))
    link.disc(colour, 0.3 * size.crowns[k], way * face, way * end)
    link.gear(colour, 0.8 * size.crowns[k], way * end, way * (end + 0.4 * size.width))
    for place in size.places(k)[::2]:
        link.gear(colour, max(1.1 * friction_radius, 0.4 * size.crowns[k]), way * place,
                  way * (place + 0.2 * size.width))


def draw_carrier(link, size, count):
    """Draw the carrier: pins of the satellites, case, ring gear, every other plate."""
    half = 0.25 * min(size.satellite, max(size.crowns))
    for n in range(count):
        angle = 2 * pi * n / count
        link.rod('carrier', 0.1 * max(size.crowns), (0.0, 0.0, 0.0),
                 (size.case * cos(angle), size.case * sin(angle), 0.0))
    link.hoop('carrier', size.case, -half, half, 0.3 * size.width)
    ends = [size.reach(k) if size.plates[k] else half for k in (0, 1)]
    if size.pinion:
        face = size.side * size.pinion
        back = face + size.side * size.width / 2
        link.hoop('carrier', size.ring, face, face + size.side * size.width, size.width)
        k = 0 if size.side > 0 else 1
        ends[k] = max(ends[k], abs(back))
    for k, way in enumerate((1, -1)):
        for place in size.places(k)[1::2]:
            link.gear('carrier', size.case, way * place, way * (place + 0.2 * size.width))
    for n in range(BARS):
        x, y = cos(pi / 4 + 2 * pi * n / BARS), sin(pi / 4 + 2 * pi * n / BARS)
        link.rod('carrier', 0.2 * size.width, (size.case * x, size.case * y, -ends[1]),
                 (size.case * x, size.case * y, ends[0]))
        if size.pinion:
            link.rod('carrier', 0.3 * size.width, (size.case * x, size.case * y, back),
                     (size.ring * x, size.ring * y, back))


def joint(robot, prefix, name, parent, xyz, rpy, leader=None):
    """
    Add the continuous joint of a link of the same name, which may follow a leading joint.

    :param parent: name of the link against which it turns, with all that is before it.
    """
    element = SubElement(robot, 'joint', name=prefix + name, type='continuous')
    SubElement(element, 'parent', link=parent)
    SubElement(element, 'child', link=link_name(prefix, name))
    SubElement(element, 'origin', xyz=exact(*xyz), rpy=exact(*rpy))
    SubElement(element, 'axis', xyz='0 0 1')
    if leader:
        SubElement(element, 'mimic', joint=prefix + leader, multiplier='1', offset='0')


def add_materials(robot, prefix, colours):
    """Add ``{name: (red, green, blue)}``, or with opacity."""
    for name, colour in colours.items():
        SubElement(SubElement(robot, 'material', name=prefix + name), 'color',
                   rgba=brief(*(*colour, 1.0)[:4]))


def add_differential(robot, mechanism, p, prefix, parent, before='', place=(0.0, 0.0, 0.0), way=1):
    """
    Add the links and joints of a differential.

    :param mechanism: its ``Mechanism``; p: its table of parameters.
    :param prefix: before all names; before: further, before those of its links and joints.
    :param parent: name of the link against which it turns; place: of its middle there, m.
    :param way: +1 where its pinion is in front of it, -1 behind.
    :return: ``{shaft: (Link, its place, rpy of its axis)}`` of those that can be driven.
    :raises ValueError: where the parameters are too extreme to be drawn.
    """
    x, y, z = place
    size = sizes(mechanism, p)
    size = size._replace(side=way * size.side)
    inertia = {shaft: p.named()[f'{p.prefix}.inertia.{shaft}'] for shaft in mechanism.shafts}
    carrier = Link(robot, prefix, f'{before}carrier')
    carrier.inertial(inertia['carrier'], size.ring if size.pinion else size.case, size.width)
    draw_carrier(carrier, size, p.n_s)
    along = ALONG[mechanism.outputs[0]]
    joint(robot, prefix, f'{before}carrier', parent, place, along)
    made = {f'{before}carrier': (carrier, place, along)}
    for k, (shaft, colour, radius) in enumerate(zip(
            mechanism.outputs, ('first', 'second'), (p.R_F1, p.R_F2))):
        link = Link(robot, prefix, before + shaft)
        link.inertial(inertia[shaft], size.crowns[k] + size.width / 2, size.width,
                      (1 - 2 * k) * (size.satellite + size.width / 2))
        draw_shaft(link, size, k, colour, radius)
        joint(robot, prefix, before + shaft, parent, place, along)
        made[before + shaft] = link, place, along
    if size.pinion:
        end = 0.9 * size.ring
        link = Link(robot, prefix, f'{before}pinion')
        link.inertial(inertia['pinion'], size.pinion, size.width)
        link.gear('pinion', size.pinion, -size.width / 2, size.width / 2)
        link.disc('pinion', 0.5 * size.pinion, 0.0, way * end)
        link.gear('pinion', 0.8 * size.pinion, way * end, way * (end + size.width / 2))
        made[f'{before}pinion'] = link, (x + way * size.ring, y, z), FORWARD
        joint(robot, prefix, f'{before}pinion', parent, *made[f'{before}pinion'][1:])
    middle = sum(size.crowns) / 2
    half = (max(size.crowns) - min(size.crowns) + size.width) / 2
    for n in range(p.n_s):
        name, angle = f'{before}satellite{f"_{n + 1}" * (n > 0)}', 2 * pi * n / p.n_s
        link = Link(robot, prefix, name)
        link.inertial(inertia['satellite'], size.satellite, 2 * half)
        link.gear('satellite', size.satellite, -half, half)
        joint(robot, prefix, name, link_name(prefix, f'{before}carrier'),
              (middle * cos(angle), middle * sin(angle), 0.0), (0.0, pi / 2, angle),
              f'{before}satellite' if n else None)
    return made


def as_text(robot):
    """Return a URDF as text."""
    ElementTree.indent(robot)
    return f'<?xml version="1.0"?>\n{ElementTree.tostring(robot, "unicode")}\n'


def urdf(mechanism, parameters, prefix='', node=None, lockstep=False):
    """
    Return a URDF as text.

    No name in it is the end of another one, so that those of two differentials with different
    prefixes never clash.

    :param mechanism: its ``Mechanism``; parameters: its table.
    :param prefix: before the names of links, joints and materials, as in ``joint_states``.
    :param node: the full name of the node that ros2_control shall drive; None for none. Then each
        clutch is a joint too, of its slip, in an empty link.
    :param lockstep: whether each message is a tick, so that no second one may bring the forces on
        clutches: they are left out.
    :raises ValueError: where the parameters are too extreme to be drawn.
    """
    robot = Element('robot', name=f'{prefix}differential')
    add_materials(robot, prefix, COLOURS)
    Link(robot, prefix, 'housing')
    add_differential(robot, mechanism, parameters, prefix, link_name(prefix, 'housing'))
    if node:
        clutches = () if lockstep else mechanism.clutch_moments
        for clutch in clutches:
            Link(robot, prefix, clutch)
            joint(robot, prefix, clutch, link_name(prefix, 'carrier'), (0.0, 0.0, 0.0),
                  (0.0, 0.0, 0.0))
        add_ros2_control(robot, mechanism, prefix, node, bool(clutches))
    return as_text(robot)
