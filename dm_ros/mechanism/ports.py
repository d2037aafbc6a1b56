# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The inputs of a mechanism by name: what may come in, in which unit and range."""

from dataclasses import dataclass
import math
from typing import NamedTuple

import numpy as np

from dm_ros.mechanism.parameters import Parameters, row


class Port(NamedTuple):
    """One input: a number that is held in a tick."""

    name: str     # of the element on which it acts
    kind: str     # what it is, such as ``torque``
    unit: str
    low: float    # the least that may come in; infinity itself never may
    high: float = math.inf
    idle: float | None = 0.0   # what holds while nothing comes in
    array: str = 'effort'      # of a JointState that brings it
    lasts: bool = False        # whether it holds however old it is
    note: str = ''             # why not all is allowed
    topic: str = ''            # that brings it alone, below the name of a node

    def refusal(self, value):
        """Return why a value must not come in, in words, or None."""
        what = f'the {self.kind} on {self.name} is {value}'
        if not math.isfinite(value):
            return what
        note = f': {self.note}' if self.note else ''
        if value < self.low:
            return f'{what}, it must not be below {self.low:g}{note}'
        if value > self.high:
            return f'{what}, it must not be above {self.high:g}{note}'
        return None


def torque(shaft):
    """Return the port of an external torque on a shaft."""
    return Port(shaft, 'torque', 'N m', -math.inf)


def speed(shaft):
    """Return the port of an outside speed, by an elastic shaft; it is free without any."""
    return Port(shaft, 'speed', 'rad/s', -1e6, 1e6, idle=None, array='velocity')


def force(clutch):
    """Return the port of the axial force of an actuator on a clutch; it can only press."""
    return Port(clutch, 'force', 'N', 0.0)


def acting_on(elements, ports):
    """Return the matrix (elements, ports) that puts each input on the element of its name."""
    return np.array([[float(port.name == element) for port in ports] for element in elements])


@dataclass(frozen=True)
class PortParameters(Parameters):
    """
    How the outside is coupled to one shaft.

    :raises ValueError: names the parameter, its value and what is allowed.
    """

    kind: str = row('kind', 'torque', '', 0, 0, 'what comes in: the torque on the shaft, or the '
                    'speed of the outer end of an elastic shaft', kind=str, read_only=True,
                    choices=('torque', 'speed'))
    stiffness: float = row('stiffness', 1e4, 'N m/rad', 0.0, 1e9,
                           'of the elastic shaft of a speed port', above_low=True)
    damping: float = row('damping', 100.0, 'N m s/rad', 0.0, 1e6,
                         'of the elastic shaft of a speed port')


def port_table(shaft):
    """Return the table of parameters, a class, of the port of a shaft."""
    return type('PortParameters', (PortParameters,), {'prefix': f'port.{shaft}'})
