"""The report of a fit against published values, definitions written out, and statsmodels' own influence."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from tests.calibration.calibration_factory import hub_data
from toolkit.calibration.fit.diagnostics import lack_of_fit, load_levels, reversals
from toolkit.calibration.fit.regression import fit_terms
from toolkit.calibration.fit.report import FitReport, coefficient_rows, prediction_half_width, report_session
from toolkit.calibration.fit.session_fit import fit_session
from toolkit.calibration.session.read import read_session
from toolkit.calibration.terms import term_matrix

Make = Callable[..., Path]

# NIST StRD, Pontius: deflection at twenty loads [lbf], taken twice.
PONTIUS_X = np.array([150000.0 * (1 + i % 20) for i in range(40)])
PONTIUS_Y = np.array([
    .11019, .21956, .32949, .43899, .54803, .65694, .76562, .87487, .98292, 1.09146,
    1.20001, 1.30822, 1.41599, 1.52399, 1.63194, 1.73947, 1.84646, 1.95392, 2.06128, 2.16844,
    .11052, .22018, .32939, .43886, .54798, .65739, .76596, .87474, .98300, 1.09150,
    1.20004, 1.30818, 1.41613, 1.52408, 1.63159, 1.73965, 1.84696, 1.95445, 2.06177, 2.16829,
])  # fmt: skip


def reported(path: Path) -> tuple[FitReport, ...]:
    return report_session(fit_session(read_session(path)))


@pytest.mark.parametrize(("degree", "F"), [(1, 214.7), (2, 0.811), (3, 0.794)])
def test_lack_of_fit_of_pontius(degree: int, F: float) -> None:
    terms = (*("x", "x^2", "x^3")[:degree], "intercept")
    fit = fit_terms(terms=terms, columns={"x": PONTIUS_X}, load=PONTIUS_Y)
    found = lack_of_fit(fit, load_levels(PONTIUS_X[:, None]))
    assert found is not None
    assert found.F == pytest.approx(F, rel=7e-4)
    assert (found.lack_dof, found.pure_dof) == (19 - degree, 20)
    # Pure error by its definition: half the squared differences of the pairs.
    pairs = PONTIUS_Y[:20] - PONTIUS_Y[20:]
    assert found.pure_error_sd == pytest.approx(np.sqrt(np.sum(pairs**2) / 2 / 20), rel=1e-9)


def test_levels_are_loads_that_agree_in_every_load() -> None:
    loads = np.array([[100.0, 0], [100.005, 0], [100.0, 5], [-100.0, 0], [100.1, 0], [100.0, 5]])
    level = load_levels(loads)
    assert level is not None
    # 0.005 of 100 is the same load, 0.1 of 100 is another; MZ tells rows 3 and 6 apart from 1 and 2.
    assert level[0] == level[1] != level[4]
    assert level[2] == level[5] != level[0]
    assert len(set(level.tolist())) == 4


def test_a_sweep_has_no_levels() -> None:
    assert load_levels(np.linspace(0, 100, 20001)[:, None]) is None
    assert load_levels(np.linspace(0, 100, 30)[:, None]) is None


def test_influence_against_statsmodels(make_session: Make) -> None:
    import statsmodels.api as sm
    from statsmodels.stats.diagnostic import het_breuschpagan
    from statsmodels.stats.outliers_influence import OLSInfluence, variance_inflation_factor

    values = hub_data(60, 1)
    path = make_session(values)
    # One run: the rows' errors are independent, as the peer takes them to be.
    one_run = re.sub(r"(?m),\d+,(up|down)$", r",1,\1", (path.parent / "loads.csv").read_text())
    (path.parent / "loads.csv").write_text(one_run)
    report = reported(path)[0]
    cells, load = np.round(values[:, :3], 7), np.round(values[:, 3], 7)
    design = sm.add_constant(cells)
    peer = sm.OLS(load, design).fit()
    influence = OLSInfluence(peer)
    assert report.fit.leverage == pytest.approx(influence.hat_matrix_diag, rel=1e-6)
    assert report.tests.internal == pytest.approx(influence.resid_studentized_internal, rel=1e-5, abs=1e-8)
    assert report.tests.external == pytest.approx(influence.resid_studentized_external, rel=1e-5, abs=1e-8)
    assert report.tests.cook == pytest.approx(influence.cooks_distance[0], rel=1e-5, abs=1e-10)
    assert report.tests.press == pytest.approx(np.sqrt(np.mean(influence.resid_press**2)), rel=1e-6)
    total = np.sum((load - load.mean()) ** 2)
    assert 1 - report.predicted_r_squared == pytest.approx(np.sum(influence.resid_press**2) / total, rel=1e-5)
    assert dict(report.vif)["E5"] == pytest.approx(variance_inflation_factor(design, 3), rel=1e-6)
    spread = het_breuschpagan(peer.resid, sm.add_constant(np.abs(load)), robust=False)
    assert report.tests.heteroscedasticity == pytest.approx(spread[1], rel=1e-4)
    half = peer.get_prediction(design[[np.argmax(np.abs(load))]]).conf_int(obs=True, alpha=0.05)[0]
    assert report.prediction_half_width == pytest.approx(np.diff(half)[0] / 2, rel=1e-6)


def test_sign_confidence_is_students() -> None:
    # One regressor, two rows a side: t and its probability by hand.
    x, y = np.array([-1.0, 0.0, 1.0, 2.0]), np.array([-0.9, 0.2, 0.6, 2.3])
    fit = fit_terms(terms=("x", "intercept"), columns={"x": x}, load=y)
    slope, _, _, p, error = stats.linregress(x, y)
    one, other = coefficient_rows(fit, np.array([2.0, 1.0]), 2.3)
    assert one.t == pytest.approx(slope / error)
    assert one.sign_confidence == pytest.approx(1 - p / 2)
    assert one.percent_fs == pytest.approx(100 * slope * 2 / 2.3)
    assert 0.5 <= other.sign_confidence < 1


def test_the_sign_of_a_term_that_is_not_there_is_even() -> None:
    # Uniform in repeated samples: the mean of the sign confidence of a null term is 3/4.
    rng = np.random.default_rng(2)
    x = rng.uniform(-1, 1, 20)
    sure = []
    for _ in range(200):
        fit = fit_terms(terms=("x", "intercept"), columns={"x": x}, load=rng.normal(0, 1, 20))
        sure.append(coefficient_rows(fit, np.ones(2), 1.0)[0].sign_confidence)
    assert stats.kstest(sure, stats.uniform(0.5, 0.5).cdf).pvalue > 0.01


def test_prediction_interval_holds_its_share() -> None:
    rng = np.random.default_rng(5)
    x, new = np.linspace(0, 1, 12), np.array([0.9])
    inside = 0
    for _ in range(400):
        fit = fit_terms(terms=("x", "intercept"), columns={"x": x}, load=2 * x + rng.normal(0, 0.1, 12))
        value = term_matrix(fit.terms, {"x": new}) @ np.array(fit.coefficients)
        inside += abs(value[0] - 1.8 - rng.normal(0, 0.1)) < prediction_half_width(fit, {"x": new})[0]
    assert stats.binomtest(inside, 400, 0.95).pvalue > 0.01


def test_weighted_fits_predict_from_their_stated_uncertainties() -> None:
    x, u = np.linspace(0, 1, 9), np.full(9, 0.2)
    fit = fit_terms(terms=("x", "intercept"), columns={"x": x}, load=2 * x, u=u)
    design = np.column_stack([x, np.ones(9)])
    covariance = 0.04 * np.linalg.inv(design.T @ design)
    at = np.array([1.0, 1.0])
    expected = stats.norm.ppf(0.975) * np.sqrt(0.04 + at @ covariance @ at)
    assert prediction_half_width(fit, {"x": np.ones(1)})[0] == pytest.approx(expected)


def test_reversals_at_equal_loads_by_run() -> None:
    # Going down the cell shows 0.3 more at 50 in run 1 and 0.1 less in run 2; 100 has one direction only.
    load = np.array([50.0, 100, 50, 50, 100, 50.0])
    indicated = np.array([50.0, 100, 50.3, 50.0, 100, 49.9])
    found = reversals(
        residuals=load - indicated,
        load=load,
        level=load_levels(load[:, None]),
        up=np.array([True, True, False, True, True, False]),
        run=np.array([1.0, 1, 1, 2, 2, 2]),
    )
    assert [(r.run, r.load) for r in found] == [(1, 50.0), (2, 50.0)]
    assert [r.difference for r in found] == pytest.approx([0.3, -0.1])
    assert [r.percent_fs for r in found] == pytest.approx([0.3, -0.1])


def test_check_loads_row_by_row_in_percent_of_full_scale(make_session: Make) -> None:
    check = hub_data(9, 2)
    check[4, 3] += 2.0
    report = reported(make_session(check_rows=check))[0]
    assert report.check_percent_fs is not None
    assert report.check_percent_fs[4] == pytest.approx(-100 * 2.0 / report.full_scale, rel=0.02)
    assert np.abs(np.delete(report.check_percent_fs, 4)).max() < 0.01
    assert report.tolerance_percent_fs == pytest.approx(0.1)


def test_an_exact_session_is_said_to_be_one(make_session: Make) -> None:
    values = hub_data(60, 1, noise=0.0)
    for report in reported(make_session(values, check_rows=hub_data(9, 2, noise=0.0), digits=17)):
        assert report.noise_free
        assert (
            report.normality
            is report.lack_of_fit
            is report.tests.heteroscedasticity
            is report.robust_weight
            is None
        )
        assert np.isfinite([c.sign_confidence for c in report.coefficients]).all()
