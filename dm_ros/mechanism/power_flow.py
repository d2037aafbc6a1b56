# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The power-flow index, (35)-(36): which side drives."""

DIRECT = 1    # the input shaft (pinion, or carrier) drives the output shafts
REVERSE = -1  # the output shafts drive the input shaft


def power_flow(input_power, output_power, deadband, last):
    """
    Return the power-flow index, +1 (direct) or -1 (reverse).

    :param input_power: power of the torque on the input shaft, W.
    :param output_power: algebraic sum of the powers of the torques on the output shafts, W.
    :param deadband: while the two magnitudes differ by no more than this, in W, the index
        stays what it was.
    :param last: the index up to now; at rest, where both powers are zero, it stays.
    """
    excess = abs(input_power) - abs(output_power)
    if excess > deadband:
        return DIRECT
    if excess < -deadband or (excess == deadband == 0.0 and output_power != 0.0):
        return REVERSE   # (36): equal powers, without a dead band, count as reverse
    return last
