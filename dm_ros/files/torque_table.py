# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Torques, speeds and forces over time from a CSV file, and which tick gets which row."""

from bisect import bisect_right
import csv
import math
from typing import NamedTuple

ON_TIME = 1e-3   # ticks; a time this little after the start of a tick counts as that start


class TorqueTable(NamedTuple):
    """Times, strictly increasing and none negative, and the torques from each time on."""

    times: tuple     # s
    torques: tuple   # of tuples: N m, in the order of the inputs, and N, in that of the clutches
    idle: tuple      # likewise, what holds before the first time

    def held(self, dt):
        """Return the ``HeldTorques`` for ticks of the length ``dt``, s."""
        return HeldTorques(self, dt)


class HeldTorques:
    """
    The torques of a table, held in ticks: tick n has those in force at its start, n dt.

    Before the first time of the table they are zero, and a speed port is free. The last time ends
    the run: it has as many ticks as come nearest to that time. Times that are multiples of ``dt``
    up to rounding start exactly with their tick.

    :raises ValueError: when the run has no tick, or more than can be counted.
    """

    def __init__(self, table, dt):
        end = table.times[-1] / dt
        if not 0.5 < end < 2**53:
            raise ValueError(f'time: ticks of {dt:g} s make no run to {table.times[-1]:g} s')
        self._starts = [0] + [math.ceil(time / dt - ON_TIME) for time in table.times]
        self._torques = table.idle, *table.torques
        self._ticks = round(end)

    def __len__(self):
        """Return the number of ticks."""
        return self._ticks

    def __iter__(self):
        """Yield the torques of each tick of the run."""
        ends = [min(start, self._ticks) for start in self._starts[1:]] + [self._ticks]
        for start, end, torques in zip(self._starts, ends, self._torques, strict=True):
            for _ in range(start, end):
                yield torques

    def at(self, tick):
        """Return the torques of one tick; those of the last row hold on after the end."""
        return self._torques[bisect_right(self._starts, tick) - 1]


def read_torque_file(path, ports, clutches=()):
    """
    Return the ``TorqueTable`` of a CSV file.

    :param ports: the ``Port`` s of the shafts; the header is ``time`` and their names, in any
        order, and a cell is in the unit of its port.
    :param clutches: names of columns that may be there too, forces of at least 0; where one of
        them is, they follow the torques in each row of the table, all of them, 0 for the others.
    :raises ValueError: one line that names file, line and column.
    """
    try:
        # utf-8-sig: spreadsheets begin the file with a byte order mark
        with open(path, newline='', encoding='utf-8-sig') as file:
            return _table(path, csv.reader(file, strict=True), ports, clutches)
    except OSError as error:
        raise ValueError(f'{path}: {error.strerror}') from None
    except UnicodeDecodeError:
        raise ValueError(f'{path}: not a text file in UTF-8') from None


def _table(path, reader, ports, clutches):
    inputs = [port.name for port in ports]
    try:
        rows = (row for row in reader if any(cell.strip() for cell in row))
        header = _header(next(rows, ()), inputs, clutches)
        forces = clutches if set(clutches) & set(header) else ()
        times, torques = [], []
        for row in rows:
            cells = _cells(header, row)
            time = cells['time']
            if time < 0.0:
                raise ValueError(f"column 'time': {time!r} is negative, a run begins at 0")
            if times and not time > times[-1]:
                raise ValueError(f"column 'time': {time!r} does not come after {times[-1]!r}")
            times.append(time)
            torques.append((*(cells[name] for name in inputs),
                            *(_force(name, cells.get(name, 0.0)) for name in forces)))
        if not times or times[-1] == 0.0:
            raise ValueError("column 'time': a row with a time above 0 must end the run")
    except (csv.Error, ValueError) as error:
        if isinstance(error, UnicodeDecodeError):
            raise
        raise ValueError(f'{path}:{max(reader.line_num, 1)}: {error}') from None
    idle = *(port.idle for port in ports), *(0.0 for _ in forces)
    return TorqueTable(tuple(times), tuple(torques), idle)


def _header(row, inputs, clutches):
    names = [cell.strip() for cell in row]
    needed = ('time', *inputs)
    known = ', '.join((*needed, *(f'{name} (if wanted)' for name in clutches)))
    for index, name in enumerate(names):
        if name not in (*needed, *clutches):
            raise ValueError(f'column {name!r}: unknown, the columns are {known}')
        if name in names[:index]:
            raise ValueError(f'column {name!r}: it appears twice')
    for name in needed:
        if name not in names:
            raise ValueError(f'column {name!r}: missing, the columns are {known}')
    return names


def _cells(header, row):
    if len(row) < len(header):
        raise ValueError(f'column {header[len(row)]!r}: there is no cell')
    if len(row) > len(header):
        raise ValueError(f'column {len(header) + 1}: {row[len(header)]!r} has no header')
    return {name: _number(name, cell) for name, cell in zip(header, row, strict=True)}


def _force(name, value):
    if value < 0.0:
        raise ValueError(f'column {name!r}: {value!r} N is negative, a clutch can only be pressed')
    return value


def _number(name, cell):
    try:
        number = float(cell) if '_' not in cell else math.nan   # Python reads 1_000
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise ValueError(f'column {name!r}: {cell!r} is not a finite number')
    return number
