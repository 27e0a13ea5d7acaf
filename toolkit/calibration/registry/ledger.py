"""The ledger: one JSON line an event, each chained to the one before by SHA-256.

``ledger.jsonl`` only ever grows. ``head.json`` repeats the number of lines and the last hash, and
certificates and reports print that hash: a chain by itself cannot see that its end was cut off.

Canonical JSON says each thing in one way, so the form of a line is a pattern: what its texts and its number
may be, and everything else as it stands. A line that was parsed, written again and compared gives a form; one
that matches a form would be written the same, and is taken apart by it. Any other line is parsed. Both ways
refuse the same lines.
"""

from __future__ import annotations

import bisect
import contextlib
import gc
import hashlib
import json
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from datetime import date
from functools import cached_property
from typing import Any

from toolkit.calibration.records.record import canonical
from toolkit.calibration.registry.clock import ahead, moment, today
from toolkit.days import parse_day
from toolkit.files import sha256_bytes
from toolkit.trust.decisions import SIGNATURE

_MOST = 32  # forms: a ledger has some ten
_DECODE = json.JSONDecoder().raw_decode
_NUMBER, _TAKEN = "seq", "sha256"
_BEFORE, _BEHIND = len(f'"{_TAKEN}":"'), len('",')  # around the hash: an entry has a time, so a comma follows
_TEXT = '[^"]*+'  # of a line in which nothing is escaped
_PLAIN = bytes(byte for byte in range(0x20, 0x100) if byte != ord("\\"))
_INTEGER = "(0|[1-9][0-9]*+)"


class LineForm:
    """The lines that differ from one of them in the number ``seq`` and in texts that are no names."""

    def __init__(self, text: str) -> None:
        body: dict[str, Any] = json.loads(text)
        rows = []
        for name, value in body.items():
            part = f'"({_TEXT})"' if type(value) is str else f"({_form_of(value)})"
            rows.append(f"{re.escape(canonical(name))}:{_INTEGER if name == _NUMBER else part}")
        self.match = re.compile(rf"\{{{','.join(rows)}\}}").fullmatch
        self._names = tuple(map(sys.intern, body))
        self._taken = 1 + self._names.index(_TAKEN)
        others = {name: body[name] for name in body if name != _NUMBER and type(body[name]) is not str}
        self._empty = {name: value for name, value in others.items() if not value}
        self._deep = [name for name, value in others.items() if value]
        self._days = [name for name in _DAYS if body.get(name) is not None]
        self._lists = [name for name in _LISTS if name in body]

    def parts(self, text: str, match: re.Match[str]) -> Parts:
        """Return the parts of a line that matches."""
        body: dict[str, Any] = dict(zip(self._names, match.groups(), strict=False))  # a group for each name
        body[_NUMBER] = int(body[_NUMBER])
        if self._empty:
            body.update(self._empty)
        for name in self._deep:
            body[name] = json.loads(body[name])
        start, end = match.span(self._taken)
        return self, body, text[: start - _BEFORE] + text[end + _BEHIND :]

    def finish(self, body: dict[str, Any]) -> None:
        """Make of the entries of such a line what `Entry` has: days, and lists that nobody changes."""
        for name in self._days:
            body[name] = parse_day(body[name])
        for name in self._lists:
            body[name] = tuple(body[name])


Parts = tuple[LineForm | None, dict[str, Any], str]
"""The form of a line where it is known, its entries, and its text without the entry ``sha256``: what that is
the hash of."""


def _form_of(value: object) -> str:
    """Return the pattern of a value within a line: its texts are free, its names are not."""
    if isinstance(value, dict):
        return (
            r"\{"
            + ",".join(f"{re.escape(canonical(name))}:{_form_of(value[name])}" for name in value)
            + r"\}"
        )
    if isinstance(value, list):
        return r"\[" + ",".join(map(_form_of, value)) + r"\]"
    return f'"{_TEXT}"' if isinstance(value, str) else re.escape(canonical(value))


