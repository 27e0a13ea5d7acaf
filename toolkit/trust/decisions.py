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

from toolkit.errors import TrustError
from toolkit.trust.keys import Signer
from toolkit.trust.people import MEANINGS, NAMESPACE, Action, History, Version, objections
from toolkit.trust.ssh import BadSignatureError, PublicKey, check

ACTIONS: Mapping[str, Action] = {
    "entered": "enter", "approved": "approve", "withdrawn": "withdraw", "discarded": "discard",
    "issued": "issue", "enrolled": "enrol",
}  # fmt: skip
_UNSIGNED = ("signatures", "sha256")


@dataclass(frozen=True, slots=True, kw_only=True)
class Signing:
    """Who signs now: the people of the laboratory, and the keys that are at hand."""

    history: History
    signers: tuple[Signer, ...] = ()

    def check(self, action: Action, time: str, *, operator: str | None = None, where: object = None) -> None:
        """Refuse a decision that the keys at hand do not make; nothing is signed yet.

        Raises
        ------
        TrustError
            ``not-signed``: no key; ``not-allowed``: it takes other people, or more
        """
        if self.history.now is None:
            return
        if not self.signers:
            demand = self.history.now.people.policy.demand(action)
            raise TrustError(
                f"to {action} takes a signature", where=where, got="no key",
                expected=f"{demand.signatures} by {' or '.join(demand.roles)}",
                next_step="sign with --sign KEY; nothing was changed", rule="not-signed",
            )  # fmt: skip
        publics = [signer.public for signer in self.signers]
        reasons = objections(self.history.at(time), action, time, publics, operator=operator)
        if reasons:
            raise TrustError(
                f"these keys cannot {action}", where=where, got="; ".join(reasons),
                expected=f"what {action} takes by the laboratory's policy",
                next_step="see 'toolkit person list'; nothing was changed", rule="not-allowed",
            )  # fmt: skip


def statement(
    event: Mapping[str, Any], subject: str | None, root: bytes, version: Version | None
) -> dict[str, Any]:
    """Return what a signed line says beside its event.

    ``subject`` is the hash of the record that the decision is about, ``root`` that of the tree over the lines
    before.
    """
    action = ACTIONS[event["event"]]
    return {
        "action": action,
        "subject": {"record": event["id"], "sha256": subject},
        "meaning": MEANINGS[action],
        "extends": root.hex(),
        "people": None if version is None else version.sha256,
    }


def signatures_of(signing: Signing, message: bytes) -> list[dict[str, str]]:
    """Return the signatures of a line's content by every key at hand, as the line has them."""
    rows = []
    for signer in signing.signers:
        person = None if signing.history.now is None else signing.history.now.people.owner(signer.public)
        rows.append({
            "by": "" if person is None else person.id,
            "key": signer.public.fingerprint,
            "namespace": NAMESPACE,
            "sig": signer.armour(message, NAMESPACE),
        })  # fmt: skip
    return rows


def unsigned(body: Mapping[str, Any]) -> dict[str, Any]:
    """Return what of a line is signed."""
    return {key: value for key, value in body.items() if key not in _UNSIGNED}


@dataclass(frozen=True, slots=True, kw_only=True)
class SignedLine:
    """A line of a ledger, for its judgement.

    ``message`` is what is signed; ``body`` its entries; ``subject`` the hash of the record that its id had
    when it was entered; ``operator`` the person who entered that.
    """

    seq: int
    body: Mapping[str, Any]
    message: bytes
    subject: str | None
    operator: str | None
    root: bytes


def violations(line: SignedLine, history: History) -> list[str]:
    """Say why a line is no decision of the laboratory's people; empty where it is."""
    body, time = line.body, str(line.body["time"])
    action = ACTIONS[body["event"]]
    rows = body.get("signatures")
    if not isinstance(rows, list) or not rows:
        return ["it is not signed"]
    version = history.at(time, body.get("people"))
    stated = statement(body, line.subject, line.root, version)
    reasons = [f"its {name!r} is not what it should be" for name in stated if body.get(name) != stated[name]]
    publics: list[PublicKey] = []
    for row in rows:
        try:
            publics.append(_signer_of(row, line.message, version))
        except BadSignatureError as error:
            reasons.append(f"a signature proves nothing: {error}")
    return reasons or objections(version, action, time, publics, operator=line.operator)


def _signer_of(row: object, message: bytes, version: Version | None) -> PublicKey:
    """Return the key of one signature.

    Raises
    ------
    BadSignatureError
        it does not hold, or names another key or person than it was made by
    """
    if not isinstance(row, Mapping) or row.get("namespace") != NAMESPACE:
        raise BadSignatureError("it is for another purpose")
    public = check(str(row.get("sig")), message, NAMESPACE)
    person = None if version is None else version.people.owner(public)
    if row.get("key") != public.fingerprint or person is None or row.get("by") != person.id:
        raise BadSignatureError("its key is not that of the person whom it names")
    return public
