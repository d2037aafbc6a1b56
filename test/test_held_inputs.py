# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A demand is taken whole or not at all, is clamped, and grows old."""

import pytest

from dm_ros.mechanism.ports import torque
from dm_ros.motion.held_inputs import HeldInputs

SHAFTS = ('pinion', 'left', 'right')


def inputs(limit=1e5, timeout=100):
    return HeldInputs([torque(shaft) for shaft in SHAFTS], limit, timeout)


def test_a_subset_leaves_the_other_shafts_alone():
    torques = inputs()
    torques.demand(('left', 'pinion'), (1.0, 2.0), 0)
    torques.demand(('right',), (3.0,), 0)
    assert torques.in_force(0) == (2.0, 1.0, 3.0)


@pytest.mark.parametrize('names, values, word', [
    (('left', 'right'), (5.0, float('nan')), 'right'),
    (('left', 'right'), (5.0, float('inf')), 'right'),
    (('left', 'wheel'), (5.0, 5.0), 'wheel'),
    (('left', 'left'), (5.0, 5.0), 'left'),
    (('left', 'right'), (5.0,), '2 names'),
    (('left',), (5.0, 5.0), '2 values'),
])
def test_a_bad_demand_is_refused_whole_and_says_why(names, values, word):
    torques = inputs()
    torques.demand(SHAFTS, (1.0, 2.0, 3.0), 0)
    with pytest.raises(ValueError, match=word):
        torques.demand(names, values, 1)
    assert torques.in_force(1) == (1.0, 2.0, 3.0)
    assert (torques.received, torques.refused) == (1, 1)


def test_what_is_beyond_the_limit_is_clamped_and_counted():
    torques = inputs(limit=10.0)
    assert torques.demand(SHAFTS, (11.0, -1e308, 10.0), 0)
    assert torques.in_force(0) == (10.0, -10.0, 10.0)
    assert torques.clamped == 1
    assert not torques.demand(SHAFTS, (1.0, 2.0, -10.0), 0)


def test_a_demand_holds_for_its_time_and_then_is_zero_until_it_is_renewed():
    torques = inputs(timeout=100)
    torques.demand(('left',), (5.0,), 7)
    torques.demand(('right',), (6.0,), 50)
    assert torques.in_force(107) == (0.0, 5.0, 6.0)
    assert torques.stale(107) == []
    assert torques.in_force(108) == (0.0, 0.0, 6.0)
    assert torques.stale(108) == ['left']
    torques.demand(('left',), (4.0,), 200)
    assert torques.in_force(200) == (0.0, 4.0, 0.0)


def test_without_a_timeout_a_demand_holds_for_ever():
    torques = inputs(timeout=0)
    torques.demand(('left',), (5.0,), 0)
    assert torques.in_force(10**9) == (0.0, 5.0, 0.0)
    assert torques.stale(10**9) == []


def test_a_shaft_is_silent_until_its_first_demand():
    torques = inputs()
    assert torques.silent() == list(SHAFTS)
    torques.demand(('left',), (5.0,), 0)
    assert torques.silent() == ['pinion', 'right']
    torques.forget()
    assert torques.silent() == list(SHAFTS)
    assert torques.in_force(0) == (0.0, 0.0, 0.0)
