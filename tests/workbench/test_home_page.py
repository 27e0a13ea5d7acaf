"""The first page: every number is the one that the command's --json has."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from tests.workbench.conftest import Served, plain
from toolkit.cli.main import run
from toolkit.lab.desk.agenda import work_of


def command(capsys: pytest.CaptureFixture[str], *words: object) -> dict[str, Any]:
    with pytest.raises(SystemExit):
        run([*map(str, words), "--json"])
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


def test_the_instruments_are_those_of_list_and_due(
    served: Served, capsys: pytest.CaptureFixture[str]
) -> None:
    listed = command(capsys, "calibration", "list", "--home", served.home)
    due = command(capsys, "calibration", "due", "--home", served.home)
    page = served.page("/agenda/instruments")
    in_force = {row["instrument"]: row["record"] for row in due["instruments"]}
    assert set(listed["heads"]) == set(in_force) == {"cell", "m15", "m15-virtual"}
    for name, head in listed["heads"].items():
        states = [row["status"] for row in listed["records"] if row["id"].rpartition("-r")[0] == name]
        counts = [states.count(state) for state in ("candidate", "approved", "withdrawn")]
        assert [int(value) for value in page.data(instrument=name)] == [*counts, head["count"]]
        assert head["sha256"] in page.body
        assert f'/record/{in_force[name]}"' in page.body


def test_the_agenda_counts_what_the_commands_answer(
    served: Served, capsys: pytest.CaptureFixture[str]
) -> None:
    listed = command(capsys, "calibration", "list", "--home", served.home)
    candidates = [row["id"] for row in listed["records"] if row["status"] == "candidate"]
    part = served.page("/agenda/candidates")
    assert part.data(count="candidates") == [str(len(candidates))] == ["6"]
    assert all(f'data-record="{name}"' in part.body for name in candidates)

    due = command(capsys, "calibration", "due", "--home", served.home)
    part = served.page("/agenda/due")
    overdue = [row for row in due["instruments"] if row["overdue"]]
    assert part.data(count="due") == [str(len(overdue))] == ["1"]
    assert part.data(instrument="cell") == [str(overdue[0]["days_left"])]

    chart = command(capsys, "calibration", "chart", "cell", "--home", served.home)
    part = served.page("/agenda/drift")
    assert part.data(count="drift") == [str(len(chart["findings"]))] == ["1"]
    assert chart["findings"][0]["message"] in plain(part.body)


def test_the_agenda_follows_what_changes_on_the_disk(own: Served) -> None:
    assert own.page("/agenda/candidates").data(count="candidates") == ["6"]
    (own.home / "calibrations" / "cell" / "cell-r7.loads.csv").write_text("S [mV/V],FY [N]\n1,1\n")
    assert "fails its gates" in plain(own.page("/agenda/candidates").body)


def test_tests_without_report_and_unfinished_audits(lab: Path, tmp_path: Path) -> None:
    home = shutil.copytree(lab, tmp_path / "lab")
    work = work_of(home)
    assert (work.tests, work.without_report) == (2, ("tests/a", "tests/b"))
    assert (work.audits, work.unfinished) == (1, ("audit",))
    from toolkit.files import sha256_file

    inputs = [{"name": "test.toml", "sha256": sha256_file(home / "tests" / "a" / "test.toml")}]
    (home / "reports").mkdir()
    (home / "reports" / "manifest.json").write_text(json.dumps({"inputs": inputs}))
    (home / "audit" / "audit.jsonl").write_text("{}\n")
    (home / "loop").symlink_to(home)
    work = work_of(home)
    assert (work.tests, work.without_report, work.unfinished) == (2, ("tests/b",), ())
    # A statement that changed since: the report was made from another test.
    (home / "tests" / "a" / "test.toml").write_text('schema = 1\nname = "c"\n')
    (home / "reports" / "manifest.json").with_name("broken").mkdir()
    assert work_of(home).without_report == ("tests/a", "tests/b")


def test_a_damaged_ledger_is_told_and_hides_no_other_instrument(own: Served) -> None:
    ledger = own.home / "calibrations" / "cell" / "ledger.jsonl"
    ledger.write_bytes(ledger.read_bytes().replace(b'"by":', b'"by" :', 1))
    page = own.page("/agenda/instruments")
    assert page.status == 200
    assert "damaged" in plain(page.body)
    assert "m15-r2" in page.body
    assert [own.page(f"/agenda/{name}").status for name in ("candidates", "due", "drift")] == [200] * 3
    assert own.page("/").status == own.page("/records").status == 200
    assert own.page("/record/cell-r7").status == 400


def test_an_empty_home_says_what_comes_first(tmp_path: Path) -> None:
    from tests.workbench.conftest import serving

    (tmp_path / "new" / "calibrations").mkdir(parents=True)
    with serving(tmp_path / "new") as bench:
        assert "toolkit calibrate SESSION.toml" in plain(bench.page("/agenda/instruments").body)
        assert bench.page("/agenda/candidates").data(count="candidates") == ["0"]
        assert bench.page("/records").status == 200


def test_a_witness_is_named_with_what_it_has_seen(own: Served) -> None:
    from toolkit.lab.signatures.people import checkpoint_of

    folder = own.home / "trust" / "witnessed"
    folder.mkdir(parents=True)
    (folder / "cell-notary.checkpoint").write_text(checkpoint_of(own.registry, "cell").text)
    assert "notary: 8 of 8 entries seen" in plain(own.page("/agenda/instruments").body)
    assert own.page("/agenda/instruments", Accept_Language="de").body.count("kein Zeuge") == 2
