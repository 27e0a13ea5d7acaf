"""Balance form of AIAA R-091: a synthetic balance of known responses and tares is recovered."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.calibration.calibration_factory import csv_text, session_text
from toolkit.calibration.fit.balance import (
    BalanceForm,
    estimate_tares,
    fit_balance,
    loads_by_iteration,
    loads_by_newton,
)
from toolkit.calibration.fit.balance_report import balance_findings, report_balance
from toolkit.calibration.fit.session_fit import fit_session
from toolkit.calibration.session.read import read_session
from toolkit.calibration.terms import model_terms, term_matrix
from toolkit.errors import SessionError

LOADS = ("FX", "FY")
TERMS = model_terms("balance", LOADS)
FULL = np.array([1000.0, 600.0])
# Per unit of full scale, in mV/V: linear, |F|, F^2, F|F|, product, zero. Higher terms of 0.1 to 1 %.
TRUTH = np.array([
    [1.20, 0.05, 0.004, 0.001, 0.006, -0.003, 0.002, 0.001, 0.005, 0.010],
    [-0.04, 0.90, 0.001, -0.002, 0.003, 0.008, -0.001, 0.003, -0.004, -0.020],
])  # fmt: skip
TARES = np.array([[12.0, -3.0], [-5.0, 8.0], [-1.0, 20.0]])


def responses(loads: np.ndarray, truth: np.ndarray = TRUTH) -> np.ndarray:
    """Return what the balance reads, by its definition."""
    x, y = (loads / FULL).T
    columns = [x, y, abs(x), abs(y), x**2, y**2, x * abs(x), y * abs(y), x * y, np.ones(len(x))]
    return np.column_stack(columns) @ truth.T


def named(values: np.ndarray, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    return dict(zip(names, values.T, strict=True))


def applied(rows: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Return loads (rows, 2) and their run 1, 2, 3."""
    rng = np.random.default_rng(seed)
    return rng.uniform(-1, 1, (rows, 2)) * FULL, 1.0 + np.arange(rows) * 3 // rows


def per_full_scale(form: BalanceForm) -> np.ndarray:
    scale = term_matrix(form.terms, {n: np.array([f]) for n, f in zip(LOADS, FULL, strict=True)})
    return form.coefficients * scale


def test_response_coefficients_are_recovered() -> None:
    loads, _ = applied(80)
    form = fit_balance(loads=named(loads, LOADS), responses=named(responses(loads), ("A", "B")))
    assert form.terms == TERMS
    assert form.not_excited == ()
    assert per_full_scale(form) == pytest.approx(TRUTH, abs=1e-12)


@pytest.mark.parametrize("solve", [loads_by_iteration, loads_by_newton])
def test_loads_come_back_from_responses(solve: Callable[..., object]) -> None:
    loads, _ = applied(80)
    form = fit_balance(loads=named(loads, LOADS), responses=named(responses(loads), ("A", "B")))
    others, _ = applied(50, seed=2)
    solved = solve(form, responses(others))
    assert solved.loads == pytest.approx(others, abs=1e-7)  # type: ignore[attr-defined]
    assert solved.steps <= 12  # type: ignore[attr-defined]


def test_iteration_and_newton_agree_with_noise() -> None:
    loads, _ = applied(80)
    read = responses(loads) + np.random.default_rng(3).normal(0, 1e-4, (80, 2))
    form = fit_balance(loads=named(loads, LOADS), responses=named(read, ("A", "B")))
    one, two = loads_by_iteration(form, read), loads_by_newton(form, read)
    assert (np.abs(one.loads - two.loads) / FULL).max() < 1e-9
    assert two.steps < one.steps


def test_slopes_against_differences() -> None:
    loads, _ = applied(80)
    form = fit_balance(loads=named(loads, LOADS), responses=named(responses(loads), ("A", "B")))
    step = 1e-3
    for j in range(2):
        shift = np.zeros(2)
        shift[j] = step
        difference = (form.predict(loads + shift) - form.predict(loads - shift)) / (2 * step)
        assert form.slopes(loads)[:, :, j] == pytest.approx(difference, abs=1e-9)


def test_an_iteration_that_diverges_is_an_error() -> None:
    # Squares that outweigh the linear part twice at full scale: no contraction.
    truth = TRUTH.copy()
    truth[0, 4] = 3.0
    loads, _ = applied(80)
    form = fit_balance(loads=named(loads, LOADS), responses=named(responses(loads, truth), ("A", "B")))
    with pytest.raises(SessionError) as caught:
        loads_by_iteration(form, responses(np.array([[900.0, 500.0]]), truth))
    assert caught.value.rule == "not-converged"
    assert "row 1" in str(caught.value.got)
    assert caught.value.next_step


