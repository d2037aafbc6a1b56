# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What others may ask of a node: ~/reset, ~/pause, ~/step, and to change its parameters."""

from functools import partial

from rcl_interfaces.msg import SetParametersResult
from std_srvs.srv import SetBool, Trigger

from dm_ros.ros.parameters import strictly_checked
from dm_ros.ros.privates import WholeRequests


class Requests:
    """Serves a node's services; each request is done at its lock, between two ticks."""

    def __init__(self, node):
        self._node = node
        self._prepared = None
        node.create_service(Trigger, '~/reset', self.reset)
        node.create_service(SetBool, '~/pause', self.pause)
        node.create_service(Trigger, '~/step', self.step)
        self.parameters = WholeRequests(node, partial(strictly_checked, node.plant.rows))
        node.add_on_set_parameters_callback(self._prepare)
        node.add_post_set_parameters_callback(self._adopt)

    def reset(self, request, response):
        """Go back to the start and publish it."""
        node = self._node
        with node.control.lock:
            node.plant.reset()
            node.publish_state()
        response.success = True
        return response

    def pause(self, request, response):
        """Stop the ticks, or go on."""
        control = self._node.control
        with control.lock:
            if request.data:
                control.running.clear()
            else:
                control.running.set()
        response.success = True
        response.message = 'paused' if request.data else 'running'
        return response

    def step(self, request, response):
        """Make one tick while paused."""
        node = self._node
        with node.control.lock:
            response.success = not node.control.running.is_set()
            if response.success:
                node.tick()
                response.message = f'time {node.simulation.time:.9g} s'
            else:
                response.message = 'only while paused, see ~/pause'
        return response

    def _prepare(self, parameters):
        """Refuse a request as a whole, or prepare all that it changes."""
        plant = self._node.plant
        known = plant.values
        try:
            for parameter in parameters:
                if (parameter.name == 'use_sim_time'
                        and parameter.value is not self._node.use_sim_time):
                    raise ValueError('use_sim_time: it cannot be changed while it runs; give it '
                                     'to the node at its start')
            self._prepared = plant.prepared({   # the others are those of every node
                parameter.name: parameter.value for parameter in parameters
                if parameter.name in known})
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _adopt(self, parameters):
        """Put what was prepared into force."""
        node = self._node
        with node.control.lock:
            node.plant.adopt(self._prepared)
            node.set_pace()
