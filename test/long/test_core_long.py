# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The core in C has the bits of Python, and many at once those of one, by the 100,000."""

from ensembles import runs_by_lanes
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


@pytest.mark.skipif(core.language != 'C', reason='the core in C is not built')
@pytest.mark.parametrize('loss_law', LOSS_LAWS)
@pytest.mark.parametrize('variant, clutched', [('symmetric_ode', False), ('symmetric_ode', True),
                                               ('lsd_ode', False)])
def test_how_many_go_at_once_changes_no_bit_on_random_mechanisms(variant, clutched, loss_law):
    for seed in progress(range(500)):
        first, *others = runs_by_lanes(variant, clutched, loss_law, seed)
        assert others and all(run == first for run in others), seed
