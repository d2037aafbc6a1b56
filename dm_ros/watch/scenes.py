# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The scenes of all kinds of nodes that are shown, and which of them a node has."""

from dm_ros.driveline_plant import all_rows
from dm_ros.settings import known_rows
from dm_ros.watch.car import CarScene
from dm_ros.watch.scene import Scene


def scene_of(name, values):
    """
    Return the scene of a node: of a ``driveline`` where it has a layout, else a differential's.

    :param name: full name of the node; values: its parameters, ``{full name: value}``.
    :raises ValueError: for parameters that this version does not know or cannot have.
    """
    return (CarScene if 'layout' in values else Scene)(name, values)


def known_names():
    """Return the full names of all parameters that a scene is made of."""
    return known_rows().keys() | all_rows().keys()
