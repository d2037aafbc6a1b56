# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
A differential or a car for the tests of a controller: in lockstep, in the test's own process.

``LockstepDifferential`` runs the node ``differential`` in mode lockstep in a ROS domain of its
own, with the test's own rclpy nodes around it, and stops to the tick. ``DirectDifferential``
runs a control law, a function, without topics. Both return a ``Record``. ``LockstepDriveline`` and
``DirectDriveline`` do the same with a whole driveline, and return a ``DrivelineRecord``.

The pytest fixtures ``differential``, ``direct_differential``, ``driveline`` and
``direct_driveline`` make them, see ``dm_ros.testing.pytest_plugin``.
"""

from importlib import import_module

# loaded when they are asked for: pytest loads the plugin in this package for every test suite
HOMES = {
    'DirectDifferential': 'dm_ros.testing.direct',
    'DirectDriveline': 'dm_ros.testing.direct',
    'LockstepDifferential': 'dm_ros.testing.lockstep',
    'LockstepDriveline': 'dm_ros.testing.lockstep',
}
__all__ = sorted(HOMES)


def __getattr__(name):
    if name not in HOMES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(HOMES[name]), name)
