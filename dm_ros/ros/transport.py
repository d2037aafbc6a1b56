# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""How messages travel: by UDP, on this host too, where the user has not chosen otherwise."""

import os
from pathlib import Path

import rclpy

CHOICES = 'FASTDDS_BUILTIN_TRANSPORTS', 'FASTRTPS_DEFAULT_PROFILES_FILE'
PROFILES = 'DEFAULT_FASTRTPS_PROFILES.xml'   # read from the working directory
RANGE, OLD_RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE', 'ROS_LOCALHOST_ONLY'
LOCALHOST = Path(__file__).with_name('localhost.xml')


def prefer_udp(environment=os.environ):
    """
    Let DDS in this process use UDP alone; to be called before ``rclpy.init``.

    Through shared memory, the first ``publish()`` after a subscriber was killed waits a third of a
    second, or some of them, for the dead one, and holds the interpreter. For the range LOCALHOST,
    ``rmw_fastrtps`` adds shared memory whatever the transport is: ``localhost.xml`` is what it
    does for that range, without it.

    Where the user chose a transport, a profile of Fast DDS, peers for LOCALHOST or another DDS,
    nothing changes.
    """
    if (not rclpy.get_rmw_implementation_identifier().startswith('rmw_fastrtps')
            or any(environment.get(name) for name in CHOICES) or os.path.exists(PROFILES)):
        return
    if environment.get(OLD_RANGE) != '1' and environment.get(RANGE) != 'LOCALHOST':
        environment['FASTDDS_BUILTIN_TRANSPORTS'] = 'UDPv4'
    elif not environment.get('ROS_STATIC_PEERS'):
        environment['FASTRTPS_DEFAULT_PROFILES_FILE'] = str(LOCALHOST)
        environment[RANGE] = 'SYSTEM_DEFAULT'   # as the profile has it
        environment.pop(OLD_RANGE, None)        # it would count more
