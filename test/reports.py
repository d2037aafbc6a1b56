# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What the tests read in /diagnostics."""


def told(diagnostics, part='torques', node='/differential'):
    """Return the newest status of a part of a node as (level, message, values)."""
    for status in (s for message in reversed(diagnostics) for s in message.status):
        if status.name == f'{node}: {part}':
            return status.level, status.message, {v.key: v.value for v in status.values}
    return None, '', {}
