# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
Built-in loads: torques over time, like those that the paper shows as pictures alone.

A load is a pure function of time that returns N m in the order of the inputs. With the default
parameters the shafts turn and outrun each other within some hundred rad/s, and power flows in
both directions.
"""

from math import sin


def symmetric(time):
    """
    Return the torques on pinion, left and right, in the manner of Figure 3.

    Left and right are in phase, left a little larger. The carrier gets nearly the opposite of
    their sum from the pinion: what is left over swings the carrier to and fro. The paper's
    final drive ratio is negative there, the default is positive: hence the pinion's sign.
    """
    phase = sin(1.2 * time) + 0.35 * sin(3.24 * time)
    left, right = -41.5 * phase, -40.0 * phase
    imbalance = 10.0 * sin(0.8 * time + 1.0)
    return (imbalance - left - right) / 3.517, left, right


def self_locking(time):
    """
    Return the torques on carrier, front and rear, in the manner of Figure 7.

    The loads nearly balance the carrier torque, and the front's part of them wanders around
    the share at which the shafts are locked: to both sides further than friction can hold.
    """
    carrier = 200.0 * (sin(1.6 * time) + 0.4 * sin(3.68 * time + 0.5))
    load = 15.0 * sin(1.1 * time + 1.5) - carrier
    front_share = 0.42 + 0.28 * sin(2.3 * time + 1.0)
    return carrier, front_share * load, (1.0 - front_share) * load
