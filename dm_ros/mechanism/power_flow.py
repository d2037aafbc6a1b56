# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The power-flow index: which side drives, as the paper tells it and as the passive law does."""

DIRECT = 1    # the input shaft (pinion, or carrier) drives the output shafts
REVERSE = -1  # the output shafts drive the input shaft


def power_flow(input_power, output_power, deadband, last):
    """
    Return the power-flow index of the paper, (35)-(36): +1 (direct) or -1 (reverse).

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


def who_drives(input_power, turning, deadband, last):
    """
    Return the index under the passive law: +1 while the input gives power, -1 while it takes it.

    :param input_power: power of the torque on the input shaft, W.
    :param turning: whether the carrier turns faster than a creep, whose sign says nothing.
    :param deadband: up to this power, W, the index stays what it was.
    :param last: the index up to now.
    """
    if turning and input_power > deadband:
        return DIRECT
    if turning and input_power < -deadband:
        return REVERSE
    return last
