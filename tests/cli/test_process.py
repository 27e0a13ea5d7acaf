"""`toolkit process`, and that TEST arguments fail with what, where, got, expected and the next step."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from tests import commands
from toolkit.cli.main import run
from toolkit.lab.home import packaged_home

CALIBRATIONS = packaged_home() / "calibrations"
FIG = packaged_home() / "toolkit" / "examples" / "fig4_4" / "M15_fig4_4.xlsx"


def toolkit(*words: object) -> tuple[int, dict[str, Any]]:
    code, answer = commands.answer(*words, "--calibrations", CALIBRATIONS)
    assert answer["schema"] == 1
    return code, answer


def fig_test(tmp_path: Path, toml: str) -> Path:
    folder = tmp_path / "test"
    folder.mkdir()
    (folder / "test.toml").write_text(f"schema = 1\n{toml}")
    shutil.copy(FIG, folder / "M15_0001")
    return folder


def test_a_real_file_is_corrected_by_the_record_in_force(tmp_path: Path) -> None:
    test = fig_test(tmp_path, 'machine = "m15"\ndate = 2019-05-31')
    code, answer = toolkit("process", test, "--out", tmp_path / "test.xlsx")
    assert code == 1
    assert answer["calibration"]["id"] == "m15-r2"
    assert answer["calibration"]["unverified"] is True
    rules = {finding["rule"] for finding in answer["findings"]}
    assert {"unverified", "acquired-differs", "no-tare", "missing"} <= rules
    first = answer["conditions"][0]
    assert first["FY_N"] / 4.4482216152605 == pytest.approx(-1.79, abs=0.01)
    assert first["FY_file_N"] / 4.4482216152605 == pytest.approx(371.353, abs=0.001)
    assert (tmp_path / "test.xlsx").is_file()


def test_a_table_of_an_unverified_record_says_so_in_every_row(tmp_path: Path) -> None:
    test = fig_test(tmp_path, 'machine = "m15"\ndate = 2019-05-31')
    whole, table, tydex, back = (tmp_path / name for name in ("w.xlsx", "w.csv", "w.tdx", "back.csv"))
    toolkit("process", test, "--out", whole)
    code, _ = toolkit("convert", whole, table)
    assert code == 1
    lines = table.read_text().splitlines()
    assert lines[0] == "SA [deg],FZ [N],FY [N],MZ [N*m],calibration"
    assert len(lines) > 1
    assert all(line.endswith(",UNVERIFIED CALIBRATION: m15-r2") for line in lines[1:])
    read = pd.read_csv(table)
    assert set(read["calibration"]) == {"UNVERIFIED CALIBRATION: m15-r2"}
    assert read["FY [N]"].dtype == float
    # Through TYDEX and back, and into what is made of it.
    code, answer = toolkit("convert", table, tydex)
    assert (code, answer["findings"][0]["rule"]) == (1, "unverified")
    assert "UNVERIFIED CALIBRATION: m15-r2" in tydex.read_text().splitlines()
    toolkit("convert", tydex, back)
    assert pd.read_csv(back)["calibration"].tolist() == read["calibration"].tolist()


def test_a_reduced_test_is_a_test(tmp_path: Path) -> None:
    test = fig_test(tmp_path, 'machine = "m15"\ndate = 2019-05-31')
    _, first = toolkit("process", test, "--out", tmp_path / "test.xlsx")
    code, again = toolkit("process", tmp_path / "test.xlsx")
    assert code == 1
    assert again["conditions"] == first["conditions"]


def test_a_reduced_test_of_a_machine_by_its_own_file_is_judged_by_its_record(tmp_path: Path) -> None:
    test = fig_test(tmp_path, 'machine = "own.toml"\ndate = 2019-05-31')
    (test / "own.toml").write_text('schema = 1\nname = "m15"\nextends = "m15"\ntitle = "Own"\nkind = "real"')
    code, first = toolkit("process", test, "--out", tmp_path / "test.xlsx")
    assert (code, first["calibration"]["id"], first["draft"]) == (1, "m15-r2", False)
    code, again = toolkit("process", tmp_path / "test.xlsx")
    assert (code, again["draft"]) == (1, False)


def test_the_withdrawn_record_was_in_force_for_who_did_not_know(tmp_path: Path) -> None:
    test = fig_test(tmp_path, 'machine = "m15"\ndate = 2019-05-31')
    _, answer = toolkit("process", test, "--known-at", "2019-06-30")
    assert answer["calibration"]["id"] == "m15-r1"
    assert "acquired-differs" not in {finding["rule"] for finding in answer["findings"]}


@pytest.mark.parametrize(
    ("toml", "words", "rule"),
    [
        ('machine = "m15"', (), "no-date"),
        ('machine = "m16"\ndate = 2019-05-31', (), "unknown-machine"),
        ('machine = "m15"\ndate = 1950-01-01', (), "no-record-in-force"),
        ('machine = "m15"\ndate = 2019-05-31\noperater = "x"', (), "unknown-key"),
        ('machine = "m15"\ndate = 2019-05-31', ("--calibration", "m15-r9"), None),
        ('machine = "m15"\ndate = 2019-05-31', ("--calibration", "m15-virtual-r1"), "not-in-force"),
        (
            'machine = "m15"\ndate = 2019-05-31',
            ("--calibration", "m15-virtual-r1", "--draft"),
            "record-units",
        ),
        ('machine = "m15"', ("--calibration", "m15-r2"), "not-in-force"),
        ('machine = "m15"\ndate = 2019-05-31\n[rotations]\n"nobody" = "reverse"', (), "no-file"),
    ],
)
def test_bad_input_ends_with_2_and_writes_nothing(
    tmp_path: Path, toml: str, words: tuple[str, ...], rule: str | None
) -> None:
    test = fig_test(tmp_path, toml)
    code, answer = toolkit("process", test, "--out", tmp_path / "out.xlsx", *words)
    assert code == 2
    error = answer["error"]
    assert all(error[part] for part in ("what", "got", "expected", "next_step"))
    assert rule is None or error["rule"] == rule
    assert not (tmp_path / "out.xlsx").exists()


def test_not_a_test(tmp_path: Path) -> None:
    code, answer = toolkit("process", FIG)
    assert (code, answer["error"]["rule"]) == (2, "not-a-test")
    code, answer = toolkit("process", tmp_path / "nothing")
    assert (code, answer["error"]["rule"]) == (2, "no-test")


def test_a_file_that_is_no_recording_stops_the_test(tmp_path: Path) -> None:
    test = fig_test(tmp_path, 'machine = "m15"\ndate = 2019-05-31')
    (test / "photo.png").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    code, answer = toolkit("process", test)
    assert code == 2
    assert answer["error"]["rule"] == "not-a-workbook"
    assert "photo.png" in answer["error"]["where"]


def test_an_output_that_cannot_be_written(tmp_path: Path) -> None:
    test = fig_test(tmp_path, 'machine = "m15"\ndate = 2019-05-31')
    (tmp_path / "file").write_text("")
    code, answer = toolkit("process", test, "--out", tmp_path / "file" / "out.xlsx")
    assert code == 2
    assert "written" in answer["error"]["what"]


@pytest.mark.parametrize("name", ["M15_0001", "test.toml", "notes.docx"])
def test_originals_are_never_written_to(tmp_path: Path, name: str) -> None:
    test = fig_test(tmp_path, 'machine = "m15"\ndate = 2019-05-31')
    before = {path.name: path.read_bytes() for path in test.iterdir()}
    code, _ = toolkit("process", test, "--out", test / name)
    assert code == 2
    assert {path.name: path.read_bytes() for path in test.iterdir()} == before


def test_a_recording_with_the_right_ending_is_an_original_too(tmp_path: Path) -> None:
    test = fig_test(tmp_path, 'machine = "m15"\ndate = 2019-05-31')
    original = test / "copy.xlsx"
    shutil.move(test / "M15_0001", original)
    before = original.read_bytes()
    code, answer = toolkit("process", test, "--out", original)
    assert (code, answer["error"]["rule"]) == (2, "original")
    assert original.read_bytes() == before


def test_an_earlier_result_may_be_replaced_and_may_lie_in_the_test(tmp_path: Path) -> None:
    test = fig_test(tmp_path, 'machine = "m15"\ndate = 2019-05-31')
    for _ in range(2):
        code, answer = toolkit("process", test, "--out", test / "test.xlsx")
        assert code == 1
        assert len(answer["conditions"]) == 5


def test_a_withdrawn_record_that_is_named_is_called_withdrawn(tmp_path: Path) -> None:
    test = fig_test(tmp_path, 'machine = "m15"\ndate = 2019-05-31')
    words = ("process", test, "--calibration", "m15-r1")
    code, refused = toolkit(*words)
    assert code == 2
    assert refused["error"]["rule"] == "not-in-force"
    assert "withdrawn on 2019-12-31" in refused["error"]["got"]
    assert "m15-r2" in refused["error"]["next_step"]
    code, answer = toolkit(*words, "--draft")
    assert code == 1
    assert answer["draft"] is True
    (told,) = [f for f in answer["findings"] if f["rule"] == "draft"]
    assert "wrong sign" in told["message"]


def test_a_reduced_test_whose_record_was_withdrawn_says_so(tmp_path: Path) -> None:
    test = fig_test(tmp_path, 'machine = "m15"\ndate = 2019-05-31')
    toolkit("process", test, "--known-at", "2019-06-30", "--out", tmp_path / "old.xlsx")
    code, answer = toolkit("process", tmp_path / "old.xlsx")
    assert code == 2
    assert "withdrawn on 2019-12-31" in answer["error"]["got"]
    code, then = toolkit("process", tmp_path / "old.xlsx", "--known-at", "2019-06-30")
    assert (code, then["draft"]) == (1, False)
    (since,) = [f["message"] for f in then["findings"] if f["rule"] == "known-since"]
    assert since.startswith("withdrawn on 2019-12-31")
    code, draft = toolkit("process", tmp_path / "old.xlsx", "--draft", "--out", tmp_path / "draft.xlsx")
    assert (code, draft["draft"]) == (1, True)
    # The mark stays with the file: what is made of it later is a draft too, on any day of knowledge.
    code, later = toolkit("process", tmp_path / "draft.xlsx", "--known-at", "2019-06-30")
    assert (code, later["error"]["rule"]) == (2, "not-in-force")
    assert "process the recordings again" in later["error"]["next_step"]


def test_the_budget_and_the_values_at_slip_angles_are_answered_in_si(virtual_test: Path) -> None:
    _, answer = toolkit("process", virtual_test)
    chars = answer["characteristics"]
    owners = {(p["load_N"], "both"): p for p in chars["pull"]}
    owners |= {(s["load_N"], s["rotation"]): s for s in chars["stiffness"]}
    for one in chars["budgets"]:
        u = owners[one["load_N"], one["rotation"]][one["name"]]["standard_uncertainty"]
        assert sum(part**2 for part in one["standard_uncertainty"].values()) == pytest.approx(u**2)
        assert one["standard_uncertainty"]["pressure"] > 0
    assert len({one["SA_rad"] for one in chars["at_angles"]}) == 13
    assert all(one["u_FY_N"] >= one["u_FY_repeatability_N"] for one in answer["conditions"])
    assert "SAE J1987 style" in answer["protocol"]


def test_people_choose_their_units(virtual_test: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shown = {}
    for units in ("SI", "lbf"):
        with pytest.raises(SystemExit):
            run(["process", str(virtual_test), "--units", units, "--calibrations", str(CALIBRATIONS)])
        lines = capsys.readouterr().out.splitlines()
        head = next(i for i, line in enumerate(lines) if line.startswith("FZ [N]"))
        assert ("lbf·ft" in lines[head]) is (units == "lbf")
        shown[units] = float(lines[head + 3].split("±")[2].split()[1])  # conicity at the second load
    assert shown["SI"] / shown["lbf"] == pytest.approx(4.448, rel=0.02)
    code, answer = toolkit("process", virtual_test, "--units", "kgf")
    assert (code, answer["error"]["rule"]) == (2, "unknown-units")


def test_an_unknown_pressure_is_a_note_and_no_part_of_the_budget(tmp_path: Path, virtual_test: Path) -> None:
    copy = tmp_path / "test"
    shutil.copytree(virtual_test, copy)
    toml = copy / "test.toml"
    lines = [line for line in toml.read_text().splitlines() if not line.startswith("pressure")]
    toml.write_text("\n".join(lines))
    _, answer = toolkit("process", copy)
    (note,) = [one for one in answer["findings"] if one["rule"] == "no-pressure"]
    assert note["level"] == "note"
    assert all("pressure" not in one["standard_uncertainty"] for one in answer["characteristics"]["budgets"])
