# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Torques, speeds and forces over time from a CSV file, and which tick gets which row."""

from bisect import bisect_right
import csv
from decimal import Decimal
import math
from typing import NamedTuple

from dm_ros.files import table_hints
from dm_ros.mechanism.ports import force

ON_TIME = 1e-3   # ticks; a time this little after the start of a tick counts as that start
LATEST_BEGIN = 1000.0   # s; a file that begins later, as at an epoch, begins the run


class TorqueTable(NamedTuple):
    """Times, strictly increasing and none negative, and the torques from each time on."""

    times: tuple     # s
    torques: tuple   # of tuples: N m, in the order of the inputs, and N, in that of the clutches;
    # those of a driveline in the order and the units of its ports
    idle: tuple      # likewise, what holds before the first time
    begin: float = 0.0   # s; what the file calls time 0

    def held(self, dt):
        """Return the ``HeldTorques`` for ticks of the length ``dt``, s."""
        return HeldTorques(self, dt)

    def tick_for_all(self, longest):
        """Return a length of a tick, s, ``longest`` or shorter, in which no row is lost."""
        gaps = [after - before for before, after in zip(self.times, self.times[1:])]
        if self.times[-1] / longest > 0.5 and not self.held(longest).never_in_force:
            return longest
        gap = min(gaps, default=self.times[-1])
        # the run may end half a tick before its last time; 0.6 of the gap leave the last row one
        for share in (1.0, 0.9, 0.8, 0.7, 0.6):
            for digits in range(1, 17):
                dt = float(f'{gap * share:.{digits}g}')
                if abs(dt - gap * share) <= 1e-4 * gap and not self.held(dt).never_in_force:
                    return dt
        return gap / 2


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
        self._ends = [*(min(start, self._ticks) for start in self._starts[1:]), self._ticks]

    @property
    def never_in_force(self):
        """How many rows no tick takes, without the last one, which ends the run."""
        return sum(start >= end for start, end in zip(self._starts[1:-1], self._ends[1:-1]))

    def __len__(self):
        """Return the number of ticks."""
        return self._ticks

    def __iter__(self):
        """Yield the torques of each tick of the run."""
        for start, end, torques in zip(self._starts, self._ends, self._torques, strict=True):
            for _ in range(start, end):
                yield torques

    def at(self, tick):
        """Return the torques of one tick; those of the last row hold on after the end."""
        return self._torques[bisect_right(self._starts, tick) - 1]


def read_torque_file(path, ports, clutches=(), ignored=(), beside=()):
    """
    Return the ``TorqueTable`` of a CSV file.

    A file that begins later than ``LATEST_BEGIN`` has stamps of some clock: its first time is the
    begin of the run.

    :param ports: the ``Port`` s of the shafts; the header is ``time`` and their names, in any
        order, and a cell is in the unit of its port.
    :param clutches: names of columns that may be there too, forces of at least 0; where one of
        them is, they follow the torques in each row of the table, all of them, 0 for the others.
    :param ignored: names of further columns, whose cells are not read.
    :param beside: the same, of columns that may well be there.
    :raises ValueError: one line that names file, line and column.
    """
    return _read(path, ports, [force(name) for name in clutches], False, ignored, beside, {})


def read_input_file(path, ports, ignored=(), reasons=()):
    """
    Return the ``TorqueTable`` of a CSV file that may have a column for each port, and need not.

    A row has a value for each port, the idle one where there is no column.

    :param ports: the ``Port`` s; cells must be in their ranges.
    :param ignored: names of further columns, whose cells are not read.
    :param reasons: ``{port name: words}``, why a range is as it is.
    :raises ValueError: as ``read_torque_file``.
    """
    return _read(path, (), ports, True, ignored, (), dict(reasons))


def _read(path, *more):
    try:
        # utf-8-sig: spreadsheets begin the file with a byte order mark
        with open(path, newline='', encoding='utf-8-sig') as file:
            return _table(path, csv.reader(file, strict=True), *more)
    except OSError as error:
        raise ValueError(f'{path}: {error.strerror}') from None
    except UnicodeDecodeError:
        raise ValueError(f'{path}: not a text file in UTF-8') from None


