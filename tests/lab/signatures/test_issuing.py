"""An issue is a signed entry, made whole or not at all, and only by what the document knew."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from datetime import date
from pathlib import Path

import pytest

from tests.calibration.calibration_factory import hub_data, write_session
from tests.calibration.registry.test_signatures import (
    KEYS,
    RECORD,
    _found,
    _people,
    _registry,
    _withdraw,
    home,
)
from toolkit.calibration.control.calibrate import rehearse
from toolkit.calibration.registry import store
from toolkit.calibration.registry.approval import withdraw
from toolkit.calibration.registry.candidate import calibrate
from toolkit.calibration.registry.people_log import enrol
from toolkit.calibration.registry.registry import Registry
from toolkit.errors import OutputError, RegistryError, TrustError
from toolkit.lab.signatures.issuing import issue, issuers
from toolkit.trust.people import Demand, Policy
from toolkit.trust.requested import Requested
from toolkit.trust.requests import Request, read_request
from toolkit.trust.signing import Travel

__all__ = ["home"]

DOCUMENT = {"name": "certificate CC-1", "content": "c" * 64, "CC-1.docx": "d" * 64}


def _issue(registry: Registry) -> int:
    return issue(registry, RECORD, DOCUMENT, decided=registry.ledger("m15-virtual").decided)


def test_a_laboratory_without_people_issues_unsigned(home: Path) -> None:
    registry = _registry(home)
    assert issuers(registry, RECORD) == ()
    assert _issue(registry) == 3
    entry = registry.ledger("m15-virtual").entries[-1]
    assert (entry.event, entry.id, dict(entry.document or {})) == ("issued", RECORD, DOCUMENT)
    assert entry.signatures == ()
    assert registry.status(RECORD).state == "approved"
    assert registry.signature(RECORD) == "unsigned"


def test_people_who_are_enrolled_sign_what_they_issue(home: Path) -> None:
    _found(home)
    registry = _registry(home, "dora", "anna")
    assert issuers(registry, RECORD) == ("Dora", "Anna")
    _issue(registry)
    line = json.loads(_registry(home).ledger("m15-virtual").lines[-1])
    assert (line["action"], line["meaning"]) == ("issue", "issued")
    assert line["subject"] == {"record": RECORD, "sha256": registry.load(RECORD).sha256}
    assert [row["by"] for row in line["signatures"]] == ["dora", "anna"]


@pytest.mark.parametrize(("signers", "rule"), [((), "not-signed"), (("carl",), "not-allowed")])
def test_who_may_not_issue_does_not(home: Path, signers: tuple[str, ...], rule: str) -> None:
    _found(home)
    ledger = home / "calibrations/m15-virtual/ledger.jsonl"
    before = ledger.read_bytes()
    for attempt in (issuers, lambda registry, _: _issue(registry)):
        with pytest.raises(TrustError) as refusal:
            attempt(_registry(home, *signers), RECORD)
        assert refusal.value.rule == rule
    assert ledger.read_bytes() == before


def test_a_document_that_does_not_know_the_last_decision_is_not_issued(home: Path) -> None:
    decided = _registry(home).ledger("m15-virtual").decided
    issue(_registry(home), RECORD, DOCUMENT, decided=decided)
    issue(_registry(home), RECORD, DOCUMENT, decided=decided)  # an issue decides nothing
    _withdraw(home)
    before = _registry(home).head("m15-virtual")
    with pytest.raises(RegistryError) as refusal:
        issue(_registry(home), RECORD, DOCUMENT, decided=decided)
    assert refusal.value.rule == "ledger-moved"
    assert _registry(home).head("m15-virtual") == before


def test_an_issue_changes_nothing_that_an_audit_rests_on_and_a_lost_key_does(home: Path) -> None:
    _found(home)
    before = _registry(home).digest("m15-virtual")
    _issue(_registry(home, "anna"))
    assert _registry(home).digest("m15-virtual") == before
    people = _people()
    enrol(home / "calibrations", people, [KEYS["ben"]], by="ben", reason="again")
    assert _registry(home).digest("m15-virtual") == before
    anna = people.person[0]
    lost = replace(anna, keys=(replace(anna.keys[0], until="2026-01-01T00:00:00Z"),))
    enrol(home / "calibrations", people.with_person(lost), [KEYS["ben"]], by="ben", reason="lost")
    changed = _registry(home).digest("m15-virtual")
    assert changed != before
    withdraw(_registry(home, "ben"), RECORD, on=date(2026, 11, 21), reason="not traceable", by="ben")
    assert _registry(home).digest("m15-virtual") != changed


def test_a_session_can_be_tried_where_lines_are_signed(tmp_path: Path) -> None:
    (tmp_path / "calibrations").mkdir()
    _found(tmp_path)
    calibrate(write_session(tmp_path), _registry(tmp_path, "carl"))
    before = _registry(tmp_path).digest("hub")
    tried = rehearse(
        write_session(tmp_path, hub_data(40, 5), name="second", date="2026-02-05"), _registry(tmp_path)
    )
    assert tried.record.id == "hub-r2"
    assert _registry(tmp_path).digest("hub") == before


@pytest.mark.parametrize("failing", range(1, 5))
def test_a_failure_between_signature_and_entry_leaves_neither(
    home: Path, failing: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The journal, the ledger and its head are written in turn; each of them fails once."""
    _found(home)
    before = _registry(home).ledger("m15-virtual")
    written = store.write_atomic
    calls: list[Path] = []

    def write(path: Path, data: bytes | str) -> None:
        calls.append(path)
        if len(calls) == failing:
            raise OSError(28, "No space left on device")
        written(path, data)

    monkeypatch.setattr(store, "write_atomic", write)
    if failing <= 3:
        with pytest.raises(OutputError):
            _issue(_registry(home, "anna"))
        assert _registry(home).ledger("m15-virtual") == before
    else:
        assert _issue(_registry(home, "anna")) == len(calls) == 3


