# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A drive with the speeds that were measured in it, from a CSV file or a bag."""

import csv
import math
from typing import NamedTuple

import numpy as np

from dm_ros.files.recorded_drive import read_drive
from dm_ros.files.torque_table import read_torque_file, TorqueTable

SPEED, TORQUE, FORCE = 'velocity.', 'torque.', 'clutch_force.'


class MeasuredDrive(NamedTuple):
    """Inputs over time, and speeds that were measured."""

    table: TorqueTable
    times: np.ndarray   # s, of the rows of measured speeds; the run begins at 0
    speeds: dict        # {shaft: rad/s at these times, NaN where there is none}
    values: dict        # parameters that a run of it needs
    forces_in_force: bool = False   # whether forces on clutches have lag and limit behind them
    dt: float | None = None         # s, of a tick, if the recording tells
    remarks: tuple = ()             # lines for who wants to run it


def read_measured_file(path, mechanism, ignored=()):
    """
    Return the ``MeasuredDrive`` of a CSV file.

    It is a table of torques as ``read_torque_file`` reads it with columns ``velocity.<shaft>``
    beside, what was measured at the time of the row, where an empty cell is no measurement. Or it
    is what ``simulate`` writes, known by its columns ``torque.<shaft>``: those of a row were in
    force until its time, the speeds are those of the output shafts, and all other columns are
    passed over.

    :param mechanism: the ``Mechanism`` to run; ignored: names of further columns to pass over.
    :raises ValueError: one line that names file, line and column.
    """
    names, rows = _read(path)
    written = any(name.startswith(TORQUE) for name in names)
    measured = [name for name in names if name.startswith(SPEED) and name not in ignored]
    for name in measured:
        if name.removeprefix(SPEED) not in mechanism.shafts:
            raise ValueError(f'{path}:1: column {name!r}: there is no such shaft, the '
                             f'{mechanism.title} has {", ".join(mechanism.shafts)}')
        if names.count(name) > 1:
            raise ValueError(f'{path}:1: column {name!r}: it appears twice')
    ports, clutches, others = mechanism.ports, mechanism.clutch_moments, measured
    if written:
        ports = [port._replace(name=TORQUE + port.name) for port in ports]
        clutches = [FORCE + name for name in mechanism.clutches]
        # the other speeds were made of these two
        measured = [name for name in measured if name.removeprefix(SPEED) in mechanism.outputs]
    if written or not measured:   # what is wrong with the table itself comes first
        known = {'time', *(port.name for port in ports), *clutches, *ignored}
        others = [name for name in names if name not in known]
    if not measured and set(names) & {'time', *(port.name for port in ports)}:
        raise ValueError(f'{path}:1: no column has a measured speed, such as '
                         f'{SPEED}{mechanism.outputs[0]}')
    table = read_torque_file(path, ports, clutches, ignored, () if not measured else others)
    speeds = {name.removeprefix(SPEED): np.array(
        [_speed(path, line, name, row[names.index(name)]) for line, row in rows])
        for name in measured}
    for shaft, column in speeds.items():
        if np.isnan(column).all():
            raise ValueError(f'{path}: column {SPEED + shaft!r}: nothing was measured')
    times = np.array(table.times)
    if not written:
        return MeasuredDrive(table, times, speeds, {})
    if len(times) < 2:
        raise ValueError(f"{path}: column 'time': a start and the end of a tick are needed")
    times -= times[0]
    inputs = *table.torques[1:], table.torques[-1]
    in_force = len(table.idle) > len(ports)
    return MeasuredDrive(TorqueTable(tuple(times.tolist()), inputs, table.idle), times, speeds,
                         _without_lag(mechanism) if in_force else {}, in_force)


def read_measured_bag(path, mechanism, rate, node=None, timeout=0.0):
    """
    Return the ``MeasuredDrive`` of a bag: its inputs, and the speeds of both output shafts.

    A node computes those of all other shafts from these two, so they would tell nothing more. The
    arguments are those of ``read_drive``.

    :raises ValueError: one line that names the bag and says what is wrong.
    """
    drive = read_drive(path, mechanism, rate, node, timeout)
    if not drive.speeds:
        raise ValueError(f'{path}: without joint_states there are no measured speeds')
    columns = np.array(list(drive.speeds.values())).T
    speeds = {shaft: columns[mechanism.shafts.index(shaft)] for shaft in mechanism.outputs}
    return MeasuredDrive(drive.table, np.array(list(drive.speeds)) * drive.dt, speeds,
                         drive.values, _without_lag(mechanism).items() <= drive.values.items()
                         and bool(mechanism.clutches), drive.dt, drive.remarks)


def _without_lag(mechanism):
    return {f'{mechanism.parameters.prefix}.clutch.{clutch}.actuator_time_constant': 0.0
            for clutch in mechanism.clutches}


def _read(path):
    """Return the names of the columns, and (line, cells) of each row that is not empty."""
    try:
        with open(path, newline='', encoding='utf-8-sig') as file:
            reader = csv.reader(file, strict=True)
            rows = [(reader.line_num, row) for row in reader if any(map(str.strip, row))]
    except OSError as error:
        raise ValueError(f'{path}: {error.strerror}') from None
    except UnicodeDecodeError:
        raise ValueError(f'{path}: not a text file in UTF-8') from None
    except csv.Error as error:
        raise ValueError(f'{path}:{max(reader.line_num, 1)}: {error}') from None
    return ([cell.strip() for cell in rows[0][1]] if rows else []), rows[1:]


def _speed(path, line, name, cell):
    """Return a number, NaN of an empty cell."""
    if not cell.strip():
        return math.nan
    try:
        number = float(cell) if '_' not in cell else math.nan
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f'{path}:{line}: column {name!r}: {cell!r} is not a finite number')
    return number
