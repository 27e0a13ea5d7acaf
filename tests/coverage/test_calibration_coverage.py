"""A small seeded part of the coverage of calibration sessions: intervals hold as often as they say."""

from __future__ import annotations

import pytest
from scipy.stats import binom

from tests.coverage.calibration import Drawn, rows_of_cell

REPETITIONS = 40
EASIER = pytest.mark.campaign(
    "runs that are alike: those with zeros and gains of their own hold in every run"
)
CASES = (
    pytest.param(Drawn(runs=3, scatter=5e-4, run_effects=False, correlated=False), marks=EASIER),
    Drawn(runs=6, scatter=5e-5, run_effects=True, correlated=False),
)


@pytest.mark.parametrize("cell", CASES, ids=lambda cell: cell.text)
def test_intervals_hold_as_often_as_they_say(cell: Drawn) -> None:
    for row in rows_of_cell(cell, REPETITIONS, seed=11):
        # So few covered would be seen once in two thousand tries of an interval that covers 93 %.
        assert binom.cdf(row.covered, row.n, 0.93) > 5e-4, row
        assert row.median_width_ratio is not None
        assert row.median_width_ratio < 2.5, row
