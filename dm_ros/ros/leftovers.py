# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Shared memory of DDS that processes leave behind that were killed."""

import fcntl
import os
import re
import time

SEGMENT_LOCK = re.compile(r'fastrtps_[0-9a-f]{16}_el')
SETTLED = 5.0   # s, younger ones may belong to a process that is just about to lock them


def remove_leftovers(folder='/dev/shm'):
    """
    Remove the segments of Fast DDS that nobody owns, as ``fastdds shm clean`` does.

    Fast DDS keeps the lock of a segment as long as its owner lives, and never removes that of
    another process: half a megabyte for each that was killed.
    """
    try:
        names = os.listdir(folder)
    except OSError:   # another system keeps them elsewhere
        return
    for name in filter(SEGMENT_LOCK.fullmatch, names):
        path = os.path.join(folder, name)
        try:
            with open(path) as file:
                if time.time() - os.fstat(file.fileno()).st_mtime < SETTLED:
                    continue
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                os.unlink(path.removesuffix('_el'))
                os.unlink(path)
        except OSError:   # somebody owns it, or is faster, or it is another user's
            continue
