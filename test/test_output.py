# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Files that are whole or not there, whatever the moment of a signal."""

import sys

import pytest

from dm_ros.ending import Signalled
from dm_ros.files import output
from dm_ros.files.output import replacing


def write(path, moment):
    """Write the file, with a signal before the instruction number ``moment`` of the writer."""
    seen = 0

    def trace(frame, event, _):
        nonlocal seen
        if frame.f_code.co_filename != output.__file__:
            return None
        frame.f_trace_opcodes = True
        if event == 'opcode':
            seen += 1
            if seen == moment:
                sys.settrace(None)
                raise Signalled(15)
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        with replacing(path, 'w') as file:
            file.write('new')
    finally:
        sys.settrace(before)
    return seen


def test_a_signal_at_any_moment_leaves_the_old_file_or_the_new_one(tmp_path):
    path = tmp_path / 'OUT.csv'
    path.write_text('old')
    instructions = write(path, None)
    assert path.read_text() == 'new' and instructions > 50
    found = set()
    for moment in range(1, instructions + 1):
        path.write_text('old')
        with pytest.raises(Signalled):
            write(path, moment)
        assert list(tmp_path.iterdir()) == [path]
        found.add(path.read_text())
    assert found == {'old', 'new'}
