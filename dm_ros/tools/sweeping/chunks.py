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
import re
import shutil

import numpy as np

from dm_ros.files.output import replacing

MANIFEST = 'study.json'
OURS = re.compile(rf'{re.escape(MANIFEST)}|[0-9]{{8,}}\.doubles')
UNFINISHED = re.compile(rf'\.({OURS.pattern})\.[0-9]+\.part')   # see ``replacing``


@contextmanager
def chunks_of(folder, description, width):
    """
    Give the ``Chunks`` in a folder to this process alone.

    :param description: what makes it this study, as plain data; width: columns of a chunk.
    :raises ValueError: where the chunks there are those of another study, or another process is
        at work in the folder.
    """
    if os.path.islink(folder) or os.path.exists(folder) and not os.path.isdir(folder):
        raise ValueError(f'{folder}: it must be a folder of its own for what is done; remove it, '
                         'or name another --out')
    os.makedirs(folder, exist_ok=True)
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise ValueError(f'{folder}: another sweep is at work there') from None
        manifest = os.path.join(folder, MANIFEST)
        description = json.loads(json.dumps(description))
        for name in os.listdir(folder):   # what a kill left of a file that was being written
            if UNFINISHED.fullmatch(name):
                os.unlink(os.path.join(folder, name))
        others = [name for name in os.listdir(folder) if not OURS.fullmatch(name)]
        if others:
            raise ValueError(f'{folder}: {others[0]} in it is not of a sweep; remove the folder, '
                             'or name another --out')
        if any(name != MANIFEST for name in os.listdir(folder)):
            _check_same(folder, _read(manifest), description)
        else:   # nothing is done there
            _write(manifest, json.dumps(description, indent=1).encode())
        yield Chunks(folder, width)
    finally:
        os.close(handle)


def _read(manifest):
    try:
        with open(manifest, encoding='utf-8') as file:
            return dict(json.load(file))
    except (OSError, ValueError) as error:
        raise ValueError(f'{manifest}: it does not tell which study is done there ({error}); '
                         'remove the folder, or name another --out') from None


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

    def has(self, number, size):
        """Return whether a chunk of so many sets is done."""
        try:
            return os.path.getsize(self._path(number)) == 8 * self._width * size
        except FileNotFoundError:
            return False

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
