# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The differentials of a driveline in C have the bits of those in Python."""

from unittest import mock

import numpy as np
from properties import random_case
import pytest

from dm_ros import core, Driveline
from dm_ros.driveline import differential
from dm_ros.mechanism import passive
from dm_ros.mechanism.variants import equipped, variant_named

pytestmark = pytest.mark.skipif(core.passive_point is None, reason='the core in C is not built')


@pytest.mark.parametrize('clutched', [False, True])
def test_points_slopes_and_losses_are_those_of_python_to_the_last_bit(clutched):
    rng = np.random.default_rng(3)
    for n in range(150):
        case = random_case(n, clutched)
        table = case.arguments['parameters']
        mechanism = equipped(variant_named(case.variant).mechanism, table)
        k = passive.coefficients(table, bool(mechanism.clutches))
        there, here = differential.in_c(k), differential.in_python(k)
        for scale in 10.0 ** rng.uniform(-3, 3, 4):
            w, s, *u = (scale * rng.normal(0, 1, 5)).tolist()
            u = *u, *rng.uniform(0, 50, 2).tolist()
            point = here[0](u, w, s)
            assert repr(there[0](u, w, s)) == repr(point)
            for in_c, in_python in zip(there[1:], here[1:]):
                assert repr(in_c(u, w, s, point)) == repr(in_python(u, w, s, point))


@pytest.mark.parametrize('layout, planar', [('awd', True), ('fwd', False)])
def test_a_drive_has_the_same_bits_in_both(layout, planar):
    cars = [Driveline(layout, planar)]
    with mock.patch.object(core, 'passive_point', None):
        cars.append(Driveline(layout, planar))
        assert cars[1].language == 'Python'
    assert cars[0].language == 'Python, differentials in C'
    for car in cars:
        car.reset(6.0)
    for n in range(300):
        given = {'torque': 300.0 * np.sin(n / 20).item(), 'grip': (0.2, 1.0, 1.0, 0.5),
                 'steer': 0.05 * (n > 100) * planar, 'brakes': (500.0 * (n > 200),) * 4}
        first, second = [car.step(**given) for car in cars]
        assert repr(first) == repr(second)
    assert cars[0].energy == cars[1].energy and cars[0].losses == cars[1].losses


def test_what_is_no_state_is_refused():
    k = passive.coefficients(random_case(0, False).arguments['parameters'], False)
    evaluate, slopes, lost = differential.in_c(k)
    with pytest.raises(TypeError, match='held must be a tuple of 5 numbers'):
        evaluate((1.0, 2.0), 1.0, 1.0)
    with pytest.raises(TypeError, match='coefficients must be'):
        core.passive_point(b'', (0.0,) * 5, 1.0, 1.0)
