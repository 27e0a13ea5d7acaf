"""The ledger: one JSON line an event, each chained to the one before by SHA-256.

``ledger.jsonl`` only ever grows. ``head.json`` repeats the number of lines and the last hash, and
certificates and reports print that hash: a chain by itself cannot see that its end was cut off.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date
from functools import cached_property
from pathlib import Path
from typing import Any

from toolkit.calibration.records.record import canonical
from toolkit.calibration.registry.clock import moment
from toolkit.files import read_regular, sha256_bytes

LEDGER = "ledger.jsonl"
HEAD = "head.json"
START = "0" * 64
EVENTS = ("entered", "approved", "withdrawn", "discarded")


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One event of a record. What an event does not have is None or empty.

    ``entered``: ``by``, ``record`` (its hash), ``file`` (the hash of its file's bytes) and ``inputs`` (of
    its session's data and settings, by which the session is found again; older lines have none).
    ``approved``: ``known_on``, ``since`` (in force from), ``by`` (checked by), ``approved_by``, ``reason``,
    ``unverifiable`` terms as "load: term", ``note`` where ``since`` lies before ``known_on``, ``recall`` the
    recall interval such as "12 months", where one was set; ``evidence``: by what the signs were confirmed,
    and what the gates said that did not stand in the way.
    ``withdrawn``: ``known_on``, ``since`` (void from; None is the in-force date), ``by``, ``reason``, and a
    ``note`` where the entry is dated back.
    ``discarded``: ``known_on``, ``by``, ``reason``: the end of a candidate that was never approved.
    """

    seq: int
    prev: str
    sha256: str
    event: str
    id: str
    time: str
    by: str
    record: str | None = None
    file: str | None = None
    inputs: str | None = None
    known_on: date | None = None
    since: date | None = None
    approved_by: str | None = None
    reason: str | None = None
    note: str | None = None
    recall: str | None = None
    unverifiable: tuple[str, ...] = ()
    evidence: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Ledger:
    """What was read. ``damage`` says what is wrong, None where the chain and the head hold.

    Without slots: the two look-ups by id are made once and kept.
    """

    entries: tuple[Entry, ...]
    damage: str | None

    @property
    def head(self) -> str:
        """The last line's hash; zeros where there is none."""
        return self.entries[-1].sha256 if self.entries else START

    def disorder(self) -> str | None:
        """Say which entry's time lies before that of the one before it; None where none does."""
        for last, entry in itertools.pairwise(self.entries):
            if moment(entry.time) < moment(last.time):
                return (
                    f"line {entry.seq} was entered at {entry.time}, before line {last.seq} at {last.time}: "
                    "a clock was set back"
                )
        return None

    def of(self, record_id: str) -> tuple[Entry, ...]:
        """Return the events of one record, oldest first."""
        return self._events.get(record_id, ())

    def entered(self) -> Mapping[str, Entry]:
        """Return each record's entry by id."""
        return self._entered

    @cached_property
    def _events(self) -> dict[str, tuple[Entry, ...]]:
        entries: dict[str, tuple[Entry, ...]] = {}
        for entry in self.entries:
            entries[entry.id] = (*entries.get(entry.id, ()), entry)
        return entries

    @cached_property
    def _entered(self) -> dict[str, Entry]:
        return {entry.id: entry for entry in self.entries if entry.event == "entered"}


def next_line(seq: int, prev: str, event: Mapping[str, Any]) -> tuple[bytes, str]:
    """Return a ledger line (with its line feed) and its hash."""
    body = {"seq": seq, "prev": prev, **event}
    digest = sha256_bytes(canonical(body).encode())
    return (canonical({**body, "sha256": digest}) + "\n").encode(), digest


def head_bytes(count: int, digest: str) -> bytes:
    """Return the content of head.json."""
    return (canonical({"count": count, "sha256": digest}) + "\n").encode()


def read_ledger(folder: Path) -> Ledger:
    """Read an instrument's ledger and check chain and head; damage is told in the result, not raised."""
    try:
        lines = read_regular(folder / LEDGER) if (folder / LEDGER).exists() else None
        head = read_regular(folder / HEAD) if (folder / HEAD).exists() else None
    except OSError as error:
        return Ledger(entries=(), damage=f"the ledger cannot be read: {error.strerror}")
    if lines is None and head is None:
        return Ledger(entries=(), damage=None)
    if lines is None:
        return Ledger(entries=(), damage="ledger.jsonl is missing while head.json exists")
    return parse_ledger(lines, head)


def parse_ledger(lines: bytes, head: bytes | None) -> Ledger:
    """Parse a ledger's bytes; entries end before the first damaged line."""
    entries: list[Entry] = []
    damage: str | None = None
    prev = START
    parts = lines.split(b"\n")
    if parts[-1] != b"":
        damage = f"line {len(parts)} of the ledger is incomplete"
    for number, line in enumerate(parts[:-1], start=1):
        try:
            entry = _entry(line, number, prev)
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            damage = f"line {number} of the ledger is damaged: {error}"
            break
        entries.append(entry)
        prev = entry.sha256
    if damage is None and head != head_bytes(len(entries), prev):
        damage = (
            "head.json is missing"
            if head is None
            else f"head.json does not match the ledger's {len(entries)} lines: lines were cut off or changed"
        )
    return Ledger(entries=tuple(entries), damage=damage)


def _entry(line: bytes, number: int, prev: str) -> Entry:
    text = line.decode("utf-8")
    body = json.loads(text)
    if canonical(body) != text:
        raise ValueError("its text is not canonical")
    stated = body.pop("sha256")
    # Of a canonical text, the entry can be cut out: what is left is canonical too.
    entry = f'"sha256":"{stated}",'
    remainder = text.replace(entry, "") if text.count(entry) == 1 else canonical(body)
    if sha256_bytes(remainder.encode()) != stated:
        raise ValueError("its hash does not match")
    if body["seq"] != number or body["prev"] != prev:
        raise ValueError("it does not follow the line before")
    if body["event"] not in EVENTS:
        raise ValueError(f"unknown event {body['event']!r}")
    moment(body["time"])
    for key in ("known_on", "since"):
        if body.get(key) is not None:
            body[key] = date.fromisoformat(body[key])
    for key in ("unverifiable", "evidence"):
        body[key] = tuple(body.get(key, ()))
    return Entry(**{**body, "sha256": stated})
