# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The core in C has the bits of Python, by the 100,000."""

from properties import Twins
import pytest

from dm_ros import core
from dm_ros.motion.models import LOSS_LAWS
from dm_ros.tools.progress import progress


@pytest.mark.skipif(core.language != 'C', reason='the core in C is not built')
@pytest.mark.parametrize('ported', [False, True])
@pytest.mark.parametrize('clutched', [False, True])
@pytest.mark.parametrize('loss_law', LOSS_LAWS)
def test_c_and_python_give_the_same_bits_on_random_mechanisms(loss_law, clutched, ported):
    twins = Twins(loss_law, clutched, ported)
    for n in progress(range(50_000)):
        twins.run(n)
    print(twins)
