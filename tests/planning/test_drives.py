"""Courses keep their ends, their pace and their start; what a move cannot reach it leaves out."""

from __future__ import annotations

import math

import numpy as np
import pytest

from toolkit.planning.drives import Drive, Pace, driven, fastest

T = np.linspace(0.0, 40.0, 8001)
ENDS = (-2.0, 2.0)
FREE = Pace(rate=1e6)
COURSES = [
    Drive(cycles=cycles, levels=levels, swept=swept, rests=rests)
    for cycles in (0.5, 2.0, 8.0)
    for levels in (2, 3, 5, 9)
    for swept in (False, True)
    for rests in (False, True)
]


@pytest.mark.parametrize("drive", COURSES, ids=str)
@pytest.mark.parametrize("pace", [FREE, Pace(rate=0.7), Pace(rate=3.0, acceleration=0.4)], ids=str)
def test_a_course_keeps_its_ends_its_start_and_its_pace(drive: Drive, pace: Pace) -> None:
    column = driven(T, drive, 0.5, ENDS, pace)
    assert column[0] == 0.5
    assert ENDS[0] - 1e-12 <= column.min() <= column.max() <= ENDS[1] + 1e-12
    rate = np.gradient(column, T)
    if pace.rate < 1e3:
        assert np.abs(rate).max() <= pace.rate * (1 + 1e-6)
    if math.isfinite(pace.acceleration):
        # Of a second difference: a move begins and ends within a row.
        assert np.abs(np.gradient(rate, T)).max() <= pace.acceleration * 1.01
    assert fastest(T, column) <= pace.rate * (1 + 1e-6)


@pytest.mark.parametrize(("levels", "cycles"), [(2, 4), (3, 2), (5, 1), (9, 0.5)])
def test_a_course_that_rests_holds_each_of_its_levels_and_no_others(levels: int, cycles: float) -> None:
    column = driven(T, Drive(cycles=cycles, levels=levels), 0.0, ENDS, FREE)
    values, counts = np.unique(np.round(column, 9), return_counts=True)
    held = values[counts > 100]
    np.testing.assert_allclose(held, np.linspace(*ENDS, levels), atol=1e-9)
    turns = np.flatnonzero(np.diff(np.sign(np.diff(column[np.flatnonzero(np.diff(column))]))))
    assert len(turns) <= math.ceil(2 * cycles)


def test_without_rest_an_input_goes_slowly_through_zero() -> None:
    column = driven(T, Drive(cycles=0.5, levels=2, rests=False), -2.0, ENDS, FREE)
    assert column[-1] == pytest.approx(2.0)
    rate = np.abs(np.gradient(column, T))
    # Of least jerk: 15/8 of the mean rate at most, and no slower way there is in the time.
    assert rate.max() == pytest.approx(15 / 8 * 4.0 / 20.0, rel=1e-3)


def test_a_swept_course_goes_ever_faster() -> None:
    column = driven(T, Drive(cycles=4.0, levels=2, swept=True, rests=False), 0.0, ENDS, FREE)
    crossings = T[np.flatnonzero(np.diff(np.sign(column + 1e-9)))]
    assert (np.diff(np.diff(crossings)) < 0).all()


def test_what_is_too_far_for_the_time_is_left_out() -> None:
    # 17 moves at 0.1 a second: from the start to one end, and to and fro.
    slow = driven(T, Drive(cycles=8.0, levels=2), 0.0, ENDS, Pace(rate=0.1))
    whole = 2.0 + 16 * 4.0
    assert np.abs(np.diff(slow)).sum() == pytest.approx(0.1 * 40.0 / (15 / 8), rel=1e-6)
    assert np.ptp(slow) == pytest.approx(4.0 / whole * 0.1 * 40.0 / (15 / 8), rel=1e-6)
    np.testing.assert_array_equal(
        driven(T, Drive(cycles=1.0), 0.3, ENDS, Pace(rate=0.0)), np.full(len(T), 0.3)
    )


def test_every_level_is_reached_where_the_whole_way_takes_less_than_the_time() -> None:
    # From the upper end down to the lower and up again: 12 in 40 s, as nearly half of it as may be.
    column = driven(T, Drive(cycles=1.0, levels=5), 2.0, ENDS, Pace(rate=12.0 * (15 / 8) / 39.0))
    assert (column.min(), column.max()) == pytest.approx(ENDS)


@pytest.mark.parametrize(("rate", "acceleration"), [(2.0, math.inf), (2.0, 3.0), (9.0, 0.5)])
def test_the_shortest_time_and_the_farthest_way_are_inverse(rate: float, acceleration: float) -> None:
    pace = Pace(rate=rate, acceleration=acceleration)
    for seconds in (0.01, 0.5, 7.0):
        assert pace.shortest(pace.farthest(seconds)) == pytest.approx(seconds)


def test_the_rate_is_that_of_the_input_and_not_that_of_its_noise() -> None:
    t = np.linspace(0.0, 40.0, 4001)
    slow = 5.0 * np.sin(2 * np.pi * 0.1 * t)
    noisy = slow + np.random.default_rng(1).normal(0, 0.02, len(t))
    true = 5.0 * 2 * np.pi * 0.1
    assert fastest(t, slow) == pytest.approx(true, rel=0.02)
    assert fastest(t, noisy) == pytest.approx(true, rel=0.15)
    assert np.abs(np.gradient(noisy, t)).max() > 2 * true
    step = (t > 20).astype(float)
    assert fastest(t, step) == pytest.approx(1 / (t[1] - t[0]))
    assert fastest(t, np.zeros(len(t))) == 0.0
