# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""How a node of the examples runs and ends."""

import signal
import threading

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import install_signal_handlers, SignalHandlerOptions


def run(kind, args=None):
    """Run a node of a kind until SIGINT or SIGTERM; return the exit code."""
    ended = threading.Event()
    # a KeyboardInterrupt may come anywhere, also in a __del__, where Python tells and drops it
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    try:
        executor = SingleThreadedExecutor()
        executor.add_node(kind())
        # these call those above and shut the context down, which breaks whatever uses it
        install_signal_handlers()
        if not ended.is_set():
            executor.spin()
    except Exception:
        if not ended.is_set():
            raise
    finally:
        rclpy.try_shutdown()
    return 0
