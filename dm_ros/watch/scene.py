# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What the page has to know of a node to draw it: names, units, tooth numbers and sizes."""

from itertools import product
from math import asin, copysign, log, pi

from dm_ros.files.published import Published
from dm_ros.files.urdf import sizes
from dm_ros.mechanism.variants import equipped, variant_named
from dm_ros.settings import NodeParameters, port_parameters, speed_ports

TEETH = range(8, 15)       # of the smallest gear of a pair
NEAR_COUNT = 10            # of a satellite, where nothing speaks for another number
RATIOS = 1.0, 6.0          # of crown gear to satellite, between which a drawing is legible
DRIVES = 1.6, 6.0          # of ring gear to pinion
MOST_SATELLITES = 6        # that are drawn
SPEED_SPAN = 100.0         # rad/s, of a slider
FORCE_SPAN = 5000.0        # N
TORQUE_SPAN = 300.0        # N m


def clipped(value, limits):
    """Return the value, or the limit that it is beyond."""
    return min(max(value, limits[0]), limits[1])


def satellite_teeth(ratios, count):
    """
    Return the tooth numbers of the crown gears and of a satellite that are drawn.

    They are whole numbers, near the ratios of the radii, such that all satellites can be put in:
    the sum of the crown gears' is a multiple of the count.

    :param ratios: of the radii of the two crown gears to that of a satellite.
    """
    def error(numbers):
        *crowns, satellite = numbers
        return (sum(abs(log(crown / satellite / ratio)) for crown, ratio in zip(crowns, ratios)),
                abs(satellite - NEAR_COUNT))
    near = range(-count, count + 1)
    return min(((first, second, satellite) for satellite in TEETH
                for first, second in product(*(
                    [round(ratio * satellite) + more for more in near] for ratio in ratios))
                if min(first, second) >= 6 and (first + second) % count == 0), key=error)


def drive_teeth(ratio):
    """Return the tooth numbers of ring gear and pinion that are drawn for their ratio."""
    return min(((round(ratio * pinion), pinion) for pinion in TEETH),
               key=lambda pair: (abs(log(pair[0] / pair[1] / ratio)), pair[1]))


def gears(mechanism, p):
    """
    Return what is drawn of a ``Mechanism``, as JSON has it.

    :param p: its table of parameters. What is too extreme to be seen is drawn less so, and
        ``exact`` is false.
    :raises ValueError: where the parameters are too extreme to be drawn.
    """
    size = sizes(mechanism, p)
    ratios = [clipped(crown / size.satellite, RATIOS) for crown in size.crowns]
    room = int(pi / asin(min(1.0, 2.2 / sum(ratios))))   # satellites side by side
    count = max(1, min(p.n_s, MOST_SATELLITES, room))
    first, second, satellite = satellite_teeth(ratios, count)
    drawn, drive = count == p.n_s, None
    wanted = [crown / size.satellite for crown in size.crowns]
    found = [first / satellite, second / satellite]
    if size.pinion:
        ring, pinion = drive_teeth(clipped(abs(p.g_F), DRIVES))
        drive = {'ring': ring, 'pinion': pinion, 'side': copysign(1.0, p.g_F)}
        wanted.append(abs(p.g_F))
        found.append(ring / pinion)
    return {
        'crowns': [first, second], 'satellite': satellite, 'count': count, 'drive': drive,
        'plates': list(size.plates),
        'plate_radii': [1.2 * radius / max(size.crowns) for radius in (p.R_F1, p.R_F2)],
        'bevel': first == second,
        'exact': drawn and all(abs(a / b - 1) < 0.03 for a, b in zip(found, wanted))}


def span(mechanism, port, limit):
    """Return how far the slider of a port goes, in its unit."""
    return min(limit, {'torque': TORQUE_SPAN, 'speed': SPEED_SPAN, 'force': FORCE_SPAN}[port.kind])


def control_ports(mechanism, node, limits):
    """Return what can be commanded: a dictionary for each port."""
    result = []
    for port in mechanism.ports + mechanism.actuators:
        limit = limits.get(port.name, node.torque_limit if port.kind == 'torque' else port.high)
        reach = span(mechanism, port, limit)
        result.append({
            'name': port.name, 'kind': port.kind, 'unit': port.unit,
            'low': max(port.low, -limit), 'high': limit,
            'zero': 0.0, 'from': 0.0 if port.low == 0.0 else -reach, 'to': reach})
    return result


