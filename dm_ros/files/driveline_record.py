# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A run of a driveline as arrays: what it reported, tick by tick."""

import numpy as np

from dm_ros.files.plot import BESIDE
from dm_ros.files.record import Table

BODY = ('x', 'y', 'yaw', 'longitudinal_speed', 'lateral_speed', 'yaw_rate',
        'longitudinal_acceleration', 'lateral_acceleration')
OF_NAMES = {   # column: which names of a ``Driveline`` it has
    'velocity': 'shafts', 'position': 'shafts', 'torque': 'connections', 'twist': 'connections',
    'moment': 'moments', 'power_flow': 'differentials', 'longitudinal_slip': 'wheels',
    'lateral_slip': 'wheels', 'longitudinal_force': 'wheels', 'lateral_force': 'wheels',
    'load': 'wheels', 'clutch_force': 'clutches'}


def driveline_columns(car):
    """Return the names of the columns of a record of a ``Driveline``."""
    return ['time', *(f'{column}.{name}' for column, names in OF_NAMES.items()
                      for name in getattr(car, names)), *BODY]


def driveline_row(snapshot, forces):
    """Return a ``Snapshot`` and the forces on the clutches as a row in that order."""
    return (snapshot.time, *snapshot.velocity, *snapshot.position, *snapshot.torque,
            *snapshot.twist, *snapshot.moment, *snapshot.power_flow,
            *(kappa for kappa, _ in snapshot.slip), *(alpha for _, alpha in snapshot.slip),
            *(along for along, _ in snapshot.wheel_force),
            *(across for _, across in snapshot.wheel_force), *snapshot.wheel_load, *forces,
            *snapshot.pose, *snapshot.twist_body, *snapshot.acceleration)


class DrivelineRecord(Table):
    """
    What a driveline reported in a run, as numpy arrays over the ticks.

    ``time`` (s), ``x``, ``y`` (m), ``yaw`` (rad), ``longitudinal_speed``, ``lateral_speed`` (m/s),
    ``yaw_rate`` (rad/s) and ``longitudinal_acceleration``, ``lateral_acceleration`` (the specific
    force, m/s^2) are arrays. These map names to arrays: ``velocity`` (rad/s) and ``position``
    (rad) of shafts; ``torque`` (N m) and ``twist`` (rad) of connections; ``moment`` (N m);
    ``power_flow`` of differentials; ``longitudinal_slip``, ``lateral_slip``,
    ``longitudinal_force``, ``lateral_force`` and ``load`` (N) of wheels; ``clutch_force`` (N).

    :param car: gives the names; rows: as ``driveline_row`` makes them.
    """

    def __init__(self, car, rows, title=''):
        super().__init__(driveline_columns(car), rows, title)
        for name in BODY:
            setattr(self, name, self.columns[name])
        for kind, of in OF_NAMES.items():
            setattr(self, kind, {name: self.columns[f'{kind}.{name}']
                                 for name in getattr(car, of)})

    def draw(self, file):
        """Draw the record as PNG into a binary file: body, wheels, tyres, torques."""
        from matplotlib.figure import Figure

        figure = Figure(figsize=(11, 10), dpi=110, layout='constrained')
        axes = figure.subplots(4, 1, sharex=True)
        axes[0].plot(self.time, self.longitudinal_speed, label='speed, m/s')
        if np.any(self.yaw_rate):
            axes[0].plot(self.time, np.degrees(self.yaw_rate), label='yaw rate, degrees/s')
        for axis, unit, lines in (
                (axes[1], 'speed of the wheels, rad/s',
                 {wheel: self.velocity[wheel] for wheel in self.load}),
                (axes[2], 'force of the road forward, N', self.longitudinal_force),
                (axes[3], 'torque of the shafts, N m', self.torque)):
            for name, values in lines.items():
                axis.plot(self.time, values, label=name.replace('_', ' '), linewidth=1.2)
            axis.set_ylabel(unit)
        axes[0].set_title(self.title)
        axes[-1].set_xlabel('time, s')
        for axis in axes:
            axis.grid(alpha=0.25)
            axis.legend(**BESIDE)
        figure.savefig(file, format='png')
