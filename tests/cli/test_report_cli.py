from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "report"))

from report_factory import make_record, make_result
from template_factory import make, p, tbl

from toolkit.cli import resolve
from toolkit.cli.delivery import home_template
from toolkit.cli.report import command
from toolkit.cli.template import check, new, tags
from toolkit.errors import OutputError, TemplateError
from toolkit.findings import Finding

CHECKOUT = Path(__file__).resolve().parents[2]
office_needed = pytest.mark.skipif(
    not (shutil.which("soffice") and shutil.which("pdftotext")),
    reason="LibreOffice or poppler is not installed",
)


@pytest.fixture
def resolved(monkeypatch):
    """Make every TEST the synthetic one; the test may change what comes out."""
    made = SimpleNamespace(result=make_result(), record=make_record(), findings=())
    monkeypatch.setattr(resolve, "resolve_test", lambda _test, **_options: made)
    return made


def answer(capsys) -> dict:
    return json.loads(capsys.readouterr().out)


@office_needed
def test_report_answers_with_the_contract(tmp_path: Path, resolved, capsys) -> None:
    body = p("{{tk:tire.size}} {{tk:report.id}}") + p("{{tk:figure.gough}}")
    body += p("{{tk:table.acquisition}}") + tbl(["a", "b"], ["{{tk:row.file}}", "{{tk:row.FY_difference}}"])
    template = make(tmp_path, body)
    out = tmp_path / "out"
    assert command(Path("any"), template=template, out=out, json=True) == 0
    said = answer(capsys)
    assert said["schema"] == 1
    assert said["verified"] is True
    assert said["docx"] == str(out / "report.docx")
    assert said["pdf"] == str(out / "report.pdf")
    assert (out / "report.pdf").is_file()
    assert said["pages"] >= 1
    assert said["calibrations"] == [{"id": "m15-r2", "sha256": make_record().sha256, "unverified": False}]
    assert said["figures"][0]["tag"] == "tk:figure.gough"
    assert "Gough plot" in said["figures"][0]["alt"]
    assert {"tag": "tk:tire.size", "text": "265/35 ZR 18", "part": "word/document.xml"} in said["manifest"]
    assert len(said["template_sha256"]) == 64
    assert {"placeholders", "values", "cells", "fonts", "pages", "figures"} <= {
        c["name"] for c in said["checks"]
    }


@office_needed
def test_an_unverified_record_or_a_finding_ends_with_one(tmp_path: Path, resolved, capsys) -> None:
    template = make(tmp_path, p("{{tk:calibration.status}} {{tk:test.special}}"))
    resolved.result = make_result(unverified=True, special=None)
    resolved.findings = (Finding(rule="no-tare", where="test.toml", message="no tare"),)
    assert command(Path("any"), template=template, out=tmp_path / "out", allow_missing=True) == 1
    said = capsys.readouterr().out
    assert "UNVERIFIED" in said
    assert "no-tare" in said
    assert "missing-value: tk:test.special" in said


def test_a_refused_template_is_told_before_the_test_is_read(tmp_path: Path, monkeypatch) -> None:
    def never(*_args, **_options):
        raise AssertionError("the test was read")

    monkeypatch.setattr(resolve, "resolve_test", never)
    bad = tmp_path / "t.docx"
    bad.write_text("no word file")
    with pytest.raises(TemplateError):
        command(Path("any"), template=bad, out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_the_default_template_is_the_homes(tmp_path: Path) -> None:
    (tmp_path / "calibrations").mkdir()
    assert home_template("org.docx", tmp_path).name == "org.docx"
    own = tmp_path / "report_templates" / "org.docx"
    own.parent.mkdir()
    own.write_bytes(b"x")
    assert home_template("org.docx", tmp_path) == own


def test_template_check_new_and_tags(tmp_path: Path, resolved, capsys) -> None:
    target = tmp_path / "ours.docx"
    assert new(target, json=True) == 0
    assert answer(capsys)["style"] == str(tmp_path / "ours.toml")
    with pytest.raises(OutputError):
        new(target)
    assert check(target, json=True) == 0
    assert answer(capsys)["findings"] == []
    assert check(make(tmp_path, p("{{tk:tire.sise}}")), json=True) == 1
    finding = answer(capsys)["findings"][0]
    assert finding["rule"] == "unknown-tag"
    assert set(finding) == {"rule", "level", "part", "place", "message"}
    assert tags(json=True) == 0
    listed = {one["tag"]: one for one in answer(capsys)["tags"]}
    keys = {"tag", "kind", "unit", "required", "columns", "available", "value", "description"}
    assert all(set(one) == keys for one in listed.values())
    assert [tag for tag, one in listed.items() if one["required"]] == ["tk:calibration.hash"]
    assert listed["tk:test.pressure.psi"]["unit"] == "psi"
    assert listed["tk:table.files"]["columns"] == ["file", "rotation", "sha256"]
    assert tags(test=Path("any"), json=True) == 0
    listed = {one["tag"]: one for one in answer(capsys)["tags"]}
    assert listed["tk:tire.size"]["value"] == "265/35 ZR 18"
    assert listed["tk:figure.conicity"]["available"] is True
    assert listed["tk:if.simulated"]["value"] is False
    assert listed["tk:calibration.FY.D51"]["value"] == "1.01235"
