# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What a command line gives to nodes that are not there: ROS passes over it in silence."""

import re

from dm_ros.files.parameter_file import is_for_node, missing

FOR_A_NODE = re.compile(r'([^:=]+):[^:=]+:=')   # as in -p rear:rate:=100.0


def strays(args, node):
    """
    Return, in a line each, the files and parameters of a command line that are for others alone.

    :param node: full name of the node that it starts.
    """
    lines, words = [], iter(ros_arguments(args))
    for word in words:
        if word == '--params-file':
            lines.append(missing_in(next(words, ''), node))
        elif word in ('-p', '--param'):
            given = next(words, '')
            if (match := FOR_A_NODE.match(given)) and not is_for_node(match[1], node):
                lines.append(f'-p {given}: it is not for {node}, but for /{match[1]}')
    return list(filter(None, lines))


def ros_arguments(args):
    """Return what of a command line is for ROS: from --ros-args to -- or its end, any times."""
    found, is_ros = [], False
    for word in args:
        is_ros = word == '--ros-args' or is_ros and word != '--'
        if is_ros:
            found.append(word)
    return found


def missing_in(path, node):
    """Return ``missing`` of a file that ROS has read, None where it cannot be read here."""
    try:
        return missing(path, node)
    except ValueError:
        return None
