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

"""The property tests of ``test_properties``, at length."""

from properties import Tally

from dm_ros.progress import progress

CASES = 100_000


def test_no_random_differential_breaks_a_law_or_fails():
    tally = Tally()
    for n in progress(range(CASES), total=CASES, unit='case'):
        tally.run(n)
    print(f'\n{tally}')
    assert tally.cases == CASES
