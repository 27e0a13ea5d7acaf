"""A decision that travels to the keys of those who make it, as a file; each signature makes it an answer.

    {"schema": 1, "message": "{...}", "people": "...", "file": "...", "operators": ["carl"], "signatures": []}

``message`` is what is signed: the line of the ledger without its signatures, as canonical JSON. ``people`` is
the text of the people's file whose hash stands in it, ``file`` that of the record or the people's file which
the decision brings. Nothing else in the file is believed: where the line is entered, the ledger's own people
and operators count.
"""

from __future__ import annotations

import json
import unicodedata
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from toolkit.errors import ConfigError, ToolkitError, TrustError
from toolkit.files import parse_json, sha256_bytes
from toolkit.inputs import REQUEST_FILE, read_input
from toolkit.printable import unprintable
from toolkit.trust.decisions import ACTIONS, action_of, signature_row, signer_of, stated, statement, unsigned
from toolkit.trust.keys import Signer
from toolkit.trust.people import ROOT_HEADS, Action, Person, Version, inability, moment, version_of
from toolkit.trust.ssh import BadSignatureError, PublicKey

HOLDS = timedelta(days=7)
"""How long a request waits: the ledger has the time at which it was made, and not that of its entry."""

_AGAIN = "make a new request: the same command with --request FILE; nothing was changed"
_WORDS = {
    "action": "decision", "subject, record": "record", "subject, sha256": "SHA-256 of it",
    "by": "named", "approved_by": "named as approver", "known_on": "known, or decided, on",
    "since": "in force or void from", "seq": "number of the entry", "prev": "SHA-256 of the entry before",
    "extends": "root of the tree before it", "people": "SHA-256 of the people's file",
    "file": "SHA-256 of the file", "record": "SHA-256 of the record", "inputs": "SHA-256 of its inputs",
    "recall": "recall interval", "clock": "clock of that computer",
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """A decision to be signed, with the signatures until now. ``path``: the file that it was read from."""

    message: str
    people: str
    file: str | None = None
    operators: tuple[str, ...] = ()
    signatures: tuple[Mapping[str, str], ...] = ()
    path: Path | None = field(default=None, compare=False)

    @property
    def body(self) -> dict[str, Any]:
        """What is signed, as JSON values."""
        body: dict[str, Any] = json.loads(self.message)
        return body

    @property
    def action(self) -> Action:
        """What is decided."""
        return action_of(self.body)

    @property
    def time(self) -> str:
        """When the request was made."""
        return str(self.body["time"])

    @property
    def version(self) -> Version:
        """The people of the laboratory, as the request states them."""
        return version_of(self.people.encode(), self.time)

    @property
    def takes(self) -> str:
        """How many must sign it, and who."""
        demand = self.version.people.policy.demand(self.action)
        founding = self.action == "enrol" and self.body["seq"] == 1
        count = max(demand.signatures, ROOT_HEADS) if founding else demand.signatures
        return f"{count} of {' or '.join(demand.roles)}"

    @property
    def text(self) -> str:
        """The content of the request's file."""
        parts = {
            "schema": 1, "message": self.message, "people": self.people, "file": self.file,
            "operators": list(self.operators), "signatures": [dict(row) for row in self.signatures],
        }  # fmt: skip
        return json.dumps(parts, ensure_ascii=False, indent=1) + "\n"

    def keys(self, version: Version) -> tuple[PublicKey, ...]:
        """Return the keys of the signatures until now, whose owners are of a version of the people.

        Raises
        ------
        TrustError
            ``request``: a signature proves nothing
        """
        try:
            return tuple(signer_of(row, self.message.encode(), version) for row in self.signatures)
        except BadSignatureError as error:
            raise bad_request(
                "a signature is not valid", self.path, error, "a signature of this request",
                "let its owner sign the request again: toolkit sign REQUEST; nothing was changed",
            ) from error  # fmt: skip

    def signed(self, signer: Signer) -> tuple[Request, Person]:
        """Return the answer with one more signature, and whose it is.

        Raises
        ------
        TrustError
            ``not-allowed``: not this person, by the people that the request states; ``request``
        """
        version = self.version
        reason = inability(version, self.action, self.time, signer.public, self.operators)
        person = version.people.owner(signer.public)
        before = self.keys(version)
        named, demand = stated(self.body, self.action), version.people.policy.demand(self.action)
        alone = demand.signatures == 1 and not (self.action == "enrol" and self.body["seq"] == 1)
        if person is not None and named and alone and not any(map(person.is_named, named)):
            reason = (
                reason or f"it names {' and '.join(map(shown, named))}, and {person.id} is another person"
            )
        if person is not None and person in map(version.people.owner, before):
            reason = f"{person.id} has signed it already"
        if reason is not None or person is None:
            raise TrustError(
                f"this key cannot {self.action}", where=self.path, got=reason,
                expected="the key of somebody whom the laboratory's policy names, once for each person",
                next_step="let another person sign; nothing was signed", rule="not-allowed",
            )  # fmt: skip
        row = signature_row(person.id, signer, self.message.encode())
        return replace(self, signatures=(*self.signatures, row)), person


def read_request(path: Path) -> Request:
    """Read a request or an answer.

    Raises
    ------
    TrustError
        ``request``: it is none, or its parts do not belong together
    """
    return parse_request(read_input(path, REQUEST_FILE), path)


def parse_request(data: bytes, path: Path) -> Request:
    """Return a request from the content of its file; ``path`` says in messages where that is.

    Raises
    ------
    TrustError
        ``request``
    """
    try:
        entries = parse_json(data)
        parts = {key: entries[key] for key in ("message", "people", "file", "operators", "signatures")}
        body = parse_json(parts["message"])
        request = Request(
            **{**parts, "operators": tuple(parts["operators"]), "signatures": tuple(parts["signatures"])},
            path=path,
        )
        fault = None if entries["schema"] == 1 else f"schema {entries['schema']}"
        fault = fault or _fault(request, body)
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError, ConfigError) as error:
        raise _no_request(path, f"{type(error).__name__}: {error}") from error
    if fault is not None:
        raise _no_request(path, fault)
    return request


