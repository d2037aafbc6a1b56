# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A ROS domain of one's own, so that runs and tests do not hear each other."""

import random
import socket

LARGEST_DOMAIN = 101      # above it, the ports of a domain may be taken by outgoing connections
PARTICIPANTS = 8


def free_domain():
    """Return the number of a ROS domain in which nobody on this machine takes part now."""
    domains = list(range(1, LARGEST_DOMAIN + 1))
    random.shuffle(domains)
    for domain in domains:
        if all(is_free(discovery_port(domain, i)) for i in range(PARTICIPANTS)):
            return domain
    raise OSError('every ROS domain is in use on this machine')


def discovery_port(domain, participant):
    """Return the unicast discovery port of a participant, DDSI-RTPS 9.6.1.1."""
    return 7400 + 250 * domain + 10 + 2 * participant


def is_free(port):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind(('', port))
        except OSError:
            return False
    return True
