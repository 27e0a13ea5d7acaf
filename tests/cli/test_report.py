from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import openpyxl
import pytest
import typer

import toolkit
from tests.report.report_factory import make_record, make_result
from tests.report.template_factory import make, p, tbl
from toolkit.cli.report import command
from toolkit.cli.template import check, new, tags
from toolkit.errors import ConfigError, OutputError, TemplateError
from toolkit.findings import Finding
from toolkit.lab.home import home_template
from toolkit.lab.tire_tests import resolve, tire_files
from toolkit.lab.tire_tests.handover import details_of
from toolkit.recording.marks import is_own_output
from toolkit.tires.tir import read_tir
from toolkit.tires.tydex import read_tydex

CHECKOUT = Path(__file__).resolve().parents[2]
office_needed = pytest.mark.skipif(
    not (shutil.which("soffice") and shutil.which("pdftotext")),
    reason="LibreOffice or poppler is not installed",
)


@pytest.fixture
def resolved(monkeypatch):
    """Make every TEST the synthetic one; the test may change what comes out."""
    made = SimpleNamespace(result=make_result(), record=make_record(), findings=())
    monkeypatch.setattr(resolve, "resolve_test", lambda _test, *_basis, **_options: made)
    return made


def answer(capsys) -> dict:
    return json.loads(capsys.readouterr().out)


@office_needed
def test_report_answers_with_the_contract(tmp_path: Path, resolved, capsys) -> None:
    body = p("{{tk:tire.size}} {{tk:report.id}}") + p("{{tk:figure.gough}}")
    body += p("{{tk:table.acquisition}}") + tbl(["a", "b"], ["{{tk:row.file}}", "{{tk:row.FY_difference}}"])
    template = make(tmp_path, body)
    out = tmp_path / "out"
    assert command([Path("any")], template=template, out=out, json=True) == 0
    said = answer(capsys)
    assert said["schema"] == 1
    assert said["verified"] is True
    assert said["docx"] == str(out / "report.docx")
    assert said["pdf"] == str(out / "report.pdf")
    assert (out / "report.pdf").is_file()
    assert said["pages"] >= 1
    assert said["calibrations"] == [
        {"id": "m15-r2", "sha256": make_record().sha256, "unverified": False, "signature": "unsigned"}
    ]
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
    assert command([Path("any")], template=template, out=tmp_path / "out", allow_missing=True) == 1
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
        command([Path("any")], template=bad, out=tmp_path / "out")
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
    said = answer(capsys)
    assert said["tag_count"] == 2  # that one, and the hash
    finding = said["findings"][0]
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


def named(name: str, **changes: object) -> SimpleNamespace:
    return SimpleNamespace(
        result=make_result(name=name, **changes), record=make_record(), findings=(), recordings=()
    )


@office_needed
def test_several_tests_are_made_in_one_command_and_a_bad_one_stops_no_other(
    tmp_path: Path, monkeypatch, capsys
) -> None:
    def resolve_one(test: Path, **_options: object) -> SimpleNamespace:
        if test.name == "bad":
            raise ConfigError("the test does not exist", rule="no-test")
        return named(test.name, operator=None if test.name == "silent" else "A. Operator")

    monkeypatch.setattr(resolve, "resolve_test", resolve_one)
    template = make(tmp_path, p("{{tk:test.operator}} {{tk:test.name}}"))
    tests = [Path(name) for name in ("one", "bad", "two", "silent", "one")]
    assert command(tests, template=template, out=tmp_path / "out", json=True) == 2
    told = answer(capsys)["reports"]
    assert [one["verified"] for one in told] == [True, False, True, False, False]
    rules = [one["error"]["rule"] for one in told if "error" in one]
    assert rules == [
        "no-test",
        "missing-value",
        "not-empty",
    ]
    # Nothing is left of what was refused, and every report is in a folder of its own.
    assert sorted(one.name for one in (tmp_path / "out").iterdir()) == ["one", "two"]
    assert sorted(one.name for one in (tmp_path / "out" / "two").iterdir()) == [
        "manifest.json", "report.docx", "report.pdf",
    ]  # fmt: skip


