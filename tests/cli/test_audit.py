"""`toolkit audit` as a user runs it: answers, files of --out, exit codes, refusals before any work."""

from __future__ import annotations

import html
import json
import shutil
import subprocess
from pathlib import Path

import pytest

from tests import commands
from tests.recording.fig4_4 import write_fig4_4
from toolkit.declared import json_value
from toolkit.lab.archives.audit_headline import headline_of

HOME = Path(__file__).resolve().parents[2]
CALIBRATIONS = ("--calibrations", str(HOME / "calibrations"))


@pytest.fixture
def archive(tmp_path):
    folder = tmp_path / "archive" / "2019" / "run"
    folder.mkdir(parents=True)
    write_fig4_4(folder)
    (folder / "test.toml").write_text('schema = 1\nmachine = "m15"\ndate = 2019-03-01\n')
    return tmp_path / "archive"


def run(*words):
    return commands.result("audit", *words, *CALIBRATIONS)


def test_out_holds_a_page_and_lines_for_machines(archive, tmp_path):
    result = run(archive, "--out", tmp_path / "out", "--json")
    answer = json.loads(result.stdout)
    assert [Path(one).name for one in answer["written"]] == ["audit.html", "audit.jsonl"]
    lines = [json.loads(line) for line in (tmp_path / "out" / "audit.jsonl").read_text().splitlines()]
    assert (lines[0]["generator"], lines[0]["schema"]) == ("toolkit", 1)
    assert lines[1:] == answer["files"]


def test_a_test_toml_that_cannot_be_used_is_told_once_with_what_is_wrong(archive):
    toml = archive / "2019" / "run" / "test.toml"
    toml.write_text('schema = 1\nmachine = "m15"\ndate = "soon"\n')
    told = [line for line in run(archive).stdout.splitlines() if "test.toml cannot be used" in line]
    assert len(told) == 1
    assert "got soon, expected a date" in told[0]


def test_the_answer_is_the_same_again_and_with_more_workers_but_for_timing(archive, tmp_path):
    answers = []
    for words in (
        ("--workers", "1"),
        ("--workers", "2"),
        ("--out", tmp_path / "o"),
        ("--out", tmp_path / "o"),
    ):
        answer = json.loads(run(archive, *words, "--json").stdout)
        assert answer.pop("timing")["reused"] == (2 if len(answers) == 3 else 0)
        answer.pop("written")
        answers.append(answer)
    assert all(answer == answers[0] for answer in answers)


def test_everything_at_once(archive, tmp_path):
    (tmp_path / "reports").mkdir()
    (tmp_path / "reports" / "Run of 2019.pdf").write_bytes(b"x")
    result = run(archive, "--reports", tmp_path / "reports", "--repair", tmp_path / "fixed", "--json")
    answer = json.loads(result.stdout)
    assert result.return_value == 1
    assert answer["reports"][0]["tests"] == ["2019/run"]
    assert answer["files"][0]["reports"] == ["Run of 2019.pdf"]
    assert answer["report_unknown"] == []
    assert [one["sha256"] is not None for one in answer["repaired"]] == [True, True]
    fixed = json.loads(run(tmp_path / "fixed", "--json").stdout)
    assert fixed["summary"]["grades"]["exact"] == fixed["summary"]["files"] == 2


def test_an_archive_that_is_right_ends_with_0_whatever_else_is_noted(archive, tmp_path):
    run(archive, "--repair", tmp_path / "fixed", "--quiet")
    result = run(tmp_path / "fixed")
    assert result.return_value == 0
    assert "2 exact" in result.stdout
    assert "duplicate-file" in result.stdout  # the two are one recording


@pytest.mark.parametrize(
    "words",
    [
        ("--repair", "archive"),
        ("--reports", "none"),
        ("--since-good", "m15-r99"),
        ("--since-good", "nonsense"),
        ("--workers", "0"),
        ("--template", "none.docx", "--out", "out"),
    ],
)
def test_what_cannot_be_used_is_refused_before_any_work(archive, tmp_path, monkeypatch, words):
    from toolkit.errors import ToolkitError

    monkeypatch.chdir(tmp_path)
    result = run(archive, *words, "--json")
    assert isinstance(result.exception, ToolkitError)
    assert result.exception.exit_code == 2
    assert result.exception.next_step
    assert not (tmp_path / "out").exists()


def test_a_summary_needs_a_folder(archive):
    import typer

    result = run(archive, "--template", "x.docx")
    assert isinstance(result.exception, typer.BadParameter)


