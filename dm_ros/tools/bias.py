# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Print how far the clutches of a differential can shift torque, or what force it takes."""

import argparse
import math
import sys

from dm_ros.driveline_plant import make_driveline
from dm_ros.ending import run_command
from dm_ros.files.parameter_file import read_parameter_file
from dm_ros.mechanism.bias import forces_for, torque_bias
from dm_ros.mechanism.power_flow import DIRECT
from dm_ros.mechanism.variants import MECHANISMS, SELF_LOCKING, variant_named
from dm_ros.tools.driveline_option import add_driveline, driveline_values, refuse, SEVERAL
from dm_ros.tools.passed_over import warn

DESCRIPTION = """\
Print how far the clutches of a differential can shift torque between its output shafts, with a
driving carrier and full slip; or what force on which clutch it takes for a share of the torque.
"""
EPILOG = """\
What force sends 80 % to the rear at 300 N m?

  bias --torque 300 --share-to rear 80

The shares are of what both output shafts get together. Below some torque the preload and the
forces on the clutches turn one of them round: its share is negative then. Beside a large torque
neither counts.

The torque on the carrier of a symmetric differential is that of the pinion times the final drive
ratio, less what pinion bearing and final drive lose.

The mechanism is that of the variant in FILE, or the only one with parameters in FILE, or else the
self-locking one. The limits of the actuators are those of FILE.

With --driveline it tells of each differential of a car, with its own parameters, by the torque on
its carrier.
"""


def sentence(p, torque, direction=DIRECT, forces=(0.0, 0.0), what='this parameter set'):
    """Return one line on the limits at a carrier torque in N m, or at a large one, infinite."""
    limits = torque_bias(p, torque, direction, forces)
    one, other = p.shafts
    first, second = (_range(side) for side in zip(*(split.share for split in limits)))
    if direction == DIRECT:
        return (f'{what} can send {first} of {_in_words(torque)} to the {one} '
                f'and {second} to the {other}')
    return (f'{what} can take {first} of {_in_words(torque)} that brakes the carrier '
            f'from the {one} and {second} from the {other}')


def sentence_without_friction(p, direction, what):
    """Return one line on the one split that a differential without friction has."""
    split, _ = torque_bias(p, direction=direction)
    (one, other), (first, second) = p.shafts, (f'{100 * share:.1f} %' for share in split.share)
    why = 'its clutches have no friction' if p.has_clutches else 'it has no clutches'
    if direction == DIRECT:
        return (f'{what} sends {first} of any torque to the {one} and {second} to the {other}: '
                f'{why}')
    return (f'{what} takes {first} of any torque that brakes the carrier from the {one} and '
            f'{second} from the {other}: {why}')


def answer(p, side, percent, torque, direction=DIRECT):
    """Return one line on the forces with which a share, in percent, can go to a side."""
    limits = torque_bias(p, torque, direction)
    sides = p.shafts
    words = _in_words(torque)
    what = (f'{percent:g} % of {words} can go to the {side}' if direction == DIRECT else
            f'{percent:g} % of {words} that brakes the carrier can come from the {side}')
    found, beyond = [], []
    for pressed in ((1.0, 0.0), (0.0, 1.0), (1.0, 1.0)):
        forces = forces_for(p, side, percent / 100, torque, direction, pressed)
        if forces is None or all(pressed) and not all(p.f):
            continue
        if not any(forces):
            index = sides.index(side)
            return f'{what} without any force: {_range(split.share[index] for split in limits)}'
        allowed = all(force <= limit for force, limit in zip(forces, (p.A_1, p.A_2)))
        (found if allowed else beyond).append((all(pressed), math.ceil(max(forces)), pressed))
    ways = ', or '.join(
        f'both clutches with {force} N each' if both else
        f'the {sides[pressed.index(1.0)]} clutch with {force} N'
        for both, force, pressed in sorted(found or beyond))
    if found:
        return f'{what} by pressing {ways}'
    if beyond:
        return f'{what} only with forces above actuator_limit: {ways}'
    return f'{what} by no force on the clutches' + ('' if any(p.f) else ': they have no friction')


def _in_words(torque):
    return 'a large torque' if math.isinf(torque) else f'{torque:g} N m'


def _range(shares):
    """Return shares as a range in percent, or as one number where both ends are."""
    low, high = (f'{100 * share:.1f} %' for share in sorted(shares))
    return low if low == high else f'{low} to {high}'


