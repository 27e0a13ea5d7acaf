"""Products that do not round, held against rational arithmetic; and a fit of many rows, against the same."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from toolkit.calibration.fit.basis import inner
from toolkit.calibration.fit.regression import CutDesign, exact_bits, fit_loads, fit_terms, leading
from toolkit.calibration.records.golden import solve_exactly


def test_a_cut_line_keeps_few_bits_and_loses_nothing() -> None:
    values = np.random.default_rng(1).normal(size=(3, 500)) * np.array([[1e-9], [1.0], [1e12]])
    high = leading(values, 20)
    rest = values - high
    for line, head, tail in zip(values, high, rest, strict=True):
        grid = 2.0 ** (np.frexp(np.abs(line).max())[1] - 20)
        assert (head / grid == np.rint(head / grid)).all()
        assert np.abs(tail).max() <= grid / 2
        assert all(Fraction(v) == Fraction(h) + Fraction(t) for v, h, t in zip(line, head, tail, strict=True))


@pytest.mark.parametrize("rows", [2, 21, 1000, 1024, 1025])
def test_as_many_bits_as_the_number_of_rows_allows(rows: int) -> None:
    bits = exact_bits(rows)
    # The largest sum of the largest products is a whole number that a double still holds.
    assert rows * (2**bits) ** 2 <= 2**53 < 4 * rows * (2 ** (bits + 1)) ** 2


def test_a_zero_line_stays_zero() -> None:
    assert (leading(np.zeros((1, 5)), 20) == 0).all()


def test_residuals_and_gradient_to_seventy_bits() -> None:
    rng = np.random.default_rng(2)
    design, loads = rng.normal(size=(3, 400)), rng.normal(size=(1, 400)) * 1e4
    solution = np.array([[1e4 / 3, -2.0 / 7, 1e-3 / 9]], dtype=np.longdouble)
    cut = CutDesign.of(design)
    found = cut.residuals(loads, solution)
    x = [Fraction(float(v)) + Fraction(float(v - np.longdouble(float(v)))) for v in solution[0]]
    rows = [[Fraction(v) for v in column] for column in design.T.tolist()]
    wanted = [
        Fraction(y) - sum((a * b for a, b in zip(row, x, strict=True)), Fraction(0))
        for y, row in zip(loads[0].tolist(), rows, strict=True)
    ]
    largest = float(np.abs(loads).max())
    off = [
        abs(float(Fraction(h) + Fraction(t) - w))
        for h, t, w in zip(found.high[0], found.low[0], wanted, strict=True)
    ]
    assert max(off) < 2**-68 * largest
    exact = [sum((r[j] * w for r, w in zip(rows, wanted, strict=True)), Fraction(0)) for j in range(3)]
    for got, true in zip(cut.gradient(found)[0], exact, strict=True):
        assert abs(float(Fraction(float(got)) - true)) < 2**-52 * abs(float(true)) + 2**-60 * largest


def test_a_fit_of_many_rows_is_the_rational_solution() -> None:
    rng = np.random.default_rng(3)
    columns = {name: rng.normal(5, 1, 3000).round(6) for name in ("A", "B")}
    loads = [columns["A"] * 7 - columns["B"] + rng.normal(0, 50, 3000).round(4) for _ in range(2)]
    terms = ("A", "B", "intercept")
    for fit, load in zip(fit_loads(terms=terms, columns=columns, loads=loads), loads, strict=True):
        exact = solve_exactly(
            terms=terms, columns={n: c.tolist() for n, c in columns.items()}, load=load.tolist(), weights=None
        )
        # Scatter far above the solution's own digits: what a gradient that rounds cannot carry.
        np.testing.assert_allclose(fit.coefficients, [float(c) for c in exact], rtol=2e-16)


def test_loads_fitted_together_are_as_those_fitted_alone() -> None:
    rng = np.random.default_rng(4)
    columns = {"A": rng.normal(size=50)}
    loads = [2 * columns["A"] + rng.normal(size=50), 1e6 * columns["A"] + 3]
    together = fit_loads(terms=("A", "intercept"), columns=columns, loads=loads)
    for fit, load in zip(together, loads, strict=True):
        assert (
            fit.coefficients == fit_terms(terms=("A", "intercept"), columns=columns, load=load).coefficients
        )


def test_inner_product_takes_truth_values() -> None:
    assert inner(np.array([1.5, 2.0, 4.0]), np.array([True, False, True])) == 5.5
