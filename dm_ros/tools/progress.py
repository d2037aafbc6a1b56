# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A progress bar for the tools."""

from tqdm import tqdm


def progress(iterable=None, total=None, unit='tick', initial=0):
    """Return a bar on stderr; it shows on a terminal alone, after a second, for a known total."""
    return tqdm(iterable, total=total, initial=initial, unit=unit, unit_scale=True, delay=1.0,
                leave=False, dynamic_ncols=True, disable=True if total is None else None)
