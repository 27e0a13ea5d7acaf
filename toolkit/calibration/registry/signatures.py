"""A ledger's lines as decisions of people: signed where people are enrolled, and judged when read."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from toolkit.calibration.records.record import canonical
from toolkit.calibration.records.use import UNSIGNED
from toolkit.calibration.registry.clock import check_after, clock_state, day_of
from toolkit.calibration.registry.ledger import BRINGING, START, Entry, Ledger
from toolkit.errors import TrustError
from toolkit.inputs import read_regular
from toolkit.publication import publication
from toolkit.trust.decisions import SignedLine, action_of, signature_row, statement, unsigned, violations
from toolkit.trust.merkle import Growing, leaf_hash
from toolkit.trust.people import Action, History
from toolkit.trust.requested import Requested
from toolkit.trust.requests import Request, check_same, check_standing
from toolkit.trust.signing import HERE, Signing

Place = tuple[int, str]
"""How many lines a ledger had, and the hash of the last."""


def timed_event(event: Mapping[str, Any], ledger: Ledger, signing: Signing | None) -> dict[str, Any]:
    """Return an event with the state of the clock; what was requested has time and clock of its request.

    Raises
    ------
    TrustError
        ``request``: an answer no longer extends this ledger, or has waited too long
    """
    answers = () if signing is None else signing.travel.answers
    version = None if signing is None else signing.history.now
    for answer in answers:
        since = "" if version is None else version.since
        check_standing(answer, seq=len(ledger.entries) + 1, prev=ledger.head, since=since)
    if not answers:
        return {**event, "clock": clock_state()}
    return {**event, **{key: answers[0].body.get(key) for key in ("time", "clock")}}


def signed_event(
    event: Mapping[str, Any],
    ledger: Ledger,
    signing: Signing,
    *,
    action: Action | None = None,
    file: str | None = None,
) -> dict[str, Any]:
    """Return the next event of a ledger with its signatures; as it is where nobody is enrolled.

    ``action`` says of an entry that it is an import; ``file`` is the text of what it brings.

    Raises
    ------
    TrustError
        ``not-signed``, ``not-allowed``; ``request``: an answer is of another decision or another ledger
    RegistryError
        ``time``: it lies before the newest version of the people
    Requested
        the decision was written to a file to be signed elsewhere
    """
    if signing.history.now is None:
        if signing.signers or signing.travel != HERE:
            raise nobody(event["id"])
        return dict(event)
    event = {**event, **({"action": action} if action else {})}
    signing.demand_key(action_of(event), event["id"])
    version, time = signing.history.now, event["time"]
    check_after(version.since, time, "the log of people")
    root = Growing(map(leaf_hash, ledger.lines)).root()
    stated = {**event, **statement(event, _subject(ledger, event), root, version)}
    message = canonical({"seq": len(ledger.entries) + 1, "prev": ledger.head, **stated})
    operators = operators_of(ledger, signing.history, event["id"])
    path = signing.travel.request
    request = Request(message=message, people=version.text, file=file, operators=operators, path=path)
    if path is not None:
        _write(request, path, signing.travel.files)
        raise Requested(request)
    rows: list[Mapping[str, str]] = []
    publics = [signer.public for signer in signing.signers]
    for answer in signing.travel.answers:
        check_same(answer, request)
        publics += answer.keys(version)
        rows += [row for row in answer.signatures if row not in rows]
    signing.check(event, action_of(event), publics, operators)
    for signer in signing.signers:
        owner = version.people.owner(signer.public)
        rows += [signature_row("" if owner is None else owner.id, signer, message.encode())]
    return {**stated, "signatures": rows}


def _write(request: Request, path: Path, files: Sequence[Path]) -> None:
    """Write a request and what it has hashes of, together: nobody should sign what cannot be read."""
    with publication(path.parent) as stage:
        (stage / path.name).write_text(request.text, encoding="utf-8")
        for file in files:
            documents = stage / f"{path.stem}.documents"
            documents.mkdir(exist_ok=True)
            (documents / file.name).write_bytes(read_regular(file))


def unproved(
    ledger: Ledger, history: History, places: Sequence[Place | None] = (), *, of_people: bool = False
) -> str | None:
    """Say which line is no decision of the laboratory's people; None where every line is.

    ``places``: of each version of the people, count and last hash of the lines that were there before it; the
    lines before the first one need no signature. ``of_people``: it is the log of people itself, in which each
    line is judged by the version before it.
    """
    if history.now is None:
        for entry in ledger.entries:
            # What only a signed line says stays where its signatures were taken off.
            if entry.signatures or entry.people or entry.extends:
                states = "is signed" if entry.signatures else "names the people of its time and is not signed"
                return f"line {entry.seq} {states}, and the log of people is missing"
        return None
    for number, place in enumerate(places, start=1):
        if place is not None and _end(ledger, place[0]) != place[1]:
            version = "" if number == 1 else f" for version {number}"
            lines = f"its first {place[0]} lines"
            return f"{lines} are not those that were there when people were enrolled{version}"
    unsigned_lines = places[0][0] if places and places[0] is not None else 0
    tree = Growing()
    for entry, text in zip(ledger.entries, ledger.lines, strict=True):
        if entry.seq > unsigned_lines:
            body = json.loads(text)
            line = SignedLine(
                seq=entry.seq,
                body=body,
                message=canonical(unsigned(body)).encode(),
                subject=_subject(ledger, body),
                operators=operators_of(ledger, history, entry.id),
                root=tree.root(),
            )
            judges = history.before(entry.seq) if of_people else _enrolled_at(history, places, entry.seq)
            reasons = violations(line, judges)
            if reasons:
                return f"line {entry.seq} ({entry.event} {entry.id}): {'; '.join(reasons)}"
        tree.add(leaf_hash(text))
    return None


def _end(ledger: Ledger, count: int) -> str | None:
    """Return the hash of a line, zeros for none; None where there are fewer."""
    if count > len(ledger.entries):
        return None
    return ledger.entries[count - 1].sha256 if count else START


def _enrolled_at(history: History, places: Sequence[Place | None], seq: int) -> History:
    """Return the versions of the people among which a line lies; one, where each version knows its place."""
    known = [(at, place[0]) for at, place in enumerate(places) if place is not None]
    first = max((at for at, count in known if count < seq), default=0)
    later = (at for at, count in known if count >= seq and at > first)
    return History(history.versions[first : min(later, default=None)])


def revoked(ledger: Ledger, history: History) -> frozenset[int]:
    """Return the lines that rest on a key which was revoked later, from a time before the line on.

    They stay in the ledger and decide nothing: a stolen key cannot put a record in force.
    """
    return frozenset(
        entry.seq
        for entry in (ledger.entries if history.now else ())
        if any(history.revoked(row["key"], entry.time) is not None for row in entry.signatures)
    )


def signature_line(ledger: Ledger, history: History, record_id: str) -> str:
    """Return who signed the decisions that a record rests on: the one place that says *unsigned*.

    A record is unsigned where nobody signed that it was entered, or one of its approvals.
    """
    rows = []
    for entry in ledger.of(record_id):
        if entry.event not in ("entered", "approved"):
            continue
        if not entry.signatures or entry.seq in ledger.void:
            return UNSIGNED
        rows.append(f"{entry.event} by {names_of(entry, history)} on {day_of(entry.time).isoformat()}")
    return ", ".join(rows) or UNSIGNED


def names_of(entry: Entry, history: History) -> str:
    """Return the names of the people who signed an entry, as their file of that time has them."""
    version = history.at(entry.time, entry.people)
    people = [None if version is None else version.people.of(person) for person in signers_of(entry)]
    return " and ".join(
        person if enrolled is None else enrolled.name
        for person, enrolled in zip(signers_of(entry), people, strict=True)
    )


def signers_of(entry: Entry) -> tuple[str, ...]:
    """Return the people who signed an entry, by id."""
    return tuple(row["by"] for row in entry.signatures)


def _subject(ledger: Ledger, event: Mapping[str, Any]) -> str | None:
    """Return the hash of what a decision is about: of the record, or of the people's file."""
    if event["event"] in BRINGING:
        stated = event.get("record") or event.get("file")
        return None if stated is None else str(stated)
    entered = ledger.entered().get(event["id"])
    return None if entered is None else entered.record


def operators_of(ledger: Ledger, history: History, record_id: str) -> tuple[str, ...]:
    """Return who entered a record: those who signed its entry, and the operator whom it names.

    By id too, as the people were called then: a person who is renamed approves no reading of before.
    """
    entered = ledger.entered().get(record_id)
    if entered is None:
        return ()
    version = history.at(entered.time, entered.people)
    people = () if version is None else version.people.person
    ids = (person.id for person in people if person.is_named(entered.by))
    return tuple(dict.fromkeys((*signers_of(entered), entered.by, *ids)))


def nobody(where: object) -> TrustError:
    """Return the refusal of a signature where it would prove nothing."""
    return TrustError(
        "nobody is enrolled who could sign", where=where, got="a laboratory without people",
        expected="people whose keys sign: toolkit person enrol",
        next_step="decide without --sign, --request and --answer, or enrol people first; nothing was changed",
        rule="request",
    )  # fmt: skip
