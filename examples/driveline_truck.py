# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A truck with a tandem: six wheels, two driven axles behind, and a differential between them."""

import argparse
import sys

from dm_ros import Driveline
from dm_ros.driveline.layouts import half_shafts, wheels
from dm_ros.driveline.parameters import AxleParameters, Shaft

SPACING = 1.35   # m, between the two driven axles
TRUCK = {        # assumed, as all that follows
    'driveline.mass': 18_000.0, 'driveline.yaw_inertia': 90_000.0,
    'driveline.front_distance': 3.4, 'driveline.rear_distance': 1.8, 'driveline.track': 2.0,
    'driveline.height': 1.4, 'driveline.wheel_radius': 0.5, 'driveline.wheel_inertia': 12.0,
    'driveline.input_inertia': 30.0, 'driveline.drag_area': 6.0,
    'driveline.tyre.load_reference': 30_000.0, 'driveline.shaft.half.stiffness': 6e4,
    'driveline.shaft.half.damping': 200.0}
INPUT = Shaft('input', 1e5, 100.0)
THROUGH = Shaft('through', 2e5, 100.0)
LINK = Shaft('link', 8e4, 80.0)


def tandem(truck):
    """Drive two rear axles through a symmetric differential, which has no final drive."""
    p = truck.vehicle
    wheels(truck, 'front', p.a, is_front=True, is_steered=True)
    first_wheels = wheels(truck, 'first', SPACING / 2 - p.b, is_front=False)
    second_wheels = wheels(truck, 'second', -SPACING / 2 - p.b, is_front=False)
    between = truck.differential('between', AxleParameters, g_F=1.0)
    first, second = truck.axle('first', g_F=5.3), truck.axle('second', g_F=5.3)
    truck.connect('input', truck.input(), between.pinion, INPUT)
    truck.connect('through', between.left, first.pinion, THROUGH)
    truck.connect('link', between.right, second.pinion, LINK)
    half_shafts(truck, first, first_wheels)
    half_shafts(truck, second, second_wheels)


def pull_away(torque=2500.0, seconds=5.0, first_grip=1.0):
    """Pull away on the level; return the truck and its last snapshot."""
    truck = Driveline(tandem, parameters=TRUCK)
    grip = (1.0, 1.0, first_grip, first_grip, 1.0, 1.0)
    for _ in range(round(seconds / truck.dt)):
        snapshot = truck.step(torque=torque, grip=grip)
    return truck, snapshot


def main(args=None):
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--first-grip', type=float, default=1.0,
                        help='of the road below the first of the driven axles')
    truck, snapshot = pull_away(first_grip=parser.parse_args(args).first_grip)
    print(f'{snapshot.twist_body[0]:.3f} m/s after {snapshot.time:.1f} s')
    for wheel, omega, force in zip(truck.wheels, snapshot.velocity[-6:], snapshot.wheel_force):
        print(f'{wheel:14}{omega:8.3f} rad/s {force[0]:9.1f} N')
    return 0


if __name__ == '__main__':
    sys.exit(main())
