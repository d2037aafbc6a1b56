# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What advances time: the steady clock, another simulator's clock, or messages."""

import os
import threading
import time

from dm_ros.ros.privates import take, Waiter

SPIN = 50_000           # ns before a deadline that are not slept but watched
LOOK = 0.5e-3           # s between two looks at a clock that another simulator drives
LONGEST_WAIT = 0.1      # s until a loop notices that it shall stop


class Control:
    """How the rest of the node reaches into its loop."""

    def __init__(self):
        self.lock = threading.Lock()       # held during a tick, and to change what it uses
        self.running = threading.Event()   # cleared while paused
        self.running.set()
        self.stopping = threading.Event()


def ask_for_priority(priority, log):
    """Put the calling thread under SCHED_FIFO; say so where that is not permitted."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    except OSError as error:
        log.warning(f'realtime_priority {priority}: {error.strerror}; going on without. An entry '
                    'rtprio in /etc/security/limits.conf or CAP_SYS_NICE permits it')


def follow_steady_clock(control, pacer, tick):
    """Call ``tick`` at the pacer's deadlines on the steady clock, which nobody can set."""
    pacer.restart(time.monotonic_ns())
    while not control.stopping.is_set():
        if not control.running.is_set():
            if control.running.wait(LONGEST_WAIT):
                pacer.restart(time.monotonic_ns())
            continue
        left = pacer.due - time.monotonic_ns()
        if left > LONGEST_WAIT * 1e9:
            time.sleep(LONGEST_WAIT)
            continue
        if left > SPIN:
            time.sleep((left - SPIN) * 1e-9)
        while time.monotonic_ns() < pacer.due:
            pass
        with control.lock:
            if control.running.is_set():
                pacer.begin(time.monotonic_ns())
                tick()


def follow_ros_clock(control, pacer, clock, tick, set_back):
    """
    Call ``tick`` at the pacer's deadlines on a ROS clock, which another simulator drives.

    While it stands still nothing happens; when it jumps back the deadlines begin anew.

    :param set_back: called when it jumps back, with the times before and after, ns.
    """
    before = 0
    while not control.stopping.is_set():
        now = clock.now().nanoseconds
        if now < before:
            set_back(before, now)
        if now < before or before == 0 or not control.running.is_set():
            pacer.restart(now)
        before = now
        if now < pacer.due or now == 0:
            time.sleep(LOOK)
            continue
        with control.lock:
            if control.running.is_set():
                pacer.begin(now)
                tick()


def follow_messages(control, subscription, context, tick):
    """Call ``tick(message, info)`` for each message of a polled subscription, in their order."""
    waiter = Waiter(subscription, context)
    while not control.stopping.is_set():
        if not control.running.wait(LONGEST_WAIT):
            continue
        waiter.wait(LONGEST_WAIT)
        taken = True
        while taken and not control.stopping.is_set():
            with control.lock:
                # what is not taken while paused stays in the queue
                taken = control.running.is_set() and take(subscription)
                if taken:
                    tick(*taken)
