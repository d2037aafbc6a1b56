# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The tables of parameters as ROS 2 parameters: declared, described, checked."""

import re

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor

from dm_ros.mechanism.variants import PORT_TABLES, variant_named
from dm_ros.ros.privates import given_parameters
from dm_ros.settings import known_rows, names_for, NodeParameters, passed_over

WITH_EXPONENT = re.compile(r'[-+]?[0-9]+(\.[0-9]*)?[eE][-+]?[0-9]+')


def descriptor(entry):
    """Return the ParameterDescriptor of a ``Row``."""
    unit = '' if entry.unit in ('', '1') else f' [{entry.unit}]'
    result = ParameterDescriptor(
        description=entry.description + unit,
        additional_constraints=entry.allowed,
        read_only=entry.read_only)
    if entry.kind is float:
        result.floating_point_range = [
            FloatingPointRange(from_value=entry.low, to_value=entry.high)]
    elif entry.kind is int:
        result.integer_range = [IntegerRange(from_value=entry.low, to_value=entry.high, step=1)]
    return result


def declare_all(node):
    """
    Declare all parameters of the node; return ``{full name: value}`` with those of the start.

    One warning names what is given for another mechanism.

    :raises ValueError: names the parameter, its value and what is allowed.
    """
    given = given_parameters(node)
    for name in given:
        if name not in known_rows() and not node.has_parameter(name):
            raise ValueError(f'{name}: there is no such parameter')
    settings = NodeParameters().changed(
        {name: value for name, value in given.items() if name == 'variant'})
    mechanism = variant_named(settings.variant).mechanism
    mine, started = set(names_for(mechanism)), {}
    for table in (settings, mechanism.parameters(),
                  *(PORT_TABLES[shaft]() for shaft in mechanism.inputs)):
        started |= declare(node, table, given, mine)
    if line := passed_over(given, mechanism):
        node.get_logger().warning(line)
    return started


def declare(node, table, given, mine):
    """Declare the rows of a table that are the node's; return as ``declare_all``."""
    rows = {name: entry for name, entry in table.rows().values() if name in mine}
    started = table.changed({name: entry.strictly_checked(name, given[name])
                             for name, entry in rows.items() if name in given}).named()
    declare_rows(node, rows, started)
    return started


def declare_rows(node, rows, values):
    """Declare parameters with the values of the start; rows: ``{full name: Row}``."""
    for name, entry in rows.items():
        node.declare_parameter(name, values[name], descriptor(entry))


def strictly_checked(rows, name, value):
    """
    Return a value for a parameter, checked with the types of ROS 2; raise as ``declare`` does.

    :param rows: ``{full name: Row}`` of the parameters that are checked here.

    ``ros2 param`` makes a string of ``4e-05``, which a parameter file takes as a double.
    """
    if name not in rows:
        return value
    entry = rows[name]
    if entry.kind is float and isinstance(value, str) and WITH_EXPONENT.fullmatch(value):
        value = float(value)
    return entry.strictly_checked(name, value)
