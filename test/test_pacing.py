# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Deadlines are absolute, and what was missed is skipped and counted."""

import pytest

from dm_ros.motion.pacing import Pacer


def test_deadlines_do_not_add_up_rounding():
    pacer, start = Pacer(1e9 / 300), 10**15   # ns, as of a machine that is up for twelve days
    pacer.restart(start)
    for _ in range(300 * 60):
        pacer.begin(pacer.due)
    assert pacer.due - start == pytest.approx(60e9 + 1e9 / 300, abs=1)
    assert pacer.missed == 0


def test_a_late_tick_moves_no_later_deadline():
    pacer = Pacer(1000)
    pacer.restart(0)
    pacer.begin(1999)
    assert pacer.due == 2000
    assert pacer.missed == 0


@pytest.mark.parametrize('late, missed, due', [(1000, 1, 3000), (2999, 2, 4000), (10**9, 10**6,
                                                                                1000002000)])
def test_whole_periods_are_skipped_and_counted_without_a_burst(late, missed, due):
    pacer = Pacer(1000)
    pacer.restart(0)
    pacer.begin(pacer.due + late)
    assert (pacer.missed, pacer.ticks, pacer.due) == (missed, 1, due)


def test_a_restart_misses_nothing():
    pacer = Pacer(1000)
    pacer.restart(0)
    pacer.begin(pacer.due)
    pacer.restart(10**9)
    assert (pacer.due, pacer.missed) == (10**9 + 1000, 0)


def test_lateness_is_that_of_the_ticks_since_the_last_question():
    pacer = Pacer(1000)
    pacer.restart(0)
    for late in (30, 10, 20):
        pacer.begin(pacer.due + late)
    assert pacer.take_lateness() == [10, 20, 30]
    assert pacer.take_lateness() == []


def test_a_patient_pacer_catches_up_a_leap_of_the_clock_but_not_a_jump():
    pacer = Pacer(1000, patience=10)
    pacer.restart(0)
    ticks = 0
    while pacer.due <= 9000:
        pacer.begin(9000)
        ticks += 1
    assert (ticks, pacer.missed) == (9, 0)
    pacer.begin(3_600_000_500)
    assert pacer.missed == 3_599_990
    assert pacer.due == 3_600_001_000
