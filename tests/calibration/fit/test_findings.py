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

from tests.calibration.calibration_factory import SENSITIVITY, ZERO, hub_data
from toolkit.calibration.fit.findings import session_findings
from toolkit.calibration.fit.printed_digits import copies
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


@pytest.mark.campaign("200 sessions: how often sound data get advice")
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
    findings = session_findings(session_in_runs(make_session, values))
    assert {one.rule for one in findings if one.level == "warning"} == {"robust", "check-load"}
    assert {one.rule for one in findings if one.level == "error"} == {"run-apart"}
    told_of = {(one.rule, one.where): one.message for one in findings}
    assert "of the 27 rows of run 2" in told_of["robust", "FY"]
    assert told_of["run-apart", "FY"].startswith("run 2 lies")


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


@pytest.mark.parametrize("digits", [4, 5, 6])
def test_what_printing_rounded_away_is_no_scatter(make_session: Make, digits: int) -> None:
    # Rounding grows with the decade of a value: it looks like a curve, like outliers, like unequal weights.
    values = np.array([[float(f"{one:.{digits}g}") for one in row] for row in hub_data(80, 3, noise=0.0)])
    fit = fitted(make_session(values, digits=12))
    assert all(load.exact for load in fit.loads)
    advice = {one.rule for one in session_findings(fit)} & {
        "outlier",
        "robust",
        "model",
        "method",
        "lack-of-fit",
    }
    assert not advice
    values[9, 3] += 2.0
    fit = fitted(make_session(values, digits=12))
    assert not fit.loads[0].exact
    assert told(fit)["outlier"].where == "FY, row 10"


def test_an_outlier_is_told_by_the_distance_that_names_it(make_session: Make) -> None:
    values = in_runs(60, 3, 8)
    values[:, 3] += np.repeat([-3.0, 0.0, 3.0], 20)  # zeros of the runs, far beyond their scatter
    values[33, 3] += 0.6
    finding = told(session_in_runs(make_session, values))["outlier"]
    assert finding.where == "FY, row 34"
    deviations = re.search(r"within its run, ([0-9.]+) standard deviations", finding.message)
    assert deviations is not None
    assert float(deviations[1]) > 4


def test_readings_of_one_loading_are_no_repeats_of_it(make_session: Make) -> None:
    # What is applied scatters from loading to loading, and each is read three times.
    named = 0
    for seed in range(10):
        rng = np.random.default_rng(seed)
        steps = np.concatenate([np.linspace(-1, 1, 9), np.linspace(1, -1, 9)])
        loads = np.zeros((54, 3))
        for at in range(3):
            loads[18 * at : 18 * at + 18, at] = steps * [500.0, 100.0, 150.0][at]
        applied = loads * (1 + 2e-3 * rng.normal(size=loads.shape)) * (loads != 0)
        values = np.repeat(hub_rows(applied + rng.normal(0, 0.1, loads.shape), applied), 3, axis=0)
        values[:, :3] += rng.normal(0, 1e-6, (162, 3))
        session = read_session(make_session(values))
        table = dataclasses.replace(
            session.table, up=np.tile(np.repeat([True, False], 27), 3), run=np.ones(162)
        )
        fit = fit_session(dataclasses.replace(session, table=table))
        named += "lack-of-fit" in told(fit)
    assert named <= 1


def hub_rows(loads: NDArray[np.float64], applied: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.column_stack([loads @ SENSITIVITY.T + ZERO, applied])


@pytest.mark.parametrize("digits", [6, 5])
def test_check_loads_that_were_copied_in_fewer_digits_check_nothing(make_session: Make, digits: int) -> None:
    values = hub_data(60, 1)
    copied = np.array([[float(f"{one:.{digits}g}") for one in row] for row in values[[3, 17, 40, 41]]])
    check = np.vstack([hub_data(9, 2), copied])
    found = [
        one
        for one in session_findings(fitted(make_session(values, check_rows=check)))
        if one.rule == "check-not-apart"
    ]
    assert [one.where for one in found] == [f"check row {row}" for row in (10, 11, 12, 13)]
    assert [int(one.message.split()[2]) for one in found] == [4, 18, 41, 42]


def test_check_loads_of_the_same_weights_are_no_copies() -> None:
    # One cell, the weights of the fit, an indicator of five digits: some readings agree by chance.
    told_of = 0
    for seed in range(200):
        rng = np.random.default_rng(seed)
        load = np.tile(np.linspace(0, 20, 6), 6)
        rows = np.column_stack([np.round(load / 10 + rng.normal(0, 4e-4, 36), 4), load])
        check = np.column_stack([np.round(load[:6] / 10 + rng.normal(0, 4e-4, 6), 4), load[:6]])
        repeated = {tuple(row) for row in rows.tolist()}
        new = [at for at, row in enumerate(check.tolist()) if tuple(row) not in repeated]
        told_of += bool(set(copies(check, rows, [4e-4, 0.0])) & set(new))
    assert told_of <= binom.ppf(0.999, 200, 0.01)


@pytest.mark.parametrize(
    ("ratio", "column", "units"),
    [
        (1 / 4.4482216, 3, "lbf against N"),
        (4.4482216, 3, "N against lbf"),
        (1.3558179, 4, "N*m against lbf*ft"),
    ],
)
def test_a_run_in_another_unit_is_named_with_its_units(
    make_session: Make, ratio: float, column: int, units: str
) -> None:
    values = in_runs(81, 3, 5)
    values[27:54, column] *= ratio
    found = session_findings(session_in_runs(make_session, values))
    (finding,) = [one for one in found if one.rule == "run-scale"]
    assert finding.message.startswith(
        f"run 2 (rows 28 to 54): its loads are {ratio:.4g} times what most other"
    )
    assert f"the ratio of {units}" in finding.message
    # Advice follows the runs that agree.
    assert not {one.rule for one in found} & {"model", "lack-of-fit", "method"}


def test_indications_of_a_run_in_another_unit_are_named_too(make_session: Make) -> None:
    values = in_runs(80, 2, 5)
    values[:, :3] -= ZERO
    values[40:, :3] *= 1000
    finding = told(session_in_runs(make_session, values))["run-scale"]
    assert "run 2 (rows 41 to 80): its loads are 0.001 times what the other runs tell" in finding.message


def test_runs_that_load_one_axis_each_tell_no_scale(make_session: Make) -> None:
    rng = np.random.default_rng(4)
    loads = np.zeros((60, 3))
    for at, largest in enumerate((500.0, 100.0, 150.0)):
        loads[20 * at : 20 * at + 20, at] = np.linspace(-largest, largest, 20)
    values = np.column_stack([hub_rows(loads, loads), np.repeat([1.0, 2.0, 3.0], 20)])
    values[:, :3] += rng.normal(0, 2e-4, (60, 3))
    values[20:40, 3] += 3.0
    assert "run-scale" not in told(session_in_runs(make_session, values))
