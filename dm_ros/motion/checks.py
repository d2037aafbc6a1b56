# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What a caller hands over, as numbers, or a ValueError that names what is wrong."""

import math

from dm_ros.mechanism.variants import PORT_TABLES


def checked_ports(ports, inputs):
    """
    Return ``{shaft: (stiffness, damping)}`` as floats; raise ValueError that names what is wrong.

    :param inputs: names of the shafts that may have a speed port.
    """
    result = {}
    try:
        ports = dict(ports)
    except (TypeError, ValueError):
        raise ValueError(f'ports: {ports!r} must be {{shaft: (stiffness, damping)}}') from None
    for shaft, pair in ports.items():
        if shaft not in inputs:
            raise ValueError(f'ports: {shaft!r} is not one of {", ".join(inputs)}')
        try:
            stiffness, damping = pair
        except (TypeError, ValueError):
            raise ValueError(f'ports: {shaft}: {pair!r} must be two numbers, stiffness and '
                             'damping') from None
        table = PORT_TABLES[shaft](stiffness=stiffness, damping=damping)
        result[shaft] = table.stiffness, table.damping
    return result


def numbers_for(what, values, ports):
    """Return values as floats, as many as there are ports; raise ValueError that names them."""
    try:
        numbers = tuple(map(float, values))
        fits = len(numbers) == len(ports)
    except (TypeError, ValueError, OverflowError):
        fits = False
    if not fits:
        raise ValueError(f'{what}: {values!r} must be {len(ports)} numbers, '
                         f'for {", ".join(port.name for port in ports)}')
    return numbers


def refuse(what, values, ports):
    """Raise ValueError where a port does not take its value."""
    for port, value in zip(ports, values):
        if refusal := port.refusal(value):
            raise ValueError(f'{what}: {refusal}')


def checked(name, value, fits, allowed):
    """Return the value as a finite float that fits; raise ValueError that names it."""
    try:
        number = float(value)
        good = not isinstance(value, (bool, str)) and math.isfinite(number) and fits(number)
    except (TypeError, ValueError, OverflowError):
        good = False
    if not good:
        raise ValueError(f'{name}: {value!r} is not allowed, it must be {allowed}')
    return number
