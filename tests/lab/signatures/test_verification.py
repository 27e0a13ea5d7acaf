"""A report holds where its record is the one in force on the day of its test, as known today."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from datetime import date
from pathlib import Path

import pytest

from tests.calibration.calibration_factory import hub_data
from tests.calibration.conftest import entered, make_session, registry
from tests.trust.seal.seal_factory import key, plain_pdf, trust
from toolkit.audit.linked import RestingReport
from toolkit.calibration.registry.approval import approve, withdraw
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.clock import today
from toolkit.calibration.registry.registry import Registry
from toolkit.lab.signatures.issuing import issue
from toolkit.lab.signatures.people import checkpoint_of, lines_of
from toolkit.lab.signatures.proofs import registry_ledger
from toolkit.lab.signatures.verification import Verdict, verify_file
from toolkit.trust.anchor import Anchor, anchor_of
from toolkit.trust.seal.pdf import seal_pdf

__all__ = ["entered", "make_session", "registry"]

TEST = date(2026, 3, 10)
REPORT = {"name": "report T-1", "content": "c" * 64, "report.docx": "d" * 64}


@pytest.fixture
def hub(registry: Registry, make_session: Callable[..., Path]) -> Registry:
    """hub-r1 is in force from 2026-02-01; hub-r2 is a candidate."""
    calibrate(make_session(hub_data(60, 3), name="later"), registry)
    _approve(registry, "hub-r1", date(2026, 2, 1))
    return registry


def _approve(registry: Registry, record_id: str, since: date) -> None:
    done = approve(registry, record_id, in_force_from=since, checked_by="B", reason="entered late")
    assert done.done, done.failed


def _anchor(registry: Registry, document: Mapping[str, str]) -> Anchor:
    """Issue a document over hub-r1; return the proof of its entry."""
    seq = issue(registry, "hub-r1", document, decided=registry.ledger("hub").decided)
    return anchor_of(lines_of(registry, "hub"), seq - 1, checkpoint_of(registry, "hub", []))


def _pdf(registry: Registry, folder: Path, document: Mapping[str, str], *, proved: bool = True) -> Path:
    """Return a sealed PDF over hub-r1; without its proof it is one of before there were any."""
    proof = {
        "schema": 1,
        "document": document["name"],
        "records": [{"id": "hub-r1", "sha256": registry.load("hub-r1").sha256}],
        "files": [],
        **({"ledger": _anchor(registry, document).as_dict()} if proved else {}),
    }
    path = folder / "report.pdf"
    attachments = {"toolkit.json": json.dumps(proof).encode()}
    path.write_bytes(seal_pdf(plain_pdf(), key(), reason="issued", attachments=attachments))
    return path


def _verdict(registry: Registry, path: Path) -> Verdict:
    return verify_file(path, trust(), ledger=registry_ledger(lambda: registry))


def _dated(day: date = TEST) -> dict[str, str]:
    return {**REPORT, "tested": day.isoformat()}


def test_a_report_of_a_day_that_a_newer_record_took_does_not_hold(hub: Registry, tmp_path: Path) -> None:
    pdf = _pdf(hub, tmp_path, _dated())
    verdict = _verdict(hub, pdf)
    assert (verdict.signature, verdict.still_holds, verdict.code) == ("valid", True, 0), verdict.why
    assert "in force on 2026-03-10, the day of the test" in verdict.why
    _approve(hub, "hub-r2", date(2026, 3, 1))
    verdict = _verdict(hub, pdf)
    assert (verdict.signature, verdict.still_holds, verdict.code) == ("valid", False, 1)
    assert "superseded by hub-r2, in force from 2026-03-01" in verdict.why
    # What an audit says of the same report, by the same records in force.
    in_force = hub.id_in_force("hub", on=TEST)
    assert in_force == "hub-r2"
    past = RestingReport(report="R", id="T-1", calibrations=("hub-r1",), in_force={in_force})
    assert past.to_amend is True


def test_a_supersession_after_the_test_voids_nothing(hub: Registry, tmp_path: Path) -> None:
    pdf = _pdf(hub, tmp_path, _dated())
    _approve(hub, "hub-r2", date(2026, 3, 11))
    assert _verdict(hub, pdf).still_holds is True


@pytest.mark.parametrize(("void_from", "holds"), [(date(2026, 3, 11), True), (TEST, False), (None, False)])
def test_a_withdrawal_is_of_the_days_that_it_names(
    hub: Registry, tmp_path: Path, void_from: date | None, holds: bool
) -> None:
    pdf = _pdf(hub, tmp_path, _dated())
    withdraw(hub, "hub-r1", on=today(), void_from=void_from, reason="dropped", by="B")
    verdict = _verdict(hub, pdf)
    assert (verdict.still_holds, verdict.code) == (holds, 0 if holds else 1)
    assert "withdrawn" in verdict.why
    assert "dropped" in verdict.why


@pytest.mark.parametrize("proved", [True, False])
def test_of_a_report_without_the_day_of_its_test_it_cannot_be_told(
    hub: Registry, tmp_path: Path, proved: bool
) -> None:
    pdf = _pdf(hub, tmp_path, REPORT, proved=proved)
    verdict = _verdict(hub, pdf)
    assert (verdict.signature, verdict.still_holds, verdict.code) == ("valid", None, 1)
    assert "cannot be told" in verdict.why
    assert "holds" not in verdict.line
    withdraw(hub, "hub-r1", on=today(), void_from=date(2026, 3, 20), reason="dropped", by="B")
    verdict = _verdict(hub, pdf)
    assert (verdict.still_holds, verdict.code) == (None, 1)
    assert "withdrawn" in verdict.why


def test_a_record_that_is_void_on_every_day_holds_no_report_whatever_its_day(
    hub: Registry, tmp_path: Path
) -> None:
    pdf = _pdf(hub, tmp_path, REPORT)
    withdraw(hub, "hub-r1", on=today(), reason="wrong sign", by="B")
    assert _verdict(hub, pdf).still_holds is False


def test_where_no_ledger_is_a_report_without_a_day_is_what_it_was(hub: Registry, tmp_path: Path) -> None:
    verdict = verify_file(_pdf(hub, tmp_path, REPORT), trust())
    assert (verdict.signature, verdict.ledger, verdict.still_holds, verdict.code) == (
        "valid", "unknown", None, 0,
    )  # fmt: skip


@pytest.mark.parametrize("day", ["2026-13-40", "tomorrow", ""])
def test_a_day_that_is_none_says_nothing(hub: Registry, tmp_path: Path, day: str) -> None:
    pdf = _pdf(hub, tmp_path, {**REPORT, "tested": day})
    assert (_verdict(hub, pdf).still_holds, _verdict(hub, pdf).code) == (None, 1)


def test_a_certificate_is_of_its_record_and_of_no_day(hub: Registry, tmp_path: Path) -> None:
    pdf = _pdf(hub, tmp_path, {**REPORT, "name": "certificate CC-1"})
    assert (_verdict(hub, pdf).still_holds, _verdict(hub, pdf).code) == (True, 0)
    _approve(hub, "hub-r2", date(2026, 2, 1))
    assert _verdict(hub, pdf).still_holds is True


def test_the_code_on_a_page_is_of_the_day_that_its_entry_has(hub: Registry, tmp_path: Path) -> None:
    code = tmp_path / "code.txt"
    code.write_bytes(_anchor(hub, _dated()).compact)
    assert _verdict(hub, code).still_holds is True
    _approve(hub, "hub-r2", date(2026, 3, 1))
    verdict = _verdict(hub, code)
    assert (verdict.still_holds, verdict.code) == (False, 1)
    assert "superseded by hub-r2" in verdict.why


@pytest.mark.parametrize("rows", [1, 2])
def test_a_document_of_another_laboratory_with_an_instrument_of_that_name_accuses_nobody_alone(
    hub: Registry, make_session: Callable[..., Path], tmp_path: Path, rows: int
) -> None:
    """Two laboratories have the same machine: the ledger of one is no continuation of the other's."""
    other = Registry(tmp_path / "other")
    for seed in range(rows):
        calibrate(make_session(hub_data(60, 7 + seed), name=f"other{seed}"), other)
    verdict = _verdict(other, _pdf(hub, tmp_path, _dated()))
    assert (verdict.ledger, verdict.code) == ("rolled_back", 1)
    assert "or the document is of another laboratory's hub: no entry here holds its record" in verdict.why


