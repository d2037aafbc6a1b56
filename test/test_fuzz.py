# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Random sequences of good and bad requests break no law, briefly; at length in ``long``."""

from fuzzing import CoreMachine, NodeMachine, nodes, run
import pytest


def test_no_sequence_of_requests_breaks_a_law_of_the_core():
    assert run(CoreMachine, 100) >= 100


def test_no_sequence_of_requests_breaks_a_law_of_the_node():
    pytest.importorskip('rclpy')
    with nodes():
        assert run(NodeMachine, 40) >= 40
