# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The five reference runs of a driveline, as plain data.

A scenario says how a car starts and which inputs change when: until the first change, and for
all inputs that no change names, the inputs have their defaults. A value holds from its time on,
to the next change of that input. All times are multiples of 1 ms.
"""

import math
from typing import NamedTuple

WHEELS = ('front_left', 'front_right', 'rear_left', 'rear_right')
DIFFERENTIALS = {'fwd': ('front',), 'rwd': ('rear',), 'awd': ('centre', 'front', 'rear')}
DEFAULT_INPUTS = {
    'torque': 0.0, 'brakes': (0.0,) * 4, 'clutch_forces': {}, 'steer': 0.0, 'grade': 0.0,
    'grip': (1.0,) * 4, 'contact': (1.0,) * 4, 'wind': 0.0}


class Scenario(NamedTuple):
    layout: str
    planar: bool
    speed: float        # at the start, m/s
    parameters: dict    # those that are not the defaults, by full name
    changes: list       # (time, {input: value}), in the order of time; the first is at 0
    duration: float     # s


def ramp(name, first, last, count, begin, end):
    """
    Return the changes of one input from a value to another, in equal steps.

    Step i = 0 .. count - 1 is at ``begin + (end - begin) i/count`` and brings the value at the
    share (i + 1)/count: the first step is at ``begin``, the last one before ``end``.
    """
    def value(share):
        if isinstance(first, tuple):
            return tuple(a + (b - a) * share for a, b in zip(first, last))
        return first + (last - first) * share
    return [(round(begin + (end - begin) * i / count, 9), {name: value((i + 1) / count)})
            for i in range(count)]


def in_order(*parts):
    """Return all changes by time, those of one time in one mapping."""
    merged = {}
    for time, values in sorted((change for part in parts for change in part),
                               key=lambda change: change[0]):
        merged.setdefault(time, {}).update(values)
    return list(merged.items())


def sine_steer():
    """Return the steps of a double sine with 0.035 rad, 100 from 0.3 s to 3.3 s, then 0."""
    changes = []
    for i in range(100):
        time = round(0.3 + 0.03 * i, 9)
        s = 2.0 * math.pi * (time - 0.285) / 3.0
        inside = 0.0 <= s < 2.0 * math.pi
        changes.append((time, {'steer': 0.035 * math.sin(2.0 * s) if inside else 0.0}))
    return [*changes, (3.3, {'steer': 0.0})]


def sign_speeds(layout, value=0.1):
    """Return the parameters with which the meshes of all differentials change sign smoothly."""
    return {f'driveline.{name}.mesh_sign_speed': value for name in DIFFERENTIALS[layout]}


SCENARIOS = {
    'hill_axle_ice': Scenario(
        layout='awd', planar=False, speed=0.0, parameters=sign_speeds('awd'),
        changes=in_order(
            [(0.0, {'grade': 0.12, 'grip': (0.15, 0.15, 1.0, 1.0), 'brakes': (800.0,) * 4})],
            ramp('torque', 0.0, 500.0, 25, 0.5, 1.0),
            ramp('brakes', (800.0,) * 4, (0.0,) * 4, 10, 1.0, 1.2)),
        duration=3.0),
    'lift_front': Scenario(
        layout='awd', planar=False, speed=0.0, parameters=sign_speeds('awd'),
        changes=in_order(
            [(0.0, {'contact': (0.0, 0.0, 1.0, 1.0)})],
            ramp('torque', 0.0, 400.0, 15, 0.2, 0.5)),
        duration=2.0),
    'stop_hold': Scenario(
        layout='awd', planar=False, speed=10.0, parameters=sign_speeds('awd'),
        changes=in_order(
            [(0.0, {'grade': -0.15})],
            ramp('brakes', (0.0,) * 4, (900.0, 900.0, 700.0, 700.0), 10, 0.2, 0.4)),
        duration=14.0),
    'tip': Scenario(
        layout='rwd', planar=False, speed=8.0,
        parameters={**sign_speeds('rwd'), 'driveline.shaft.half.stiffness': 8000.0,
                    'driveline.shaft.half.damping': 20.0, 'driveline.shaft.half.gap': 0.035,
                    'driveline.shaft.input.gap': 0.02},
        changes=in_order(
            [(0.0, {'torque': -40.0})],
            ramp('torque', -40.0, 400.0, 6, 0.5, 0.56),
            ramp('torque', 400.0, -60.0, 6, 1.7, 1.76)),
        duration=3.0),
    'lane': Scenario(
        layout='awd', planar=True, speed=22.0, parameters=sign_speeds('awd'),
        changes=in_order([(0.0, {'torque': 60.0})], sine_steer()),
        duration=4.5),
}


def split_grip_start(layout):
    """Return a start on a hill of 8 % where each wheel has its own grip, a little to the left."""
    return Scenario(
        layout=layout, planar=True, speed=0.0, parameters=sign_speeds(layout),
        changes=[(0.0, {'grade': 0.08, 'grip': (0.12, 0.9, 0.2, 1.0), 'brakes': (800.0,) * 4,
                        'steer': 0.1}),
                 (0.3, {'torque': 500.0}), (0.4, {'brakes': (0.0,) * 4})],
        duration=0.8)
