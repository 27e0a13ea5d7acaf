"""Designs of the literature are found again, and those that an enumeration shows to be the best."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from numpy.typing import NDArray

from toolkit.planning.row_exchange import Criterion, Response, exchange, loss


def plain(columns: NDArray[np.float64]) -> Response:
    """A response without effects of runs, predicted at all its candidates."""
    none = np.empty(0)
    return Response(
        common=columns, of_run=np.empty((len(columns), 0)), precision=np.zeros(columns.shape[1]),
        run_precision=none, targets=columns,
    )  # fmt: skip


def one_run(rows: int) -> NDArray[np.intp]:
    return np.zeros(rows, dtype=np.intp)


def quadratic(levels: tuple[float, ...] = (-1.0, 0.0, 1.0)) -> NDArray[np.float64]:
    """The full quadratic in two factors: 1, x, y, xy, x^2, y^2 on a grid."""
    points = np.array(list(itertools.product(levels, repeat=2)))
    x, y = points.T
    return np.column_stack([np.ones(len(x)), x, y, x * y, x * x, y * y])


# The largest determinants of matrices of -1 and 1 (Hadamard's problem, OEIS A003433): the best saturated
# two-level designs. n = 4 and 8 are the fractional factorials 2^(3-1) and 2^(7-4).
@pytest.mark.parametrize(("n", "largest"), [(2, 2), (3, 4), (4, 16), (5, 48), (6, 160), (7, 576), (8, 4096)])
def test_saturated_two_level_designs_have_the_largest_determinant(n: int, largest: int) -> None:
    factors = np.array(list(itertools.product((-1.0, 1.0), repeat=n - 1)))
    response = plain(np.column_stack([np.ones(len(factors)), factors]))
    chosen = exchange([response], one_run(n), "D", np.random.default_rng(1), starts=12)
    assert abs(np.linalg.det(response.common[chosen])) == pytest.approx(largest, rel=1e-9)


def test_twelve_runs_of_eleven_factors_reach_plackett_and_burman() -> None:
    """Biometrika 33 (1946) 305: X'X = 12 I, so that its determinant is 12^12."""
    factors = np.array(list(itertools.product((-1.0, 1.0), repeat=11)))
    response = plain(np.column_stack([np.ones(len(factors)), factors]))
    chosen = exchange([response], one_run(12), "D", np.random.default_rng(4), starts=10)
    X = response.common[chosen]
    # Efficiency of 95 % at least: the twelve-run Hadamard matrix is unique, and exchanges end beside it too.
    assert np.linalg.slogdet(X.T @ X)[1] / 12 >= math.log(12 * 0.95)


# Box and Draper, Technometrics 13 (1971) 731: D-optimal designs of n runs for the quadratic in two factors.
# On three levels the nine runs are the factorial 3^2, |X'X| = 5184; the others are those of an enumeration
# of every choice of n out of the nine points with repetition.
LARGER = pytest.mark.campaign("more rows than terms: of the smallest design and of one more in every run")


@pytest.mark.parametrize("n", [6, 7, pytest.param(8, marks=LARGER), pytest.param(9, marks=LARGER)])
@pytest.mark.parametrize("by", ["D", "I", "G"])
def test_three_level_designs_are_the_best_of_all(n: int, by: Criterion) -> None:
    response = plain(quadratic())
    chosen = exchange([response], one_run(n), by, np.random.default_rng(2), starts=25)
    best = math.inf
    for design in itertools.combinations_with_replacement(range(9), n):
        rows = response.common[list(design)]
        if abs(np.linalg.det(rows.T @ rows)) > 1e-6:
            best = min(best, loss([response], np.array(design), one_run(n), by))
    assert loss([response], chosen, one_run(n), by) == pytest.approx(best, rel=1e-9)


def test_nine_runs_are_the_factorial() -> None:
    response = plain(quadratic())
    chosen = exchange([response], one_run(9), "D", np.random.default_rng(3), starts=10)
    assert sorted(chosen.tolist()) == list(range(9))
    X = response.common[chosen]
    assert np.linalg.det(X.T @ X) == pytest.approx(5184.0)


def test_many_runs_approach_the_equivalence_theorem() -> None:
    """Kiefer and Wolfowitz (1960): the best design's largest variance is p / n; its weights 0.1458 a corner,
    0.0802 a side and 0.0962 the centre (Fedorov, Theory of Optimal Experiments, 1972)."""
    response = plain(quadratic())
    n = 240
    chosen = exchange([response], one_run(n), "D", np.random.default_rng(5), starts=1)
    assert n * loss([response], chosen, one_run(n), "G") == pytest.approx(6.0, rel=0.01)
    weight = np.bincount(chosen, minlength=9) / n
    assert weight[[0, 2, 6, 8]].mean() == pytest.approx(0.1458, abs=0.002)
    assert weight[[1, 3, 5, 7]].mean() == pytest.approx(0.0802, abs=0.002)
    assert weight[4] == pytest.approx(0.0962, abs=0.003)


def test_a_run_effect_makes_every_run_hold_both_ends() -> None:
    """A slope under runs of two rows with large zeros of their own: each takes -1 and 1."""
    x = np.linspace(-1, 1, 5)
    response = Response(
        common=x[:, None], of_run=np.ones((5, 1)), precision=np.zeros(1), run_precision=np.array([1e-4]),
        targets=np.ones((1, 1)),
    )  # fmt: skip
    run = np.repeat(np.arange(4), 2)
    chosen = exchange([response], run, "D", np.random.default_rng(6))
    assert all(sorted(x[chosen[run == r]].tolist()) == [-1.0, 1.0] for r in range(4))


def test_the_information_is_that_of_generalised_least_squares() -> None:
    """Columns with a precision are a random effect: the block of the inverse is (X' V^-1 X)^-1."""
    rng = np.random.default_rng(7)
    X, sd = rng.normal(size=(12, 2)), 1.7
    run = np.repeat(np.arange(3), 4)
    response = Response(
        common=X, of_run=np.ones((12, 1)), precision=np.zeros(2), run_precision=np.array([1 / sd**2]),
        targets=np.eye(2),
    )  # fmt: skip
    V = np.eye(12) + sd**2 * (run[:, None] == run)
    expected = np.linalg.inv(X.T @ np.linalg.solve(V, X))
    block = np.linalg.inv(response.information(np.arange(12), run, 3))[:2, :2]
    assert np.allclose(block, expected, rtol=1e-10)


def test_a_design_that_cannot_tell_a_coefficient_has_no_finite_loss() -> None:
    response = plain(quadratic())
    assert loss([response], np.array([0] * 6), one_run(6), "D") == math.inf
