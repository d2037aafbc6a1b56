# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Lockstep over 100,000 ticks: two runs give identical bytes, whatever the machine does."""

from array import array
from contextlib import contextmanager
import subprocess
import sys
import time

import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import JointState

from dm_ros.testing import LockstepDifferential

TICKS = 100_000


class Controller(Node):
    """Answers each joint state with torques that lock, slip and reverse."""

    def __init__(self, context):
        super().__init__('controller', context=context)
        self.heard = 0
        self.message = JointState(name=['carrier', 'front', 'rear'], effort=[0.0, 0.0, 0.0])
        self.torques = self.create_publisher(JointState, '/differential/torques', 100)
        self.states = self.create_subscription(
            JointState, '/differential/joint_states', self.answer, 100)

    def answer(self, message):
        n = self.heard = self.heard + 1
        self.message.effort[:] = array('d', (
            300.0 - n % 400 - message.velocity[0], -100.0 + n % 37, -150.0 + n % 91))
        self.torques.publish(self.message)


@contextmanager
def busy_machine():
    """Let two processes take all the time of the machine that they get."""
    burners = [subprocess.Popen([sys.executable, '-c', 'while True: pass']) for _ in range(2)]
    try:
        yield
    finally:
        for burner in burners:
            burner.kill()
            burner.wait()


def run():
    with LockstepDifferential('lsd_ode', 1000.0) as vehicle:
        vehicle.attach(Controller(vehicle.context))
        return vehicle.run(seconds=TICKS / 1000.0)


def test_two_runs_of_100000_ticks_are_equal_to_the_last_bit_at_any_load():
    start = time.monotonic()
    quiet = run()
    print(f'\n{TICKS} ticks through topics: {TICKS / (time.monotonic() - start):.0f} a second')
    with busy_machine():
        busy = run()
    assert len(quiet) == TICKS
    for name, values in quiet.columns.items():
        assert np.array_equal(values.view(np.int64), busy.columns[name].view(np.int64)), name
