# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The JointStates of a tick of a driveline without ROS: names and arrays."""

from array import array
import math

from dm_ros.files.published import Arrays, EMPTY

ALONG = 'longitudinal', 'lateral'


class PublishedDriveline:
    """
    The JointStates of a tick.

    ``names`` maps the last word of each topic, in the order of publication, to its list of names;
    ``frame`` is their ``frame_id``.
    """

    def __init__(self, car, prefix='', frame='base_link'):
        """:param car: a ``Driveline``; prefix: before each name."""
        self.frame = frame
        self.names = {
            'joint_states': car.shafts, 'internal_moments': car.moments,
            'clutches': [f'{clutch}_clutch' for clutch in car.clutches],
            'tyres': [f'{wheel}_{what}' for wheel in car.wheels for what in (*ALONG, 'load')]}
        self.names = {topic: [prefix + name for name in names]
                      for topic, names in self.names.items() if names}
        self._efforts = [car.connections.index(driven) if driven else None
                         for driven in map(car.driven_by.get, car.shafts)]
        self._slips = [(car.shafts.index(shaft), car.shafts.index(carrier))
                       for shaft, carrier in car.clutched_shafts]

    def arrays(self, snapshot, torque, slip_speed, forces):
        """
        Return the ``Arrays`` of a ``Snapshot`` for each topic, in the order of ``names``.

        :param torque: on the input, N m; slip_speed: of each wheel, m/s; forces: on clutches, N.
        """
        efforts = [0.0 if n is None else snapshot.torque[n] for n in self._efforts]
        efforts[0] = torque
        result = [Arrays(array('d', snapshot.position), array('d', snapshot.velocity),
                         array('d', efforts)),
                  Arrays(EMPTY, EMPTY, array('d', snapshot.moment))]
        if forces:
            result.append(Arrays(*[
                array('d', [values[shaft] - values[carrier] for shaft, carrier in self._slips])
                for values in (snapshot.position, snapshot.velocity)], array('d', forces)))
        slips, speeds, loads = array('d'), array('d'), array('d')
        for slip, speed, force, load in zip(
                snapshot.slip, slip_speed, snapshot.wheel_force, snapshot.wheel_load):
            slips.extend((*slip, math.nan))
            speeds.extend((*speed, math.nan))
            loads.extend((*force, load))
        return [*result, Arrays(slips, speeds, loads)]