def _table(path, reader, needed, optional, is_whole, ignored, beside, reasons):
    """
    Return the ``TorqueTable``.

    :param needed, optional: ``Port`` s; is_whole: whether rows have a value for each of the
        optional ones even if no column is there.
    """
    inputs, wanted = ([port.name for port in ports] for ports in (needed, optional))
    try:
        rows = (row for row in reader if any(cell.strip() for cell in row))
        header = _header(next(rows, ()), inputs, wanted, ignored, beside)
        ignored = *ignored, *beside
        if not is_whole and not set(wanted) & (set(header) - set(ignored)):
            optional = ()
        times, torques, begin = [], [], 0
        for row in rows:
            cells = _cells(header, ignored, row, is_first=not times)
            time = cells['time']
            if time < 0.0:
                raise ValueError(f"column 'time': {time!r} is negative, a run begins at 0")
            if not times and time > LATEST_BEGIN:
                begin = Decimal(row[header.index('time')])
            if begin:   # exact: the digits of an epoch leave few for what is behind the point
                time = float(Decimal(row[header.index('time')]) - begin)
            if times and not time > times[-1]:
                since = f' after {begin} s' if begin else ''
                raise ValueError(
                    f"column 'time': {time!r}{since} does not come after {times[-1]!r}{since}")
            times.append(time)
            torques.append((*(cells[name] for name in inputs),
                            *(_in_range(port, cells, reasons) for port in optional)))
        if not times or times[-1] == 0.0:
            raise ValueError(f"column 'time': a row with a time above {begin} must end the run")
    except (csv.Error, ValueError) as error:
        if isinstance(error, UnicodeDecodeError):
            raise
        raise ValueError(f'{path}:{max(reader.line_num, 1)}: {error}') from None
    idle = tuple([port.idle for port in (*needed, *optional)])
    return TorqueTable(tuple(times), tuple(torques), idle, float(begin))


def _header(row, inputs, wanted, ignored, beside):
    if not row:
        raise ValueError('the file is empty')
    names = [cell.strip() for cell in row]
    needed = ('time', *inputs)
    known = (', '.join((*needed, *(f'{name} (if wanted)' for name in wanted))) if inputs else
             f'time and any of {", ".join(wanted)}')
    for name in ignored:
        if name in needed:
            raise ValueError(f'column {name!r}: it is needed and cannot be ignored')
        if name not in names:
            raise ValueError(f'column {name!r}: it is not there to be ignored')
    for index, name in enumerate(names):
        if name in ignored or name in beside:
            continue
        if name not in (*needed, *wanted):
            hint = table_hints.of_header(names, needed, (*wanted, *beside))
            raise ValueError(f'column {name!r}: unknown, the columns are {known}{hint}')
        if name in names[:index]:
            raise ValueError(f'column {name!r}: it appears twice')
    for name in needed:
        if name not in names:
            raise ValueError(f'column {name!r}: missing, the columns are {known}')
    return names


def _cells(header, ignored, row, is_first):
    if len(row) < len(header):
        raise ValueError(f'column {header[len(row)]!r}: there is no cell')
    if len(row) > len(header):
        raise ValueError(f'column {len(header) + 1}: {row[len(header)]!r} has no header'
                         f'{table_hints.of_cells(row, header)}')
    cells = {}
    for name, cell in zip(header, row, strict=True):
        if name not in ignored:
            cells[name] = number = _number(cell)
            if not math.isfinite(number):
                hint = table_hints.of_number(name, cell, row, is_first)
                raise ValueError(f'column {name!r}: {cell!r} is not a finite number{hint}')
    return cells


def _in_range(port, cells, reasons):
    """Return the value of an optional port from the cells of a row, or its idle one."""
    value = cells.get(port.name, port.idle)
    if port.kind == 'force' and value < 0.0:
        raise ValueError(f'column {port.name!r}: {value!r} N is negative, a clutch can only be '
                         'pressed')
    if refusal := port.refusal(value):
        raise ValueError(f'column {port.name!r}: {refusal}{reasons.get(port.name, "")}')
    return value


def _number(cell):
    try:
        return float(cell) if '_' not in cell else math.nan   # Python reads 1_000
    except ValueError:
        return math.nan
