"""Cases that an outside trial of sessions brought: a wrong uncertainty, or an alarm without cause."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.calibration.calibration_factory import hub_data
from tests.calibration.uncertainty_factory import levels, record_of_table, table_of
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.stored import stored_loads
from toolkit.calibration.uncertainty.budget import calibration_budget
from toolkit.calibration.uncertainty.common_errors import record_covariance

Make = Callable[..., Path]


def with_column(path: Path, header: str, value: str) -> None:
    lines = path.read_text().splitlines()
    path.write_text("\n".join([f"{lines[0]},{header}", *(f"{line},{value}" for line in lines[1:])]) + "\n")


def test_uncertainties_of_rows_count_where_the_fit_does_not_weigh_by_them(
    make_session: Make, tmp_path: Path
) -> None:
    """u_FY = 4 N row by row under ordinary least squares: at full scale the reference's share is 4 N."""
    path = make_session()
    with_column(path.parent / "loads.csv", "u_FY [N]", "4.0")
    registry = Registry(tmp_path / "cal")
    record = registry.load(calibrate(path, registry).record.id)
    loads = stored_loads(registry.folder, record)
    assert loads is not None
    part = calibration_budget(record, loads, None, "FY").component("reference")
    assert part.stated
    assert part.u == pytest.approx(4.0 / 4.4482216152605, rel=1e-9)
    c = np.asarray(record.loads[0].coefficients)
    added = record_covariance(record)["FY"] - np.asarray(record.loads[0].covariance)
    share = part.u / record.loads[0].largest
    assert added == pytest.approx(share**2 * np.outer(c, c), rel=1e-6)


def test_an_intercept_that_tared_rows_leave_is_part_of_the_uncertainty() -> None:
    """2 N at zero load, far beyond its scatter: every tared reading has them, so U at zero holds them."""
    load, run, direction = levels(runs=3)
    rng = np.random.default_rng(4)
    read = (load - 2.0 + rng.normal(0, 0.1, len(load))) / 500
    table = table_of(read, load, run=run, direction=direction)
    tared, included = (record_of_table(table, fit_zero=zero) for zero in ("tared", "included"))
    part = calibration_budget(tared, table, None, "F", 0.0).component("zero")
    assert part.u == pytest.approx(2.0 / np.sqrt(3), rel=0.05)
    assert calibration_budget(included, table, None, "F", 0.0).component("zero").u == 0.0
    assert record_covariance(tared)["F"][1][1] - record_covariance(included)["F"][1][1] == pytest.approx(
        part.u**2, rel=1e-6
    )


@pytest.mark.campaign("many sessions of short runs: gains of longer runs are told in every run")
def test_runs_of_two_rows_tell_their_gain(make_session: Make, tmp_path: Path) -> None:
    """Sixty runs of a zero and one load, gain 0.1 % from run to run: U at full scale holds it."""
    rng = np.random.default_rng(9)
    values = np.repeat(hub_data(60, 1, noise=0.0), 2, axis=0)
    values[::2, 3:] = 0.0
    zero = np.array([0.012, -0.008, 0.02])
    values[::2, :3] = zero
    gain = 1 + rng.normal(0, 1e-3, 60).repeat(2)[:, None]
    values[:, :3] = zero + gain * (values[:, :3] - zero) + rng.normal(0, 2e-6, (120, 3))
    path = make_session(values, zero='"run"', check="-")
    text = (path.parent / "loads.csv").read_text().splitlines()
    rows = [re.sub(r",\d+,(up|down)$", f",{at // 2 + 1},up", line) for at, line in enumerate(text[1:])]
    (path.parent / "loads.csv").write_text("\n".join([text[0], *rows]) + "\n")
    record = calibrate(path, Registry(tmp_path / "cal")).record
    for one in record.loads:
        assert one.scatter is not None
        # 60 runs know a standard deviation to a tenth; the largest load of a run is not the same in each.
        assert one.scatter.gain == pytest.approx(1e-3 * one.largest, rel=0.35)


def gains(rng: np.random.Generator, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rows whose runs, of twenty rows each, differ in gain by 0.1 %, twenty times the noise."""
    moved = values.copy()
    zero = np.array([0.012, -0.008, 0.02])
    gain = 1 + rng.normal(0, 1e-3, 1 + len(values) // 20)[np.arange(len(values)) // 20][:, None]
    moved[:, :3] = zero + gain * (moved[:, :3] - zero)
    return moved


@pytest.mark.parametrize("seed", range(4))
def test_rows_of_runs_that_differ_in_gain_are_no_outliers(
    make_session: Make, tmp_path: Path, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    path = make_session(gains(rng, hub_data(200, 10 + seed)), name=f"gains{seed}")
    made = calibrate(path, Registry(tmp_path / "cal"))
    assert not [one for one in made.findings if one.rule in ("outlier", "robust")]
    # One row that is wrong is found all the same.
    values = gains(np.random.default_rng(seed), hub_data(200, 10 + seed))
    values[77, 0] += 2e-3
    made = calibrate(make_session(values, name=f"wrong{seed}"), Registry(tmp_path / "wrong"))
    assert [one.where for one in made.findings if one.rule == "outlier" and "row 78" in one.where]


def test_a_reference_that_is_coarser_than_the_cell_is_told(make_session: Make, tmp_path: Path) -> None:
    tail = "[reference.uncertainty]\nFY = { U = 200, k = 2, unit = '%' }\n"
    made = calibrate(make_session(tail=tail), Registry(tmp_path / "cal"))
    assert [one.where for one in made.findings if one.rule == "coarse-reference"] == ["FY"]
