# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.


"""The faults around the processes at length: fifty kills, signals at a hundred moments."""

from ros.conftest import ros  # noqa: F401  the fixtures
from ros.test_fault_processes import kill_and_clear, start, sweep  # noqa: F401


def test_killed_and_restarted_fifty_times(ros, start):   # noqa: F811
    kill_and_clear(ros, start, 50)


def test_a_signal_at_any_of_a_hundred_moments(start):   # noqa: F811
    sweep(start, 50)
