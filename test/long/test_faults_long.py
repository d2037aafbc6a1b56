# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The faults at length: fifty kills, signals at a hundred moments, a queue of 10,000."""

from ros.conftest import ros  # noqa: F401  the fixtures
from ros.test_fault_processes import fork, kill_again_and_again, start, sweep  # noqa: F401
from ros.test_faults import fill_the_queue_of_a_stopped_subscriber, listeners  # noqa: F401


def test_killed_and_restarted_fifty_times(ros, fork):   # noqa: F811
    kill_again_and_again(ros, fork, 50)


def test_a_signal_at_any_of_a_hundred_moments(start):   # noqa: F811
    sweep(start, 100)


def test_a_stopped_subscriber_holds_no_tick_up_when_its_queue_of_10000_is_full(
        ros, listeners):   # noqa: F811
    fill_the_queue_of_a_stopped_subscriber(ros, listeners, 10_000)
