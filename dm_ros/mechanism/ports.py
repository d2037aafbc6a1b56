# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The inputs of a mechanism by name: what may come in, in which unit and range."""

import math
from typing import NamedTuple

import numpy as np


class Port(NamedTuple):
    """One input: a number that is held in a tick."""

    name: str     # of the element on which it acts
    kind: str     # what it is, such as ``torque``
    unit: str
    low: float    # the least that may come in; infinity itself never may

    def refusal(self, value):
        """Return why a value must not come in, in words, or None."""
        what = f'the {self.kind} on {self.name} is {value}'
        if not math.isfinite(value):
            return what
        if value < self.low:
            return f'{what}, it must not be below {self.low:g}'
        return None


def torque(shaft):
    """Return the port of an external torque on a shaft."""
    return Port(shaft, 'torque', 'N m', -math.inf)


def force(clutch):
    """Return the port of the axial force of an actuator on a clutch; it can only press."""
    return Port(clutch, 'force', 'N', 0.0)


def acting_on(elements, ports):
    """Return the matrix (elements, ports) that puts each input on the element of its name."""
    return np.array([[float(port.name == element) for port in ports] for element in elements])
