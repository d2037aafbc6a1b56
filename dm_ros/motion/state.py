# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What a differential is and what it reports at an instant, as immutable values."""

from typing import NamedTuple


class State(NamedTuple):
    """
    All that the next tick follows from, but the inputs, and all that can be reported.

    Whoever puts a state back into a ``Simulation`` with the same parameters goes on bit for bit.
    """

    x: tuple          # rad/s, the two independent speeds of the model; rad, the twists
    turned: tuple     # rad, their integrals since the parameters last changed
    origin: tuple     # rad, the angles of all shafts at that time
    torque: tuple     # N m, mean of the last tick, in the order of the ports
    power_flow: int   # +1 or -1, as it was in force
    memory: tuple     # N m, |M| as the friction of ``lsd_lagged`` knew it; () for others
    force: tuple      # N, in force on the clutches in the last tick, in their order
    held: tuple       # N m, or rad/s of a speed port, as they came in for the last tick


class Snapshot(NamedTuple):
    """What a differential reports at the end of a tick, in plain floats."""

    time: float        # s, the number of ticks times their length
    velocity: tuple    # rad/s, in the order of ``Simulation.shafts``
    position: tuple    # rad, the integral of velocity
    torque: tuple      # N m, in the order of ``Simulation.inputs``; of a speed port the mean
    moment: tuple      # N m, in the order of ``Simulation.moments``
    power_flow: int    # +1 direct, -1 reverse, as it was in force
    clutch_force: tuple = ()   # N, in force in the tick, in the order of ``Simulation.clutches``