def words(request: Request) -> list[tuple[str, str]]:
    """Return everything that is signed, a name and a text each, as a terminal can show it.

    Nothing is left out: what a reader of the toolkit does not know is shown by its own name.
    """
    body, version = request.body, request.version
    names = {row["by"]: version.people.of(row["by"]) for row in request.signatures}
    rows = [(_WORDS.get(key, key.replace("_", " ")), shown(value)) for key, value in _leaves(body)]
    order = ("decision", "record", "meaning", "reason")
    rows.sort(key=lambda row: order.index(row[0]) if row[0] in order else len(order))
    signers = ", ".join(f"{key} ({person.name})" for key, person in names.items() if person is not None)
    rows += [("signatures it takes", request.takes), ("signed until now by", shown(signers or "nobody"))]
    if request.file is not None and request.action == "enrol":
        rows.append(("text of the file", "\n" + "\n".join(map(shown, request.file.splitlines()))))
    return rows


def shown(value: object) -> str:
    """Return a value as one line that shows every character: none moves the cursor or turns the text.

    >>> shown("a" + chr(0x202E) + "b" + chr(27) + "[2J")
    'a\\\\u202eb\\\\u001b[2J'
    """
    text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
    return "".join(
        c if unicodedata.category(c)[0] != "C" and c not in "\u2028\u2029" else f"\\u{ord(c):04x}"
        for c in text
    )


