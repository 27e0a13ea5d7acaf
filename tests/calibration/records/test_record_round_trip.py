"""A record is the same bytes for ever, and one changed byte anywhere is found."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from toolkit.calibration.records.record import canonical, from_bytes, sealed, to_bytes
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.verify import verify_registry
from toolkit.errors import RecordError

FOLDER = Path(__file__).resolve().parents[3] / "calibrations"


def test_bytes_to_record_to_bytes(registry: Registry) -> None:
    data = (registry.folder / "hub" / "hub-r1.json").read_bytes()
    record = from_bytes(data, where="hub-r1")
    assert to_bytes(record) == data
    assert from_bytes(to_bytes(record), where="again") == record
    assert hash(record)  # frozen throughout: no list or dict within


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*/*-r*.json")), ids=lambda p: p.stem)
def test_every_record_of_the_project_is_the_same_bytes(path: Path) -> None:
    data = path.read_bytes()
    assert to_bytes(from_bytes(data, where=path)) == data
    assert Registry(FOLDER).load(path.stem).sha256 == json.loads(data)["sha256"]


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_float_reads_back_to_the_same_double(value: float) -> None:
    assert json.loads(canonical([value]))[0].hex() == value.hex()


def test_the_hash_covers_the_content_and_not_the_software(registry: Registry) -> None:
    record = registry.load("hub-r1")
    assert sealed(dataclasses.replace(record, software=(("numpy", "0"),))).sha256 == record.sha256
    assert sealed(dataclasses.replace(record, zero="tared")).sha256 != record.sha256


@pytest.mark.parametrize("data", [b"", b"{}", b"[1]", b"\xff\xfe", b'{"schema": 1}', b"not json"])
def test_what_is_no_record_is_unreadable(data: bytes) -> None:
    with pytest.raises(RecordError) as caught:
        from_bytes(data, where="x.json")
    assert caught.value.rule == "unreadable"


def test_a_record_of_a_newer_schema_asks_for_a_newer_version(registry: Registry) -> None:
    document = json.loads((registry.folder / "hub" / "hub-r1.json").read_bytes())
    newer = document | {
        "schema": 2,
        "content": {"of": "a form that nobody knows yet"},
        "software": {"toolkit": "9.1.0"},
    }
    with pytest.raises(RecordError) as caught:
        from_bytes(json.dumps(newer).encode(), where="m15-r3.json")
    assert caught.value.rule == "newer-schema"
    assert caught.value.got == "schema 2, written by toolkit 9.1.0"
    assert caught.value.expected == "schema 1"


def test_one_byte_changed_anywhere_is_found_and_named(registry: Registry) -> None:
    folder = registry.folder / "hub"
    assert all(row.ok for row in verify_registry(registry))
    for path in sorted(folder.iterdir()):
        whole = path.read_bytes()
        for at in range(0, len(whole), max(1, len(whole) // 7)):
            path.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
            rows = verify_registry(registry)
            bad = [row for row in rows if not row.ok]
            assert bad, f"{path.name}, byte {at}"
            assert "hub-r1" in {row.id for row in bad}
            with pytest.raises(RecordError):
                registry.load("hub-r1")
        path.write_bytes(whole)
    assert all(row.ok for row in verify_registry(registry))


def test_verify_names_missing_and_stray_files_and_a_ledger_that_was_cut(registry: Registry) -> None:
    folder = registry.folder / "hub"
    (folder / "notes.txt").write_text("x")
    (registry.folder / "loose.json").write_text("{}")
    reasons = {row.id: row.reason for row in verify_registry(registry) if not row.ok}
    assert reasons["notes.txt"].startswith("stray")
    assert reasons["loose.json"].startswith("stray")
    (folder / "notes.txt").unlink()
    (registry.folder / "loose.json").unlink()
    (folder / "hub-r1.loads.csv").rename(folder / "kept")
    assert _reason(registry).startswith("data")
    (folder / "kept").rename(folder / "hub-r1.loads.csv")
    (folder / "hub-r1.json").rename(registry.folder / "hub-r1.json")
    assert _reason(registry).startswith("missing")
    (registry.folder / "hub-r1.json").rename(folder / "hub-r1.json")
    lines = (folder / "ledger.jsonl").read_bytes()
    (folder / "ledger.jsonl").write_bytes(lines + lines[:40])
    assert _reason(registry).startswith("ledger")
    (folder / "ledger.jsonl").write_bytes(b"")
    assert _reason(registry).startswith("ledger")


def test_a_printed_head_shows_that_the_end_was_cut_off(registry: Registry) -> None:
    from datetime import date

    from toolkit.calibration.registry.approval import approve
    from toolkit.calibration.registry.ledger import head_bytes

    folder = registry.folder / "hub"
    one = registry.head("hub")
    approve(registry, "hub-r1", in_force_from=date(2026, 1, 5), checked_by="B")
    two = registry.head("hub")
    assert all(row.ok for row in verify_registry(registry, one))
    assert all(row.ok for row in verify_registry(registry, two))
    first = (folder / "ledger.jsonl").read_bytes().splitlines(keepends=True)[0]
    (folder / "ledger.jsonl").write_bytes(first)
    (folder / "head.json").write_bytes(head_bytes(1, one))
    assert all(row.ok for row in verify_registry(registry))
    assert not any(row.ok for row in verify_registry(registry, two))


def _reason(registry: Registry) -> str:
    reason = next(row.reason for row in verify_registry(registry) if row.id == "hub-r1")
    assert reason is not None
    return reason
