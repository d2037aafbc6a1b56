# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A ROS domain of one's own, so that runs and tests do not hear each other."""

from contextlib import contextmanager
import random
import socket

LARGEST_DOMAIN = 101      # above it, the ports of a domain may be taken by outgoing connections
PARTICIPANTS = 8


@contextmanager
def own_domain():
    """
    Give the number of a ROS domain in which nobody on this machine takes part, while it lasts.

    :raises OSError: when every domain is in use.
    """
    domains = list(range(1, LARGEST_DOMAIN + 1))
    random.shuffle(domains)
    for domain in domains:
        claim = bound(claim_port(domain))
        if claim is None:
            continue
        with claim:
            if all(is_free(discovery_port(domain, i)) for i in range(PARTICIPANTS)):
                yield domain
                return
    raise OSError('every ROS domain is in use on this machine')


def claim_port(domain):
    """Return a port of a domain that DDS leaves free; who holds it has claimed the domain."""
    return 7400 + 250 * domain + 5


def discovery_port(domain, participant):
    """Return the unicast discovery port of a participant, DDSI-RTPS 9.6.1.1."""
    return 7400 + 250 * domain + 10 + 2 * participant


def bound(port):
    """Return a UDP socket bound to the port, None where the port is taken."""
    result = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        result.bind(('127.0.0.1', port))
    except OSError:
        result.close()
        return None
    return result


def is_free(port):
    """Return whether nobody is bound to a UDP port."""
    probe = bound(port)
    if probe:
        probe.close()
    return probe is not None
