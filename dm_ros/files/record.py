# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A run as arrays: what a differential reported, tick by tick."""

import numpy as np

from dm_ros.files.output import as_row, column_names, replacing, write_csv
from dm_ros.files.plot import save_plot


class Record:
    """
    Snapshots of a run as numpy arrays over the ticks.

    ``time`` (s) and ``power_flow`` (+1, -1) are arrays; ``velocity`` (rad/s), ``position``
    (rad), ``torque`` (N m) and ``moment`` (N m) map names to arrays, such as
    ``record.velocity['left']``.
    """

    def __init__(self, simulation, snapshots):
        """
        Make the arrays.

        :param simulation: gives the names, a ``Simulation`` of the same variant.
        :param snapshots: sequence of ``Snapshot``.
        """
        self.variant = simulation.variant
        names = column_names(simulation)
        table = np.array([as_row(snapshot) for snapshot in snapshots]).reshape(-1, len(names))
        self.columns = dict(zip(names, table.T))
        self.time = self.columns['time']
        self.power_flow = self.columns['power_flow'].astype(int)
        self.velocity, self.position, self.torque, self.moment = (
            {name.removeprefix(kind): values for name, values in self.columns.items()
             if name.startswith(kind)}
            for kind in ('velocity.', 'position.', 'torque.', 'moment.'))

    def __len__(self):
        return len(self.time)

    @property
    def slip(self):
        """Difference of the speeds of the two output shafts, first minus second, rad/s."""
        _, first, second, *_ = self.velocity.values()
        return first - second

    def save_csv(self, path):
        """Write the record with the columns of OUT.csv of ``simulate``."""
        write_csv(self.columns, path)

    def save_plot(self, path):
        """Draw the record as PNG, which needs matplotlib."""
        with replacing(path, 'wb') as file:
            save_plot(self.columns, file, self.variant)
