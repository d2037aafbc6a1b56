# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The commands of the package, which a signal ends quietly also while Python still loads them."""

from functools import partial
from importlib import import_module
import os
import signal
import sys

from dm_ros.ending import SIGNALS

# where each is, and whether a signal is how it is meant to end
COMMANDS = {
    'bias': ('tools.bias', False),
    'compare_variants': ('tools.compare_variants', False),
    'demo': ('tools.demo', False),
    'differential': ('ros.node', True),
    'driveline': ('ros.driveline_node', True),
    'export_fmu': ('tools.export_fmu', False),
    'identify': ('tools.identify', False),
    'play_torques': ('tools.play_torques', True),
    'simulate': ('tools.simulate', False),
    'sweep': ('tools.sweep', False),
    'urdf': ('tools.urdf', False),
    'watch': ('tools.watch', True),
}


def run(name, args=None):
    """Load a command and run it; return its exit code."""
    module, until_signal = COMMANDS[name]
    for number in SIGNALS:
        if until_signal or signal.getsignal(number) != signal.SIG_IGN:
            # there is nothing to clean up yet
            code = 0 if until_signal else 128 + number
            signal.signal(number, lambda *_, code=code: os._exit(code))
    return import_module(f'dm_ros.{module}').main(args)


(bias, compare_variants, demo, differential, driveline, export_fmu, identify, play_torques,
 simulate, sweep, urdf, watch) = (partial(run, name) for name in COMMANDS)


if __name__ == '__main__':   # python -m dm_ros.commands NAME ...
    del sys.argv[0]
    sys.exit(run(sys.argv[0]))