class Scene:
    """
    A node as it runs.

    :ivar description: what the page is told, as JSON has it.
    :ivar names: ``{last word of a topic: names in its messages}`` of those that make a tick.
    :ivar frame: the ``frame_id`` of these messages.
    :ivar topics: last words of the topics that make a tick, of JointStates first.
    :ivar odometry: the frames of ``odometry`` where that is one of them, else None.
    :ivar flows: last words of the topics of power-flow indices that have no stamp.
    :ivar grouped: last word of the topic on which many inputs are commanded.
    :ivar inputs: the ``Port`` s of the node.
    :ivar ports: what can be commanded, as ``control_ports`` returns it.
    :raises ValueError: for parameters that this version does not know or cannot have.
    """

    grouped, odometry, flows = 'torques', None, ()

    def __init__(self, name, values):
        """:param name: full name of the node; values: its parameters, ``{full name: value}``."""
        self.node = node = NodeParameters().changed(NodeParameters.part_of(values))
        mechanism = variant_named(node.variant).mechanism
        parameters = mechanism.parameters().changed(mechanism.parameters.part_of(values))
        self.mechanism = mechanism = equipped(
            mechanism, parameters, speed_ports(port_parameters(mechanism.inputs, values)))
        actuators = mechanism.actuators
        limits = dict(zip([port.name for port in actuators], (parameters.A_1, parameters.A_2)))
        self.inputs = mechanism.ports + actuators
        self.ports = control_ports(mechanism, node, limits)
        strips = [('speeds', 'rad/s', mechanism.shafts), ('slip', 'rad/s', mechanism.outputs),
                  ('moments', 'N m', mechanism.moments), ('torques', 'N m', mechanism.inputs)]
        if actuators:
            strips.append(('forces', 'N', [port.name for port in actuators]))
        strips.append(('index', '', ['power_flow']))
        try:
            drawing, refusal = gears(mechanism, parameters), None
        except ValueError as error:
            drawing, refusal = None, str(error)
        meshes = dict(zip(mechanism.gears[-2:], mechanism.outputs))
        if len(mechanism.gears) > 2:   # what the pinion drives
            meshes = {mechanism.gears[0]: mechanism.shafts[0], **meshes}
        self.description = {
            'node': name, 'kind': 'differential', 'variant': node.variant,
            'title': mechanism.title, 'law': node.loss_law, 'mode': node.mode, 'rate': node.rate,
            'timeout': node.torque_timeout, 'grouped': self.grouped,
            'shafts': mechanism.shafts, 'inputs': mechanism.inputs, 'outputs': mechanism.outputs,
            'moments': mechanism.moments, 'meshes': meshes,
            'clutches': dict(zip(mechanism.clutch_moments, mechanism.clutches)),
            'strips': [{'name': name, 'unit': unit, 'series': series}
                       for name, unit, series in strips],
            'ports': self.ports, 'gears': drawing, 'not drawn': refusal}
        published = Published(mechanism, node.joint_prefix)
        self.names, self.frame = published.names, published.frame
        self.topics = tuple(self.names)
        self._inputs = [mechanism.shafts.index(shaft) for shaft in mechanism.inputs]
        self._outputs = [mechanism.shafts.index(shaft) for shaft in mechanism.outputs]

    def columns(self, velocity, torque, moment, force, flow):
        """Return the numbers of a tick in the order of the strips; each argument is an array."""
        carrier = velocity[0]
        return (*velocity, *(velocity[i] - carrier for i in self._outputs), *moment,
                *(torque[i] for i in self._inputs), *force, *flow)

    def angles(self, parts):
        """Return the angles of all shafts in a tick, rad; parts: of a ``Tick``."""
        return parts[0][0]

    def row(self, parts):
        """Return the numbers of a tick in the order of the strips."""
        (_, velocity, torque), (moment,), *clutches, (flow,) = parts
        return self.columns(velocity, torque, moment, clutches[0][2] if clutches else (), flow)

    def told(self, parts, travel):
        """
        Return what the page is told of a tick.

        :param travel: how far all shafts have turned, rad.
        """
        (position, velocity, torque), (moment,), *clutches, (flow,) = parts
        return {'position': list(position), 'velocity': list(velocity), 'torque': list(torque),
                'moment': list(moment), 'force': list(clutches[0][2] if clutches else ()),
                'flow': flow[0], 'travel': travel}
