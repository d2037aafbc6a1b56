# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A table of torques on the command line: its options, and what is told about it before a run."""

from dm_ros.files.table_hints import of_times
from dm_ros.files.torque_table import LATEST_BEGIN


def add_ignore_columns(parser, file):
    """Add the option ``--ignore-columns`` for a file."""
    parser.add_argument('--ignore-columns', metavar='A,B', default=(),
                        type=lambda text: tuple(name.strip() for name in text.split(',')),
                        help=f'columns of {file} that are passed over')


def unit_hint(table):
    """Return what to add to words about the times of a ``TorqueTable``; '' for nothing."""
    return of_times(table.times, table.begin)


def remarks(path, table, dt, option=None):
    """
    Yield what a user may not know about a ``TorqueTable`` in ticks of the length ``dt``.

    :param option: function of the length of a tick: the option that sets it, in words; None where
        there is none.
    """
    hint = unit_hint(table)
    if table.begin:
        yield (f'{path}: time 0 is {table.begin!r} s in the file, as that begins after '
               f'{LATEST_BEGIN:g} s{hint}')
    elif hint:
        yield f'{path}: it lasts {table.times[-1]:g} s{hint}'
    lost = table.held(dt).never_in_force
    if lost:
        cure = f', {option(table.tick_for_all(dt))} takes all' if option else ''
        yield (f'{path}: {lost} of {len(table.times)} rows are never in force in ticks of '
               f'{dt:.6g} s{cure}')
