# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Files that are whole or not there."""

from contextlib import contextmanager
import os


@contextmanager
def replacing(path, mode):
    """
    Open a file that takes the place of ``path`` in the end, but only if all went well.

    What is no ordinary file, such as /dev/stdout or a pipe, is written to as it is.
    """
    path = os.fspath(path)
    if path.startswith('/dev/') or os.path.exists(path) and not os.path.isfile(path):
        with open(path, mode) as file:
            yield file
        return
    folder, name = os.path.split(os.path.realpath(path))
    unfinished = os.path.join(folder, f'.{name}.{os.getpid()}.part')
    try:
        file = open(unfinished, mode)
    except OSError as error:
        raise OSError(error.errno, error.strerror, path) from None
    try:
        with file:
            yield file
        os.replace(unfinished, os.path.join(folder, name))
    except BaseException as error:
        os.unlink(unfinished)
        if isinstance(error, OSError) and error.filename is None:   # as on a full disk
            raise OSError(error.errno, error.strerror, path) from None
        raise