def check_standing(request: Request, *, seq: int, prev: str, since: str = "") -> None:
    """Refuse an answer that no longer extends the ledger, is of other people, or has waited too long.

    ``since`` is the time of the newest version of the people.

    Raises
    ------
    TrustError
        ``request``
    """
    body = request.body
    if (body["seq"], body["prev"]) != (seq, prev):
        entries = seq - int(body["seq"])
        what = f"{entries} entr{'y' if entries == 1 else 'ies'} later" if entries > 0 else "another one"
        raise bad_request(
            "the ledger is no longer the one that was signed for", request.path,
            f"{what}: its next entry is {seq} after {prev[:12]}",
            f"entry {body['seq']} after {str(body['prev'])[:12]}", _AGAIN,
        )  # fmt: skip
    if request.time < since:
        raise bad_request(
            "the people of the laboratory changed since the request was made", request.path,
            f"made at {request.time}", f"a time from {since} on", _AGAIN,
        )  # fmt: skip
    at, present = moment(request.time), datetime.now(tz=UTC)
    if at is None or not -timedelta(minutes=5) <= present - at <= HOLDS:
        raise bad_request(
            "a signing request has waited too long, or is of the future", request.path,
            f"made at {request.time}, now {present:%Y-%m-%dT%H:%M:%SZ}", f"{HOLDS.days} days at most",
            _AGAIN,
        )  # fmt: skip


def check_same(answer: Request, request: Request) -> None:
    """Refuse an answer to another request than the one that the command would make.

    Raises
    ------
    TrustError
        ``request``
    """
    got, expected = request.body, answer.body
    differing = {key: (got.get(key), expected.get(key)) for key in sorted({*got, *expected})}
    for name in ("people", "file", "operators"):
        differing[f"{name} of the request"] = getattr(request, name), getattr(answer, name)
    differing = {name: pair for name, pair in differing.items() if pair[0] != pair[1]}
    if differing:
        raise bad_request(
            "the command decides something else than what was signed", answer.path,
            "; ".join(f"{name}: {shown(pair[0])[:200]}" for name, pair in differing.items()),
            "; ".join(f"{name}: {shown(pair[1])[:200]}" for name, pair in differing.items()),
            "give the command the options with which the request was made, or make a new request; "
            "nothing was changed",
        )  # fmt: skip


def bad_request(what: str, where: object, got: object, expected: object, next_step: str) -> TrustError:
    """Return the error of a request that cannot be used."""
    return TrustError(what, where=where, got=got, expected=expected, next_step=next_step, rule="request")


def _fault(request: Request, body: Mapping[str, Any]) -> str | None:
    """Say which part of a request does not belong to it; None where all do."""
    if unsigned(body) != body or body["event"] not in ACTIONS or type(body["seq"]) is not int:
        return "a message that is no line of a ledger before its signatures"
    if not all(isinstance(body[name], str) for name in ("prev", "id", "time", "by", "extends")):
        return "a message without what every line has"
    texts = (request.message, request.people, *request.operators, *((request.file,) if request.file else ()))
    if not all(isinstance(text, str) for text in texts):
        return "a part that is no text"
    if bad := next((name for name, text in _leaves(body) if isinstance(text, str) and unprintable(text)), ""):
        return f"{bad}: a text with a character that no document can print"
    if _canonical(body) != request.message:
        return "a message that is not canonical JSON"
    subject = body["subject"]
    if {*subject} != {"record", "sha256"} or moment(str(body["time"])) is None:
        return "a message without subject or time"
    derived = statement(body, subject["sha256"], bytes.fromhex(body["extends"]), request.version)
    for name in derived:
        if body.get(name) != derived[name]:
            return f"{name} {shown(body.get(name))}, and its own parts say {shown(derived[name])}"
    if request.file is not None and sha256_bytes(request.file.encode()) != body.get("file"):
        return "a file that is not the one of the decision"
    return None


def _canonical(body: Mapping[str, Any]) -> str:
    return json.dumps(body, ensure_ascii=False, sort_keys=True, separators=(",", ":"), allow_nan=False)


def _leaves(value: object, name: str = "") -> Iterator[tuple[str, object]]:
    if isinstance(value, Mapping):
        for key, below in value.items():
            yield from _leaves(below, f"{name}, {key}" if name else str(key))
    elif isinstance(value, Collection) and not isinstance(value, str) and value:
        for number, below in enumerate(value, start=1):
            yield from _leaves(below, f"{name} {number}")
    else:
        yield name, value


def _no_request(path: Path, got: object) -> ToolkitError:
    return bad_request(
        "the file is no signing request", path, got, "a file that --request wrote, or toolkit sign",
        "take the file as it was written; nothing was signed",
    )  # fmt: skip
