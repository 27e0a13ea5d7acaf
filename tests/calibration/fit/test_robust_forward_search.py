"""Rows that contradict the others are found where up to a third is wrong; sound ones are left alone."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom

from tests.coverage.sound_rows import names_a_row, plane
from toolkit.calibration.fit.robust import RISK, contradicting


def test_a_masked_pair_at_the_end_of_a_line() -> None:
    rng = np.random.default_rng(8)
    x = np.concatenate([np.linspace(0, 5, 18), [7.0, 7.1]])
    y = 3 * x + rng.normal(0, 0.1, 20)
    y[18:] += 1.5
    assert contradicting(np.column_stack([x, np.ones(20)]), y) == (19, 20)


BETWEEN = pytest.mark.campaign(
    "sessions between the shortest and those of most terms, which hold in every run"
)


@pytest.mark.parametrize(
    ("rows", "terms", "sessions"),
    [
        (12, 2, 300),
        pytest.param(20, 4, 300, marks=BETWEEN),
        pytest.param(81, 4, 300, marks=BETWEEN),
        pytest.param(81, 8, 300, marks=BETWEEN),
        (120, 13, 15),
    ],
)
def test_sound_rows_are_named_at_the_stated_risk(rows: int, terms: int, sessions: int) -> None:
    """Of the largest a few; `make coverage` has as many of it as of the others."""
    named = sum(names_a_row(rows, terms, seed) for seed in range(sessions))
    # Twice the risk, for the search chooses among orders; one of a thousand runs of this test may miss.
    assert named <= binom.ppf(0.999, sessions, 2 * RISK)


@pytest.mark.parametrize(
    ("rows", "terms", "wrong"), [(20, 4, 6), (81, 4, 27), (81, 8, 27), (81, 13, 27), (120, 13, 40)]
)
def test_rows_at_the_end_of_an_axis_that_are_wrong_together_are_found(
    rows: int, terms: int, wrong: int
) -> None:
    for seed in range(10):
        design, load = plane(rows, terms, seed)
        at = np.argsort(-design[:, 0])[:wrong]
        load[at] += 40.0
        assert contradicting(design, load) == tuple(sorted((at + 1).tolist()))


def test_a_curve_is_no_contradiction() -> None:
    rng = np.random.default_rng(2)
    x = np.tile(np.linspace(0, 1, 11), 3)
    for curve in (1.0, 10.0, 50.0):
        y = 100 * x + curve * x * x + rng.normal(0, 0.3, 33)
        assert contradicting(np.column_stack([x, np.ones(33)]), y) == ()


def test_the_answer_does_not_depend_on_units_or_on_the_order_of_rows() -> None:
    design, load = plane(60, 4, 3)
    load[[5, 17, 40]] -= 30.0
    assert contradicting(design, load) == (6, 18, 41)
    assert contradicting(design * [1e3, 1e-3, 1, 1], load * 4.448) == (6, 18, 41)
    assert contradicting(design[::-1], load[::-1]) == (20, 43, 55)


def test_rows_of_rounding_and_too_few_rows_are_not_judged() -> None:
    x = np.arange(30.0)
    design = np.column_stack([x, np.ones(30)])
    load = 2 * x + 1
    load[4] += 1.0
    assert contradicting(design, load) == ()
    assert contradicting(design[:5], load[:5]) == ()


def test_loads_that_stand_apart_by_few_rows_are_no_contradiction() -> None:
    # Most rows load one axis alone: the half that agrees best knows nothing of the other.
    rng = np.random.default_rng(4)
    first = np.concatenate([rng.uniform(-1, 1, 40), np.zeros(12)])
    second = np.concatenate([np.zeros(40), rng.uniform(-1, 1, 12)])
    load = 300 * first + 50 * second + rng.normal(0, 0.1, 52)
    assert contradicting(np.column_stack([first, second, second**2, np.ones(52)]), load) == ()
