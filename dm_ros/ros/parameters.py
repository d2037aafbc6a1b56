# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The tables of parameters as ROS 2 parameters: declared, described, checked."""

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor

from dm_ros.ros.privates import given_parameters
from dm_ros.settings import known_rows


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


def declare(node, parameters, wanted=lambda name: True):
    """
    Declare the wanted rows of a table and return the table with the values given at the start.

    :raises ValueError: names the parameter, its value and what is allowed.
    """
    given = given_parameters(node)
    rows = {name: entry for name, entry in parameters.rows().values() if wanted(name)}
    started = parameters.changed({
        name: entry.strictly_checked(name, given[name])
        for name, entry in rows.items() if name in given})
    values = started.named()
    for name, entry in rows.items():
        node.declare_parameter(name, values[name], descriptor(entry))
    return started


def strictly_checked(name, value):
    """Check a value for a parameter, with the types of ROS 2; raise ValueError as ``declare``."""
    if name in known_rows():
        known_rows()[name].strictly_checked(name, value)