def parser():
    """Return the parser of the command line."""
    result = argparse.ArgumentParser(
        'bias', description=DESCRIPTION, epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument('--params', metavar='FILE', help='a ROS 2 parameter file')
    add_driveline(result, planar=False)
    result.add_argument('--mechanism', choices=MECHANISMS,
                        help='which differential; default: that of FILE, see below')
    result.add_argument('--torque', type=float, default=300.0, metavar='N',
                        help='torque on the carrier, N m; default: %(default)g')
    forces = result.add_mutually_exclusive_group()
    forces.add_argument('--forces', type=float, nargs=2, default=(0.0, 0.0), metavar='N',
                        help='forces of the actuators on the clutches, N: front and rear, or left '
                        'and right; default: none')
    forces.add_argument('--share-to', nargs=2, metavar=('SIDE', 'PERCENT'),
                        help='what force sends this share to a side: front, rear, left or right')
    result.add_argument('--reverse', action='store_true',
                        help='for driving output shafts and a braking carrier')
    return result


def mechanism_of(values, otherwise=SELF_LOCKING):
    """Return the ``Mechanism`` that the values of a parameter file are for, if they tell."""
    if 'variant' in values:
        return variant_named(values['variant']).mechanism
    found = [m for m in MECHANISMS.values() if m.parameters.part_of(values)]
    return found[0] if len(found) == 1 else otherwise


def run_driveline(arguments):
    """Print the limits of each differential of a car; raise ValueError where they are none."""
    refuse(arguments, {'--mechanism': SEVERAL, '--share-to': SEVERAL})
    if any(arguments.forces):
        raise ValueError(f'--forces: {SEVERAL}')
    car = make_driveline(driveline_values('bias', arguments))
    direction = -DIRECT if arguments.reverse else DIRECT
    for name, differential in car.mechanisms.items():
        p, what = differential.parameters, f'the {name} differential'
        if not any(p.f):
            print(sentence_without_friction(p, direction, what))
            continue
        for torque in (arguments.torque, math.inf):
            try:
                print(sentence(p, torque, direction, what=what))
            except ValueError as error:
                raise ValueError(f'{what}: {error}') from None


def run(arguments):
    """Do what the command line says; raise ValueError or OSError where it cannot be done."""
    if not 0.0 < arguments.torque < math.inf:
        raise ValueError(f'--torque: {arguments.torque!r} is not allowed, '
                         'it must be a number of N m above 0')
    if arguments.driveline is not None:
        run_driveline(arguments)
        return
    values = read_parameter_file(arguments.params) if arguments.params else {}
    mechanism = (MECHANISMS[arguments.mechanism] if arguments.mechanism
                 else mechanism_of(values))
    warn('bias', arguments.params, values, mechanism)
    p = mechanism.parameters().changed(mechanism.parameters.part_of(values))
    for force in arguments.forces:
        if not 0.0 <= force < math.inf:
            raise ValueError(f'--forces: {force!r} is not allowed, it must be a number of N, '
                             'at least 0')
    if any(arguments.forces) and not p.has_clutches:
        raise ValueError('--forces: there are no clutches to press, '
                         f'{p.prefix}.clutch.*.friction_surfaces are 0')
    direction = -DIRECT if arguments.reverse else DIRECT
    if arguments.share_to:
        side, percent = share_to(arguments.share_to, mechanism)
        print(answer(p, side, percent, arguments.torque, direction))
        return
    for torque in (arguments.torque, math.inf):
        print(sentence(p, torque, direction, arguments.forces))


def share_to(words, mechanism):
    """Return side and percent of the option; raise ValueError where they are none."""
    side, text = words
    if side not in mechanism.outputs:
        raise ValueError(f'--share-to: {side!r} is not one of {", ".join(mechanism.outputs)}, '
                         f'the output shafts of the {mechanism.title}')
    try:
        percent = float(text.rstrip(' %'))
    except ValueError:
        percent = math.nan
    if not 0.0 <= percent <= 100.0:
        raise ValueError(f'--share-to: {text!r} is not allowed, it must be a number of percent '
                         'from 0 to 100: no force sends more than all to one side')
    return side, percent


def main(args=None):
    """Run the tool ``bias`` and return its exit code."""
    arguments = parser().parse_args(args)
    return run_command('bias', lambda: run(arguments))


if __name__ == '__main__':
    sys.exit(main())
