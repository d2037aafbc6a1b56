# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Print how far the clutches of a self-locking differential can shift torque."""

import argparse
import math
import sys

from dm_ros.ending import run_command
from dm_ros.files.parameter_file import read_parameter_file
from dm_ros.mechanism.bias import torque_bias
from dm_ros.mechanism.parameters import SelfLockingParameters
from dm_ros.mechanism.power_flow import DIRECT


def sentence(p, torque, direction=DIRECT, forces=(0.0, 0.0)):
    """Return one line on the limits at a carrier torque in N m, or at a large one, infinite."""
    words = 'a large torque' if math.isinf(torque) else f'{torque:g} N m'
    limits = []
    for side in zip(*(split.share for split in torque_bias(p, torque, direction, forces))):
        limits.append('{:.1f} % to {:.1f} %'.format(*sorted(100 * share for share in side)))
    front, rear = limits
    if direction == DIRECT:
        return (f'this parameter set can send {front} of {words} to the front '
                f'and {rear} to the rear')
    return (f'this parameter set can take {front} of {words} that brakes the carrier '
            f'from the front and {rear} from the rear')


def parser():
    """Return the parser of the command line."""
    result = argparse.ArgumentParser(
        'bias', description='Print how far the clutches of a self-locking differential can '
        'shift torque between front and rear, with a driving carrier and full slip.',
        epilog='The shares are of what both output shafts get together. Below some torque the '
        'preload and the forces on the clutches turn one of them round: its share is negative '
        'then. Beside a large torque neither counts.')
    result.add_argument('--params', metavar='FILE', help='a ROS 2 parameter file')
    result.add_argument('--torque', type=float, default=300.0, metavar='N',
                        help='torque on the carrier, N m; default: %(default)g')
    result.add_argument('--forces', type=float, nargs=2, default=(0.0, 0.0),
                        metavar=('FRONT', 'REAR'),
                        help='forces of the actuators on the clutches, N; default: none')
    result.add_argument('--reverse', action='store_true',
                        help='for driving output shafts and a braking carrier')
    return result


def run(arguments):
    """Do what the command line says; raise ValueError or OSError where it cannot be done."""
    values = read_parameter_file(arguments.params) if arguments.params else {}
    p = SelfLockingParameters().changed(SelfLockingParameters.part_of(values))
    if not 0.0 < arguments.torque < math.inf:
        raise ValueError(f'--torque: {arguments.torque!r} is not allowed, '
                         'it must be a number of N m above 0')
    for force in arguments.forces:
        if not 0.0 <= force < math.inf:
            raise ValueError(f'--forces: {force!r} is not allowed, it must be a number of N, '
                             'at least 0')
    for torque in (arguments.torque, math.inf):
        print(sentence(p, torque, -DIRECT if arguments.reverse else DIRECT, arguments.forces))


def main(args=None):
    """Run the tool ``bias`` and return its exit code."""
    arguments = parser().parse_args(args)
    return run_command('bias', lambda: run(arguments))


if __name__ == '__main__':
    sys.exit(main())