@office_needed
def test_the_hand_over_has_one_manifest_and_the_content_hash_is_the_same_twice(
    tmp_path: Path, monkeypatch, capsys
) -> None:
    shown = named("altimax-89", special="=1+1")
    made = resolve.Resolved(result=shown.result, record=shown.record, findings=shown.findings)
    monkeypatch.setattr(resolve, "resolve_test", lambda _test, *_basis, **_options: made)
    template = make(tmp_path, p("{{tk:report.date}} {{tk:test.special}}") + p("{{tk:figure.gough}}"))
    out = tmp_path / "out"
    told = []
    for _ in range(2):  # the second run replaces the first one's files: they are the toolkit's own
        assert command([Path("any")], template=template, out=out, hand_over=True, json=True) == 0
        told.append(answer(capsys))
    assert told[0]["content_sha256"] == told[1]["content_sha256"]
    manifest = json.loads((out / "manifest.json").read_text())
    assert manifest["content_sha256"] == told[1]["content_sha256"]
    assert [one["name"] for one in manifest["outputs"]] == [
        "report.docx", "report.pdf", "test.xlsx", "test.tdx", "tire.tir",
    ]  # fmt: skip
    for one in manifest["outputs"]:
        assert one["sha256"] == hashlib.sha256((out / one["name"]).read_bytes()).hexdigest()
    assert manifest["calibrations"] == [
        {"id": "m15-r2", "sha256": make_record().sha256, "unverified": False, "signature": "unsigned"}
    ]
    hashes = {one["name"]: one["sha256"] for one in manifest["inputs"]}
    assert hashes["f+0"] == hashlib.sha256(b"f+0").hexdigest()
    assert manifest["template"]["sha256"] == hashlib.sha256(template.read_bytes()).hexdigest()
    assert manifest["software"]["toolkit"] == toolkit.__version__
    assert all(map(is_own_output, out.iterdir()))
    # Numbers are numbers in the workbook, and a text that looks like a formula is a text.
    book = openpyxl.load_workbook(out / "test.xlsx")
    cells = {row[0].value: row[1] for row in book["provenance"].iter_rows()}
    assert (cells["info.special"].value, cells["info.special"].data_type) == ("=1+1", "s")
    table = read_tydex(out / "test.tdx")
    FZ = next(one for one in table.channels if one.symbol == "FZ")
    used = made.result.reduced.used()
    assert FZ.values == pytest.approx([one.FZ for one in used], rel=1e-6)
    # What the test declares is in it; the format has no channel for the direction.
    info = made.result.reduced.info
    for symbol, value in (("P", info.pressure_Pa), ("V", info.speed_m_s)):
        (column,) = [one for one in table.channels if one.symbol == symbol]
        assert column.values == pytest.approx(np.full(len(used), value), rel=1e-6)
    forward = sum(one.rotation == "forward" for one in used)
    said = (
        f"rows 1 to {forward} forward, rows {forward + 1} to {len(used)} reverse; the axes follow the travel"
    )
    assert said in (out / "test.tdx").read_text()
    assert read_tir(out / "tire.tir").version is not None
    # Who is given the tire file is told what its fit leaves open.
    of_fit = [finding.as_dict() for finding in tire_files.fit_test_tire(made.result.reduced).findings()]
    assert of_fit
    assert [one for one in told[0]["findings"] if one["where"].startswith("tire file, mf61")] == of_fit


@office_needed
def test_the_content_hash_follows_the_content(tmp_path: Path, monkeypatch, capsys) -> None:
    template = make(tmp_path, p("{{tk:test.operator}}"))
    told = set()
    for operator in ("A. Operator", "B. Operator"):
        made = named("altimax-89", operator=operator)
        monkeypatch.setattr(resolve, "resolve_test", lambda _test, *_basis, made=made, **_options: made)
        command([Path("any")], template=template, out=tmp_path / "out", json=True)
        told.add(answer(capsys)["content_sha256"])
    assert len(told) == 2


