# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The option ``--driveline`` of the tools: a whole car in place of one differential."""

import sys

from dm_ros.driveline.layouts import LAYOUTS
from dm_ros.driveline_plant import all_rows, DrivelineNodeParameters, make_driveline, passed_over
from dm_ros.files.parameter_file import missing, read_parameter_file

NODE = '/driveline'
SEVERAL = 'a driveline is made of several differentials'   # why no single one can be named
NOT_A_DRIVELINE = 'only a driveline has that, see --driveline'
OF_FILE = True   # what the option is without a layout


def add_driveline(parser, planar=True):
    """Add the options ``--driveline`` and, where wanted, ``--planar``."""
    parser.add_argument('--driveline', metavar='LAYOUT', nargs='?', const=OF_FILE,
                        choices=LAYOUTS,
                        help=f'a car instead of one differential: {", ".join(LAYOUTS)}; without '
                        'LAYOUT that of FILE')
    if planar:
        parser.add_argument('--planar', action='store_true', help='the car moves sideways and '
                            'yaws too, and can be steered; default: planar of FILE')


def refuse(arguments, reasons):
    """Raise ValueError for an option that is given; reasons: ``{option: why it cannot be}``."""
    for option, reason in reasons.items():
        value = getattr(arguments, option.removeprefix('--').replace('-', '_'))
        if not (value is None or value is False or value == ()):
            raise ValueError(f'{option}: {reason}')


def driveline_values(tool, arguments, **more):
    """
    Return the parameters, by full name, of the node ``/driveline`` that a command line asks for.

    What counts for nothing in its file is told on stderr, in a line each.

    :param more: parameters of the node that options give, None where they are not given.
    :raises ValueError: one line that names the file, or the option, and what is wrong.
    """
    path = arguments.params
    values = read_parameter_file(path, NODE, all_rows()) if path else {}
    if getattr(arguments, 'planar', False):
        values['planar'] = True
    if arguments.driveline is not OF_FILE:
        values['layout'] = arguments.driveline
    try:
        make_driveline(values)   # before the options: what is wrong now is of the file
    except ValueError as error:
        raise ValueError(f'{path}: {error}') from None
    table = DrivelineNodeParameters.rows()
    for name, value in more.items():
        if value is not None:
            full_name, row = table[name]
            values[full_name] = row.checked(f'--{name.replace("_", "-")}', value)
    if path:
        for line in filter(None, (missing(path, NODE), passed_over(values))):
            print(f'{tool}: warning: {line}', file=sys.stderr)
    return values


def layout_of(values):
    """Return the name of the layout that the parameters of a node ``/driveline`` ask for."""
    return values.get('layout', DrivelineNodeParameters().layout)
