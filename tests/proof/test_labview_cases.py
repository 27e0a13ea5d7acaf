"""Files as the machine's own program writes them."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import openpyxl
import pytest

from proof import cell_cases, files
from proof.draw import Drawn, draw_case
from proof.files import enter
from proof.labview_cases import HEADER


def drawn(*effect: str) -> Drawn:
    """Return a case with the effect, or a null."""
    return draw_case(5, 1, "single" if effect else "null", compare=False, picked=("labview", effect))


def test_the_program_computes_with_the_bench_and_prints_its_digits() -> None:
    case = drawn()
    for run, y in zip(case.scenario.runs, case.measured, strict=True):
        found = case.scenario.nominal(case.scenario.inputs(run), run, {})
        assert np.abs(found["FY"] - y["FY"]).max() <= 0.5e-4 * 1.001
        assert np.abs(found["MZ"] - y["MZ"]).max() <= 0.5e-5 * 1.001


def test_a_reversed_drum_turns_the_lateral_force_and_keeps_the_moment() -> None:
    case = drawn()
    for run, y in zip(case.scenario.runs, case.measured, strict=True):
        angle = run.fine["SA"].mean()
        turned = -1.0 if run.conditions["rotation"] == "reverse" else 1.0
        if abs(angle) > 0.9:
            assert np.sign(y["FY"].mean()) == -np.sign(angle) * turned


@pytest.mark.parametrize("effect", ["channel_sign", "channel_swap", "unit_error"])
def test_a_mistake_of_the_program_is_in_the_file(effect: str) -> None:
    case = drawn(effect)
    run = case.scenario.runs[1]
    right = case.scenario.nominal(case.scenario.inputs(run), run, {})
    wrong = case.measured[1]
    if effect == "unit_error":
        assert np.allclose(wrong["MZ"], right["MZ"] * cell_cases.LBF_FT, atol=1e-5)
    else:
        # E5 stands in the plane of the moment: its sign is seen in FY; a swap of the other two in MZ
        seen = "FY" if effect == "channel_sign" else "MZ"
        assert np.abs(wrong[seen] - right[seen]).max() > 0.5 * np.abs(right[seen]).max()


@pytest.mark.usefixtures("entered_here")
def test_the_file_has_the_machines_columns_and_the_case_no_time(tmp_path: Path) -> None:
    case = drawn()
    files.write_case(case.scenario, case.measured, tmp_path / "case")
    book = openpyxl.load_workbook(tmp_path / "case" / "run01.xlsx")
    assert book.active is not None
    rows = list(book.active.iter_rows(values_only=True))
    assert rows[0] == HEADER
    assert len(rows) == 1 + 60
    assert all(isinstance(x, float) for x in rows[1])
    assert "time =" not in (tmp_path / "case" / "CASE.toml").read_text()


def test_the_same_numbers_give_the_same_bytes(tmp_path: Path) -> None:
    case = drawn()
    for name in ("a", "b"):
        files.write_csv(
            files.table(case.scenario, case.scenario.runs[0], case.measured[0]), tmp_path / f"{name}.xlsx"
        )
    assert (tmp_path / "a.xlsx").read_bytes() == (tmp_path / "b.xlsx").read_bytes()


@pytest.mark.campaign(
    "sessions entered twice over: that of a drawn case is entered in every run (test_cells)"
)
@pytest.mark.usefixtures("entered_here")
def test_the_older_record_stands_in_the_registry_and_the_case_names_the_newer(tmp_path: Path) -> None:
    case = drawn("wrong_calibration")
    files.write_case(case.scenario, case.measured, tmp_path / "case")
    sessions = sorted((tmp_path / "case" / files.SESSIONS).iterdir())
    tool = [str(Path(sys.executable).with_name("toolkit"))]
    newest = enter(sessions, tmp_path / "calibrations", tool)
    assert newest.name == "m15-r2.json"
    assert newest.read_bytes() == (tmp_path / "case" / "record.json").read_bytes()
    assert (newest.parent / "m15-r1.json").exists()