@office_needed
def test_units_of_choice_go_through_values_and_tables(tmp_path: Path, resolved, capsys) -> None:
    characteristics = resolved.result.characteristics
    load = characteristics.loads_N[0]
    conicity, CRAT = (characteristics.at(name, load).estimate.value for name in ("conicity", "CRAT"))
    body = p("{{tk:unit.force}} {{tk:unit.moment}} {{tk:summary.load}}") + p("{{tk:figure.plysteer}}")
    columns = ["{{tk:row.load}}", "{{tk:row.conicity}}", "{{tk:row.CRAT}}"]
    template = make(tmp_path, body + p("{{tk:table.pull}}") + tbl(["a", "b", "c"], columns))
    # The option goes before the style file.
    (tmp_path / "org.toml").write_text('[units]\nforce = "kN"\nmoment = "N*m"\n')
    assert command([Path("any")], template=template, out=tmp_path / "out", units="lbf", json=True) == 0
    said = answer(capsys)
    assert said["units"] == {"force": "lbf", "moment": "lbf*ft"}
    texts = {one["tag"]: one["text"] for one in reversed(said["manifest"])}
    assert (texts["tk:unit.force"], texts["tk:unit.moment"]) == ("lbf", "lbf·ft")
    lbf, lbf_ft = 0.45359237 * 9.80665, 0.45359237 * 9.80665 * 0.3048  # exact by definition
    assert float(texts["tk:table.pull.load"]) == pytest.approx(load / lbf, abs=0.5)
    assert float(texts["tk:table.pull.conicity"]) == pytest.approx(conicity / lbf, abs=0.05)
    assert float(texts["tk:table.pull.CRAT"]) == pytest.approx(CRAT / lbf_ft, abs=0.005)
    assert "lbf" in said["figures"][0]["alt"]
    for units in ("psi", ""):
        with pytest.raises(ConfigError) as caught:
            command([Path("any")], template=template, out=tmp_path / "none", units=units)
        assert caught.value.rule == "unknown-units"
    assert not (tmp_path / "none").exists()


def test_the_protocol_of_a_file_is_what_the_test_is_read_by(tmp_path: Path, monkeypatch) -> None:
    asked: list[object] = []

    def read(_test: Path, **options: object) -> object:
        asked.append(options["basis"].protocol)  # type: ignore[attr-defined]
        raise ConfigError("enough was asked", rule="enough")

    monkeypatch.setattr(resolve, "resolve_test", read)
    with pytest.raises(ConfigError, match="enough"):
        command([Path("any")], template=make(tmp_path, ""), protocol=Path("own.toml"), out=tmp_path / "out")
    assert asked == [Path("own.toml")]


def test_a_diagnosis_is_of_one_test_and_a_release_needs_one(tmp_path: Path) -> None:
    (tmp_path / "diagnosis.json").write_text("{}")
    out = tmp_path / "out"
    for tests, given, by, rule in (
        ([Path("a"), Path("b")], tmp_path, None, "diagnosis-of-one-test"),
        ([Path("a")], None, "second person", "diagnosis-of-one-test"),
        ([Path("a")], tmp_path, None, "not-a-diagnosis"),
    ):
        with pytest.raises(ConfigError) as caught:
            command(tests, diagnosis=given, by=by, out=out)
        assert caught.value.rule == rule
    assert not out.exists()


def test_details_are_those_of_the_test_or_of_a_file(tmp_path: Path) -> None:
    (tmp_path / "test.toml").write_text('[report]\ncustomer = "Example Tyres"\nreceived = 2026-03-01\n')
    other = tmp_path / "other.toml"
    other.write_text('customer = "Another"\n')
    assert details_of(tmp_path, None).customer == "Example Tyres"
    assert details_of(tmp_path, None).received == "2026-03-01"
    assert details_of(tmp_path, other).customer == "Another"
    other.write_text('[report]\ncustmer = "x"\n')
    with pytest.raises(ConfigError, match="custmer"):
        details_of(tmp_path, other)


@pytest.mark.parametrize("like", ["summary", "pruefbericht", "certificate"])
def test_a_new_template_can_be_like_any_of_the_toolkits(tmp_path: Path, like: str, capsys) -> None:
    target = tmp_path / "ours.docx"
    assert new(target, like=like, json=True) == 0
    assert answer(capsys)["template"] == str(target)
    assert check(target, json=True) == 0
    assert answer(capsys)["findings"] == []
    with pytest.raises(typer.BadParameter):
        new(tmp_path / "other.docx", like="letter")


@pytest.mark.parametrize(
    ("words", "got"),
    [({"issue": True, "draft": True}, "both"), ({"sign": ["anna"]}, "no --issue")],
)
def test_a_draft_is_never_issued_and_a_key_signs_an_issue(
    tmp_path: Path, words: dict[str, Any], got: str
) -> None:
    if "sign" in words:
        key = tmp_path / "anna"
        command_line = ["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", str(key)]
        subprocess.run(command_line, check=True)
        words = {"sign": [key]}
    home = tmp_path / "home"
    (home / "calibrations").mkdir(parents=True)
    with pytest.raises(ConfigError) as refusal:
        command([Path("any")], out=tmp_path / "out", home=home, **words)
    assert (refusal.value.rule, refusal.value.got) == ("usage", got)
    assert not (tmp_path / "out").exists()
