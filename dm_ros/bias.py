# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Torque bias of a differential, see ``dm_ros.mechanism.bias``."""

import sys

from dm_ros.mechanism.bias import (
    AxleBias,
    AxleSplit,
    Bias,
    forces_for,
    Friction,
    friction_for,
    Split,
    torque_bias,
)

__all__ = [
    'AxleBias', 'AxleSplit', 'Bias', 'forces_for', 'Friction', 'friction_for', 'Split',
    'torque_bias']

if __name__ == '__main__':
    from dm_ros.tools.bias import main
    sys.exit(main())
