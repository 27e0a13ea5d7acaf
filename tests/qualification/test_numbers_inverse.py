"""x from y by a straight line: published predictions, the other way round, and Monte Carlo."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from toolkit.calibration.fit.regression import fit_terms
from toolkit.qualification.numbers import StraightLine, x_from_y

# ISO/TS 28037:2010, the examples with equal and with unequal weights, as quoted with the GUM Tree Calculator.
EQUAL = StraightLine(a=1.866667, b=1.757143, u_a=0.4654747, u_b=0.1195229, cov_ab=-0.050)
UNEQUAL = StraightLine(a=0.8852, b=2.0570, u_a=0.5297081, u_b=0.1778920, cov_ab=-0.08227848)


@pytest.mark.parametrize(
    ("line", "u_y0", "x0", "u_x0"), [(EQUAL, 0.5, 4.913, 0.322), (UNEQUAL, 1.0, 4.674, 0.533)]
)
def test_the_published_predictions(line: StraightLine, u_y0: float, x0: float, u_x0: float) -> None:
    found = x_from_y(line, 10.5, u_y0=u_y0)
    assert found.value == pytest.approx(x0, abs=0.0005)
    assert found.u == pytest.approx(u_x0, abs=0.0005)


def test_the_line_of_a_fit() -> None:
    x = np.arange(1.0, 7.0)
    y = np.array([3.3, 5.6, 7.1, 9.3, 10.7, 12.1])
    line = StraightLine.of(fit_terms(terms=("x", "intercept"), columns={"x": x}, load=y, u=np.full(6, 0.5)))
    # Closed form for equal weights: u^2(b) = s^2 / Sxx, cov = -mean(x) u^2(b), Sxx = 17.5, mean 3.5.
    assert line.b == pytest.approx(float((x - 3.5) @ y) / 17.5, rel=1e-13)
    assert line.u_b == pytest.approx(math.sqrt(0.25 / 17.5), rel=1e-13)
    assert line.cov_ab == pytest.approx(-3.5 * 0.25 / 17.5, rel=1e-12)
    assert line.u_a == pytest.approx(math.sqrt(0.25 / 6 + 3.5**2 * 0.25 / 17.5), rel=1e-13)


def test_another_equation_is_no_line() -> None:
    x = np.arange(1.0, 7.0)
    for terms in (("x",), ("x", "x^2"), ("x", "x^2", "intercept")):
        fit = fit_terms(terms=terms, columns={"x": x}, load=2 * x + np.sin(x))
        with pytest.raises(ValueError, match="no straight line"):
            StraightLine.of(fit)


def variance(line: StraightLine, x: float) -> float:
    """The GUM's law of propagation with its matrix: (1, x) V (1, x)'."""
    slopes = np.array([1.0, x])
    v = np.array([[line.u_a**2, line.cov_ab], [line.cov_ab, line.u_b**2]])
    return float(slopes @ v @ slopes)


@given(x=st.floats(-1e3, 1e3), u=st.floats(0, 10))
def test_back_from_the_value_forward(x: float, u: float) -> None:
    back = x_from_y(UNEQUAL, UNEQUAL.a + UNEQUAL.b * x, u_y0=u)
    assert back.value == pytest.approx(x, rel=1e-12, abs=1e-12)
    # The line's variance at x0, the observation's beside it, over the slope.
    assert back.u * UNEQUAL.b == pytest.approx(math.hypot(math.sqrt(variance(UNEQUAL, x)), u), rel=1e-9)


def test_backward_against_monte_carlo_where_the_slope_is_known_well() -> None:
    line = StraightLine(a=1.0, b=2.0, u_a=0.01, u_b=0.004, cov_ab=-3e-5)
    rng = np.random.default_rng(28037)
    trials = 200_000
    a, b = rng.multivariate_normal([1.0, 2.0], [[1e-4, -3e-5], [-3e-5, 1.6e-5]], trials).T
    x = (rng.normal(9.0, 0.02, trials) - a) / b
    found = x_from_y(line, 9.0, u_y0=0.02)
    # Standard error of a standard deviation of n draws: 1 / sqrt(2 n); five of them.
    assert found.u == pytest.approx(float(x.std(ddof=1)), rel=5 / math.sqrt(2 * trials))
    assert found.value == 4.0


def test_an_offset_of_x_changes_no_uncertainty() -> None:
    # The same line about x = 3: a' = a + 3 b, and its covariance carried over.
    shift = 3.0
    u_a = math.sqrt(variance(UNEQUAL, shift))
    moved = StraightLine(
        a=UNEQUAL.a + shift * UNEQUAL.b, b=UNEQUAL.b, u_a=u_a, u_b=UNEQUAL.u_b,
        cov_ab=UNEQUAL.cov_ab + shift * UNEQUAL.u_b**2,
    )  # fmt: skip
    here, there = x_from_y(UNEQUAL, 10.5, u_y0=1.0), x_from_y(moved, 10.5, u_y0=1.0)
    assert there.value == pytest.approx(here.value - shift, rel=1e-12)
    assert there.u == pytest.approx(here.u, rel=1e-12)


def test_full_correlation_leaves_no_negative_variance() -> None:
    # a = -3 b exactly: at x = 3 the line's value is known.
    line = StraightLine(a=-0.3, b=0.1, u_a=0.3, u_b=0.1, cov_ab=-0.3 * 0.1)
    assert x_from_y(line, 0.0, u_y0=0.0).u == pytest.approx(0.0, abs=1e-14)


def test_a_line_without_uncertainty_passes_on_that_of_the_value() -> None:
    line = StraightLine(a=0.0, b=-4.0, u_a=0.0, u_b=0.0, cov_ab=0.0)
    assert x_from_y(line, 2.0, u_y0=0.8).u == pytest.approx(0.2, rel=1e-15)


GOOD = {"a": 1.0, "b": 2.0, "u_a": 0.1, "u_b": 0.1, "cov_ab": 0.0}


@pytest.mark.parametrize(
    ("change", "told"),
    [({"a": math.nan}, "a = nan"), ({"b": math.inf}, "b = inf"), ({"u_a": -0.1}, "u_a = -0.1"),
     ({"u_b": -1e-9}, "u_b = -1e-09"), ({"cov_ab": 0.011}, "exceeds"),
     ({"u_a": 0.0, "cov_ab": 1e-9}, "exceeds")],
)  # fmt: skip
def test_what_is_no_line_is_refused(change: dict[str, float], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        StraightLine(**{**GOOD, **change})


@pytest.mark.parametrize(
    ("b", "y0", "u_y0", "told"),
    [(0.0, 1.5, 0.1, "slope is 0"), (5e-324, 1.5, 0.1, "too small"), (2.0, math.nan, 0.1, "y0 = nan"),
     (2.0, 1.5, -0.1, "u_y0 = -0.1"), (2.0, 1.5, math.inf, "u_y0 = inf")],
)  # fmt: skip
def test_what_cannot_be_carried_back_is_refused(b: float, y0: float, u_y0: float, told: str) -> None:
    line = StraightLine(**{**GOOD, "b": b})
    with pytest.raises(ValueError, match=told):
        x_from_y(line, y0, u_y0=u_y0)
