"""Exchange of points against designs whose optimum is known in closed form."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from toolkit.planning.exchange import Criterion, Exchange


def log_det(x: np.ndarray, degree: int) -> Criterion:
    """The D criterion of a polynomial, to be made small."""
    terms = np.vander(x, degree + 1, increasing=True)

    def criterion(points: tuple[int, ...]) -> float:
        sign, size = np.linalg.slogdet(terms[list(points)].T @ terms[list(points)])
        return math.exp(-float(size) / (degree + 1)) if sign > 0 else math.inf

    return criterion


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
    exchange = Exchange(log_det(x, degree), len(x))
    start = exchange.resized(range(len(x)), 2 * (degree + 1))
    best = exchange.improved(start)
    np.testing.assert_allclose(x[list(best)], np.repeat(points, 2), atol=1e-12)


def test_two_factors_at_two_levels_end_at_the_factorial() -> None:
    grid = np.array(list(itertools.product(np.linspace(-1, 1, 5), repeat=2)))
    terms = np.column_stack([np.ones(len(grid)), grid, grid[:, 0] * grid[:, 1]])

    def criterion(points: tuple[int, ...]) -> float:
        return 1 / max(float(np.linalg.det(terms[list(points)].T @ terms[list(points)])), 1e-30)

    exchange = Exchange(criterion, len(grid))
    best = exchange.improved(exchange.resized(range(len(grid)), 4))
    assert {tuple(point) for point in grid[list(best)]} == {(-1, -1), (-1, 1), (1, -1), (1, 1)}


def test_a_design_is_judged_once_in_whatever_order_its_points_stand() -> None:
    judged: list[tuple[int, ...]] = []

    def criterion(points: tuple[int, ...]) -> float:
        judged.append(points)
        return float(sum(points))

    exchange = Exchange(criterion, 3)
    assert exchange.value((2, 0, 1)) == exchange.value((0, 1, 2)) == 3.0
    assert judged == [(0, 1, 2)]


def test_no_size_is_too_large_for_the_candidates() -> None:
    exchange = Exchange(log_det(np.array([-1.0, 0.0, 1.0]), 1), 3)
    assert exchange.improved(exchange.resized((0,), 6)) == (0, 0, 0, 2, 2, 2)
