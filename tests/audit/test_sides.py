"""A disagreement is evidence about both sides: wrong forces are repaired, changed cells never are."""

from __future__ import annotations

import datetime as dt
from pathlib import Path

import numpy as np
import pytest

from tests.audit.archive_made import FY, MZ, dated, factory, recording, write
from toolkit.audit.archive import audit_archive
from toolkit.audit.corrected import write_copies
from toolkit.audit.inspection import inspect_file
from toolkit.calibration.registry.registry import Registry
from toolkit.lab.archives.audit_answer import AuditOutcome, text_of
from toolkit.lab.archives.audit_headline import headline

REGISTRY = Registry(Path(__file__).resolve().parents[2] / "calibrations")
WRONG = (*FY[:2], -FY[2], FY[3])
ROWS = 200  # 40 at each load


def audit(folder):
    return audit_archive(folder, REGISTRY, known_at=dt.date(2026, 1, 1))


def one(tmp_path, table):
    dated(tmp_path / "a" / "test", "2019-06-01")
    write(tmp_path / "a" / "test" / "run.xlsx", table)
    made = audit(tmp_path / "a")
    (file,) = made.files
    return made, file


def with_turned_cell(table, rows, cell="E5"):
    values = np.array(table[cell])
    values[rows] = -values[rows]
    return table | {cell: values}


def with_wrong_force(rows, **more):
    right, wrong = recording(rows=ROWS, **more), recording(rows=ROWS, FY=WRONG, **more)
    force = np.array(right["FY"])
    force[rows] = wrong["FY"][rows]
    return right | {"FY": force}


MIDDLE = slice(90, ROWS)  # from the middle of a load block on


def test_a_cell_turned_in_mid_block_is_not_blamed_on_the_force(tmp_path):
    made, file = one(tmp_path, with_turned_cell(recording(rows=ROWS), MIDDLE))
    assert file.grade == "altered_cells"
    assert file.sides.side == "cells"
    assert file.sides.grade == "stale"
    assert "row 91" in file.sides.reason
    assert headline(made).wrong == 0
    assert headline(made).altered == 1
    (copy,) = write_copies(made, REGISTRY, tmp_path / "fixed")
    assert copy.sha256 is None
    assert copy.reason.startswith("cells-disagree")
    assert not list((tmp_path / "fixed").rglob("*.xlsx"))


def test_a_force_of_a_wrong_sign_in_mid_block_is_repaired(tmp_path):
    made, file = one(tmp_path, with_wrong_force(MIDDLE))
    assert file.grade == "sign_variant"
    assert file.sides.side == "forces"
    (copy,) = write_copies(made, REGISTRY, tmp_path / "fixed")
    assert copy.reason is None


def test_a_whole_load_block_is_told_by_the_curve_over_load(tmp_path):
    _, file = one(tmp_path, with_turned_cell(recording(rows=ROWS), slice(80, 120)))
    assert file.grade == "altered_cells"
    assert "curve over load" in file.sides.reason
    _, file = one(tmp_path, with_wrong_force(slice(80, 120)))
    assert file.grade == "sign_variant"


def test_one_changed_reading_is_the_cells_and_one_changed_force_the_forces(tmp_path):
    table = recording(rows=ROWS)
    cell = np.array(table["D51"])
    cell[99] += 30.0
    _, file = one(tmp_path, table | {"D51": cell})
    assert file.grade == "altered_cells"
    force = np.array(table["FY"])
    force[99] += 30.0
    _, file = one(tmp_path, table | {"FY": force})
    assert file.grade == "unknown"
    assert file.sides.side == "forces"


def test_what_a_tire_cannot_do_decides_a_whole_file(tmp_path):
    _, file = one(tmp_path, recording(rows=ROWS, FY=WRONG))  # 0.75 of the load at zero slip
    assert (file.grade, file.sides.side) == ("sign_variant", "forces")
    _, file = one(tmp_path, with_turned_cell(recording(rows=ROWS), slice(None)))
    assert (file.grade, file.sides.side) == ("altered_cells", "cells")


# Cells of a wheel: side force and aligning moment over the slip angle [deg], shared by D51, D52 and E5.


