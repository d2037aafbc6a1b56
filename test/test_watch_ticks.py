# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What ``watch`` makes of the ticks of a node: nothing of what is seen is lost or made up."""

import json

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from dm_ros.watch.ticks import BUCKET, extremes, Joined, SPAN, Strips, Travel

NUMBERS = st.floats(-1e6, 1e6)
ROWS = st.integers(1, 4).flatmap(lambda columns: st.lists(
    st.tuples(*[NUMBERS] * columns), min_size=1, max_size=60))
MS = 1_000_000


def taken(strips):
    """Return what is new: whether all was emptied, and the rows."""
    emptied, rows = strips.take()
    return emptied, json.loads(rows)


def kept(strips):
    return json.loads(strips.all())


@given(ROWS)
def test_a_bucket_keeps_the_extremes_of_each_column_in_their_order(rows):
    result, rows = extremes(rows), np.array(rows)
    assert len(result) == min(2, len(rows))
    assert (result.min(axis=0) == rows.min(axis=0)).all()
    assert (result.max(axis=0) == rows.max(axis=0)).all()
    for column, ends in zip(rows.T, result.T):
        if len(rows) > 1 and column.min() < column.max():
            assert (ends[0] < ends[1]) == (column.argmin() < column.argmax())


@given(ROWS, st.integers(1, 20))
def test_no_peak_is_lost_whatever_the_rate(rows, period):
    strips = Strips(period * 1e-3)
    for n, row in enumerate(rows):
        strips.add(n * period * MS, row)
    strips.close()
    _, drawn = taken(strips)
    values = np.array([row[1:] for row in drawn])
    assert drawn == kept(strips) and len(drawn) <= len(rows)
    # as many digits as an eye sees
    assert values.min(axis=0) == pytest.approx(np.min(rows, axis=0), rel=1e-5)
    assert values.max(axis=0) == pytest.approx(np.max(rows, axis=0), rel=1e-5)
    assert drawn[0][0] == 0.0 and drawn[-1][0] == pytest.approx((len(rows) - 1) * period / 1e3)


def test_one_tick_among_thirty_thousand_is_seen():
    strips = Strips(0.001)
    for n in range(30_000):
        strips.add(n * MS, (1.0 if n == 12_345 else 0.0,))
    strips.close()
    rows = kept(strips)
    peak, = [row for row in rows if row[1] == 1.0]
    assert peak[0] == pytest.approx(12.345, abs=BUCKET * 1e-9)
    assert len(rows) <= 2 * SPAN * 1e9 / BUCKET + 2


def test_what_is_older_than_the_strips_is_forgotten():
    strips = Strips(0.01)
    for n in range(10_000):
        strips.add(n * 10 * MS, (float(n),))
    times = [row[0] for row in kept(strips)]
    assert times[0] == pytest.approx(100.0 - SPAN, abs=0.1) and times[-1] > 99.9


def test_a_time_that_goes_back_empties_the_strips():
    strips = Strips(0.001)
    for n in range(200):
        strips.add(n * MS, (1.0,))
    assert taken(strips)[0] is False
    for n in range(50):
        strips.add(n * MS, (2.0,))
    strips.close()
    emptied, rows = taken(strips)
    assert emptied and rows == kept(strips)
    assert {row[1] for row in rows} == {2.0} and rows[0][0] == 0.0
    assert taken(strips) == (False, [])


def test_no_line_goes_across_a_pause_or_a_reset():
    strips = Strips(0.001)
    strips.add(0, (1.0,))
    strips.add(3000 * MS, (2.0,))               # a pause
    strips.add(3001 * MS, (3.0,), is_reset=True)
    strips.close()
    assert taken(strips) == (False, [[0.0, 1.0], None, [0.25, 2.0], None, [0.251, 3.0]])


def test_a_long_pause_pushes_nothing_out_of_the_strips():
    strips = Strips(0.001)
    for begin in (0, 3_600_000, 7_200_000):
        for n in range(100):
            strips.add((begin + n) * MS, (1.0,))
    strips.close()
    rows = kept(strips)
    assert rows[0] == [0.0, 1.0] and rows[-1] == [pytest.approx(0.797), 1.0]
    assert rows.count(None) == 2


def test_the_line_of_a_slow_node_goes_on():
    strips = Strips(10.0)
    strips.add(0, (1.0,))
    strips.add(10_000 * MS, (2.0,))
    strips.close()
    assert None not in kept(strips)


def test_what_is_no_number_is_a_hole():
    strips = Strips()
    strips.add(0, (float('nan'), float('inf')))
    strips.close()
    assert kept(strips) == [[0.0, None, None]]


def test_the_messages_of_a_tick_are_joined_by_their_stamp():
    joined = Joined(2)
    for stamp in (1, 2, 3):
        joined.put(0, stamp, (stamp,))
    assert joined.take() == []
    for stamp in (1, 2):
        joined.put(1, stamp, (-stamp,))
    assert joined.take() == [(1, ((1,), (-1,))), (2, ((2,), (-2,)))]
    joined.put(1, 3, (-3,))
    assert joined.take() == [(3, ((3,), (-3,)))] and joined.lost == 0


def test_a_tick_that_lost_a_message_is_counted_and_holds_nothing_up():
    joined = Joined(2)
    for topic, stamps in ((0, (1, 2, 3)), (1, (1, 3))):
        for stamp in stamps:
            joined.put(topic, stamp, (stamp,))
    assert [tick.stamp for tick in joined.take()] == [1, 3] and joined.lost == 1
    joined.put(0, 4, (4,))
    joined.put(0, 5, (5,))
    joined.put(1, 5, (5,))
    assert [tick.stamp for tick in joined.take()] == [5] and joined.lost == 2


def test_what_was_lost_before_the_first_whole_tick_is_not_counted():
    joined = Joined(2)
    joined.put(0, 1, (1,))
    for topic in (0, 1):
        joined.put(topic, 2, (2,))
    assert len(joined.take()) == 1 and joined.lost == 0


def test_a_reset_does_not_turn_the_shafts_back():
    travel = Travel()
    assert not travel.add((100.0, -4.0))
    assert not travel.add((101.0, -5.0)) and travel.total == (1.0, -1.0)
    assert travel.add((0.0, 0.0)) and travel.total == (1.0, -1.0)
    assert not travel.add((0.5, 0.5)) and travel.total == (1.5, -0.5)
    assert not travel.add((0.5, 0.5)) and travel.total == (1.5, -0.5)
