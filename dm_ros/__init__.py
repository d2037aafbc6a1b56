# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A vehicle differential in software, in the loop: the library, without ROS."""

from importlib import import_module

# loaded when they are asked for: a tool shall answer to signals before it loads numpy and scipy
HOMES = {
    'Driveline': 'dm_ros.driveline.driveline',
    'Ensemble': 'dm_ros.ensemble',
    'SelfLockingParameters': 'dm_ros.mechanism.parameters',
    'Simulation': 'dm_ros.motion.simulation',
    'Snapshot': 'dm_ros.motion.state',
    'SymmetricParameters': 'dm_ros.mechanism.parameters',
    'VARIANTS': 'dm_ros.mechanism.variants',
}
__all__ = sorted(HOMES)


def __dir__():
    return sorted({*globals(), *__all__})


def __getattr__(name):
    if name not in HOMES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(HOMES[name]), name)
