# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""How a node of the examples runs and ends."""

import rclpy


def run(kind, args=None):
    """Run a node of a kind until SIGINT or SIGTERM; return the exit code."""
    rclpy.init(args=args)
    try:
        rclpy.spin(kind())
    except KeyboardInterrupt:
        pass
    except Exception:
        if rclpy.ok():   # otherwise it is the shutdown, which may break a call
            raise
    finally:
        rclpy.try_shutdown()
    return 0
