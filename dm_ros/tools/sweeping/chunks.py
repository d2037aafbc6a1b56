# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The chunks of a sweep on disk: what is there after a kill -9 is whole, and is not computed again.

A folder beside the result has a file that says which study it is, and one for each chunk that is
done, written under another name, flushed to the disk and renamed.
"""

from contextlib import contextmanager
import fcntl
import json
import os
import shutil

import numpy as np

from dm_ros.files.output import replacing

MANIFEST = 'study.json'


@contextmanager
def chunks_of(folder, description, width):
    """
    Give the ``Chunks`` in a folder to this process alone.

    :param description: what makes it this study, as plain data; width: columns of a chunk.
    :raises ValueError: where the chunks there are those of another study, or another process is
        at work in the folder.
    """
    os.makedirs(folder, exist_ok=True)
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise ValueError(f'{folder}: another sweep is at work there') from None
        manifest = os.path.join(folder, MANIFEST)
        description = json.loads(json.dumps(description))
        if os.path.exists(manifest):
            with open(manifest, encoding='utf-8') as file:
                _check_same(folder, json.load(file), description)
        else:
            _write(manifest, json.dumps(description, indent=1).encode())
        yield Chunks(folder, width)
    finally:
        os.close(handle)


def _check_same(folder, before, now):
    changed = [key for key in {**before, **now} if before.get(key) != now.get(key)]
    if changed:
        raise ValueError(f'{folder}: what is done there is of another study, which differs in '
                         f'{", ".join(changed)}; remove the folder, or name another --out')


class Chunks:
    """The chunks that are done."""

    def __init__(self, folder, width):
        self._folder, self._width = folder, width

    def _path(self, number):
        return os.path.join(self._folder, f'{number:08d}.doubles')

    def has(self, number):
        """Return whether a chunk is done."""
        return os.path.exists(self._path(number))

    def load(self, number):
        """Return the array of a chunk."""
        return np.fromfile(self._path(number), '<f8').reshape(-1, self._width)

    def save(self, number, table):
        """Keep the array of a chunk."""
        _write(self._path(number), table.astype('<f8').tobytes())

    def remove(self):
        """Remove the folder."""
        shutil.rmtree(self._folder)


def _write(path, content):
    """Write bytes so that after any crash the file is whole or not there."""
    with replacing(path, 'wb') as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    handle = os.open(os.path.dirname(path), os.O_RDONLY)
    try:
        os.fsync(handle)   # the new name, too
    finally:
        os.close(handle)
