"""What a home holds: found by its marks, named by ids, read without trust."""

from __future__ import annotations

import json
from pathlib import Path

from toolkit.files import sha256_file
from toolkit.lab.desk.agenda import work_of
from toolkit.lab.desk.holdings import holding_id, holdings_of, reported_inputs, rows_of_tests

TOML = 'schema = 1\nmachine = "m15-virtual"\ndate = 2026-03-17\n[tire]\nsize = "205/55R16"\n'


def home_of(folder: Path) -> Path:
    for place in ("tests/b", "tests/a", "calibrations/no", ".hidden/no", "jobs/no"):
        (folder / place).mkdir(parents=True)
        (folder / place / "test.toml").write_text(TOML)
    (folder / "elsewhere").mkdir()
    (folder / "link").symlink_to(folder / "tests")
    return folder


def test_tests_audits_and_diagnoses_are_told_by_their_files(tmp_path: Path) -> None:
    home = home_of(tmp_path)
    for place, name in (("audits/x", "audit.jsonl"), ("audits/y", "results.jsonl"), ("d", "diagnosis.json")):
        (home / place).mkdir(parents=True)
        (home / place / name).write_text("{}\n")
    holdings = holdings_of(home)
    places = {kind: list(held.values()) for kind, held in holdings.places.items()}
    assert places == {
        "test": ["tests/a", "tests/b"], "audit": ["audits/x", "audits/y"], "diagnosis": ["d"], "case": [],
        "plan": [],
    }  # fmt: skip


def test_an_id_leads_to_what_is_held_and_nowhere_else(tmp_path: Path) -> None:
    home = home_of(tmp_path)
    holdings = holdings_of(home)
    assert holdings.path("test", holding_id("tests/a")) == home / "tests/a"
    assert holdings.path("audit", holding_id("tests/a")) is None
    for name in ("tests/a", "../..", "", holding_id("calibrations/no")):
        assert holdings.path("test", name) is None
    (home / "tests/a/test.toml").unlink()
    assert holdings.path("test", holding_id("tests/a")) is None


def test_a_row_says_what_test_toml_says_and_whether_a_report_rests_on_it(tmp_path: Path) -> None:
    home = home_of(tmp_path)
    report = home / "reports" / "a"
    report.mkdir(parents=True)
    (home / "tests/a/test.toml").write_text(TOML + 'company = "X"\n')
    inputs = [{"name": "test.toml", "sha256": sha256_file(home / "tests/a/test.toml")}]
    (report / "manifest.json").write_text(json.dumps({"inputs": inputs}))
    (home / "tests/b/test.toml").write_text("schema = 1\nmachine = [\n")
    holdings = holdings_of(home)
    a, b = rows_of_tests(holdings, holdings.places["test"], reported_inputs(holdings))
    assert (a["state"], a["date"], a["machine"], a["tire"]) == (
        "reported", "2026-03-17", "m15-virtual", "205/55R16",
    )  # fmt: skip
    assert (b["state"], b["date"]) == ("refused", None)
    assert b["reason"]


def test_a_report_of_a_reduced_test_is_one_of_the_test_that_was_reduced(tmp_path: Path) -> None:
    home = home_of(tmp_path)
    folder = home / "tests" / "a"
    for number in (1, 2):
        (folder / f"run_{number}.csv").write_text(f"FZ [N]\n{number}\n")
    report = home / "report"
    report.mkdir()

    def reported_with(*inputs: Path) -> str:
        named = [{"name": path.name, "sha256": sha256_file(path)} for path in inputs]
        (report / "manifest.json").write_text(json.dumps({"inputs": named}))
        holdings = holdings_of(home)
        (row,) = rows_of_tests(holdings, (holding_id("tests/a"),), reported_inputs(holdings))
        assert (row["state"] == "no report") == ("tests/a" in work_of(home).without_report)
        return str(row["state"])

    first, second = folder / "run_1.csv", folder / "run_2.csv"
    reduced = home / "test.xlsx"
    reduced.write_bytes(b"reduced")
    assert reported_with(first, second, reduced) == "reported"
    # A recording that the report has not seen; a report of the folder itself, whose statements changed since.
    assert reported_with(first, reduced) == "no report"
    (home / "test.toml").write_text("changed since")
    assert reported_with(first, second, home / "test.toml") == "no report"
    (home / "test.toml").unlink()
    assert reported_with(first, second, reduced) == "reported"
    second.write_text("FZ [N]\n3\n")
    assert reported_with(first, reduced) == "no report"
