# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The state of a driveline: which numbers it has, in which order, and on which scale.

    omega of each inertia; (omega_0, s) of each differential; omega of each wheel;
    twist phi of each connection; y of each brake; kappa of each tyre;
    alpha of each tyre, where the body is planar; v_x (v_y, r); A_x (A_y)
"""

import numpy as np

# what no solution exceeds that begins within, since V_r >= (|V_sx| + |V_s|)/2
LARGEST_Y, LARGEST_KAPPA, LARGEST_ALPHA = 1.0, 1.0, 2.0
# over which ``tolerance`` counts
SPEED, TWIST, PAD, SLIP, BODY, ACCELERATION = 1.0, 0.01, 1.0, 0.1, 0.3, 1.0


class StateLayout:
    """
    Where each number of the state stands.

    :param assembly: an ``Assembly``; planar: whether the body moves sideways and yaws too.
    """

    def __init__(self, assembly, planar):
        self._names, self._scale = [], []
        wheels = [wheel.name for wheel in assembly.wheels]
        self.inertias = self._next('omega', assembly.inertias, SPEED)
        first = len(self._names)
        for differential in assembly.differentials:
            self._next('omega_0', [differential.name], SPEED)
            self._next('s', [differential.name], SPEED)
        self.differentials = range(first, len(self._names), 2)   # of each omega_0
        self.wheels = self._next('omega', wheels, SPEED)
        self.speeds = slice(0, len(self._names))   # all that turns
        self.twists = self._next('phi', [c.name for c in assembly.connections], TWIST)
        self.pads = self._next('y', wheels, PAD)
        self.kappa = self._next('kappa', wheels, SLIP)
        self.alpha = self._next('alpha', wheels if planar else (), SLIP)
        self.body = self._next('', ('v_x', 'v_y', 'r') if planar else ('v_x',), BODY)
        self.A = self._next('', ('A_x', 'A_y') if planar else ('A_x',), ACCELERATION)
        self.names = tuple(self._names)
        self.bounded = slice(self.pads.start, self.alpha.stop)
        self.bounds = np.concatenate([
            np.full(part.stop - part.start, largest) for part, largest in (
                (self.pads, LARGEST_Y), (self.kappa, LARGEST_KAPPA),
                (self.alpha, LARGEST_ALPHA))])
        self.scale = np.array(self._scale)

    def __len__(self):
        return len(self.names)

    def _next(self, symbol, names, scale):
        begin = len(self._names)
        self._names += [f'{symbol}.{name}' if symbol else name for name in names]
        self._scale += [scale] * len(names)
        return slice(begin, len(self._names))


def places(part):
    """Return the places in a slice of the state."""
    return range(part.start, part.stop)
