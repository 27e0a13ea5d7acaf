"""`toolkit calibration certificate`: answers, exit codes, and nothing half-written."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests import commands
from toolkit.lab.signatures.proofs import anchor_in

CHECKOUT = Path(__file__).resolve().parents[2]
TEMPLATE = CHECKOUT / "report_templates" / "certificate.docx"
Run = Callable[..., tuple[int, dict[str, Any]]]
office_needed = pytest.mark.skipif(
    not (shutil.which("soffice") and shutil.which("pdftotext")),
    reason="LibreOffice or poppler is not installed",
)


@pytest.fixture
def calibrations(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The records of the checkout, in a home of their own: a certificate is an entry of its ledger."""
    home = tmp_path_factory.mktemp("home")
    shutil.copytree(CHECKOUT / "calibrations", home / "calibrations")
    return home / "calibrations"


@pytest.fixture
def run(tmp_path: Path, calibrations: Path) -> Run:
    given = ("--out", tmp_path / "out", "--calibrations", calibrations)
    return lambda *words: commands.answer("calibration", "certificate", *words, *given)


@office_needed
def test_a_certificate_is_delivered_whole(run: Run, tmp_path: Path) -> None:
    template = tmp_path.parent / f"{tmp_path.name} templates" / "certificate.docx"
    template.parent.mkdir()
    shutil.copy(TEMPLATE, template)
    style = (TEMPLATE.parent / "org.toml").read_text()
    (template.parent / "org.toml").write_text(style.replace("[laboratory]", '[laboratory]\ncountry = "DE"'))
    code, answer = run("m15-virtual-r1", "--template", template, "--dcc", "--known-at", "2026-04-01")
    assert (code, answer["verified"], answer["draft"]) == (1, True, False)
    assert all(check["ok"] for check in answer["checks"])
    names = {Path(answer[kind]).name for kind in ("docx", "pdf", "dcc")}
    assert {one.name for one in (tmp_path / "out").iterdir()} == names
    assert [one.name for one in tmp_path.iterdir()] == ["out"]
    assert answer["warnings"] == []
    assert {one["rule"] for one in answer["findings"]} == {"certificate-gap", "certificate-budget"}
    assert len(answer["figures"]) == 3
    assert answer["issued"] == "2026-04-01"


def _files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@office_needed
def test_where_nobody_is_enrolled_an_issue_is_entered_only_where_it_was_asked_for(
    run: Run, calibrations: Path, tmp_path: Path
) -> None:
    before = _files(calibrations)
    code, answer = run("m15-virtual-r1")
    assert (code, answer["verified"], answer["signature"]) == (1, True, "unsigned")
    assert _files(calibrations) == before
    assert anchor_in(Path(answer["pdf"]).read_bytes()) is None
    code, answer = run("m15-virtual-r1", "--issue")
    assert (code, answer["signature"]) == (1, "unsigned")
    lines = (calibrations / "m15-virtual" / "ledger.jsonl").read_bytes().splitlines()
    assert len(lines) == 3
    assert json.loads(lines[-1])["event"] == "issued"
    anchor = anchor_in(Path(answer["pdf"]).read_bytes())
    assert anchor is not None
    assert anchor.proved


def test_a_draft_is_never_issued(run: Run, calibrations: Path, tmp_path: Path) -> None:
    before = _files(calibrations)
    code, answer = run("m15-virtual-r1", "--draft", "--issue")
    assert (code, answer["error"]["rule"]) == (2, "usage")
    assert _files(calibrations) == before
    assert not (tmp_path / "out").exists()


def test_a_digital_certificate_without_a_country_is_refused_and_nothing_is_left(
    run: Run, tmp_path: Path
) -> None:
    code, answer = run("m15-virtual-r1", "--template", TEMPLATE, "--dcc")
    assert (code, answer["error"]["rule"]) == (2, "certificate-country")
    assert not any(one.is_file() for one in tmp_path.rglob("*"))


@pytest.mark.parametrize(
    ("record", "rule"), [("m15-r2", "certificate-unverified"), ("m15-r99", "missing"), ("none", "record-id")]
)
def test_no_such_certificate(run: Run, tmp_path: Path, record: str, rule: str) -> None:
    code, answer = run(record, "--template", TEMPLATE)
    assert (code, answer["error"]["rule"]) == (2, rule)
    assert list(tmp_path.iterdir()) == []


def test_a_report_template_is_no_certificate_template(run: Run, tmp_path: Path) -> None:
    code, answer = run("m15-virtual-r1", "--template", TEMPLATE.with_name("org.docx"))
    assert (code, answer["error"]["rule"]) == (2, "missing-required")
    assert list(tmp_path.iterdir()) == []


def _with_country(tmp_path: Path) -> Path:
    template = tmp_path.parent / f"{tmp_path.name} templates" / "certificate.docx"
    template.parent.mkdir()
    shutil.copy(TEMPLATE, template)
    style = (TEMPLATE.parent / "org.toml").read_text()
    (template.parent / "org.toml").write_text(style.replace("[laboratory]", '[laboratory]\ncountry = "DE"'))
    return template


@office_needed
def test_a_sealed_certificate_is_a_pdf_a_3_with_its_proof_and_a_sealed_xml(run: Run, tmp_path: Path) -> None:
    from tests.trust.seal.authority import to_pem
    from tests.trust.seal.seal_factory import key, trust
    from toolkit.files import sha256_file
    from toolkit.recording.marks import refuse_original
    from toolkit.trust.seal.pdf import check_pdf
    from toolkit.trust.seal.xml import check_xml

    (tmp_path / "key.pem").write_bytes(to_pem(key()))
    code, answer = run(
        "m15-virtual-r1", "--template", _with_country(tmp_path), "--dcc", "--known-at", "2026-04-01",
        "--seal", tmp_path / "key.pem",
    )  # fmt: skip
    assert (code, answer["sealed_by"]) == (1, "Tire laboratory")
    pdf = Path(answer["pdf"]).read_bytes()
    check = check_pdf(pdf, trust())
    assert check.signature == "valid"
    proof = json.loads(check.attachments["toolkit.json"])
    assert proof["records"] == [{"id": "m15-virtual-r1", "sha256": answer["record"]["sha256"]}]
    assert {entry["name"]: entry["sha256"] for entry in proof["files"]} == {
        Path(answer[kind]).name: sha256_file(Path(answer[kind])) for kind in ("docx", "dcc")
    }
    assert b"<pdfaid:part>3</pdfaid:part>" in pdf
    assert check_xml(Path(answer["dcc"]).read_bytes(), trust()).signature == "valid"
    # The same command may write over its own files again: the mark is still in them.
    for kind in ("pdf", "dcc", "docx"):
        refuse_original(Path(answer[kind]), suffix=Path(answer[kind]).suffix)


@office_needed
def test_a_key_that_cannot_seal_leaves_nothing(run: Run, tmp_path: Path) -> None:
    (tmp_path / "key.pem").write_text("no key")
    code, answer = run("m15-virtual-r1", "--seal", tmp_path / "key.pem")
    assert (code, answer["error"]["rule"]) == (2, "seal-key")
    assert not (tmp_path / "out").exists()


def test_a_draft_is_never_sealed(run: Run, tmp_path: Path) -> None:
    code, answer = run("m15-virtual-r1", "--draft", "--seal", tmp_path / "key.pem")
    assert (code, answer["error"]["rule"]) == (2, "usage")
    code, answer = run("m15-virtual-r1", "--time-stamp", "http://127.0.0.1:9/")
    assert (code, answer["error"]["rule"]) == (2, "usage")
