"""The three cells of a drum test, and the record that the public commands make and use of them."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from proof import cell_cases, files, tire_steady
from proof.draw import draw_case
from proof.model import Scenario

TOOLKIT = Path(sys.executable).with_name("toolkit")


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    """A drum test with cells."""
    return cell_cases.build(np.random.default_rng([1, 5]), frozenset())


def test_the_cells_carry_the_loads_that_the_matrix_gives_back(scenario: Scenario) -> None:
    run, p = scenario.runs[0], scenario.true_parameters()
    y = scenario.truth(run, p, {})
    assert scenario.written is not None
    cells = scenario.written(y)
    # FY is the sum of the forces on the cells, each read within 2 %
    total = sum(cells[c] for c in cell_cases.CELLS) * cell_cases.LBF
    assert (
        np.abs(total - y["FY"]).max() < 0.025 * sum(np.abs(cells[c]).max() for c in cell_cases.CELLS) * 4.45
    )


def test_under_load_the_cells_grow_together_as_in_figure_4_4(scenario: Scenario) -> None:
    y = scenario.truth(scenario.runs[1], scenario.true_parameters(), {})
    assert scenario.written is not None
    cells = scenario.written(y)
    at = int(np.argmax(y["FY"]))
    assert cells["D51"][at] > 0
    assert cells["D52"][at] > 0
    assert cells["E5"][at] < 0


def test_a_swap_is_nearly_invisible_in_fy_and_plain_in_mz(scenario: Scenario) -> None:
    run, p = scenario.runs[0], scenario.true_parameters()
    effect = {"channel_swap": {"channel": "D51", "with": "D52"}}
    change = {
        k: np.abs(scenario.truth(run, p, effect)[k] - scenario.truth(run, p, {})[k]).max()
        for k in ("FY", "MZ")
    }
    size = {k: np.abs(scenario.truth(run, p, {})[k]).max() for k in ("FY", "MZ")}
    assert change["FY"] < 0.05 * size["FY"]
    assert change["MZ"] > 0.5 * size["MZ"]


def test_an_unknown_effect_of_a_cell_is_an_error(scenario: Scenario) -> None:
    with pytest.raises(KeyError):
        cell_cases.disturbed(
            "friction", {"channel": "D51"}, {"D51": np.zeros(2)}, scenario.runs[0], np.zeros(2)
        )


def test_the_public_command_finds_the_cells_of_the_session(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    matrix = cell_cases.geometry(rng)
    for name, text in cell_cases.session_files(rng, matrix).items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    ran = subprocess.run(
        [TOOLKIT, "calibrate", "SESSION.toml", "--calibrations", "registry", "--json"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stdout + ran.stderr
    loads = json.loads(ran.stdout)["loads"]
    for load, row in (("FY", matrix[0]), ("MZ", matrix[1])):
        found = [loads[load]["coefficients"][cell] for cell in cell_cases.CELLS]
        assert found == pytest.approx(list(row), abs=3e-4)


@pytest.mark.usefixtures("entered_here")
def test_a_case_with_cells_names_its_record_and_has_no_loads(tmp_path: Path) -> None:
    drawn = draw_case(9, 0, "null", picked=("tire-cells", ()))
    files.write_case(drawn.scenario, drawn.measured, tmp_path / "case")
    head = (tmp_path / "case" / "run01.csv").read_text().splitlines()[0].split(",")
    assert {"D51", "D52", "E5"} <= set(head)
    assert not {"FY", "MZ", "MX"} & set(head)
    assert 'calibration = "record.json"' in (tmp_path / "case" / "CASE.toml").read_text()
    assert (tmp_path / "case" / "record.json").stat().st_size > 100


@pytest.mark.parametrize(("pressure", "camber"), [(False, False), (True, False), (False, True)])
def test_the_tire_file_means_the_same_to_the_public_command(
    tmp_path: Path, pressure: bool, camber: bool
) -> None:
    tire = tire_steady.draw_magic_formula(np.random.default_rng(3), pressure=pressure, camber=camber)
    (tmp_path / "tire.tir").write_text(tire_steady.tir_text(tire, fittyp=61 if pressure else 52))
    sa, fz = np.repeat(np.linspace(-12, 12, 13), 3), np.tile([1500.0, 4000.0, 6000.0], 13)
    kpa = np.tile([200.0, 220.0, 245.0], 13) if pressure else np.full(39, 220.0)
    grid = pd.DataFrame({"SA [deg]": sa, "FZ [N]": fz} | ({"P [kPa]": kpa} if pressure else {}))
    if camber:
        grid["IA [deg]"] = 1.5
    grid.to_csv(tmp_path / "grid.csv", index=False)
    subprocess.run(
        [TOOLKIT, "evaluate", "tire.tir", "grid.csv", "--axes", "SAE", "--out", "out.csv"],
        cwd=tmp_path, capture_output=True, check=True,
    )  # fmt: skip
    out = pd.read_csv(tmp_path / "out.csv")
    fy, mz = tire.forces(
        np.radians(sa), fz, tire_steady.Scales(pressure=kpa, camber=math.radians(1.5) if camber else 0.0)
    )
    assert np.allclose(out["FY [N]"], fy, rtol=1e-9, atol=1e-6)
    assert np.allclose(out["MZ [N*m]"], mz, rtol=1e-9, atol=1e-7)
