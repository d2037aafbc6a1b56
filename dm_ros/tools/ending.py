# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""How a command-line tool ends: every expected failure is one line and an exit code."""

import signal
import sys


def run_tool(name, work, written):
    """
    Do the work of a tool and return its exit code.

    SIGTERM ends the work by an exception, so that no unfinished file stays behind.

    :param name: of the tool; work: function without arguments that raises ValueError or OSError
        where it cannot be done.
    :param written: what the tool writes to, named where the error names no file.
    """
    before = signal.signal(signal.SIGTERM, lambda number, _: sys.exit(128 + number))
    try:
        work()
    except KeyboardInterrupt:
        return 128 + signal.SIGINT
    except BrokenPipeError:   # as when a pager was left
        return 128 + signal.SIGPIPE
    except OSError as error:
        return failed(name, f'{error.filename or written}: {error.strerror}')
    except ValueError as error:
        return failed(name, error)
    finally:
        signal.signal(signal.SIGTERM, before)
    return 0


def failed(name, error):
    """Report an error in one line and return the exit code."""
    print(f'{name}: error:', ' '.join(str(error).splitlines()), file=sys.stderr)
    return 2
