# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""How a node of the examples runs and ends."""

import signal

import rclpy
from rclpy.signals import install_signal_handlers, SignalHandlerOptions


def run(kind, args=None):
    """Run a node of a kind until SIGINT or SIGTERM; return the exit code."""
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    # a KeyboardInterrupt may come anywhere, also in a __del__, where Python tells and drops it
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    install_signal_handlers()   # these shut the context down, which ends the spin
    try:
        rclpy.spin(kind())
    except Exception:
        if rclpy.ok():   # otherwise it is the shutdown, which may break a call
            raise
    finally:
        rclpy.try_shutdown()
    return 0
