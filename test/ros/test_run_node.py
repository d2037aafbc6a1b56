# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""How a node of the examples ends, wherever in its Python a signal meets it."""

from pathlib import Path
import signal

from processes import Forked
import pytest

EXAMPLES = Path(__file__).parents[2] / 'examples'
SOURCE = f"""
import os, sys
sys.path.insert(0, {str(EXAMPLES)!r})
from rclpy.node import Node
from run_node import run

class Signals:
    def __del__(self):
        os.kill(os.getpid(), int(sys.argv[2]))

class Signalled(Node):
    def __init__(self):
        super().__init__('signalled')
        if sys.argv[1] == 'start':
            Signals()
        self.create_timer(0.01, Signals if sys.argv[1] == 'callback' else self.fail)

    def fail(self):
        raise ValueError('no signal came')

sys.exit(run(Signalled, []))
"""


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize('moment', ['start', 'callback'])
def test_a_signal_in_the_end_of_an_object_ends_it_with_exit_code_0_and_no_word(moment, number):
    with Forked(SOURCE, moment, int(number)) as node:
        assert node.ended() == 0
        assert not node.errors


def test_what_fails_in_it_is_told():
    with Forked(SOURCE, 'nothing', 0) as node:
        assert node.ended() == 1
        assert 'ValueError: no signal came' in node.errors
