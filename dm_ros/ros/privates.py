# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
All that touches private parts of rclpy, of Jazzy: what a new version of it may break is here.

``_parameter_overrides`` of a node: what the command line and files give. rclpy hands a value out
    only as it declares the parameter, after its own checks: too late to choose the table by the
    variant, and to refuse with the name and what is allowed. Without it: declare all dynamically
    typed, and check then.
``handle.take_message`` of a subscription: takes a message without an executor, which would cost
    twice the time of the loop and fight it for the interpreter. Without it: what ``Executor``
    calls in its place.
``WaitSet`` of ``rclpy.impl``: waits for a subscription without an executor, as lockstep does.
    Without it: what ``rclpy.wait_for_message`` waits with.
``_set_parameters_callback`` and ``_set_parameters_atomically_callback`` of ``ParameterService``,
    overridden, and its ``_get_node``: the services serve these, and rclpy has no other way to let
    ``set_parameters`` take all or nothing. Without them: create the six services of parameters
    by ``create_service``, as ``ParameterService`` does.

The tests of ``test/ros`` fail where one of them is gone or means something else.
"""

from rcl_interfaces.srv import SetParametersAtomically
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.parameter import Parameter
from rclpy.parameter_service import ParameterService


def given_parameters(node):
    """Return ``{name: value}`` of what the command line and files give to a node."""
    return {name: p.value for name, p in node._parameter_overrides.items()}


def take(subscription, raw=False):
    """
    Return ``(message, info)`` of the oldest message a polled subscription holds, or None.

    :param raw: whether the message is bytes, as it came.
    """
    handle = subscription.handle
    with handle:
        return handle.take_message(subscription.msg_type, raw)


def poll(subscription, raw=False):
    """Yield ``(message, info)`` for all that a polled subscription holds now."""
    while taken := take(subscription, raw):
        yield taken


class Waiter:
    """Waits for messages of a polled subscription."""

    def __init__(self, subscription, context):
        self._subscription = subscription
        self._wait_set = rclpy_implementation.WaitSet(1, 0, 0, 0, 0, 0, context.handle)

    def wait(self, seconds):
        """Wait until the subscription holds a message, at most so long."""
        self._wait_set.clear_entities()
        self._wait_set.add_subscription(self._subscription.handle)
        self._wait_set.wait(int(seconds * 1e9))


class WholeRequests(ParameterService):
    """
    The parameter services of a node, with ``set_parameters`` all or nothing.

    ROS 2 takes the parameters of such a request one by one. Those of a mechanism belong
    together: what is impossible halfway may be fine at the end, and the other way round.
    """

    def __init__(self, node, check):
        """
        Create the services.

        :param check: function of name and value; returns the value as the parameter takes it, or
            raises ValueError for what is not allowed.
        """
        self._check = check
        super().__init__(node)

    def set_parameters(self, request, response):
        """Serve ``set_parameters``."""
        whole = self.set_parameters_atomically(
            SetParametersAtomically.Request(parameters=request.parameters),
            SetParametersAtomically.Response())
        response.results = [whole.result] * len(request.parameters)
        return response

    def set_parameters_atomically(self, request, response):
        """Serve ``set_parameters_atomically``; what keeps its value is no change."""
        try:
            changes = [change for message in request.parameters
                       if (change := self._change(message))]
        except ValueError as error:
            response.result.reason = str(error)
            return response
        if request.parameters and not changes:
            response.result.successful = True
            return response
        return super()._set_parameters_atomically_callback(
            SetParametersAtomically.Request(parameters=changes), response)

    def _change(self, message):
        """Return the message as the node takes it, None for a read-only one that stays."""
        node, name = self._get_node(), message.name
        if not node.has_parameter(name):   # rclpy does not always name the parameter
            raise ValueError(f'{name}: there is no such parameter')
        given = Parameter.from_parameter_msg(message)
        value = self._check(name, given.value)
        if node.describe_parameter(name).read_only:
            before = node.get_parameter(name).value
            if (type(before), before) == (type(value), value):
                return None
        return message if value is given.value else Parameter(
            name, value=value).to_parameter_msg()

    def _set_parameters_callback(self, request, response):
        return self.set_parameters(request, response)

    def _set_parameters_atomically_callback(self, request, response):
        return self.set_parameters_atomically(request, response)
