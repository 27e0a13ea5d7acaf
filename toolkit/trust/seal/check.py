"""What a check of a seal answers, the same for a PDF and for a digital certificate."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from cryptography import x509

from toolkit.trust.seal.x509 import Judgement, Trust, fingerprint, judge, subject

Signature = Literal["valid", "invalid", "unsigned", "untrusted"]


class Forged(Exception):  # noqa: N818  a verdict on a document, not a fault of the program
    """The bytes are not those that were sealed, or the seal could be anybody's; the text says why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sealed:
    """A seal whose signature holds for every byte that counts; whose it is has yet to be judged.

    ``content`` is the signed document: of an XML file its canonical form, and nothing else may be used.
    """

    signer: x509.Certificate
    intermediates: tuple[x509.Certificate, ...]
    at: dt.datetime
    stamped: bool = False
    content: bytes = field(default=b"", repr=False)
    attachments: Mapping[str, bytes] = field(default_factory=dict, repr=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class SealCheck:
    """Whether a document's seal holds.

    Attributes
    ----------
    signature : ``valid``; ``untrusted``: intact, by somebody who is not trusted or was not at that time;
        ``invalid``: changed, or so weak that anybody could have made it; ``unsigned``
    why : in a sentence
    issued_by, certificate : whom the signer's certificate names, and its SHA-256
    at, stamped : time of the seal, and whether a time stamp proves it
    content : the signed document where the signature is valid or untrusted, else empty
    attachments : files in a PDF, by name; signed under the same condition
    """

    signature: Signature
    why: str
    issued_by: str | None = None
    certificate: str | None = None
    at: dt.datetime | None = None
    stamped: bool = False
    content: bytes = field(default=b"", repr=False)
    attachments: Mapping[str, bytes] = field(default_factory=dict, repr=False)

    @property
    def time(self) -> str | None:
        """The time of the seal in UTC."""
        return None if self.at is None else self.at.astimezone(dt.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def judged(sealed: Sealed, trust: Trust, *, now: dt.datetime | None = None) -> SealCheck:
    """Return the check of a document whose signature holds: whether its signer is trusted."""
    judgement: Judgement = judge(
        sealed.signer, sealed.intermediates, trust, at=sealed.at, stamped=sealed.stamped, now=now
    )
    intact = judgement.state != "invalid"
    return SealCheck(
        signature=judgement.state,
        why=judgement.why,
        issued_by=subject(sealed.signer),
        certificate=fingerprint(sealed.signer),
        at=sealed.at,
        stamped=sealed.stamped,
        content=sealed.content if intact else b"",
        attachments=sealed.attachments if intact else {},
    )
