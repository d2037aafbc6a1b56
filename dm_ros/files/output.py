# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Files that are whole or not there."""

from contextlib import contextmanager, suppress
import os


def remove_unfinished(path):
    """Remove what a process that was killed left of a file that it wrote by ``replacing``."""
    folder, name = os.path.split(os.path.realpath(path))
    for one in os.listdir(folder):
        middle = one.removeprefix(f'.{name}.').removesuffix('.part')
        if one == f'.{name}.{middle}.part' and middle.isdigit():
            os.unlink(os.path.join(folder, one))


@contextmanager
def replacing(path, mode):
    """
    Open a file that takes the place of ``path`` in the end, but only if all went well.

    What is no ordinary file, such as /dev/stdout or a pipe, is written to as it is.
    """
    path = os.fspath(path)
    if path.startswith('/dev/') or os.path.exists(path) and not os.path.isfile(path):
        try:
            with open(path, mode) as file:
                yield file
        except OSError as error:
            if error.filename is None:   # as of a full disk: of this file, not of one around it
                raise OSError(error.errno, error.strerror, path) from None
            raise
        return
    folder, name = os.path.split(os.path.realpath(path))
    unfinished = os.path.join(folder, f'.{name}.{os.getpid()}.part')
    try:   # from before it is there, since a signal may come at any moment
        with open(unfinished, mode) as file:
            yield file
        os.replace(unfinished, os.path.join(folder, name))
    except BaseException as error:
        with suppress(OSError):
            os.unlink(unfinished)
        # a full disk names no file, a folder that takes none that of ours
        if isinstance(error, OSError) and error.filename in (None, unfinished):
            raise OSError(error.errno, error.strerror, path) from None
        raise