def test_tares_and_coefficients_with_a_natural_zero() -> None:
    loads, run = applied(150)
    read = responses(loads + TARES[run.astype(int) - 1])
    zero = {"A": 0.010, "B": -0.020}
    found = estimate_tares(
        loads=named(loads, LOADS), responses=named(read, ("A", "B")), run=run, natural_zero=zero
    )
    assert not found.relative
    assert found.runs == (1, 2, 3)
    assert found.values == pytest.approx(TARES, abs=1e-6 * 1000)
    assert per_full_scale(found.form) == pytest.approx(TRUTH, abs=1e-6)


def test_without_a_natural_zero_the_differences_of_tares() -> None:
    loads, run = applied(150)
    tares = TARES - TARES.mean(axis=0)
    noise = np.random.default_rng(4).normal(0, 2e-5, (150, 2))
    read = responses(loads + tares[run.astype(int) - 1]) + noise
    found = estimate_tares(loads=named(loads, LOADS), responses=named(read, ("A", "B")), run=run)
    assert found.relative
    assert np.abs(found.values.sum(axis=0)).max() < 1e-9
    assert (np.abs(found.values - tares) / found.standard_errors).max() < 5
    # Noise of 2e-5 mV/V over 50 rows a run, 1.2 mV/V at full scale.
    assert found.standard_errors[0, 0] == pytest.approx(2e-5 / 1.2 * 1000 * np.sqrt(2 / 3 / 50), rel=0.3)


def test_one_run_has_no_tare_but_its_constant() -> None:
    loads, _ = applied(80)
    read = named(responses(loads), ("A", "B"))
    found = estimate_tares(loads=named(loads, LOADS), responses=read, run=np.ones(80))
    assert found.values.tolist() == [[0.0, 0.0]]


def test_terms_that_the_loads_cannot_tell_are_named() -> None:
    loads, _ = applied(80)
    loads[:40, 0] = 0.0
    loads[40:, 1] = 0.0  # never together
    loads[:, 1] = np.abs(loads[:, 1])  # and FY of one sign
    form = fit_balance(loads=named(loads, LOADS), responses=named(responses(loads), ("A", "B")))
    assert set(form.not_excited) == {"abs(FY)", "FY*abs(FY)", "FX*FY"}


def test_fewer_indications_than_loads_is_an_error() -> None:
    loads, _ = applied(80)
    with pytest.raises(SessionError) as caught:
        fit_balance(loads=named(loads, LOADS), responses={"A": responses(loads)[:, 0]})
    assert caught.value.rule == "balance"


@pytest.fixture
def balance_session(tmp_path: Path) -> Path:
    """A session of the balance with tares in its runs, on disk."""
    loads, _ = applied(200, seed=5)
    run = np.arange(200) // 20
    tares = np.random.default_rng(6).uniform(-1, 1, (10, 2)) * [20.0, 10.0]
    tares -= tares.mean(axis=0)
    read = responses(loads + tares[run]) + np.random.default_rng(7).normal(0, 2e-5, (200, 2))
    names = ["A [mV/V]", "B [mV/V]", "FX [N]", "FY [N]"]
    (tmp_path / "loads.csv").write_text(csv_text(names, np.column_stack([read, loads]), runs=True))
    path = tmp_path / "SESSION.toml"
    path.write_text(
        session_text(
            indications='["A", "B"]',
            loads='["FX", "FY"]',
            instrument='"balance"',
            model='"balance"',
            check="-",
        )
    )
    np.savetxt(tmp_path / "tares.txt", tares)
    return path


def test_a_balance_session_reports_both_forms(balance_session: Path) -> None:
    fit = fit_session(read_session(balance_session))
    report = report_balance(fit)
    assert report.tares is not None
    assert report.tares.values == pytest.approx(np.loadtxt(balance_session.parent / "tares.txt"), abs=0.05)
    assert report.newton_difference < 1e-9
    for one in report.loads:
        # Noise alone is left with the tares known (2e-5 of 1.2 or 0.9 mV/V); without them about 1 %.
        assert one.iterated_sd_percent_fs == pytest.approx(2e-3, rel=0.3)
        assert one.direct_sd_percent_fs > 100 * one.iterated_sd_percent_fs
    notes = balance_findings(fit)
    assert {one.rule for one in notes} == {"tare"}
    assert {one.level for one in notes} == {"note"}


def test_a_form_that_cannot_be_is_a_note_not_an_end(balance_session: Path) -> None:
    text = balance_session.read_text()
    balance_session.write_text(text.replace('["A", "B"]', '["A"]').replace('"balance"\n', '"balance"\n', 1))
    lines = (balance_session.parent / "loads.csv").read_text().splitlines()
    kept = [",".join(cell for i, cell in enumerate(line.split(",")) if i != 1) for line in lines]
    (balance_session.parent / "loads.csv").write_text("\n".join(kept) + "\n")
    notes = balance_findings(fit_session(read_session(balance_session)))
    assert [one.rule for one in notes] == ["balance"]
    assert "1 indications, 2 loads" in notes[0].message
