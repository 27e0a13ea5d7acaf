"""What a fit recommends and points at: true models are named, clean sessions are left in peace."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom

from tests.calibration.calibration_factory import hub_data
from toolkit.calibration.fit.findings import session_findings
from toolkit.calibration.fit.recommend import holm
from toolkit.calibration.fit.regression import fit_terms
from toolkit.calibration.fit.robust import hidden_outliers, robust_weights
from toolkit.calibration.fit.session_fit import SessionFit, fit_session
from toolkit.calibration.session.read import read_session
from toolkit.findings import Finding

Make = Callable[..., Path]
TERMS = ("x", "intercept")


def fitted(path: Path) -> SessionFit:
    return fit_session(read_session(path))


def told(fit: SessionFit) -> dict[str, Finding]:
    return {one.rule: one for one in session_findings(fit)}


def written(finding: Finding) -> dict[str, object]:
    """Return the lines for SESSION.toml that a message ends with, read as TOML."""
    return tomllib.loads(finding.message.split("SESSION.toml: ")[1].replace("; ", "\n"))


def test_holm_against_the_published_rule() -> None:
    # Holm 1979: the smallest of k by k, the next by k - 1, and none below the one before.
    assert holm([0.04, 0.001, 0.03]) == pytest.approx((0.06, 0.003, 0.06))


def test_clean_linear_sessions_are_recommended_nothing(make_session: Make) -> None:
    seeds = 200
    session = read_session(make_session(hub_data(40, 1)))
    noted = 0
    for seed in range(seeds):
        session.table.values[:] = hub_data(40, 1000 + seed)
        found = session_findings(fit_session(session))
        # The check loads stay those of another seed, beyond the loads of every other session.
        noted += any(one.level == "note" and one.rule != "check-beyond-range" for one in found)
    assert noted <= 0.05 * seeds
    # And the tests are alive: told never, at risks of 1 % a kind, would be a fault too.
    assert noted >= binom.ppf(0.001, seeds, 0.02)


def test_a_square_and_a_product_are_named_with_the_lines_that_fit_them(make_session: Make) -> None:
    values = hub_data(120, 3)
    values[:, 3] += 2e-5 * values[:, 3] ** 2  # a square of FY: squares and products of the cells
    finding = told(fitted(make_session(values)))["model"]
    assert (finding.where, finding.level) == ("FY", "note")
    lines = written(finding)
    assert lines["model"] == "balance"
    assert {"abs(D51)", "D51*abs(D51)"} <= set(lines["drop"])  # type: ignore[call-overload]
    assert "D51^2" not in lines["drop"]  # type: ignore[operator]
    again = fitted(
        make_session(values, name="again", model='"balance"', drop=str(lines["drop"]).replace("'", '"'))
    )
    assert "model" not in told(again)
    assert again.loads[0].fit.residual_sd < 0.02 * fitted(make_session(values)).loads[0].fit.residual_sd


def test_one_curved_cell_asks_for_a_degree(make_session: Make) -> None:
    values = hub_data(120, 3)
    values[:, 3] += 0.5 * values[:, 0] ** 3
    lines = written(told(fitted(make_session(values)))["model"])
    assert lines == {"model": "polynomial", "degree": 3}


def test_terms_that_are_worth_nothing_are_candidates_to_drop(make_session: Make) -> None:
    finding = told(fitted(make_session(hub_data(200, 3), model='"balance"')))["terms"]
    assert finding.level == "note"
    assert "under 0.05 % of full scale" in finding.message
    # All higher terms go, and what is left has a name of its own.
    assert written(finding) == {"model": "linear"}


def test_a_needed_term_is_no_candidate(make_session: Make) -> None:
    values = hub_data(200, 3)
    values[:, 3] += 5.0 * values[:, 0] ** 2
    drop = written(told(fitted(make_session(values, model='"polynomial"', degree="3")))["terms"])["drop"]
    assert "D51^2" not in drop  # type: ignore[operator]
    assert {"D51^3", "D52^3", "E5^3"} <= set(drop)  # type: ignore[call-overload]


def masked() -> tuple[np.ndarray, np.ndarray]:
    """Return a line of 20 rows whose last two are wrong alike, at the end: a masked pair."""
    rng = np.random.default_rng(8)
    x = np.concatenate([np.linspace(0, 5, 18), [7.0, 7.1]])
    y = 3 * x + rng.normal(0, 0.1, 20)
    y[18:] += 1.5
    return x, y


def test_two_outliers_that_hide_each_other_are_found(make_session: Make) -> None:
    # Of 20 rows and 4 terms, two equal deviations cannot pass the outlier limit, however large: with the
    # other one left in, |t| stays under sqrt(15) = 3.9, and the limit of 15 degrees of freedom is 4.4.
    values = hub_data(20, 1)
    values[[4, 11], 3] += 2.0
    fit = fitted(make_session(values))
    found = told(fit)
    assert fit.loads[0].diagnostics.outliers == ()
    assert "outlier" not in found
    assert (found["robust"].where, found["robust"].level) == ("FY", "note")
    assert found["robust"].message.startswith("rows 5, 12:")


def test_a_row_is_named_once(make_session: Make) -> None:
    values = hub_data(60, 1)
    values[7, 3] += 5.0
    findings = session_findings(fitted(make_session(values)))
    assert [one.rule for one in findings if "row 8" in f"{one.where} {one.message}"] == ["outlier"]


def test_masked_pair_on_a_line() -> None:
    x, y = masked()
    fit = fit_terms(terms=TERMS, columns={"x": x}, load=y)
    weights = robust_weights(fit, columns={"x": x}, load=y)
    assert hidden_outliers(fit, weights, columns={"x": x}) == (19, 20)


def test_sound_rows_are_not_pointed_at() -> None:
    # Over 300 lines of 20 rows: at the stated risk of 0.2 % a session, with room for the median's scale.
    rng = np.random.default_rng(3)
    x = np.linspace(0, 5, 20)
    named = 0
    for _ in range(300):
        y = 3 * x + rng.normal(0, 0.1, 20)
        fit = fit_terms(terms=TERMS, columns={"x": x}, load=y)
        named += bool(hidden_outliers(fit, robust_weights(fit, columns={"x": x}, load=y), columns={"x": x}))
    assert named <= 6


def test_exact_data_are_not_judged() -> None:
    x = np.arange(30.0)
    fit = fit_terms(terms=TERMS, columns={"x": x}, load=2 * x + 1)
    assert robust_weights(fit, columns={"x": x}, load=2 * x + 1) is None
    assert hidden_outliers(fit, None, columns={"x": x}) == ()
