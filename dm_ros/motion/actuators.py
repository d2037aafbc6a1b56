# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The actuators that press the clutches: how far, and how fast, a force follows its command."""

import math
from typing import NamedTuple


class Actuator(NamedTuple):
    """One actuator at a length of the tick."""

    limit: float   # N
    rise: float    # share of the way to its command that the force takes in a tick; 1 without lag

    def follow(self, force, command):
        """Return the force, N, after a tick; from that before, and what it is told."""
        command = min(command, self.limit)
        return command if self.rise == 1.0 else force + (command - force) * self.rise


def actuators_of(p, clutches, dt):
    """
    Return an ``Actuator`` for each clutch of a mechanism.

    :param p: its table of parameters; clutches: their names, none or two; dt: s.
    """
    if not clutches:
        return ()
    return tuple([Actuator(limit, 1.0 if not tau else -math.expm1(-dt / tau))
                  for limit, tau in ((p.A_1, p.tau_1), (p.A_2, p.tau_2))])
