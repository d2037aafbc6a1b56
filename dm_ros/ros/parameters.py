# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The tables of parameters as ROS 2 parameters: declared, described, changed as a whole."""

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
from rclpy.parameter_service import ParameterService

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


def given_parameters(node):
    """Return ``{name: value}`` of what the command line and files give to a node."""
    return {name: p.value for name, p in node._parameter_overrides.items()}


class WholeRequests(ParameterService):
    """
    The parameter services of a node, with ``set_parameters`` all or nothing.

    ROS 2 takes the parameters of such a request one by one. Those of a mechanism belong
    together: what is impossible halfway may be fine at the end, and the other way round.
    """

    def _set_parameters_callback(self, request, response):
        whole = self._set_parameters_atomically_callback(
            SetParametersAtomically.Request(parameters=request.parameters),
            SetParametersAtomically.Response())
        response.results = [whole.result] * len(request.parameters)
        return response

    def _set_parameters_atomically_callback(self, request, response):
        try:
            for message in request.parameters:
                self._check(message)
        except ValueError as error:   # rclpy does not always name the parameter
            response.result.reason = str(error)
            return response
        return super()._set_parameters_atomically_callback(request, response)

    def _check(self, message):
        if not self._get_node().has_parameter(message.name):
            raise ValueError(f'{message.name}: there is no such parameter')
        if message.name in known_rows():
            value = Parameter.from_parameter_msg(message).value
            known_rows()[message.name].strictly_checked(message.name, value)
