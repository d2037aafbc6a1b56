# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What of a parameter file a tool does not use is told, not passed over in silence."""

import sys

from dm_ros.files.parameter_file import missing, NODE
from dm_ros.settings import passed_over


def warn(tool, path, values, *mechanisms, node=NODE):
    """
    Tell on stderr, in a line each, that a file is for other nodes, and what for other mechanisms.

    :param path: of the file, None without one; values: what it gave.
    :param mechanisms: those that the tool uses; node: full name of the node that it reads for.
    """
    if path:
        for line in filter(None, (missing(path, node), passed_over(values, *mechanisms))):
            print(f'{tool}: warning: {line}', file=sys.stderr)