def test_where_an_entry_holds_the_record_the_ledger_is_this_one(hub: Registry, tmp_path: Path) -> None:
    path = _pdf(hub, tmp_path, _dated())
    ledger = hub.folder / "hub" / "ledger.jsonl"
    ledger.write_text("".join(ledger.read_text().splitlines(keepends=True)[:-1]))
    verdict = _verdict(Registry(hub.folder), path)
    assert (verdict.ledger, verdict.code) == ("rolled_back", 1)
    assert "another laboratory" not in verdict.why


@pytest.mark.parametrize(("tested", "before", "since"), [(TEST, True, False), (None, None, None)])
def test_a_manifest_says_the_day_of_its_test(
    hub: Registry, tmp_path: Path, tested: date | None, before: bool | None, since: bool | None
) -> None:
    """It may be of a report that was never issued."""
    manifest = tmp_path / "manifest.json"
    calibrations = [{"id": "hub-r1", "sha256": hub.load("hub-r1").sha256}]
    day = {} if tested is None else {"tested": tested.isoformat()}
    manifest.write_text(json.dumps({"outputs": [], "report": "T-1", "calibrations": calibrations, **day}))
    assert _verdict(hub, manifest).still_holds is before
    _approve(hub, "hub-r2", date(2026, 3, 1))
    assert _verdict(hub, manifest).still_holds is since
    assert _verdict(hub, manifest).code == 1


def test_a_manifest_of_a_draft_does_not_hold(hub: Registry, tmp_path: Path) -> None:
    manifest = tmp_path / "manifest.json"
    calibrations = [{"id": "hub-r2", "sha256": hub.load("hub-r2").sha256}]
    text = {"outputs": [], "report": "T-1", "calibrations": calibrations, "tested": TEST.isoformat()}
    manifest.write_text(json.dumps(text))
    verdict = _verdict(hub, manifest)
    assert verdict.still_holds is False
    assert "nobody has approved" in verdict.why
