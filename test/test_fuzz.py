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


"""Random sequences of good and bad requests break no law, briefly; at length in ``long``."""

from fuzzing import CoreMachine, NodeMachine, nodes, run
import pytest


def test_no_sequence_of_requests_breaks_a_law_of_the_core():
    assert run(CoreMachine, 300) >= 300


def test_no_sequence_of_requests_breaks_a_law_of_the_node():
    pytest.importorskip('rclpy')
    with nodes():
        assert run(NodeMachine, 40) >= 40
