"""What a fit recommends and points at: true models are named, clean sessions are left in peace."""

from __future__ import annotations

import dataclasses
import re
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binom

from tests.calibration.calibration_factory import hub_data
from toolkit.calibration.fit.findings import session_findings
from toolkit.calibration.fit.recommend import holm
from toolkit.calibration.fit.regression import fit_terms
from toolkit.calibration.fit.robust import robust_weights
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


def test_two_outliers_that_hide_each_other_are_found(make_session: Make) -> None:
    # Of 20 rows and 4 terms, two equal deviations cannot pass the outlier limit, however large: with the
    # other one left in, |t| stays under sqrt(15) = 3.9, and the limit of 15 degrees of freedom is 4.4.
    values = hub_data(20, 1)
    values[[4, 11], 3] += 2.0
    fit = fitted(make_session(values))
    found = told(fit)
    assert fit.loads[0].diagnostics.outliers == ()
    assert "outlier" not in found
    assert (found["robust"].where, found["robust"].level) == ("FY", "warning")
    assert found["robust"].message.startswith("rows 5, 12:")


def test_a_row_is_named_once(make_session: Make) -> None:
    values = hub_data(60, 1)
    values[7, 3] += 5.0
    findings = session_findings(fitted(make_session(values)))
    assert [one.rule for one in findings if "row 8" in f"{one.where} {one.message}"] == ["outlier"]


def in_runs(rows: int, runs: int, seed: int) -> NDArray[np.float64]:
    return np.column_stack([hub_data(rows, seed), np.repeat(np.arange(runs) + 1.0, rows // runs)])


def session_in_runs(make_session: Make, values: NDArray[np.float64]) -> SessionFit:
    """Fit a session whose last column is the run."""
    session = read_session(make_session(values[:, :6]))
    table = dataclasses.replace(session.table, run=values[:, 6])
    return fit_session(dataclasses.replace(session, table=table))


@pytest.mark.parametrize("seed", range(6))
def test_two_wrong_rows_of_81_leave_the_others_in_peace_and_advise_nothing(
    make_session: Make, seed: int
) -> None:
    values = in_runs(81, 3, seed)
    values[[10, 47], 3] += [40.0, -60.0]
    findings = [
        one for one in session_findings(session_in_runs(make_session, values)) if "check" not in one.rule
    ]
    assert sorted(one.where for one in findings) == ["FY, row 11", "FY, row 48"]
    assert {one.rule for one in findings} == {"outlier"}


def test_a_run_with_exchanged_cells_is_named(make_session: Make) -> None:
    # No row stands out from a fit that all of them tilt, and no check load is asked.
    values = in_runs(81, 3, 5)
    values[27:54, :2] = values[27:54, 1::-1]
    told_of = {one.where: one for one in session_findings(session_in_runs(make_session, values))}
    assert {one.rule for one in told_of.values() if one.level == "warning"} == {"robust", "check-load"}
    assert "of the 27 rows of run 2" in told_of["FY"].message


def test_exchanged_cells_in_scattered_rows_are_named(make_session: Make) -> None:
    values = hub_data(81, 6)
    values[::3, :2] = values[::3, 1::-1]
    message = told(fitted(make_session(values)))["robust"].message
    rows = [int(text) for text in re.findall(r"\d+", message.split(" and ")[0].split(":")[0])]
    assert all(row % 3 == 1 for row in rows)


def test_rows_beyond_the_tolerance_of_their_own_check_loads_are_told(make_session: Make) -> None:
    values = in_runs(60, 3, 7)
    values[40:, 3:6] *= 1.02  # the reference of one run, by 2 %: its gain takes it up, no row stands out
    finding = told(session_in_runs(make_session, values))["scatter"]
    assert finding.level == "warning"
    assert "between runs" in finding.message
    assert "scatter" not in told(session_in_runs(make_session, in_runs(60, 3, 7)))


def test_exact_data_are_not_judged() -> None:
    x = np.arange(30.0)
    fit = fit_terms(terms=TERMS, columns={"x": x}, load=2 * x + 1)
    assert robust_weights(fit, columns={"x": x}, load=2 * x + 1) is None
