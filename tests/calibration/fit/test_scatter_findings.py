"""What is told of scatter: stated uncertainties that it contradicts, runs that tell nothing of each other."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from tests.calibration.calibration_factory import hub_data
from tests.calibration.fit.test_row_noise import drawn_session
from toolkit.calibration.fit.findings import session_findings
from toolkit.calibration.fit.session_fit import fit_session
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.stored import stored_loads
from toolkit.calibration.session.read import read_session
from toolkit.calibration.uncertainty.budget import calibration_budget
from toolkit.findings import Finding

Make = Callable[..., Path]


def findings(path: Path, rule: str) -> list[Finding]:
    return [entry for entry in session_findings(fit_session(read_session(path))) if entry.rule == rule]


def renumbered(path: Path, rows: int) -> Path:
    """Number runs of so many rows each, in the order of reading."""
    data = path.with_name("loads.csv")
    head, *lines = data.read_text().splitlines()
    lines = [f"{at // rows + 1},{line.partition(',')[2]}" for at, line in enumerate(lines)]
    data.write_text("\n".join([head, *lines]) + "\n")
    return path


def expanded(path: Path, folder: Path) -> float:
    registry = Registry(folder)
    record = registry.load(calibrate(path, registry).record.id)
    loads = stored_loads(registry.folder, record)
    assert loads is not None
    return calibration_budget(record, loads, None, "F").U


@pytest.mark.parametrize("method", ["wls", "odr", "gls"])
def test_uncertainties_that_the_scatter_contradicts_are_told_with_their_ratio(
    tmp_path: Path, method: str
) -> None:
    path = drawn_session(tmp_path / "s", method, 1, runs=1.0, u=0.1)
    text = path.read_text().replace("u = 0.0001", "u = 0.00001")
    path.write_text(text)
    (told,) = findings(path, "stated-u")
    assert told.level == "warning"
    # Ten times as large as stated; 54 rows tell a standard deviation to a tenth.
    ratio = float(told.message.partition("within runs ")[2].split()[0])
    assert ratio == pytest.approx(10, rel=0.25)


@pytest.mark.parametrize("method", ["wls", "odr", "gls"])
def test_runs_alone_that_differ_by_more_than_is_stated_are_a_note(tmp_path: Path, method: str) -> None:
    (told,) = findings(drawn_session(tmp_path / "s", method, 1, runs=1.0), "stated-u")
    assert told.level == "note"
    assert "what runs differ by" in told.message


@pytest.mark.parametrize("method", ["wls", "odr", "gls"])
def test_uncertainties_as_large_as_the_scatter_are_not_told(tmp_path: Path, method: str) -> None:
    assert not findings(drawn_session(tmp_path / "s", method, 2, runs=0.0), "stated-u")


@pytest.mark.parametrize("rows", [1, 2])
def test_runs_of_a_row_or_two_count_as_one_run_and_make_no_U_smaller(tmp_path: Path, rows: int) -> None:
    path = drawn_session(tmp_path / "s", "ols", 4, runs=1.0)
    sound = expanded(path, tmp_path / "sound")
    renumbered(path, rows)
    (told,) = findings(path, "one-run")
    assert told.message.startswith(f"54 rows in {54 // rows} runs")
    assert expanded(path, tmp_path / "untold") >= sound


def test_a_run_of_each_row_is_told_for_every_method(tmp_path: Path) -> None:
    for method in ("ols", "wls", "odr", "gls"):
        path = renumbered(drawn_session(tmp_path / method, method, 4, runs=1.0), 1)
        assert findings(path, "one-run")


def test_scatter_that_gains_of_unnumbered_runs_make_does_not_lead_to_weights(tmp_path: Path) -> None:
    path = drawn_session(tmp_path / "s", "ols", 6, runs=1.0)
    assert not findings(path, "method")
    for rows in (1, 54):
        (told,) = findings(renumbered(path, rows), "method")
        assert "wls" not in told.message
        assert "runs differ in gain" in told.message


def test_scatter_that_grows_within_runs_leads_to_weights(tmp_path: Path) -> None:
    path = drawn_session(tmp_path / "s", "ols", 1, runs=0.0)
    rng = np.random.default_rng(3)
    head, *lines = path.with_name("loads.csv").read_text().splitlines()
    rows = []
    for line in lines:
        run, direction, cell, load, u = line.split(",")
        cell = f"{float(load) / 1250 * (1 + rng.normal(0, 2e-3)):.9f}"
        rows.append(",".join((run, direction, cell, load, u)))
    path.with_name("loads.csv").write_text("\n".join([head, *rows]) + "\n")
    (told,) = findings(path, "method")
    assert 'method = "wls"' in told.message


@pytest.mark.parametrize(
    ("k", "is_told"), [("0.5", True), ("1", False), ("2", False), ("13.97", False), ("100", True)]
)
def test_a_coverage_factor_that_no_certificate_states_is_told(
    make_session: Make, k: str, is_told: bool
) -> None:
    reference = f'[reference.uncertainty]\nFY = {{ U = 0.4, k = {k}, unit = "lbf" }}\n'
    path = make_session(hub_data(60, 1))
    path.write_text(path.read_text() + reference)
    assert bool(findings(path, "reference-k")) is is_told
