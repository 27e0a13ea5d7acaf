"""A diagnosis is told in the report of the test whose recordings it rests on, and in no other."""

from __future__ import annotations

import dataclasses
import json
import shutil
from pathlib import Path

import pytest

from tests.report.diagnosis.test_answer import ANSWER
from tests.report.report_factory import make_record, make_result
from tests.report.template_factory import make, p
from toolkit.cli.report import command
from toolkit.declared import json_value
from toolkit.diagnosis.answer.answer import DiagnosedRecording, Diagnosis
from toolkit.errors import ConfigError
from toolkit.lab.tire_tests import resolve
from toolkit.lab.tire_tests.handover import diagnosis_findings
from toolkit.lab.tire_tests.resolve import Resolved

office_needed = pytest.mark.skipif(
    not (shutil.which("soffice") and shutil.which("pdftotext")),
    reason="LibreOffice or poppler is not installed",
)
RESULT = make_result()
ITS_OWN = tuple({one.file: one.file_sha256 for one in RESULT.reduced.conditions}.items())
ANOTHERS = (("f+1", "ab" * 32), ("f-1", "cd" * 32))


def of(*recordings: tuple[str, str], own: bool = True) -> Diagnosis:
    made = tuple(DiagnosedRecording(name=name, sha256=digest, own=own) for name, digest in recordings)
    return dataclasses.replace(ANSWER, recordings=made)


def found(answer: Diagnosis) -> list[str]:
    resolved = Resolved(result=RESULT, record=make_record(), findings=())
    return [one.message for one in diagnosis_findings(answer, resolved, Path("any"))]


def test_a_diagnosis_of_the_tests_own_recordings_is_told_without_a_word() -> None:
    assert found(of(*ITS_OWN[:4])) == []


def test_files_of_another_test_are_refused_by_name() -> None:
    with pytest.raises(ConfigError) as caught:
        found(of(*ANOTHERS))  # of the same names, with other contents
    error = caught.value
    assert error.rule == "diagnosis-of-other-recordings"
    assert error.got == "f+1, f-1"
    assert "altimax-89" in str(error.expected)
    assert error.next_step


def test_files_of_another_test_beside_its_own_are_a_finding() -> None:
    (said,) = found(of(*ITS_OWN[:2], ANOTHERS[0]))
    assert said.endswith("recordings of another test: f+1")


def test_tables_made_for_a_case_and_answers_of_old_cannot_be_compared() -> None:
    (said,) = found(of(*ANOTHERS, own=False))
    assert "nobody can tell" in said
    (said,) = found(dataclasses.replace(ANSWER, recordings=None))
    assert "earlier version" in said
    # A table that happens to be a file of the test is one.
    assert found(of(*ITS_OWN[:1], own=False)) == []


@office_needed
def test_the_command_refuses_the_one_and_says_the_other(tmp_path: Path, monkeypatch, capsys) -> None:
    resolved = Resolved(result=RESULT, record=make_record(), findings=())
    monkeypatch.setattr(resolve, "resolve_test", lambda _test, *_basis, **_options: resolved)
    template = make(tmp_path, p("{{tk:diagnosis.verdict}}"))
    out = tmp_path / "out"

    def report(answer: Diagnosis) -> int:
        (tmp_path / "diagnosis.json").write_text(json.dumps({"schema": 1} | json_value(answer)))
        return command([Path("any")], template=template, out=out, diagnosis=tmp_path, json=True)

    with pytest.raises(ConfigError):
        report(of(*ANOTHERS))
    assert not out.exists()
    capsys.readouterr()
    assert report(of(*ANOTHERS, own=False)) == 1
    said = json.loads(capsys.readouterr().out)
    assert said["verified"] is True
    assert [one["rule"] for one in said["findings"]] == ["diagnosis-not-tied"]
    assert report(of(*ITS_OWN)) == 0
