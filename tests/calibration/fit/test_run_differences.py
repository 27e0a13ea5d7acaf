"""What runs differ by beyond zero and gain: drawn sessions with one cause each, and sound ones with none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from toolkit.calibration.fit.findings import session_findings
from toolkit.calibration.fit.session_fit import fit_session
from toolkit.calibration.session.read import read_session
from toolkit.findings import Finding

TRUTH = np.array([[6650.0, 6740.0, 6690.0], [-318.0, 333.0, -5.0], [332.0, 337.0, -669.0]])
NAMES = ("cell-gains", "run-apart", "copied-runs")
LARGEST = (6000.0, 500.0, 600.0)
SHARES = (0.0, 0.25, 0.5, 0.75, 1.0, 0.75, 0.5, 0.25)


def one_run(
    rng: np.random.Generator, *, gains: object = 1.0, zero: object = 0.0, truth: NDArray[np.float64] = TRUTH
) -> NDArray[np.float64]:
    """Return rows of one run (rows, 7): direction (1 up), three cells in mV/V, three loads."""
    response, rows = np.linalg.inv(truth), []
    for axis in range(3):
        for sign in (1, -1):
            for at, share in enumerate(SHARES):
                load = np.zeros(3)
                load[axis] = sign * share * LARGEST[axis]
                read = np.asarray(gains) * (response @ load) + np.asarray(zero) + rng.normal(0, 2e-5, 3)
                rows.append([float(at <= 4), *read, *load])
    return np.array(rows)


def told(folder: Path, runs: list[NDArray[np.float64]]) -> list[Finding]:
    lines = ["run,direction,A [mV/V],B [mV/V],C [mV/V],FY [N],MZ [N*m],MX [N*m]"]
    for number, rows in enumerate(runs, start=1):
        for up, *values in rows.tolist():
            cells = ",".join(f"{value:.6f}" for value in values)
            lines.append(f"{number},{'up' if up else 'down'},{cells}")
    folder.mkdir()
    (folder / "loads.csv").write_text("\n".join(lines) + "\n")
    (folder / "SESSION.toml").write_text(
        'instrument = "hub"\ndate = 2026-01-05\noperator = "A"\nindications = ["A", "B", "C"]\n'
        'loads = ["FY", "MZ", "MX"]\ndata = "loads.csv"\n'
    )
    fit = fit_session(read_session(folder / "SESSION.toml"))
    return [finding for finding in session_findings(fit) if finding.rule in NAMES]


def test_sound_runs_with_zeros_and_gains_of_their_own_are_told_nothing(tmp_path: Path) -> None:
    for seed in range(12):
        rng = np.random.default_rng(seed)
        runs = [one_run(rng, gains=1 + rng.normal(0, 5e-4), zero=rng.normal(0, 1e-3, 3)) for _ in range(3)]
        assert not told(tmp_path / str(seed), runs)


def test_cells_that_change_by_themselves_are_told_with_their_size(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    runs = [one_run(rng, gains=1 + rng.normal(0, 1e-3, 3)) for _ in range(4)]
    (finding,) = told(tmp_path / "s", runs)
    assert (finding.rule, finding.level) == ("cell-gains", "warning")
    size = float(finding.message.partition("to run by ")[2].split()[0])
    # 0.1 % of each, three cells of four runs less their mean and common gain: six degrees of freedom.
    assert 0.03 < size < 0.2


@pytest.mark.parametrize("count", [3, 5])
def test_a_run_of_another_hub_is_named_and_refuses_an_approval(tmp_path: Path, count: int) -> None:
    rng = np.random.default_rng(2)
    other = TRUTH * np.array([1.08, 0.97, 1.02])
    runs = [one_run(rng, truth=other if number == 1 else TRUTH) for number in range(count)]
    findings = told(tmp_path / "s", runs)
    assert {(one.rule, one.level) for one in findings} == {("run-apart", "error")}
    assert all(one.message.startswith("run 2 lies") for one in findings)


def test_a_run_that_was_copied_and_changed_in_the_last_digit_is_told(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    first, third = one_run(rng), one_run(rng)
    copy = first.copy()
    copy[:, 1:4] += 1e-6 + rng.uniform(-1e-6, 1e-6, copy[:, 1:4].shape)
    (finding,) = told(tmp_path / "a", [first, copy, third])
    assert finding.rule == "copied-runs"
    assert finding.message.startswith("runs 1 and 2 repeat")
    # All runs of one recording: nothing else is left to compare them with but the rows of one run.
    again = first.copy()
    again[:, 1:4] += 1e-6
    (finding,) = told(tmp_path / "b", [first, again])
    assert "rows of one run at one load" in finding.message


def test_hysteresis_that_repeats_is_no_copy(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    runs = [one_run(rng) for _ in range(3)]
    for rows in runs:
        # Ten times the noise, the same in every run, and no parabola over the load.
        rows[:, 1:4] += 2e-4 * (1 - rows[:, :1]) * np.sin(9 * rows[:, 4:5] / LARGEST[0])
    assert not [one for one in told(tmp_path / "s", runs) if one.rule == "copied-runs"]
