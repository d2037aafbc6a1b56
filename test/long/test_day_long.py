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

"""A day of simulated time at 100 Hz: nothing drifts."""

from properties import DT, endure, PERIOD
import pytest

from dm_ros import VARIANTS

TICKS = 24 * 3600 * 100


@pytest.mark.parametrize('variant', VARIANTS)
@pytest.mark.parametrize('kind', ['rest', 'constant', 'periodic'])
def test_nothing_drifts_in_a_day(kind, variant):
    # the slowest motion takes some 10 s: after an hour it has settled
    end = endure(variant, kind, settle=360, periods=TICKS // PERIOD)
    print(f'\n{variant}, {kind}: {end}')
    assert end.ticks == TICKS == 8_640_000
    assert end.time == TICKS * DT == 86_400.0
    assert end.residual < 1e-14
    if kind == 'rest':
        assert (end.speed, end.turned) == (0.0, 0.0)
    else:
        assert 10.0 < end.speed < 1e4
        assert end.turned > 1e6
        assert end.angle_error < 1e-5
    assert end.coarse_steps == 0
