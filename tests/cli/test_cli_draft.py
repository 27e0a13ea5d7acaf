"""A refused calibration reaches nobody: each command ends with 2 and the gate, --draft marks all it makes."""

from __future__ import annotations

import csv
import datetime as dt
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import openpyxl
import pytest

from tests import commands
from tests.cli.test_compare import maker
from tests.report.template_factory import make, p
from toolkit.calibration.registry.approval import approve, withdraw
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.registry import Registry, today
from toolkit.cli.main import run
from toolkit.lab.home import packaged_home
from toolkit.recording.marks import is_own_output

PACKAGED = packaged_home()
REFUSED = "m15-virtual-r2"
office_needed = pytest.mark.skipif(
    not (shutil.which("soffice") and shutil.which("pdftotext")),
    reason="LibreOffice or poppler is not installed",
)


def toolkit(home: Path, *words: object) -> tuple[int, dict[str, Any]]:
    return commands.answer(*words, "--home", home)


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A laboratory whose second session has E5 with the wrong sign, in both of its files."""
    folder = tmp_path_factory.mktemp("home")
    shutil.copytree(PACKAGED / "calibrations", folder / "calibrations")
    stored = folder / "calibrations" / "m15-virtual"
    session = folder / "session"
    session.mkdir()
    for name in ("loads", "check"):
        rows = list(csv.reader((stored / f"m15-virtual-r1.{name}.csv").read_text().splitlines()))
        at = next(i for i, text in enumerate(rows[0]) if text.startswith("E5"))
        for row in rows[1:]:
            row[at] = repr(-float(row[at]))
        (session / f"{name}.csv").write_text("\n".join(map(",".join, rows)) + "\n")
    text = (stored / "m15-virtual-r1.session.toml").read_text()
    text = re.sub(
        r"(?m)^(data|check) = .*$", lambda m: f'{m[1]} = "{"loads" if m[1] == "data" else "check"}.csv"', text
    )
    (session / "SESSION.toml").write_text(text)
    registry = Registry(folder / "calibrations")
    assert calibrate(session / "SESSION.toml", registry).record.id == REFUSED
    day = dt.date(2026, 3, 3)
    assert not approve(
        registry, REFUSED, in_force_from=day, checked_by="B", known_on=day, reason="paper of that day"
    ).done
    return folder


@pytest.fixture(scope="module")
def draft_file(home: Path, virtual_test: Path) -> Path:
    """A reduced test that was drafted with the refused record."""
    path = home / "draft.xlsx"
    with pytest.raises(SystemExit) as caught:
        run(["process", str(virtual_test), "--calibration", REFUSED, "--draft", "--quiet",
             "--out", str(path), "--home", str(home)])  # fmt: skip
    assert caught.value.code == 1
    return path


@pytest.mark.parametrize(
    "words",
    [
        ("process", "TEST", "--calibration", REFUSED, "--out", "OUT.xlsx"),
        ("fit", "TEST", "--calibration", REFUSED, "--model", "mf61", "--tir", "OUT.tir"),
        ("report", "TEST", "--calibration", REFUSED, "--hand-over", "--out", "OUT"),
        ("template", "tags", "--test", "TEST", "--calibration", REFUSED),
        ("calibration", "certificate", REFUSED, "--out", "OUT"),
        ("process", "DRAFT", "--out", "OUT.xlsx"),
        ("fit", "DRAFT"),
        ("report", "DRAFT", "--out", "OUT"),
        ("compare", "DRAFT", "TEST", "--out", "OUT"),
        ("convert", "DRAFT", "OUT.csv"),
        ("convert", "DRAFT", "OUT.tdx"),
    ],
    ids=lambda words: " ".join(words[:2]),
)
def test_no_command_makes_a_number_from_it(
    home: Path,
    virtual_test: Path,
    draft_file: Path,
    tmp_path: Path,
    words: tuple[str, ...],
) -> None:
    places = {"TEST": str(virtual_test), "DRAFT": str(draft_file)}
    said = [places.get(word, word.replace("OUT", str(tmp_path / "out"))) for word in words]
    code, answer = toolkit(home, *said)
    assert code == 2
    error = answer["error"]
    assert error["rule"] in ("not-in-force", "certificate-candidate")
    assert "sign (FY, E5; MZ, E5" in error["got"]
    assert all(error[part] for part in ("what", "where", "expected", "next_step"))
    assert list(tmp_path.iterdir()) == []


def test_a_draft_says_so_in_answer_and_file_and_stays_one(
    home: Path, draft_file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert is_own_output(draft_file)
    book = openpyxl.load_workbook(draft_file)
    told = {row[0].value: row[1].value for row in book["provenance"].iter_rows()}
    assert told["DRAFT"].startswith(f"DRAFT, NOT APPROVED: {REFUSED}")
    assert told["calibration.draft"] is True
    assert all(sheet.oddHeader.center.text.startswith("DRAFT") for sheet in book)
    assert book.properties.title.startswith("DRAFT: ")
    tire = tmp_path / "tire.tir"
    code, answer = toolkit(home, "fit", draft_file, "--draft", "--model", "mf61", "--tir", tire)
    assert (code, answer["draft"], answer["calibration"]["id"]) == (1, True, REFUSED)
    assert "failed gates sign" in answer["draft_reasons"][0]
    assert f"! DRAFT, NOT APPROVED: {REFUSED}" in tire.read_text()
    (tmp_path / "grid.csv").write_text("SA [deg],FZ [N]\n1,4000\n")
    with pytest.raises(SystemExit) as caught:
        run(["evaluate", str(tire), str(tmp_path / "grid.csv"), "--json"])
    evaluated = json.loads(capsys.readouterr().out)
    assert (caught.value.code, evaluated["draft"]) == (1, True)
    assert any(REFUSED in one["message"] for one in evaluated["findings"] if one["rule"] == "draft")
    # The comments of a tire file go along; a table has no place for the mark.
    toolkit(home, "convert", draft_file, tmp_path / "x.tdx", "--draft")
    assert "DRAFT, NOT APPROVED" in (tmp_path / "x.tdx").read_text()
    for source in (draft_file, tmp_path / "x.tdx"):
        code, answer = toolkit(home, "convert", source, tmp_path / "x.csv", "--draft")
        assert (code, answer["error"]["rule"]) == (2, "draft-unmarked")
        assert not (tmp_path / "x.csv").exists()


@office_needed
def test_every_page_of_a_draft_is_marked(
    home: Path, draft_file: Path, virtual_test: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    turn = '<w:p><w:r><w:br w:type="page"/></w:r></w:p>'
    body = p("{{tk:report.id}} {{tk:calibration.status}}") + 5 * (turn + p("{{tk:test.name}}"))
    words = ("--template", make(tmp_path, body), "--out", out)
    code, answer = toolkit(home, "report", draft_file, "--draft", "--hand-over", *words)
    assert (code, answer["draft"], answer["verified"]) == (1, True, True)
    pages = text_of(Path(answer["pdf"]))
    assert len(pages) == answer["pages"] > 5
    assert all("DRAFT, NOT APPROVED" in one and "failed gates sign" in one for one in pages)
    first = " ".join(pages[0].split())
    assert "not approved: a candidate" in first
    assert "DRAFT-TR-" in first
    manifest = json.loads((out / "manifest.json").read_text())
    assert manifest["draft"] is True
    assert REFUSED in manifest["draft_reasons"][0]
    for name in ("test.tdx", "tire.tir"):
        assert "DRAFT, NOT APPROVED" in (out / name).read_text()
    # The same test by the record in force is none, asked for or not.
    code, answer = toolkit(home, "process", virtual_test, "--draft")
    assert (answer["draft"], answer["draft_reasons"]) == (False, [])
    assert "draft" not in {one["rule"] for one in answer["findings"]}


@pytest.mark.campaign("two further documents of a draft: every page of its report is marked in every run")
@office_needed
def test_a_draft_of_a_certificate_and_of_a_comparison(home: Path, draft_file: Path, tmp_path: Path) -> None:
    words = ("calibration", "certificate", REFUSED, "--draft", "--out", tmp_path / "certificate")
    code, answer = toolkit(home, *words)
    assert (code, answer["draft"]) == (1, True)
    assert "failed gates sign" in answer["draft_reasons"][0]
    assert all("DRAFT, NOT APPROVED" in one for one in text_of(Path(answer["pdf"])))
    out = tmp_path / "compared"
    table = maker(tmp_path / "maker.csv")
    code, answer = toolkit(home, "compare", table, draft_file, "--draft", "--out", out)
    assert (code, answer["draft"]) == (1, True)
    assert [bool((one["calibration"] or {}).get("draft")) for one in answer["entries"]] == [False, True]
    assert all("DRAFT, NOT APPROVED" in one for one in text_of(out / "comparison.pdf"))


def text_of(pdf: Path) -> list[str]:
    done = subprocess.run(["pdftotext", str(pdf), "-"], capture_output=True, text=True, check=True)
    return done.stdout.split("\f")[:-1]


def test_a_reduced_test_of_a_record_in_force_is_converted_and_one_withdrawn_since_is_not(
    home: Path, virtual_test: Path, tmp_path: Path
) -> None:
    own = tmp_path / "home"
    shutil.copytree(home / "calibrations", own / "calibrations")
    whole, table = tmp_path / "whole.xlsx", tmp_path / "whole.csv"
    toolkit(own, "process", virtual_test, "--out", whole)
    code, answer = toolkit(own, "convert", whole, table)
    assert (code, answer["draft"]) == (0, False)
    lines = table.read_text().splitlines()
    assert lines[0] == "SA [deg],FZ [N],FY [N],MZ [N*m]"
    table.unlink()
    registry = Registry(own / "calibrations")
    withdraw(registry, "m15-virtual-r1", on=today(), reason="cell overloaded", by="B")
    for words in (("convert", whole, table), ("fit", whole), ("report", whole, "--out", tmp_path / "out")):
        code, answer = toolkit(own, *words)
        assert (code, answer["error"]["rule"]) == (2, "not-in-force")
        assert "cell overloaded" in answer["error"]["got"]
    assert not table.exists()
    assert not (tmp_path / "out").exists()
    # As it was known the day before the withdrawal: what became known since goes along.
    before = today() - dt.timedelta(days=1)
    code, _ = toolkit(own, "convert", whole, table, "--known-at", before)
    assert code == 1
    rows = list(csv.DictReader(table.read_text().splitlines()))
    assert rows
    assert all("KNOWN SINCE: m15-virtual-r1: " in one["calibration"] for one in rows)
    assert all("cell overloaded" in one["calibration"] for one in rows)