def rolling(angle, *, seed, FY=FY):
    rng = np.random.default_rng(seed)
    load = np.repeat([250.0, 567.0, 833.0, 1101.0, 1372.0], ROWS // 5) + rng.normal(0, 0.5, ROWS)
    slip = np.tanh(angle / 3.0)
    force, moment = -0.8 * slip * load, 0.05 * slip * load * np.exp(-abs(angle) / 4)
    middle = 0.3 * force - 0.5 * load  # and the preload of untared cells
    half = (force - middle) / 2
    x = np.column_stack([half - 3.1 * moment, half + 3.1 * moment, middle])
    x = factory.printed(x + rng.normal(0, 0.05, x.shape))
    table = {"FZ": load, "D52": x[:, 1], "D51": x[:, 0], "E5": x[:, 2],
             "SA": angle + rng.normal(0, 0.001, ROWS), "FY": x @ FY[:3] + FY[3],
             "MZ": x @ MZ[:3] + MZ[3]}  # fmt: skip
    return {name: factory.printed(values) for name, values in table.items()}


ANGLES = (-12.0, -9.0, -6.0, -4.0, -2.0, -1.0, 0.0, 1.0, 2.0, 4.0, 6.0, 9.0, 12.0)


def a_test(folder, changed):
    dated(folder / "test", "2019-06-01", 'rotation = "forward"\n')
    for number, angle in enumerate(ANGLES):
        write(folder / "test" / f"run_{number:02d}.xlsx", changed(number, rolling(angle, seed=number)))


def exchanged(table):
    return table | {"D51": table["D52"], "D52": table["D51"]}


def test_a_file_whose_cells_were_exchanged_is_told_by_the_other_files(tmp_path):
    a_test(tmp_path / "a", lambda number, table: exchanged(table) if number == 3 else table)
    made = audit(tmp_path / "a")
    grades = {file.path: file.grade for file in made.files}
    assert grades.pop("test/run_03.xlsx") == "altered_cells"
    assert set(grades.values()) == {"exact"}
    (line,) = [line for line in made.files.plain() if line["grade"] == "altered_cells"]
    assert "curve that the other files make" in line["sides"]["reason"]


def test_alone_such_a_file_is_open_and_says_what_would_decide(tmp_path):
    made, file = one(tmp_path, exchanged(rolling(-4.0, seed=3)))
    assert file.grade == "column_swap"  # what explains the rows; on which side, nothing says
    assert file.sides.side == "open"
    assert any("would decide" in finding.message for finding in made.findings)
    assert headline(made).wrong == 0
    assert headline(made).disputed == 1
    (copy,) = write_copies(made, REGISTRY, tmp_path / "fixed")
    assert copy.sha256 is None


def test_a_wrong_equation_in_every_file_of_a_test_stays_a_wrong_equation(tmp_path):
    a_test(tmp_path / "a", lambda number, _: rolling(ANGLES[number], seed=number, FY=WRONG))
    made = audit(tmp_path / "a")
    assert {file.grade for file in made.files} == {"sign_variant"}
    assert headline(made).wrong == len(ANGLES)
    copies = write_copies(made, REGISTRY, tmp_path / "fixed")
    assert all(copy.sha256 is not None for copy in copies)


def test_a_falsified_copy_is_not_approved_when_it_is_audited_again(tmp_path):
    table = with_turned_cell(recording(rows=ROWS), MIDDLE)
    x = np.column_stack([table["D51"], table["D52"], table["E5"]])
    forged = table | {
        "FY": factory.printed(x @ np.array(FY[:3]) + FY[3]),
        "MZ": factory.printed(x @ np.array(MZ[:3]) + MZ[3]),
    }
    made, file = one(tmp_path, forged)
    assert file.grade == "exact"
    assert not made.clean
    assert any(finding.rule == "discontinuity" for finding in made.findings)
    assert "carries the values" not in headline(made).sentence


def test_a_corrected_copy_is_known_again_and_proves_nothing(tmp_path):
    made, _ = one(tmp_path, recording(rows=ROWS, FY=WRONG))
    write_copies(made, REGISTRY, tmp_path / "fixed")
    again = audit(tmp_path / "fixed")
    assert [finding.rule for finding in again.findings if finding.rule == "corrected-copy"]
    assert "proves nothing of the cells" in headline(again).sentence


def test_inspect_gives_no_corrected_values_of_changed_cells(tmp_path):
    one(tmp_path, with_turned_cell(recording(rows=ROWS), MIDDLE))
    seen = inspect_file(tmp_path / "a" / "test" / "run.xlsx", REGISTRY)
    assert seen.identification.grade == "altered_cells"
    assert seen.corrected_by is None
    assert all(block.FY_N is None for block in seen.blocks)


def test_a_difference_below_what_is_printed_is_no_wrong_force():
    from toolkit.lab.archives.audit_headline import headline_of

    line = {"path": "a", "grade": "stale", "date": "2026-01-02", "record": "m15-r1", "variant": None,
            "sides": None, "notes": [], "repair": {"FY_max_abs_N": 0.02, "MZ_max_abs_Nm": 0.001}}  # fmt: skip
    told = headline_of([line, line | {"repair": {"FY_max_abs_N": 30.0, "MZ_max_abs_Nm": 0.0}}])
    assert (told.wrong, told.small) == (1, 1)
    assert "1 file carries a wrong Fy" in told.sentence
    assert "less than 0.1 N and 0.01 N·m" in told.sentence


def test_notes_and_lock_files_are_listed_apart(tmp_path):
    made, _ = one(tmp_path, recording(rows=ROWS))
    (tmp_path / "a" / "test" / "notes.txt").write_text("call the workshop\n")
    (tmp_path / "a" / "test" / "~$run.xlsx").write_bytes(b"\x04name" + b" " * 150)
    (tmp_path / "a" / "test" / ".~lock.run.xlsx#").write_text(",user,host;\n")
    (tmp_path / "a" / "test" / "half.xlsx").write_bytes(b"PK\x03\x04 and no more")
    made = audit(tmp_path / "a")
    assert made.grades["no_recording"] == 3
    assert made.grades["unreadable"] == 1
    told = text_of(
        AuditOutcome(made=made, linked=None, drift=None, drifted=(), drifted_tests=(), copies=None)
    )
    assert "3 files are no recordings" in " ".join(told.split())
    table, apart = told.split("no recordings: ")
    assert "notes.txt" not in table
    assert "notes.txt" in apart


@pytest.mark.parametrize("width", [40, 80])
def test_no_grade_nor_record_is_cut_by_the_width_of_the_terminal(tmp_path, width):
    dated(tmp_path / "a" / "a folder of a long name", "2019-06-01")
    write(tmp_path / "a" / "a folder of a long name" / "run_1.xlsx", recording(rows=ROWS, FY=WRONG))
    (tmp_path / "a" / "a folder of a long name" / "broken.xlsx").write_bytes(b"PK\x03\x04 and no more")
    made = audit(tmp_path / "a")
    told = text_of(
        AuditOutcome(made=made, linked=None, drift=None, drifted=(), drifted_tests=(), copies=None),
        width=width,
    )
    rows = told.split("-----")[-1]
    for text in ("sign_variant", "unreadable", "m15-r2", "run_1.xlsx"):
        assert text in rows
