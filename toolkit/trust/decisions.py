"""Signed decisions: what a ledger's line says of who decided, and whether that holds.

Beside what it says, a signed line has ``action``, ``subject``, ``meaning``, ``extends`` (the root of the tree
over the lines before it), ``people`` (the hash of the people's file of that time) and ``signatures``. What is
signed is the line without ``signatures`` and ``sha256``, as canonical JSON (RFC 8785), in the namespace
``toolkit-ledger@v1``: ``ssh-keygen -Y verify`` proves it without the toolkit.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from toolkit.trust.keys import Signer
from toolkit.trust.people import MEANINGS, NAMESPACE, STATED, Action, History, Version, moment, objections
from toolkit.trust.ssh import BadSignatureError, PublicKey, check

ACTIONS: Mapping[str, Action] = {
    "entered": "enter", "approved": "approve", "withdrawn": "withdraw", "discarded": "discard",
    "issued": "issue", "enrolled": "enrol",
}  # fmt: skip
_UNSIGNED = ("signatures", "sha256")
SIGNATURE = {"by", "key", "namespace", "sig"}
"""What a signature of a line says."""


def stated(event: Mapping[str, Any], action: Action) -> list[str]:
    """Return the people whom a decision names as those who make it."""
    return [str(event[key]) for key in STATED.get(action, ()) if event.get(key)]


def action_of(event: Mapping[str, Any]) -> Action:
    """Return what an event does; an import says so itself, for it is entered as a session's record is."""
    action = ACTIONS[event["event"]]
    return "import" if action == "enter" and event.get("action") == "import" else action


def statement(
    event: Mapping[str, Any], subject: str | None, root: bytes, version: Version | None
) -> dict[str, Any]:
    """Return what a signed line says beside its event.

    ``subject`` is the hash of the record that the decision is about, ``root`` that of the tree over the lines
    before.
    """
    action = action_of(event)
    return {
        "action": action,
        "subject": {"record": event["id"], "sha256": subject},
        "meaning": MEANINGS[action],
        "extends": root.hex(),
        "people": None if version is None else version.sha256,
    }


def signature_row(person: str, signer: Signer, message: bytes) -> dict[str, str]:
    """Return a person's signature of a line's content, as the line has it."""
    return {
        "by": person,
        "key": signer.public.fingerprint,
        "namespace": NAMESPACE,
        "sig": signer.armour(message, NAMESPACE),
    }


def unsigned(body: Mapping[str, Any]) -> dict[str, Any]:
    """Return what of a line is signed."""
    return {key: value for key, value in body.items() if key not in _UNSIGNED}


@dataclass(frozen=True, slots=True, kw_only=True)
class SignedLine:
    """A line of a ledger, for its judgement.

    ``message`` is what is signed; ``body`` its entries; ``subject`` the hash of the record that its id had
    when it was entered; ``operators`` the people who entered that, by id or name.
    """

    seq: int
    body: Mapping[str, Any]
    message: bytes
    subject: str | None
    operators: tuple[str, ...]
    root: bytes


def violations(line: SignedLine, history: History) -> list[str]:
    """Say why a line is no decision of the laboratory's people; empty where it is."""
    body, time = line.body, str(line.body["time"])
    action = action_of(body)
    rows = body.get("signatures")
    if not isinstance(rows, list) or not rows:
        return ["it is not signed"]
    if moment(time) is None:
        return ["its time is not UTC to the second: in another spelling it would not compare"]
    version = history.at(time, body.get("people"))
    derived = statement(body, line.subject, line.root, version)
    reasons = [
        f"its {name!r} is not what it should be" for name in derived if body.get(name) != derived[name]
    ]
    publics: list[PublicKey] = []
    for row in rows:
        try:
            publics.append(signer_of(row, line.message, version))
        except BadSignatureError as error:
            reasons.append(f"a signature is not valid: {error}")
    return reasons or objections(
        version, action, time, publics, stated=stated(body, action), operators=line.operators
    )


def signer_of(row: object, message: bytes, version: Version | None) -> PublicKey:
    """Return the key of one signature.

    Raises
    ------
    BadSignatureError
        it does not hold, or names another key or person than it was made by
    """
    if not isinstance(row, Mapping) or {*row} != SIGNATURE or row["namespace"] != NAMESPACE:
        raise BadSignatureError("it is for another purpose, or says more than who signed")
    public = check(str(row.get("sig")), message, NAMESPACE)
    person = None if version is None else version.people.owner(public)
    if row.get("key") != public.fingerprint or person is None or row.get("by") != person.id:
        raise BadSignatureError("its key is not that of the person whom it names")
    return public
