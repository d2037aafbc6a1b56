# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What the viewers command: checked as a whole, for all of them one and the same."""

import json
import math
import threading

WORKS = 'set', 'zero', 'release', 'ticks', 'pause', 'continue', 'step', 'reset'
MOST_TICKS = 1000   # of one request in lockstep


class Refused(Exception):
    """Why a request is refused, in words; ``status``: the HTTP status that says so."""

    def __init__(self, status, words):
        super().__init__(words)
        self.status = status


def read(body):
    """
    Return the request that a body of JSON has.

    :raises Refused: says what is wrong with it.
    """
    try:
        request = json.loads(body)
    except (ValueError, RecursionError) as error:
        raise Refused(400, f'the body is no JSON: {error}') from error
    if not isinstance(request, dict) or request.get('do') not in WORKS:
        raise Refused(400, f'an object is expected, with "do": one of {", ".join(WORKS)}')
    return request


def checked(values, ports):
    """
    Return values for ports as numbers.

    :param values: of a request; ports: as ``control_ports`` returns them.
    :raises Refused: names what is wrong: all are taken or none.
    """
    if not isinstance(values, dict) or not values:
        raise Refused(400, '"values" must be an object of numbers by name')
    known, result = {port['name']: port for port in ports}, {}
    for name, value in values.items():
        if name not in known:
            raise Refused(400, f'{name!r} is not one of {", ".join(known)}')
        if (isinstance(value, bool) or not isinstance(value, (int, float))
                or not math.isfinite(value)):
            raise Refused(400, f'{name}: {value!r} is no finite number')
        port = known[name]
        if not port['low'] <= value <= port['high']:
            raise Refused(400, f'{name}: {value:g} {port["unit"]} is not allowed, it must be in '
                               f'[{port["low"]:g}, {port["high"]:g}]')
        result[name] = float(value)
    return result


class Commands:
    """
    The commands in force, and which viewers gave any: when the last one leaves, none is.

    Used by the threads of requests and by the one that publishes.
    """

    def __init__(self):
        self._lock = threading.Lock()
        self._ports, self._values, self._owners = [], {}, set()

    def begin(self, ports):
        """Forget all; ports: of the node that is there now, empty while none is."""
        with self._lock:
            self._ports, self._values = ports, {}
            self._owners.clear()

    @property
    def values(self):
        """The commands in force, ``{name: number}``."""
        with self._lock:
            return dict(self._values)

    def set(self, viewer, values):
        """Put the values of a request into force; raise Refused where one is not allowed."""
        with self._lock:
            self._need_node()
            self._values.update(checked(values, self._ports))
            self._owners.add(viewer)

    def zero(self, viewer):
        """Put zero into force for every port, or what stands for it."""
        with self._lock:
            self._need_node()
            self._values = {port['name']: port['zero'] for port in self._ports}
            self._owners.add(viewer)

    def release(self):
        """Put no command into force."""
        with self._lock:
            self._values = {}
            self._owners.clear()

    def leave(self, viewer):
        """Let a viewer go, and its commands with the last one who gave any."""
        with self._lock:
            self._owners.discard(viewer)
            if not self._owners:
                self._values = {}

    def _need_node(self):
        if not self._ports:
            raise Refused(409, 'there is no node that could be commanded')
