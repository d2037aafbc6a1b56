# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What the page has to know of a node ``driveline`` to draw its car, and what a tick tells."""

from math import hypot

from dm_ros.driveline.body import G
from dm_ros.driveline.parameters import VehicleParameters
from dm_ros.driveline_plant import (
    DrivelineNodeParameters,
    make_driveline,
    node_ports,
    port_limits,
)
from dm_ros.files.published_driveline import PublishedDriveline
from dm_ros.watch.wheels import Wheels

STEERED = 2                # of the wheels: the front ones come first
REACH = {'torque': 600.0, 'capacity': 2000.0, 'force': 5000.0, 'angle': 0.5, 'tangent': 0.3,
         'share': 1.2}     # of a slider, in the unit of its port
MOST_SHARE = 10.0          # that is taken of a grip or a contact


def flanges(car):
    """Return ``{differential: (input shaft, {output shaft: shaft that it drives})}``."""
    driven = dict(car.ends.values())
    found = {}
    for name, differential in car.mechanisms.items():
        into, *outputs = differential.shaft_of.values()
        found[name] = into, {output: driven[output] for output in outputs}
    return found


def control_ports(ports, limits):
    """Return what can be commanded as ``scene.control_ports`` does; limits: ``{name: most}``."""
    result = []
    for port in ports:
        high = min(port.high, limits.get(port.name, MOST_SHARE))
        low, reach = max(port.low, -high), min(high, REACH[port.kind])
        result.append({
            'name': port.name, 'kind': port.kind, 'unit': port.unit, 'low': low, 'high': high,
            'zero': port.idle, 'from': -reach if low < 0.0 else 0.0, 'to': reach})
    return [port for port in result if port['high'] > port['low']]   # nothing steers a fixed body


class CarScene:
    """
    A node ``driveline`` as it runs; its members are those of a ``Scene``.

    :raises ValueError: for parameters that this version does not know or cannot have.
    """

    grouped = 'commands'

    def __init__(self, name, values):
        """:param name: full name of the node; values: its parameters, ``{full name: value}``."""
        self.node = node = DrivelineNodeParameters().changed(
            DrivelineNodeParameters.part_of(values))
        car = make_driveline(values)
        self.inputs = node_ports(car)
        self.ports = control_ports(self.inputs, port_limits(car, node))
        published = PublishedDriveline(car, node.joint_prefix, node.base_frame_id)
        self.names = {topic: published.names[topic] for topic in ('joint_states', 'tyres')}
        self.frame = published.frame
        self.odometry = node.odom_frame_id, node.base_frame_id
        self.topics = (*self.names, 'odometry')
        self.flows = {f'power_flow/{name}': n for n, name in enumerate(car.differentials)}
        self._flow = [None] * len(self.flows)
        p = VehicleParameters().changed(VehicleParameters.part_of(values))
        places = list(car.wheel_places.values())
        self._wheels = Wheels(p, places, STEERED if node.planar else 0)
        self._lay_out(car)
        self.description = {
            'node': name, 'kind': 'driveline', 'layout': node.layout, 'planar': node.planar,
            'mode': node.mode, 'rate': node.rate, 'timeout': node.torque_timeout,
            'grouped': self.grouped, 'wheels': car.wheels, 'places': places, 'radius': p.R,
            'track': p.track, 'front': p.a, 'rear': p.b, 'weight': p.m * G,
            'connections': car.connections,
            'differentials': [{'name': name, 'input': into, 'outputs': list(outputs)}
                              for name, (into, outputs) in flanges(car).items()],
            'strips': [{'name': name, 'unit': unit, 'series': series}
                       for name, unit, series in self._strips(car)],
            'ports': self.ports}

    def _lay_out(self, car):
        """Note where in the joint states the numbers are that are told."""
        at = car.shafts.index
        self._of_wheels = [at(wheel) for wheel in car.wheels]
        self._driven = [at(b) for _, b in car.ends.values()]
        # of each differential: (torque and speed of the input), then of the outputs
        self._flanges = [
            [(at(into), at(into)), *[(at(driven), at(output)) for output, driven
                                     in outputs.items()]]
            for into, outputs in flanges(car).values()]

    def _strips(self, car):
        """Return name, unit and series of each strip."""
        halves = [n for n, shaft in enumerate(self._driven) if shaft in self._of_wheels]
        others = [n for n in range(len(self._driven)) if n not in halves]
        self._torques = [self._driven[n] for n in (*halves, *others)]
        body = ['forward', 'sideways'] if self.node.planar else ['forward']
        result = [('wheels', 'rad/s', list(car.wheels)), ('body', 'm/s', body)]
        if self.node.planar:
            result.append(('yaw', 'rad/s', ['yaw_rate']))
        return [*result, *[(name, 'N m', [car.connections[n] for n in shafts])
                           for name, shafts in (('halves', halves), ('shafts', others))]]

    def angles(self, parts):
        """Return the angles of all shafts in a tick, rad."""
        return parts[0][0]

    def row(self, parts):
        """Return the numbers of a tick in the order of the strips."""
        (_, speed, torque), _, (_, twist) = parts
        return (*[speed[n] for n in self._of_wheels], *(twist if self.node.planar else twist[:1]),
                *[torque[n] for n in self._torques])

    def take_flow(self, topic, flow):
        """Take the power-flow index of a differential."""
        self._flow[self.flows[topic]] = flow

    def told(self, parts, travel):
        """
        Return what the page is told of a tick.

        :param travel: how far all shafts have turned, rad.
        """
        (_, speed, torque), (slips, slip_speeds, efforts), (pose, twist) = parts
        wheels = [speed[n] for n in self._of_wheels]
        slips, slip_speeds, forces = [
            [values[n:n + 2] for n in range(0, len(values), 3)]
            for values in (slips, slip_speeds, efforts)]
        loads = efforts[2::3]
        steer = self._wheels.steer(wheels, slip_speeds, twist)
        grip = self._wheels.grip(wheels, slips, slip_speeds, forces, loads)
        used = [hypot(*force) / (load * (mu or 1.0)) if load > 0.0 else 0.0
                for force, load, mu in zip(forces, loads, grip)]
        return {
            'velocity': wheels, 'travel': [travel[n] for n in self._of_wheels],
            'force': forces, 'load': list(loads), 'slip': slips, 'steer': steer,
            'grip': grip, 'used': used, 'torque': [torque[n] for n in self._driven],
            'power': [[torque[a] * speed[b] for a, b in flanges] for flanges in self._flanges],
            'flow': list(self._flow), 'pose': list(pose), 'twist': list(twist)}
