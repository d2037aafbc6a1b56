# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The faults around the processes at length: fifty kills, signals at a hundred moments."""

from ros.conftest import ros  # noqa: F401  the fixtures
from ros.test_fault_processes import kill_and_clear, start, sweep  # noqa: F401


def test_killed_and_restarted_fifty_times(ros, start):   # noqa: F811
    kill_and_clear(ros, start, 50)


def test_a_signal_at_any_of_a_hundred_moments(start):   # noqa: F811
    sweep(start, 50)