class LineForms:
    """The forms of the lines until now."""

    def __init__(self) -> None:
        self._forms: tuple[LineForm, ...] = ()  # replaced, never changed: threads read ledgers

    def read(self, line: bytes) -> Parts:
        """Return the parts of a line.

        Raises
        ------
        ValueError, KeyError, RecursionError
            it is no canonical JSON object, or has no ``sha256``
        """
        text = line.decode()
        for form in () if line.translate(None, _PLAIN) else self._forms:
            if (match := form.match(text)) is not None:
                return form.parts(text, match)
        body, end = _DECODE(text)
        if end != len(text) or type(body) is not dict:
            raise ValueError("it is no JSON object")
        if canonical(body) != text:
            raise ValueError("its text is not canonical")
        entry = f'"{_TAKEN}":"{body[_TAKEN]}",'
        before, separator, after = text.partition(entry)
        if separator and entry not in after:
            return None, body, before + after
        return None, body, canonical({name: value for name, value in body.items() if name != _TAKEN})

    def learn(self, line: bytes, body: Mapping[str, Any]) -> LineForm:
        """Return the form of a line that was parsed, and remember it: what such a line states is of its kind.

        Raises
        ------
        ValueError, KeyError, TypeError
            an entry is not of its kind
        """
        for key, value in body.items():
            if type(value) not in _TYPES[key]:
                raise ValueError(f"{key} is {value!r}")
        Entry(**body)
        for row in body.get("signatures", ()):
            if type(row) is not dict or {*row} != SIGNATURE or not all(type(row[key]) is str for key in row):
                raise ValueError("a signature states more than its person, its key and its purpose")
        form = LineForm(line.decode())
        if len(self._forms) < _MOST:
            self._forms = (*self._forms, form)
        return form


