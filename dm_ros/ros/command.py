# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The command ``differential``: the node, which a signal ends quietly also while it loads."""

import os
import signal
import sys

from dm_ros.ending import SIGNALS


def main(args=None):
    """Run the node until SIGINT or SIGTERM; return the exit code."""
    for number in SIGNALS:
        signal.signal(number, lambda *_: os._exit(0))   # there is nothing to clean up yet
    from dm_ros.ros.node import main
    return main(args)


if __name__ == '__main__':
    sys.exit(main())
