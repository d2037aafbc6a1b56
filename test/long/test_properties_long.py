# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The property tests of ``test_properties``, at length."""

from properties import Tally
from test_properties import compare_with_the_page

from dm_ros.tools.progress import progress

CASES = 100_000


def test_no_random_differential_breaks_a_law_or_fails():
    tally = Tally()
    for n in progress(range(CASES), total=CASES, unit='case'):
        tally.run(n)
    print(f'\n{tally}')
    assert tally.cases == CASES


def test_the_page_on_the_power_flow_index_prints_all_that_it_says():
    compare_with_the_page(range(32))
