# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The columns of a record, as in OUT.csv of ``simulate``, and how they are written."""


def column_names(mechanism):
    """Return the names of the columns of a record of a ``Mechanism`` or a ``Simulation``."""
    return ['time', *(f'velocity.{name}' for name in mechanism.shafts),
            *(f'position.{name}' for name in mechanism.shafts),
            *(f'torque.{name}' for name in mechanism.inputs),
            *(f'moment.{name}' for name in mechanism.moments), 'power_flow',
            *(f'clutch_force.{name}' for name in mechanism.clutches)]


def as_row(snapshot):
    """Return a ``Snapshot`` as one flat tuple in the order of ``column_names``."""
    return (snapshot.time, *snapshot.velocity, *snapshot.position, *snapshot.torque,
            *snapshot.moment, snapshot.power_flow, *snapshot.clutch_force)


def write_csv(file, names, rows):
    """Write rows of numbers, each a tuple, as CSV with 17 significant digits."""
    file.write(','.join(names) + '\n')
    line = ','.join(['%.17g'] * len(names)) + '\n'
    for row in rows:
        file.write(line % row)
