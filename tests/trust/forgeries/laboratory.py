"""A laboratory whose every kind of decision is signed, and what somebody may do who can write to its home."""

from __future__ import annotations

import functools
import json
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest import mock

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from toolkit.calibration.records.record import canonical
from toolkit.calibration.registry import people_log
from toolkit.calibration.registry.ledger import START, head_bytes, next_line
from toolkit.calibration.registry.people_log import enrol
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.store import Change
from toolkit.errors import ToolkitError
from toolkit.files import sha256_bytes
from toolkit.trust.decisions import signature_row, statement, unsigned
from toolkit.trust.keys import Signer
from toolkit.trust.merkle import Growing, leaf_hash
from toolkit.trust.people import Action, Key, People, Person, Role
from toolkit.trust.signing import HERE, Travel
from toolkit.trust.ssh import public_of, sign_with

RIG = "rig"
SINCE = "2020-01-01T00:00:00Z"
NOW = "2026-03-01T12:00:00Z"
ROLES: dict[str, tuple[Role, ...]] = {
    "anna": ("head",), "ben": ("head",), "carl": ("operator",), "dora": ("checker",), "emil": ("auditor",),
}  # fmt: skip


def new_signer() -> Signer:
    """Return a key in memory."""
    private = Ed25519PrivateKey.generate()
    return Signer(public_of(private), lambda data: sign_with(private, data))


KEYS = {name: new_signer() for name in (*ROLES, "dora-2", "expired", "later", "mallory", "thief")}


def key_of(name: str, since: str = SINCE, until: str | None = None) -> Key:
    """Return a key as the people's file has it."""
    return Key(key=KEYS[name].public.line, since=since, until=until)


def people() -> People:
    """Return the people; dora has a second key, one that has expired and one that is not yet valid."""
    keys: dict[str, tuple[Key, ...]] = {name: (key_of(name),) for name in ROLES}
    keys["dora"] += (
        key_of("dora-2"), key_of("expired", until="2026-01-01T00:00:00Z"),
        key_of("later", since="2999-01-01T00:00:00Z"),
    )  # fmt: skip
    persons = (
        Person(id=name, name=f"{name.title()} Example", roles=roles, keys=keys[name])
        for name, roles in ROLES.items()
    )
    return People(person=tuple(persons))


def event_of(kind: str, record: str, time: str = NOW, **more: Any) -> dict[str, Any]:
    """Return an event of a ledger; of an entry with the hash of a record."""
    brings = {"record": sha256_bytes(record.encode()), "file": "f" * 64} if kind == "entered" else {}
    return {"event": kind, "id": record, "time": time, **brings, **more}


DAY = {"known_on": "2026-03-01"}
DECISIONS: tuple[tuple[dict[str, Any], str, Action | None], ...] = (
    (event_of("entered", "rig-r1", by="Carl Example"), "carl", None),
    (event_of("approved", "rig-r1", by="dora", since="2026-03-01", unverifiable=["E5"], **DAY), "dora", None),
    (event_of("issued", "rig-r1", by="dora", document={"name": "c.pdf", "sha256": "d" * 64}), "dora", None),
    (event_of("entered", "rig-r2", by="legacy import"), "anna", "import"),
    (event_of("discarded", "rig-r2", by="dora", reason="a slip", **DAY), "dora", None),
    (event_of("withdrawn", "rig-r1", by="anna", reason="dropped", since="2026-03-01", **DAY), "anna", None),
    (event_of("entered", "rig-r3", by="Carl Example"), "carl", None),
)  # fmt: skip
"""Every kind of decision, who signs it, and what an entry says that it is."""


@functools.cache
def _founded() -> Path:
    home = Path(tempfile.mkdtemp(prefix="toolkit-forgeries-"))
    (home / "calibrations").mkdir()
    for month, reason in enumerate(("first enrolment", "another policy", "a third version"), start=10):
        with mock.patch.object(people_log, "now", return_value=f"2025-{month}-01T00:00:00Z"):
            signers = [KEYS["anna"], KEYS["ben"]]
            enrol(home / "calibrations", people(), signers, by="anna", reason=reason)
    for event, name, action in DECISIONS:
        decide(home, event, name, action=action)
    return home


