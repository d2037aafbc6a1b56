# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A run as arrays: what a differential reported, tick by tick."""

import numpy as np

from dm_ros.files.columns import as_row, column_names, write_csv
from dm_ros.files.output import replacing
from dm_ros.files.plot import save_plot


class Table:
    """
    Rows of numbers, a tick each, with named columns; a subclass draws them.

    :param names: of the columns, ``time`` among them; rows: as many numbers each, or all of them
        one after the other.
    :param title: what stands above the picture.
    """

    def __init__(self, names, rows, title):
        self.title = title
        self._table = np.asarray(rows, float).reshape(-1, len(names))
        self.columns = dict(zip(names, self._table.T))
        self.time = self.columns['time']

    def __len__(self):
        return len(self.time)

    def save_csv(self, path):
        """Write it with the columns of OUT.csv of ``simulate``, 17 significant digits."""
        with replacing(path, 'w') as file:
            write_csv(file, self.columns, map(tuple, self._table.tolist()))

    def save_plot(self, path):
        """Draw it as PNG, which needs matplotlib."""
        with replacing(path, 'wb') as file:
            self.draw(file)


class Record(Table):
    """
    What a differential reported in a run, as numpy arrays over the ticks.

    ``time`` (s) and ``power_flow`` (+1, -1) are arrays; ``velocity`` (rad/s), ``position``
    (rad), ``torque`` (N m), ``moment`` (N m) and ``clutch_force`` (N) map names to arrays, such
    as ``record.velocity['left']``.
    """

    def __init__(self, mechanism, rows, title):
        """
        Make the arrays.

        :param mechanism: gives the names, a ``Mechanism`` or a ``Simulation``.
        :param rows: as ``as_row`` makes them, or all of them one after the other.
        :param title: what stands above the picture.
        """
        super().__init__(column_names(mechanism), rows, title)
        self.power_flow = self.columns['power_flow'].astype(int)
        self.velocity, self.position, self.torque, self.moment, self.clutch_force = (
            {name.removeprefix(kind): values for name, values in self.columns.items()
             if name.startswith(kind)}
            for kind in ('velocity.', 'position.', 'torque.', 'moment.', 'clutch_force.'))

    @classmethod
    def of(cls, simulation, snapshots):
        """Return the record of the ``Snapshot`` s of a ``Simulation``."""
        return cls(simulation, [as_row(snapshot) for snapshot in snapshots], simulation.variant)

    @property
    def slip(self):
        """Difference of the speeds of the two output shafts, first minus second, rad/s."""
        _, first, second, *_ = self.velocity.values()
        return first - second

    def draw(self, file):
        """Draw the record as PNG into a binary file."""
        save_plot(self.columns, file, self.title)
