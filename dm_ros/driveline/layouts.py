# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The layouts of cars: front-wheel, rear-wheel and all-wheel drive, on four wheels."""

from dm_ros.driveline.parameters import Shaft

INPUT = Shaft('input', 3e4, 20.0)
FRONT_PROPELLER = Shaft('front_propeller', 2e4, 15.0)
REAR_PROPELLER = Shaft('rear_propeller', 1.5e4, 15.0)
HALF = Shaft('half', 1e4, 25.0)


def fwd(car):
    """Drive the front wheels; the axle sits at the gearbox."""
    front_wheels, _ = four_wheels(car)
    front = car.axle('front')
    car.connect('input', car.input(), front.pinion, INPUT)
    half_shafts(car, front, front_wheels)


def rwd(car):
    """Drive the rear wheels."""
    _, rear_wheels = four_wheels(car)
    rear = car.axle('rear')
    car.connect('input', car.input(), rear.pinion, INPUT)
    half_shafts(car, rear, rear_wheels)


def awd(car):
    """Drive all wheels, through a self-locking centre differential."""
    front_wheels, rear_wheels = four_wheels(car)
    centre, front, rear = car.differential('centre'), car.axle('front'), car.axle('rear')
    car.connect('input', car.input(), centre.carrier, INPUT)
    car.connect('front_propeller', centre.front, front.pinion, FRONT_PROPELLER)
    car.connect('rear_propeller', centre.rear, rear.pinion, REAR_PROPELLER)
    half_shafts(car, front, front_wheels)
    half_shafts(car, rear, rear_wheels)


def four_wheels(car):
    """Add the four wheels of a car; return the front pair and the rear pair."""
    p = car.vehicle
    return (wheels(car, 'front', p.a, is_front=True, is_steered=True),
            wheels(car, 'rear', -p.b, is_front=False))


def wheels(car, name, x, is_front, is_steered=False):
    """Add the left and the right wheel of an axle at x, m; return ``{name: flange}``."""
    half = car.vehicle.track / 2.0
    return {f'{name}_{side}': car.wheel(f'{name}_{side}', x, y, is_front, is_steered)
            for side, y in (('left', half), ('right', -half))}


def half_shafts(car, axle, wheels):
    """Connect an axle with its wheels, the left one first."""
    for side, (name, wheel) in zip((axle.left, axle.right), wheels.items()):
        car.connect(f'{name}_half', side, wheel, HALF)


LAYOUTS = {layout.__name__: layout for layout in (fwd, rwd, awd)}
