# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The whole table of doc/loss-laws.md."""

from test_loss_laws_page import CASES, compare_with_the_page

from dm_ros.tools.comparison import laws


def test_the_table_is_what_the_comparison_finds(monkeypatch):
    compare_with_the_page(monkeypatch, [case for case in CASES if case != laws.LOAD])