LEDGER = "ledger.jsonl"
HEAD = "head.json"
START = "0" * 64
EVENTS = ("entered", "approved", "withdrawn", "discarded", "issued", "enrolled")
_FORMS = LineForms()
"""Those of the lines of all ledgers that this process has read: few, and their names are in memory once."""
_DAMAGE = (ValueError, KeyError, TypeError, AttributeError, RecursionError)
_DECIDING = frozenset(("approved", "withdrawn", "discarded"))
BRINGING = ("entered", "enrolled")  # events with files of their own
ENDING = ("withdrawn", "discarded")  # events that end a record, and can always be entered


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One event of a record. What an event does not have is None or empty.

    Without slots: of a million lines each entry is the very dict that was parsed, over the class's defaults.

    ``entered``: ``by``, ``record`` (its hash), ``file`` (the hash of its file's bytes) and ``inputs`` (of
    its session's data and settings, by which the session is found again; older lines have none).
    ``approved``: ``known_on``, ``since`` (in force from), ``by`` (checked by), ``approved_by``, ``reason``,
    ``unverifiable`` terms as "load: term", ``note`` where ``since`` lies before ``known_on``, ``recall`` the
    recall interval such as "12 months", where one was set; ``evidence``: by what the signs were confirmed,
    and what the gates said that did not stand in the way.
    ``withdrawn``: ``known_on``, ``since`` (void from; None is the in-force date), ``by``, ``reason``, and a
    ``note`` where the entry is dated back.
    ``discarded``: ``known_on``, ``by``, ``reason``: the end of a candidate that was never approved.
    ``issued``: ``by``, ``document``: what left the laboratory, its ``name``, the hash ``content`` of what it
    says, the hashes of its files, and of a report the day of its test, ``tested`` (older lines have none)
    (`toolkit.lab.signatures.issuing`).
    ``enrolled``: ``by``, ``reason``, ``file`` (the hash of the people's file), ``heads``: count and last hash
    of every ledger until then, nothing of one that was damaged; older lines but the first have none. Lines
    before the first one need no signature.

    ``clock``: whether a time server kept the clock of the computer that wrote the line; older lines have
    none.

    A signed line has ``action``, ``subject``, ``meaning``, ``extends``, ``people`` and ``signatures``
    (`toolkit.trust.decisions`).
    """

    seq: int
    prev: str
    sha256: str
    event: str
    id: str
    time: str
    by: str
    clock: str | None = None
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
    document: Mapping[str, str] | None = None
    heads: Mapping[str, Mapping[str, Any]] | None = None
    action: str | None = None
    subject: Mapping[str, str | None] | None = None
    meaning: str | None = None
    extends: str | None = None
    people: str | None = None
    signatures: tuple[Mapping[str, str], ...] = ()


_SECONDS = len("2026-11-22T10:11:12Z")
_LISTS = frozenset(("unverifiable", "evidence", "signatures"))
_DAYS = frozenset(("known_on", "since"))
_TYPES: Mapping[str, tuple[type, ...]] = {
    **{part.name: (str, type(None)) if part.default is None else (str,) for part in fields(Entry)},
    **dict.fromkeys(_LISTS, (list,)), **dict.fromkeys(("document", "heads", "subject"), (dict,)),
    "seq": (int,),
}  # fmt: skip
"""What each entry of a line is in JSON."""


@dataclass(frozen=True, kw_only=True)
class Ledger:
    """What was read. ``damage`` says what is wrong, None where the chain and the head hold.

    ``hidden`` are the files of a write that was cut off: they belong to no record. ``lines`` are the texts of
    the entries, ``void`` the numbers of those that decide nothing: their key was stolen.

    Without slots: its look-ups are made once and kept.
    """

    entries: tuple[Entry, ...]
    damage: str | None
    hidden: frozenset[str] = frozenset()
    lines: tuple[bytes, ...] = field(default=(), repr=False, compare=False)
    void: frozenset[int] = frozenset()

    @property
    def head(self) -> str:
        """The last line's hash; zeros where there is none."""
        return self.entries[-1].sha256 if self.entries else START

    def texts(self) -> list[str]:
        """Return the lines as text."""
        return [line.decode() for line in self.lines]

    @property
    def decided(self) -> str:
        """The hash of the last line that decides about a record, as documents print it.

        That a document was issued changes nothing in what the next one says.
        """
        return next((entry.sha256 for entry in reversed(self.entries) if entry.event != "issued"), START)

    def known_on(self, known_at: date | None = None) -> date:
        """Return the day of knowledge: the one that is asked for, else today.

        What was decided is known: where this computer's clock was set back, the last day of a decision
        counts. A withdrawn record would come back into force otherwise. The times of entries do not: one of a
        clock that was fast would be the day of everything for years.
        """
        return known_at or max(today(), self._decided_on)

    @property
    def doubt(self) -> str | None:
        """Say which line's time lies after this computer's clock; None where none does."""
        latest = self._latest
        if latest is None or not ahead(latest.time):
            return None
        return (
            f"line {latest.seq} ({latest.event} {latest.id}) states {latest.time}, which lies after this "
            "computer's clock: one of the two is wrong"
        )

    def of(self, record_id: str) -> tuple[Entry, ...]:
        """Return the events of one record, oldest first."""
        return self._events.get(record_id, ())

    def entered(self) -> Mapping[str, Entry]:
        """Return each record's entry by id."""
        return self._entered

    @cached_property
    def decisions(self) -> tuple[Entry, ...]:
        """The lines that put a record in force or end it, without those that decide nothing."""
        return tuple(e for e in self.entries if e.event in _DECIDING and e.seq not in self.void)

    @cached_property
    def newest_before(self) -> Mapping[int, str | None]:
        """Of each approval's line the record that was in force last among the others, None where none was.

        One pass for all lines: a registry of many records asks at each of them.
        """
        newest: dict[int, str | None] = {}
        order: list[tuple[date, str]] = []
        ended: set[str] = set()
        since: dict[str, date] = {}
        for entry in self.decisions:
            before = since.pop(entry.id, None)
            if before is not None:
                del order[bisect.bisect_left(order, (before, entry.id))]
            if entry.event != "approved":
                ended.add(entry.id)
            elif entry.since is not None:
                newest[entry.seq] = self._last_of(order, entry.seq)
            if entry.since is not None and entry.id not in ended:
                since[entry.id] = entry.since if before is None else min(entry.since, before)
                bisect.insort(order, (since[entry.id], entry.id))
        return newest

    def _last_of(self, order: Sequence[tuple[date, str]], line: int) -> str | None:
        """Return the last record of an order by its day; among equals the one that a line was about last."""
        last: tuple[int, str] | None = None
        for day, record_id in reversed(order):
            if day != order[-1][0]:
                break
            about = (max(entry.seq for entry in self.of(record_id) if entry.seq < line), record_id)
            last = about if last is None else max(last, about)
        return None if last is None else last[1]

    @cached_property
    def _decided_on(self) -> date:
        # An approval that was ended decides nothing more: the day of one of a fast clock goes with it.
        ended = {e.id for e in self.decisions if e.event != "approved"}
        days = (e.known_on for e in self.decisions if e.event != "approved" or e.id not in ended)
        return max((day for day in days if day is not None), default=date.min)

    @cached_property
    def _latest(self) -> Entry | None:
        # Times of one spelling compare as texts do.
        alike = all(len(entry.time) == _SECONDS and entry.time[-1] == "Z" for entry in self.entries)
        return max(self.entries, key=lambda e: e.time if alike else moment(e.time), default=None)

    @cached_property
    def _events(self) -> dict[str, tuple[Entry, ...]]:
        entries: dict[str, list[Entry]] = {}
        for entry in self.entries:
            if entry.event in BRINGING or entry.seq not in self.void:
                entries.setdefault(entry.id, []).append(entry)
        return {record_id: tuple(events) for record_id, events in entries.items()}

    @cached_property
    def _entered(self) -> dict[str, Entry]:
        return {entry.id: entry for entry in self.entries if entry.event in BRINGING}


def next_line(seq: int, prev: str, event: Mapping[str, Any]) -> tuple[bytes, str]:
    """Return a ledger line (with its line feed) and its hash."""
    body = {"seq": seq, "prev": prev, **event}
    digest = sha256_bytes(canonical(body).encode())
    return (canonical({**body, "sha256": digest}) + "\n").encode(), digest


def head_bytes(count: int, digest: str) -> bytes:
    """Return the content of head.json."""
    return (canonical({"count": count, "sha256": digest}) + "\n").encode()


def decisions(lines: bytes) -> bytes:
    """Return a ledger's lines without those of issued documents, what is unreadable among them."""
    # Of canonical JSON, in which a quotation mark within a text is escaped.
    return b"\n".join(line for line in lines.split(b"\n") if b'"event":"issued"' not in line)


def parse_ledger(lines: bytes, head: bytes | None) -> Ledger:
    """Parse a ledger's bytes; entries end before the first damaged line."""
    entries: list[Entry] = []
    damage: str | None = None
    parts = lines.split(b"\n")
    if parts[-1] != b"":
        damage = f"line {len(parts)} of the ledger is incomplete"
    complete = parts[:-1]
    prev = START
    with _uncollected():
        try:
            for number, line in enumerate(complete, start=1):
                entry = _entry(line, number, prev)
                entries.append(entry)
                prev = entry.sha256
        except _DAMAGE as error:
            damage = f"line {len(entries) + 1} of the ledger is damaged: {error}"
    if damage is None and head != head_bytes(len(entries), prev):
        damage = (
            "head.json is missing"
            if head is None
            else f"head.json does not match the ledger's {len(entries)} lines: lines were cut off or changed"
        )
    return Ledger(entries=tuple(entries), damage=damage, lines=tuple(parts[: len(entries)]))


@contextlib.contextmanager
def _uncollected() -> Iterator[None]:
    """Let nobody look for circles among entries, which have none: that took a third of the time."""
    active = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()  # both together: what is there counts as old, and is not looked through next
        gc.unfreeze()
        if active:
            gc.enable()


def _entry(line: bytes, number: int, prev: str) -> Entry:
    form, body, remainder = _FORMS.read(line)
    if hashlib.sha256(remainder.encode()).hexdigest() != body["sha256"]:
        raise ValueError("its hash does not match")
    if body["seq"] != number or body["prev"] != prev:
        raise ValueError("it does not follow the line before")
    if body["event"] not in EVENTS:
        raise ValueError(f"unknown event {body['event']!r}")
    form = form or _FORMS.learn(line, body)
    moment(body["time"])
    body["prev"] = prev  # the same text once in memory, not twice
    form.finish(body)
    parsed = object.__new__(Entry)
    object.__setattr__(parsed, "__dict__", body)
    return parsed