@contextmanager
def laboratory() -> Iterator[Path]:
    """Yield the home of a laboratory of one's own, with every kind of decision in its ledger."""
    with tempfile.TemporaryDirectory(prefix="toolkit-forgery-") as place:
        home = Path(place) / "home"
        shutil.copytree(_founded(), home)
        yield home


@contextmanager
def rewritten_people() -> Iterator[Path]:
    """Yield a home whose log of people will be written anew; it is put back, for no copy is made."""
    home = _founded()
    before = {path: path.read_bytes() for path in (home / "people").iterdir()}
    try:
        yield home
    finally:
        for path, data in before.items():
            path.write_bytes(data)


def forget() -> None:
    """Remove the laboratory that the others are copied from."""
    shutil.rmtree(_founded())
    _founded.cache_clear()


def decide(
    home: Path, event: Mapping[str, Any], *names: str, action: Action | None = None, travel: Travel = HERE
) -> None:
    """Enter a decision through the registry, signed by keys."""
    registry = Registry(home / "calibrations", signers=[KEYS[name] for name in names], travel=travel)
    version = registry.people().history.now
    last = [entry.time for entry in registry.ledger(RIG).entries[-1:]]
    time = max([event["time"], *last, *([] if version is None else [version.since])])
    registry.commit(RIG, lambda _ledger: Change(files={}, event={**event, "time": time}, action=action))


def lines_of(home: Path) -> list[dict[str, Any]]:
    """Return the lines of the ledger as JSON values."""
    return [
        json.loads(line) for line in (home / f"calibrations/{RIG}/ledger.jsonl").read_bytes().splitlines()
    ]


def chained(lines: Sequence[Mapping[str, Any]]) -> tuple[bytes, bytes]:
    """Return the two files of a ledger whose chain and head are in order: hashing takes no key."""
    text, prev = b"", START
    for number, body in enumerate(lines, start=1):
        event = {key: value for key, value in body.items() if key not in ("seq", "prev", "sha256")}
        line, prev = next_line(number, prev, event)
        text += line
    return text, head_bytes(len(lines), prev)


def write_lines(folder: Path, lines: Sequence[Mapping[str, Any]]) -> None:
    """Write a ledger whose chain and head are in order, as anybody can who may write there."""
    text, head = chained(lines)
    (folder / "ledger.jsonl").write_bytes(text)
    (folder / "head.json").write_bytes(head)


def signed_again(
    home: Path, lines: Sequence[Mapping[str, Any]], keys: Mapping[int, Sequence[Signer]]
) -> None:
    """Write a ledger in which the lines of some numbers (from 0) are signed by whoever has these keys.

    Each is given the place, the tree and the people that an honest line would have.
    """
    registry = Registry(home / "calibrations")
    version = registry.people().history.now
    assert version is not None
    text, prev, tree = b"", START, Growing()
    for number, body in enumerate(lines):
        event = {key: value for key, value in body.items() if key not in ("seq", "prev", "sha256")}
        if number in keys:
            event.pop("signatures", None)
            subject = event.get("subject", {}).get("sha256")
            event |= statement(event, subject, tree.root(), version)
            message = canonical(unsigned({"seq": number + 1, "prev": prev, **event})).encode()
            event["signatures"] = [signature_row(_owner(signer), signer, message) for signer in keys[number]]
        line, prev = next_line(number + 1, prev, event)
        tree.add(leaf_hash(line.rstrip(b"\n")))
        text += line
    folder = home / "calibrations" / RIG
    (folder / "ledger.jsonl").write_bytes(text)
    (folder / "head.json").write_bytes(head_bytes(len(lines), prev))


def _owner(signer: Signer) -> str:
    person = people().owner(signer.public)
    return "dora" if person is None else person.id


def believed(home: Path) -> bool:
    """Tell whether a reader of the home takes its ledger for the laboratory's."""
    try:
        return Registry(home / "calibrations").ledger(RIG).damage is None
    except ToolkitError:
        return False
