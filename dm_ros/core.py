# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The ticks in C, where they are built: ``language`` is what is in use, ``'C'`` or ``'Python'``.

Both give the same bits; Python is the reference, and what is left where there was no compiler.
The environment variable ``DM_ROS_CORE`` chooses, ``c`` or ``python``; without it C is taken where
it is built. In C are whole ticks of both mechanisms under both laws, on torques, with their books;
the steps with half-shafts, with theirs; and the passive law at one state, for drivelines.
"""

from importlib import import_module
import os

CHOICE = 'DM_ROS_CORE'


def _chosen(choice):
    if choice not in ('', 'c', 'python'):
        raise ImportError(f'{CHOICE}: {choice!r} is not one of c, python')
    if choice != 'python':
        try:
            return import_module('dm_ros._core')
        except ImportError as error:
            if choice == 'c':
                raise ImportError(f'{CHOICE}: c is not built here: {error}') from None
    return None


_module = _chosen(os.environ.get(CHOICE, ''))
language = 'C' if _module else 'Python'
Ticker = getattr(_module, 'Ticker', None)   # None where Python does it
coupled_step = getattr(_module, 'coupled_step', None)   # likewise, and so are these
passive_point = getattr(_module, 'passive_point', None)
passive_slopes = getattr(_module, 'passive_slopes', None)
passive_lost = getattr(_module, 'passive_lost', None)
