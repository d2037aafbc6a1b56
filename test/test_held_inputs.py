# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A demand is taken whole or not at all, is clamped, and grows old."""

import pytest

from dm_ros.mechanism.ports import force, torque
from dm_ros.motion.held_inputs import HeldInputs

SHAFTS = ('pinion', 'left', 'right')
CLUTCHES = ('left_clutch', 'right_clutch')
NAN, INF = float('nan'), float('inf')


def inputs(limit=1e5, timeout=100):
    return HeldInputs([torque(shaft) for shaft in SHAFTS], (limit,) * 3, timeout)


def with_clutches(limits=(1e5, 1e5, 1e5, 500.0, 900.0), timeout=100):
    return HeldInputs([*map(torque, SHAFTS), *map(force, CLUTCHES)], limits, timeout)


def test_a_subset_leaves_the_other_shafts_alone():
    torques = inputs()
    torques.demand(('left', 'pinion'), (1.0, 2.0), 0)
    torques.demand(('right',), (3.0,), 0)
    assert torques.in_force(0) == (2.0, 1.0, 3.0)


@pytest.mark.parametrize('names, values, word', [
    (('left', 'right'), (5.0, NAN), 'right'),
    (('left', 'right'), (5.0, INF), 'right'),
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


# Forces beside torques


def test_one_demand_may_mix_shafts_and_clutches():
    held = with_clutches()
    held.demand(('left_clutch', 'pinion', 'right_clutch'), (4.0, 1.0, 5.0), 0)
    held.demand(('left', 'left_clutch'), (2.0, 6.0), 0)
    assert held.in_force(0) == (1.0, 2.0, 0.0, 6.0, 5.0)


@pytest.mark.parametrize('value', [-1.0, -1e-300, -INF, INF, NAN])
def test_a_force_that_pulls_or_is_no_number_is_refused_by_name_and_the_torque_with_it(value):
    held = with_clutches()
    held.demand(('left', 'left_clutch'), (2.0, 3.0), 0)
    with pytest.raises(ValueError, match=f'the force on left_clutch is {value}'):
        held.demand(('left', 'left_clutch'), (5.0, value), 0)
    assert held.in_force(0) == (0.0, 2.0, 0.0, 3.0, 0.0)
    assert (held.received, held.refused) == (1, 1)


def test_each_port_is_clamped_to_its_own_limit_and_a_demand_counts_once():
    held = with_clutches(limits=(10.0, 10.0, 10.0, 500.0, 900.0))
    clamped = held.demand(
        (*SHAFTS, *CLUTCHES), (-11.0, 10.0, 0.0, 500.1, 899.0), 0)
    assert [(port.name, limit) for port, limit in clamped] == [
        ('pinion', 10.0), ('left_clutch', 500.0)]
    assert held.in_force(0) == (-10.0, 10.0, 0.0, 500.0, 899.0)
    assert held.clamped == 1


def test_a_force_that_is_not_renewed_becomes_zero_by_itself():
    held = with_clutches(timeout=10)
    held.demand(('left', 'right_clutch'), (1.0, 50.0), 0)
    held.demand(('left',), (1.0,), 5)
    assert held.in_force(10) == (0.0, 1.0, 0.0, 0.0, 50.0)
    assert held.in_force(11) == (0.0, 1.0, 0.0, 0.0, 0.0)
    assert held.stale(11) == ['right_clutch']


# NaN as no demand


def test_where_nan_is_no_demand_the_older_one_stays_and_grows_stale_as_if_nothing_came():
    held = with_clutches(timeout=10)
    held.demand(('left', 'right_clutch'), (1.0, 50.0), 0)
    assert not held.demand((*SHAFTS, *CLUTCHES), (NAN, NAN, 3.0, 40.0, NAN), 6, sparse=True)
    assert held.in_force(10) == (0.0, 1.0, 3.0, 40.0, 50.0)
    assert held.in_force(11) == (0.0, 0.0, 3.0, 40.0, 0.0)
    assert held.stale(11) == ['left', 'right_clutch']
    assert held.silent() == ['pinion']
    assert (held.received, held.refused) == (2, 0)


@pytest.mark.parametrize('names, values, word', [
    (('left', 'wheel'), (5.0, NAN), 'wheel'),
    (('left', 'left'), (5.0, NAN), 'twice'),
    (('left', 'right'), (NAN,), '2 names'),
    (('left', 'right'), (NAN, INF), 'right is inf'),
    (('left', 'left_clutch'), (NAN, -1.0), 'left_clutch is -1'),
])
def test_beside_a_nan_that_is_no_demand_a_bad_one_is_refused_as_ever(names, values, word):
    held = with_clutches()
    with pytest.raises(ValueError, match=word):
        held.demand(names, values, 0, sparse=True)
    assert held.silent() == [*SHAFTS, *CLUTCHES]
