# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The topics of a node without ROS: names and arrays of its JointStates, in and out."""

from array import array
import math
from typing import NamedTuple

FRAME = 'housing_link'   # against which shafts turn: the root of the URDF
EMPTY = array('d')
RATE_TOLD = 'rate wanted [Hz]'   # key of /diagnostics, of ticks in simulated time


class Arrays(NamedTuple):
    """The numbers of a JointState, each ``array('d')`` as long as its names, or empty."""

    position: array   # rad
    velocity: array   # rad/s
    effort: array     # N m, on clutches N


class Published:
    """
    The JointStates of a tick.

    ``names`` maps the last word of each topic, in the order of publication, to its list of names;
    ``frame`` is their ``frame_id``.
    """

    def __init__(self, mechanism, prefix=''):
        """:param mechanism: its ``Mechanism``; prefix: before each name and the frame."""
        self.frame = prefix + FRAME
        self.names = {'joint_states': mechanism.shafts, 'internal_moments': mechanism.moments}
        if mechanism.actuators:
            self.names['clutches'] = [clutch.name for clutch in mechanism.actuators]
        self.names['power_flow_stamped'] = ['power_flow']
        self.names = {topic: [prefix + name for name in names]
                      for topic, names in self.names.items()}
        self._no_torque = dict.fromkeys(mechanism.shafts, 0.0)
        self._inputs = mechanism.inputs
        self._carrier = mechanism.shafts.index('carrier')
        self._clutched = tuple(map(mechanism.shafts.index, mechanism.clutches))

    def arrays(self, snapshot):
        """Return the ``Arrays`` of a ``Snapshot`` for each topic, in the order of ``names``."""
        torque = {**self._no_torque, **dict(zip(self._inputs, snapshot.torque))}
        result = [Arrays(array('d', snapshot.position), array('d', snapshot.velocity),
                         array('d', torque.values())),
                  Arrays(EMPTY, EMPTY, array('d', snapshot.moment))]
        if self._clutched:
            result.append(Arrays(self._slip(snapshot.position), self._slip(snapshot.velocity),
                                 array('d', snapshot.clutch_force)))
        result.append(Arrays(array('d', (snapshot.power_flow,)), EMPTY, EMPTY))
        return result

    def _slip(self, values):
        """Return how far the shafts with a clutch are ahead of the carrier."""
        carrier = values[self._carrier]
        return array('d', [values[i] - carrier for i in self._clutched])


class CommandMessage:
    """A message on ``~/torques``: ``names``, and the arrays for a value of each port."""

    def __init__(self, ports, prefix=''):
        """:param ports: the ``Port`` s whose values it brings; prefix: before each name."""
        self.names = [prefix + port.name for port in ports]
        self._taken = [port.array for port in ports]

    def arrays(self, values):
        """Return the ``Arrays`` of one value for each port, in its unit; None for no speed."""
        numbers = [math.nan if value is None else float(value) for value in values]
        return Arrays(*[
            array('d', [number if taken == wanted else math.nan
                        for number, taken in zip(numbers, self._taken, strict=True)])
            if wanted == 'effort' or wanted in self._taken else EMPTY
            for wanted in Arrays._fields])


def input_topics(mechanism):
    """Return ``{topic: port name}`` of the topics of single ports of a ``Mechanism``, below ~."""
    topics = {f'{port.kind}/{port.name}': port.name for port in mechanism.ports}
    topics.update((f'clutch/{clutch}', actuator.name)
                  for clutch, actuator in zip(mechanism.clutches, mechanism.actuators))
    return topics
