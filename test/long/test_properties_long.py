# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The property tests of ``test_properties``, at length."""

import numpy as np
from properties import check_state, RANDOM, Tally
import pytest
from test_properties import compare_with_the_page

from dm_ros.motion.models import LOSS_LAWS
from dm_ros.tools.progress import progress

CASES = 100_000


@pytest.mark.parametrize('clutched', [False, True])
@pytest.mark.parametrize('loss_law', LOSS_LAWS)
def test_no_random_differential_breaks_a_law_or_fails(loss_law, clutched):
    tally = Tally(loss_law, clutched)
    for n in progress(range(CASES), total=CASES, unit='case'):
        tally.run(n)
    print(f'\n{tally}')
    assert tally.cases == CASES


@pytest.mark.parametrize('kind', RANDOM)
def test_at_any_state_there_is_one_solution_that_loses_and_has_the_symmetries(kind):
    rng = np.random.default_rng(1)
    for _ in progress(range(CASES // 2), total=CASES // 2, unit='state'):
        check_state(rng, kind)


def test_the_page_on_the_power_flow_index_prints_all_that_it_says():
    compare_with_the_page(range(32))
