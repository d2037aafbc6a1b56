# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The table of doc/loss-laws.md is what the comparison of both laws finds; all of it in ``long``.

Its rows come from ``laws.run`` at the defaults: 10 s of the reference load of each mechanism, and
the cases of ``laws.CASES`` for their whole time, at 1 kHz, with the books of each tick. So its
columns are, of the ``Outcome`` of a row:

in, J              ``energy_in``: the work of each torque in each tick, summed where it is positive
out, J             ``energy_out``: the same where it is negative, as a positive number
given back, J      ``returned``: the loss of each gear and bearing in each tick, summed where it is
                   negative, as a positive number
in ticks, %        the share of ticks in which ``returned`` is not zero
carrier, rad/s     ``carrier`` at the end of the last tick
"""

from pathlib import Path
import re

import numpy as np
import pytest

from dm_ros.mechanism.variants import MECHANISMS
from dm_ros.tools.comparison import laws
from dm_ros.tools.comparison.runs import Load

PAGE = (Path(__file__).parents[1] / 'doc' / 'loss-laws.md').read_text()
ROW = re.compile(r'^\| `(\w+)` \| ([a-z ]+) \| `(\w+)` \| (.*) \|$', re.MULTILINE)
CASES = ('rest', 'weight', 'cruise', 'drive cycle', laws.LOAD)
CHATTER = 100   # switches of the index: beyond, the last bits of the machine move the numbers


def rows_of_the_page():
    """Return ``{(variant, case, law): numbers}``."""
    return {row[:3]: [float(cell.replace(',', '')) for cell in row[3].split(' | ')]
            for row in ROW.findall(PAGE)}


def columns(outcome):
    """Return the numbers of a row."""
    given = np.count_nonzero(outcome.returned) / len(outcome.returned)
    return [outcome.energy_in, outcome.energy_out, outcome.returned.sum(), 100.0 * given,
            outcome.carrier[-1]]


def compare_with_the_page(monkeypatch, cases):
    """Run these cases and the reference load and compare them with their rows."""
    monkeypatch.setattr(laws, 'CASES', {name: laws.CASES[name] for name in cases})
    said, seen = rows_of_the_page(), 0
    for mechanism in MECHANISMS.values():
        for case, outcomes in laws.run(
                mechanism, Load(mechanism, 10.0), {}, lambda n: None).items():
            for outcome in outcomes:
                row = mechanism.variant, case, outcome.law
                share = 0.02 if outcome.switches > CHATTER else 1e-4
                units = 1.0, 1.0, 1.0, 1.0, 0.01   # of the last digit
                for got, number, unit in zip(columns(outcome), said[row], units, strict=True):
                    assert got == pytest.approx(number, rel=share, abs=unit), row
                seen += 1
    assert seen == 2 * 2 * (1 + len(cases))


def test_the_table_has_each_case_of_both_mechanisms_under_both_laws():
    assert list(rows_of_the_page()) == [
        (mechanism.variant, case, law) for mechanism in MECHANISMS.values() for case in CASES
        for law in laws.LOSS_LAWS]


def test_the_rows_of_the_reference_loads_are_what_the_comparison_finds(monkeypatch):
    compare_with_the_page(monkeypatch, [])