def test_a_name_that_is_no_utf_8_is_an_answer_like_any_other(archive, tmp_path):
    import os

    source = next((archive / "2019" / "run").glob("*.xlsx"))
    shutil.copy(source, os.fsdecode(os.fsencode(archive) + b"/bad\xff.xlsx"))
    answer = json.loads(run(archive, "--json", "--out", tmp_path / "out").stdout)
    assert any(one["path"] == "bad\udcff.xlsx" for one in answer["files"])


def test_progress_stays_off_what_is_no_terminal(archive):
    result = run(archive)
    assert result.stderr == ""


@pytest.mark.campaign("an amended report as a document: which reports are to be amended is told in every run")
def test_a_report_by_a_withdrawn_record_is_amended_and_names_what_it_replaces(tmp_path):
    from tests.audit.test_archive_findings import WRONG, whole_test

    whole_test(tmp_path / "archive" / "tire 7", FY=WRONG, date="2015-06-01")
    told = {
        "generator": "toolkit", "schema": 1, "report": "TR-1", "calibrations": [{"id": "m15-r1"}],
        "inputs": [{"name": "run 0", "sha256": _sha(tmp_path / "archive" / "tire 7" / "run 0")}],
    }  # fmt: skip
    for name, record in (("old", "m15-r1"), ("good", "m15-r2")):
        (tmp_path / "reports" / name).mkdir(parents=True)
        manifest = told | {"report": f"TR-{name}", "calibrations": [{"id": record}]}
        (tmp_path / "reports" / name / "manifest.json").write_text(json.dumps(manifest))
    result = run(
        tmp_path / "archive", "--reports", tmp_path / "reports", "--repair", tmp_path / "fixed", "--json"
    )
    answer = json.loads(result.stdout)
    # The report that was computed by the record in force stands, whatever the files' own columns say.
    assert {one["report"]: one["to_amend"] for one in answer["reports"]} == {"old": True, "good": False}
    (one,) = answer["amended"]
    assert one["replaces"] == "TR-old"
    text = subprocess.run(
        ["pdftotext", "-layout", one["pdf"], "-"], capture_output=True, text=True, check=True
    )
    assert "TR-old" in text.stdout
    assert "rests on m15-r1" in " ".join(text.stdout.split())


def _sha(path):
    from toolkit.files import sha256_file

    return sha256_file(path)


def test_a_file_name_with_a_line_break_stays_in_its_row_and_moves_no_cursor(archive, monkeypatch):
    monkeypatch.setenv("COLUMNS", "160")  # room for the whole name
    (archive / "2019" / "run" / "a\nb\x1b[2J\u2028c.csv").write_text("nothing,of,use\n")
    lines = run(archive).stdout.split("\n")
    assert sum("a\\nb\\x1b[2J\\u2028c.csv" in line for line in lines) == 1
    assert not any("\x1b" in line or line.startswith("b") for line in lines)


def test_the_first_line_answers_in_console_page_and_json_and_tables_fit_80_columns(
    archive, tmp_path, monkeypatch
):
    monkeypatch.setenv("COLUMNS", "80")
    answer = json.loads(run(archive, "--out", tmp_path / "out", "--json").stdout)
    sentence = answer["headline"]["sentence"]
    assert answer["headline"] == json_value(headline_of(answer["files"]))
    page = (tmp_path / "out" / "audit.html").read_text(encoding="utf-8")
    assert f'<p class="headline">{html.escape(sentence)}.</p>' in page
    lines = run(archive).stdout.splitlines()
    head = lines[: lines.index("")]
    assert " ".join(head) == f"{sentence}."
    assert all(len(line) <= 80 for line in lines[: lines.index("", len(head) + 1)])


def test_a_record_that_nobody_had_approved_on_the_day_of_knowledge_is_named(archive):
    """In 1970 nobody had approved a record of the machine; m15-r2, which serves, was on 31 December 2019."""
    words = ("--known-at", "1970-06-01")
    assert json.loads(run(archive, *words, "--json").stdout)["approved_later"] == {"m15-r2": "2019-12-31"}
    text = " ".join(run(archive, *words).stdout.split())
    assert "m15-r2: approved on 2019-12-31, after 1970-06-01: no earlier approval serves" in text
    assert json.loads(run(archive, "--known-at", "2026-06-01", "--json").stdout)["approved_later"] == {}