def test_proving_a_record_costs_less_than_five_milliseconds(home: Path) -> None:
    """Two decisions a record; the processor's time, so that a busy machine changes nothing."""
    _found(home)
    decided = _registry(home).ledger("m15-virtual").decided
    for _ in range(20):
        issue(_registry(home, "anna"), RECORD, DOCUMENT, decided=decided)
    started = time.process_time()
    for _ in range(5):
        assert _registry(home).ledger("m15-virtual").damage is None
    assert 2 * (time.process_time() - started) / (5 * 20) < 0.005


def _requested(home: Path, path: Path, *named: str, document: dict[str, str] = DOCUMENT) -> Request:
    registry = Registry(home / "calibrations", travel=Travel(request=path))
    with pytest.raises(Requested):
        issue(registry, RECORD, document, decided=registry.ledger("m15-virtual").decided, named=named)
    return read_request(path)


def test_an_issue_travels_to_the_person_whom_the_document_names(home: Path, tmp_path: Path) -> None:
    _found(home)
    request = _requested(home, tmp_path / "r.json", "dora")
    assert request.body["by"] == "Dora"
    assert len(_registry(home).ledger("m15-virtual").entries) == 2, "a request enters nothing"
    with pytest.raises(TrustError, match="names Dora, and anna is another person"):
        request.signed(KEYS["anna"])
    answer = request.signed(KEYS["dora"])[0]
    registry = Registry(home / "calibrations", travel=Travel(answers=(answer,)))
    assert issuers(registry, RECORD) == ("Dora",)
    with pytest.raises(TrustError, match="decides something else"):
        issue(
            registry,
            RECORD,
            {**DOCUMENT, "content": "0" * 64},
            decided=registry.ledger("m15-virtual").decided,
        )
    assert _issue(registry) == 3
    with pytest.raises(TrustError, match="no longer the one"):
        _issue(Registry(home / "calibrations", travel=Travel(answers=(answer,))))
    assert _registry(home).ledger("m15-virtual").damage is None


@pytest.mark.parametrize(
    ("named", "rule"), [((), "person"), (("nobody",), "person"), (("carl",), "not-allowed")]
)
def test_a_request_of_an_issue_names_who_can_sign_it(
    home: Path, tmp_path: Path, named: tuple[str, ...], rule: str
) -> None:
    _found(home)
    registry = Registry(home / "calibrations", travel=Travel(request=tmp_path / "r.json"))
    with pytest.raises(TrustError) as refusal:
        issuers(registry, RECORD, named)
    assert refusal.value.rule == rule
    with pytest.raises(TrustError) as refusal:
        issue(registry, RECORD, DOCUMENT, decided=registry.ledger("m15-virtual").decided, named=named)
    assert refusal.value.rule == rule
    assert not (tmp_path / "r.json").exists()


def test_two_who_issue_answer_in_any_order(home: Path, tmp_path: Path) -> None:
    _found(home, Policy(issue=Demand(roles=("head", "checker"), signatures=2)))
    request = _requested(home, tmp_path / "r.json", "dora", "anna")
    both = [request.signed(KEYS[name])[0] for name in ("dora", "anna")]
    for answers in (both, both[::-1]):
        assert issuers(Registry(home / "calibrations", travel=Travel(answers=tuple(answers))), RECORD) == (
            "Anna",
            "Dora",
        )
    with pytest.raises(TrustError, match="1 of 2 signatures"):
        _issue(Registry(home / "calibrations", travel=Travel(answers=(both[0],))))
    assert _issue(Registry(home / "calibrations", travel=Travel(answers=tuple(both)))) == 3


def test_a_request_of_an_issue_is_nothing_where_nobody_is_enrolled(home: Path, tmp_path: Path) -> None:
    registry = Registry(home / "calibrations", travel=Travel(request=tmp_path / "r.json"))
    with pytest.raises(TrustError, match="nobody is enrolled"):
        issuers(registry, RECORD, ("dora",))
