"""Exchange of points against designs whose optimum is known in closed form."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from toolkit.planning.exchange import (
    Alternatives,
    Points,
    PointSearch,
    best_of,
    exchanged,
    grown,
    is_less,
    shrunk,
)
from toolkit.planning.row_exchange import CRITERIA, Criterion, criterion

Losses = Callable[[Sequence[Points]], NDArray[np.float64]]


def of_each(loss: Callable[[Points], float]) -> Losses:
    return lambda designs: np.array([loss(design) for design in designs])


def log_det(x: np.ndarray, degree: int) -> Losses:
    """The D criterion of a polynomial, to be made small."""
    terms = np.vander(x, degree + 1, increasing=True)

    def loss(points: Points) -> float:
        sign, size = np.linalg.slogdet(terms[list(points)].T @ terms[list(points)])
        return math.exp(-float(size) / (degree + 1)) if sign > 0 else math.inf

    return of_each(loss)


# Guest (1958): the D-optimal points of a polynomial on [-1, 1] are the ends and the zeros of the
# derivative of the Legendre polynomial of its degree, each as often.
@pytest.mark.parametrize(
    ("degree", "points"),
    [
        (1, [-1, 1]),
        (2, [-1, 0, 1]),
        (3, [-1, -math.sqrt(1 / 5), math.sqrt(1 / 5), 1]),
        (4, [-1, -math.sqrt(3 / 7), 0, math.sqrt(3 / 7), 1]),
    ],
)
def test_polynomials_are_measured_at_the_points_of_guest(degree: int, points: list[float]) -> None:
    x = np.unique(np.concatenate([np.linspace(-1, 1, 21), points]))
    exchange = PointSearch(log_det(x, degree), len(x))
    start = exchange.resized(range(len(x)), 2 * (degree + 1))
    best = exchange.improved(start)
    np.testing.assert_allclose(x[list(best)], np.repeat(points, 2), atol=1e-12)


def test_two_factors_at_two_levels_end_at_the_factorial() -> None:
    grid = np.array(list(itertools.product(np.linspace(-1, 1, 5), repeat=2)))
    terms = np.column_stack([np.ones(len(grid)), grid, grid[:, 0] * grid[:, 1]])

    def loss(points: Points) -> float:
        return 1 / max(float(np.linalg.det(terms[list(points)].T @ terms[list(points)])), 1e-30)

    exchange = PointSearch(of_each(loss), len(grid))
    best = exchange.improved(exchange.resized(range(len(grid)), 4))
    assert {tuple(point) for point in grid[list(best)]} == {(-1, -1), (-1, 1), (1, -1), (1, 1)}


def test_a_design_is_judged_once_in_whatever_order_its_points_stand() -> None:
    judged: list[tuple[int, ...]] = []

    def loss(points: Points) -> float:
        judged.append(points)
        return float(sum(points))

    exchange = PointSearch(of_each(loss), 3)
    assert exchange.loss((2, 0, 1)) == exchange.loss((0, 1, 2)) == 3.0
    assert judged == [(0, 1, 2)]


def test_no_size_is_too_large_for_the_candidates() -> None:
    exchange = PointSearch(log_det(np.array([-1.0, 0.0, 1.0]), 1), 3)
    assert exchange.improved(exchange.resized((0,), 6)) == (0, 0, 0, 2, 2, 2)


@pytest.mark.parametrize("by", CRITERIA)
@pytest.mark.parametrize("size", [3, 4, 5, 6])
def test_from_a_few_starts_the_best_of_all_designs_is_found(by: Criterion, size: int) -> None:
    """A quadratic with unlike variances on seven levels: every multiset of a size is looked at."""
    x = np.linspace(-1, 1, 7)
    terms = np.vander(x, 3) / np.sqrt(1 + 0.7 * x**2 + 0.3 * x)[:, None]

    def loss(points: Points) -> float:
        information = terms[list(points)].T @ terms[list(points)]
        if np.linalg.matrix_rank(information, hermitian=True) < 3:
            return math.inf
        return criterion(np.asarray(np.linalg.inv(information)), np.vander(x, 3), by)

    search, rng = PointSearch(of_each(loss), len(x)), np.random.default_rng(3)
    best = search.best(rng.integers(len(x), size=size).tolist() for _ in range(6))
    least = min(loss(design) for design in itertools.combinations_with_replacement(range(len(x)), size))
    assert search.loss(best) == pytest.approx(least, rel=1e-9)


def test_no_exchange_makes_a_design_worse_than_its_start() -> None:
    """Losses drawn at random have many ends; each is no better by any exchange of one part."""
    table = np.random.default_rng(11).normal(size=(4, 4, 4))

    def alternatives(design: tuple[int, ...], part: int) -> Alternatives[tuple[int, ...]]:
        def with_level(level: int) -> tuple[int, ...]:
            return (*design[:part], level, *design[part + 1 :])

        losses = np.array([table[with_level(level)] for level in range(4)])
        return Alternatives(losses=losses, present=design[part], design=with_level)

    def search(start: tuple[int, ...]) -> tuple[int, ...]:
        return exchanged(start, alternatives, lambda: range(3))

    starts = list(itertools.product(range(4), repeat=3))
    for start in starts:
        end = search(start)
        assert table[end] <= table[start]
        assert all(table[end] <= alternatives(end, part).losses.min() for part in range(3))
    assert table[best_of(starts, search, lambda end: float(table[end]))] == table.min()


def test_a_sweep_that_is_counted_ends_the_search() -> None:
    asked: list[int] = []

    def alternatives(design: int, part: int) -> Alternatives[int]:
        asked.append(part)
        return Alternatives(losses=np.array([-design, -design - 1.0]), present=0, design=lambda _: design + 1)

    assert exchanged(0, alternatives, lambda: range(2), sweeps=3) == 6
    assert asked == [0, 1, 0, 1, 0, 1]


def test_what_is_gained_by_rounding_is_no_gain() -> None:
    assert not is_less(5.0 - 1e-12, 5.0)
    assert not is_less(-1e6 - 1e-5, -1e6)
    assert is_less(-1e6 - 1.0, -1e6)
    assert not is_less(math.inf, math.inf)


def test_points_are_added_while_they_help_and_dropped_while_nothing_is_lost() -> None:
    """A set cover: 0 covers most, but 1 and 2 cover all without it."""
    covers = [{1, 2, 3, 4}, {1, 2, 5}, {3, 4, 6}, {1}]

    def uncovered(points: Points) -> float:
        return -float(len(set().union(*(covers[point] for point in points))))

    assert grown((), range(4), uncovered) == (0, 1, 2)
    assert shrunk((0, 1, 2, 3), uncovered) == (1, 2)
    assert grown((), range(4), uncovered, size=5)[:1] == (0,)
    assert len(shrunk((0, 1, 2), uncovered, size=1)) == 1
    assert grown((), (), uncovered) == ()
