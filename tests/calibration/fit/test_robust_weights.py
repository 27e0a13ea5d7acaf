"""The robust weights are those of statsmodels' RLM, and find what hides."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from toolkit.calibration.fit.basis import build_basis
from toolkit.calibration.fit.regression import fit_terms
from toolkit.calibration.fit.robust import robust_weights


def peer(
    terms: tuple[str, ...], columns: dict[str, NDArray[np.float64]], load: NDArray[np.float64],
    u: NDArray[np.float64] | None, leverage: NDArray[np.float64], dof: int,
) -> NDArray[np.float64]:  # fmt: skip
    """Huber, then the biweight from there, by statsmodels."""
    from statsmodels.robust.norms import HuberT, TukeyBiweight
    from statsmodels.robust.robust_linear_model import RLM

    w = np.ones(len(load)) if u is None else 1 / u
    design, y = build_basis(terms, columns).design * w[:, None], load * w
    start: Any = None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for norm in (HuberT(), TukeyBiweight(c=4.685)):
            start = RLM(y, design, M=norm).fit(maxiter=200, tol=1e-12, start_params=start, cov="H2").params
    rest = y - design @ np.asarray(start)
    scale = 1.4826 * np.median(np.abs(rest)) * np.sqrt(len(y) / dof)
    z = rest / (scale * np.sqrt(1 - leverage))
    return np.asarray(np.where(np.abs(z) < 4.685, (1 - (z / 4.685) ** 2) ** 2, 0.0))


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("outliers", [0, 3, 12])
@pytest.mark.parametrize("terms", [("A", "B", "intercept"), ("A", "A^2", "A^3", "intercept")])
def test_weights_are_those_of_statsmodels(terms: tuple[str, ...], outliers: int, weighted: bool) -> None:
    rng = np.random.default_rng(outliers)
    columns = {"A": rng.uniform(-1, 2, 90), "B": rng.uniform(5, 9, 90)}
    u = rng.uniform(0.5, 2, 90) if weighted else None
    load = 40 * columns["A"] - 3 * columns["B"] + rng.normal(0, 1, 90) * (1.0 if u is None else u)
    load[:outliers] += rng.uniform(15, 40, outliers)
    fit = fit_terms(terms=terms, columns=columns, load=load, u=u)
    found = robust_weights(fit, columns=columns, load=load)
    assert found is not None
    wanted = peer(terms, columns, load, u, fit.leverage, fit.dof)
    # 1.4826 is the reciprocal of the normal median to five digits.
    np.testing.assert_allclose(found, wanted, atol=2e-4)


def test_a_third_of_rows_that_are_wrong_together_weighs_nothing() -> None:
    rng = np.random.default_rng(9)
    x = np.linspace(0, 10, 60)
    load = 2 * x + rng.normal(0, 0.1, 60)
    load[40:] = x[40:]  # Huber's estimate is drawn to them: they have the leverage
    fit = fit_terms(terms=("x", "intercept"), columns={"x": x}, load=load)
    weights = robust_weights(fit, columns={"x": x}, load=load)
    assert weights is not None
    assert (weights[40:] == 0).all()
    assert (weights[:40] > 0.2).all()


def test_most_rows_fitted_exactly_have_no_scale() -> None:
    x = np.linspace(0, 10, 30)
    load = 2 * x
    load[[4, 9]] += 3.0
    fit = fit_terms(terms=("x", "intercept"), columns={"x": x}, load=load)
    assert robust_weights(fit, columns={"x": x}, load=load) is None
