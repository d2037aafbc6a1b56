# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""How a command ends: each expected failure is one line and an exit code, each signal quiet."""

import signal
import sys

SIGNALS = (signal.SIGINT, signal.SIGTERM)
AGAIN = 0.001   # s, after which Python has left the __del__ that a signal met


class Signalled(BaseException):
    """A signal that ends the work of a command; ``number``: which."""

    def __init__(self, number):
        super().__init__(number)
        self.number = number


def interrupt(number, _):
    """End the work by an exception, so that no unfinished file stays behind."""
    ignore_signals()   # a second one shall not end the tidying up
    raise Signalled(number)


def interrupt_again(dropped):
    """Raise a ``Signalled`` again that Python has dropped, as ``sys.unraisablehook``."""
    if not isinstance(dropped.exc_value, Signalled):
        sys.__unraisablehook__(dropped)
        return
    number = dropped.exc_value.number

    def again(_, frame):
        while frame:
            if frame.f_code is interrupt_again.__code__:   # here it would be dropped too
                signal.setitimer(signal.ITIMER_REAL, AGAIN)
                return
            frame = frame.f_back
        if sys.unraisablehook is interrupt_again:   # the work has not ended by itself
            raise Signalled(number)
    signal.signal(signal.SIGALRM, again)
    signal.setitimer(signal.ITIMER_REAL, AGAIN)


def ignore_signals():
    """Let no signal disturb what is still to be done."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def run_command(name, work, written='stdout', *, expected=(OSError, ValueError), code=2,
                on_signal=interrupt, until_signal=False):
    """
    Do the work of a command and return its exit code.

    :param name: of the command; work: function without arguments.
    :param written: what the command writes to, named where an OSError names no file.
    :param expected: exceptions that are told in one line, with the exit code ``code``.
    :param on_signal: handler of SIGINT and SIGTERM.
    :param until_signal: whether a signal is how the command is meant to end: the exit code is 0
        then, and not 128 and its number.
    """
    # a background job of a script shall go on to ignore what its shell lets it ignore
    before = {number: signal.signal(number, on_signal) for number in SIGNALS
              if until_signal or signal.getsignal(number) != signal.SIG_IGN}
    hook, sys.unraisablehook = sys.unraisablehook, interrupt_again
    try:
        work()
    except Signalled as error:
        return 0 if until_signal else 128 + error.number
    except BrokenPipeError:   # as when a pager was left
        return 128 + signal.SIGPIPE
    except expected as error:
        print(f'{name}: error:', in_one_line(error, written), file=sys.stderr)
        return code
    finally:
        sys.unraisablehook = hook
        if until_signal:
            ignore_signals()   # all is done, but the interpreter has still to end
        else:
            for number, handler in before.items():
                signal.signal(number, handler)
    return 0


def in_one_line(error, written):
    """Return what an exception tells; one of the system names a file."""
    if isinstance(error, OSError) and error.strerror:
        error = f'{error.filename or written}: {error.strerror}'
    return ' '.join(filter(None, map(str.strip, str(error).splitlines())))
