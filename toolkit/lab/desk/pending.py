"""Decisions that wait in the home for their signatures: made, signed, entered, dropped.

``HOME/requests/<id>.json`` is the file that ``--request`` writes, of a record by its id, of a session by
that of its draft; each signature that comes is added to it. With the last one the decision is entered and the
file goes. Nothing in it is believed: where it is entered, the ledger's own people, operators and gates count.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from toolkit.calibration.registry.registry import Registry, instrument_of
from toolkit.calibration.registry.signatures import operators_of
from toolkit.errors import ConfigError, OutputError, ToolkitError, TrustError
from toolkit.inputs import REQUEST_FILE, check_size, is_regular
from toolkit.lab.desk.drafts import keep_session, session_file
from toolkit.lab.records.decisions import Order, carry_out, order_of
from toolkit.publication import write_result
from toolkit.trust.decisions import stated
from toolkit.trust.keys import agent_keys, agent_signer
from toolkit.trust.people import Action, Version, inability, objections
from toolkit.trust.requests import Request, check_same, check_standing, parse_request, read_request
from toolkit.trust.signing import Travel
from toolkit.trust.ssh import PublicKey

FOLDER = "requests"
_ID = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*\Z")


@dataclass(frozen=True, slots=True, kw_only=True)
class Pending:
    """A decision that waits.

    ``lacks`` says which signatures; ``obstacle`` why it can be entered no more, None where it can.
    """

    id: str
    request: Request
    lacks: tuple[str, ...]
    obstacle: str | None = None

    @property
    def signers(self) -> tuple[str, ...]:
        """Who signed until now, by id."""
        return tuple(row["by"] for row in self.request.signatures)


def decide(home: Path, registry: Registry, name: str, order: Order) -> Any:
    """Make a decision; where people are enrolled write its request, under a name, unless a gate blocks it.

    Raises
    ------
    TrustError
        ``request``: one of the same name waits; ``not-allowed``: somebody whom it names cannot sign it
    ToolkitError
        as the decision; nothing is written
    Requested
        it was written
    """
    path = _path(home, name)
    if path.exists():
        raise TrustError(
            "a decision about it waits for its signatures already", where=name, got="another decision",
            expected="one decision at a time",
            next_step="sign that one, or drop it first; nothing was changed", rule="request",
        )  # fmt: skip
    version = registry.people().history.now
    if version is None:
        return carry_out(registry, order)
    _check_stated(registry, order, version)
    return carry_out(registry.travelling(Travel(request=path)), order)


def pending_request(home: Path, registry: Registry, name: str) -> Pending | None:
    """Return what waits under a name; None where nothing does.

    Raises
    ------
    TrustError
        ``request``: the file is none
    """
    path = _path(home, name)
    return _pending(registry, name, read_request(path)) if is_regular(path) else None


def pending_requests(home: Path, registry: Registry) -> tuple[dict[str, Any], ...]:
    """Return every decision that waits, a row each; a file that is no request says so."""
    rows: list[dict[str, Any]] = []
    for path in sorted((home / FOLDER).glob("*.json")):
        try:
            pending = pending_request(home, registry, path.stem)
        except ToolkitError as error:
            rows.append({"id": path.stem, "action": None, "obstacle": str(error.got)})
            continue
        if pending is not None:
            rows.append({
                "id": pending.id, "action": pending.request.action, "record": pending.request.body["id"],
                "takes": pending.request.takes, "signed": list(pending.signers), "time": pending.request.time,
                "lacks": list(pending.lacks), "obstacle": pending.obstacle,
            })  # fmt: skip
    return tuple(rows)


def able_people(registry: Registry, action: Action, operators: tuple[str, ...]) -> dict[str, str | None]:
    """Return everybody who is enrolled, by id, and why each cannot sign a decision now; None: able."""
    version = registry.people().history.now
    if version is None:
        return {}
    time = registry.now()
    return {
        person.id: next(
            (None for key in person.keys if inability(version, action, time, key.public, operators) is None),
            inability(version, action, time, person.keys[-1].public, operators),
        )
        for person in version.people.person
    }


def add_answer(home: Path, registry: Registry, name: str, data: bytes, title: str) -> bool:
    """Add the signatures of an answer's file to what waits; tell whether the decision was entered by it.

    Raises
    ------
    TrustError
        ``request``: no answer to this request, or forged; ``not-allowed``: somebody who may not sign it
    ToolkitError
        as the decision; nothing was changed
    """
    pending = _waiting(home, registry, name)
    check_size(data, REQUEST_FILE, title)
    answer = parse_request(data, Path(title))
    check_same(answer, pending.request)
    return _signed(home, registry, pending, answer)


def agent_people(registry: Registry, pending: Pending) -> tuple[str, ...]:
    """Return who can sign what waits by a key that the SSH agent of this process holds, by id."""
    return tuple(_agent_keys(registry, pending))


def sign_by_agent(home: Path, registry: Registry, name: str, person: str) -> bool:
    """Let the SSH agent sign what waits by a person's key, as `add_answer` does.

    The key stays with the agent.

    Raises
    ------
    TrustError
        ``not-allowed``: not this person; ``signing-key``: no key of this person, or the agent refuses
    """
    pending = _waiting(home, registry, name)
    reason = able_people(registry, pending.request.action, pending.request.operators).get(
        person, "nobody of this name is enrolled"
    )
    if reason is not None:
        raise _not_allowed(pending.request.action, person, reason)
    public = _agent_keys(registry, pending).get(person)
    if public is None:
        raise TrustError(
            "the agent signs nothing for this person", where=person,
            got="signed already" if person in pending.signers else "no key of this person in the agent",
            expected="a key of a person who has not signed yet",
            next_step="add the key, ssh-add FILE, or sign the file: toolkit sign; nothing was signed",
            rule="signing-key",
        )  # fmt: skip
    answer, _ = pending.request.signed(agent_signer(public))
    return _signed(home, registry, pending, answer)


def drop_request(home: Path, name: str) -> None:
    """Drop what waits: the decision is not made, and its signatures serve nothing.

    Raises
    ------
    OutputError
        the file cannot be removed
    """
    path = _path(home, name)
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(
            "a request cannot be dropped", where=path, got=error.strerror,
            expected="a folder with write permission",
            next_step="give that permission; nothing was changed", rule="not-writable",
        ) from error  # fmt: skip


def _signed(home: Path, registry: Registry, pending: Pending, answer: Request) -> bool:
    version, time = _version(registry, pending.request), pending.request.time
    rows = list(pending.request.signatures)
    for public, row in zip(answer.keys(version), answer.signatures, strict=True):
        reason = inability(version, answer.action, time, public, answer.operators)
        if reason is not None:
            raise _not_allowed(answer.action, pending.id, reason)
        if row["by"] not in {other["by"] for other in rows}:
            rows.append(row)
    if len(rows) == len(pending.request.signatures):
        raise _not_allowed(answer.action, pending.id, "nobody signed it who had not signed it before")
    merged = _pending(registry, pending.id, replace(pending.request, signatures=tuple(rows)))
    if merged.lacks:
        write_result(_path(home, pending.id), merged.request.text)
        return False
    order = order_of(merged.request.body, session_file(home, pending.id))
    outcome = carry_out(registry.travelling(Travel(answers=(merged.request,))), order)
    if findings := getattr(outcome, "findings", ()) if order.action == "approve" else ():
        raise TrustError(
            "a gate stands against what was signed", where=pending.id,
            got="; ".join(f"{finding.rule}: {finding.message}" for finding in findings),
            expected="a record that passes its gates", rule="request",
            next_step="settle what the gates say, or drop the request; nothing was changed",
        )  # fmt: skip
    drop_request(home, pending.id)
    if order.action == "enter":
        keep_session(home, pending.id, order.record)
    return True


def _pending(registry: Registry, name: str, request: Request) -> Pending:
    version, body = _version(registry, request), request.body
    publics = request.keys(version)
    lacks = objections(
        version, request.action, request.time, publics, stated=stated(body, request.action),
        operators=request.operators,
    )  # fmt: skip
    ledger = registry.ledger(instrument_of(body["id"]))
    now = registry.people().history.now
    try:
        check_standing(
            request, seq=len(ledger.entries) + 1, prev=ledger.head, since="" if now is None else now.since
        )
    except TrustError as error:
        return Pending(id=name, request=request, lacks=tuple(lacks), obstacle=f"{error.what}: {error.got}")
    return Pending(id=name, request=request, lacks=tuple(lacks))


def _waiting(home: Path, registry: Registry, name: str) -> Pending:
    pending = pending_request(home, registry, name)
    if pending is None:
        raise TrustError(
            "nothing waits for a signature", where=name, got="no request of this name",
            expected="a decision that was requested", next_step="request it first; nothing was changed",
            rule="request",
        )  # fmt: skip
    if pending.obstacle is not None:
        raise TrustError(
            "what was requested can be entered no more", where=name, got=pending.obstacle,
            expected="the ledger and the people of the request",
            next_step="drop the request and make a new one; nothing was changed", rule="request",
        )  # fmt: skip
    return pending


def _agent_keys(registry: Registry, pending: Pending) -> dict[str, PublicKey]:
    version, request = _version(registry, pending.request), pending.request
    try:
        publics = agent_keys()
    except TrustError:  # no agent: nobody signs by it
        return {}
    keys: dict[str, PublicKey] = {}
    for public in publics:
        owner = version.people.owner(public)
        if owner is None or owner.id in pending.signers:
            continue
        if inability(version, request.action, request.time, public, request.operators) is None:
            keys.setdefault(owner.id, public)
    return keys


def _version(registry: Registry, request: Request) -> Version:
    """Return the people of the home at the time of a request: its own word for them is not believed."""
    version = registry.people().history.at(request.time)
    return request.version if version is None else version


def _check_stated(registry: Registry, order: Order, version: Version) -> None:
    """Refuse a decision that names somebody who cannot sign it."""
    if order.action == "enter":
        return
    ledger = registry.ledger(instrument_of(order.record))
    able = able_people(registry, order.action, operators_of(ledger, registry.people().history, order.record))
    for name in (order.by, order.approved_by):
        person = next((p for p in version.people.person if name and p.is_named(name)), None)
        if not name:
            continue
        reason = "nobody of this name is enrolled" if person is None else able[person.id]
        if reason is not None:
            raise _not_allowed(order.action, name, reason)


def _path(home: Path, name: str) -> Path:
    if not _ID.match(name):
        raise ConfigError(
            "no name of a request", where=name, got=name, expected="the id of a record or a draft",
            next_step="see what waits on the first page", rule="request",
        )  # fmt: skip
    return home / FOLDER / f"{name}.json"


def _not_allowed(action: str, where: str, reason: str) -> TrustError:
    return TrustError(
        f"this person cannot {action} it", where=where, got=reason,
        expected="somebody whom the laboratory's policy names, once for each person",
        next_step="let another person sign; nothing was changed", rule="not-allowed",
    )  # fmt: skip
