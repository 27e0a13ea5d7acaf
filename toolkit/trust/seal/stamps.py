"""Time stamps (RFC 3161): asked of a server, and held against what they stamp.

The client is pyHanko's over the standard library alone: one request, one answer, and no session to keep.
"""

from __future__ import annotations

import asyncio
import datetime as dt
import hashlib
import logging
import urllib.error
import urllib.request
from dataclasses import dataclass
from typing import Literal

from asn1crypto import cms, tsp
from asn1crypto import x509 as asn1
from cryptography.hazmat.primitives.serialization import Encoding
from pyhanko.sign.timestamps import TimeStamper
from pyhanko.sign.validation.errors import SignatureValidationError
from pyhanko.sign.validation.generic_cms import validate_tst_signed_data
from pyhanko.sign.validation.status import TimestampSignatureStatus
from pyhanko_certvalidator import ValidationContext

from toolkit.errors import TrustError
from toolkit.trust.seal.x509 import HASHES, Trust, load_certificate, subject, weak_certificate

_SECONDS = 20.0
_LARGEST = 1 << 20  # bytes: a token with its certificates has some thousand
_REPLY = "application/timestamp-reply"


class StampServer(TimeStamper):
    """A time-stamp server by its address."""

    def __init__(self, url: str) -> None:
        super().__init__()  # type: ignore[no-untyped-call]
        self._url = url

    async def async_request_tsa_response(self, req: tsp.TimeStampReq) -> tsp.TimeStampResp:
        """Ask the server.

        Raises
        ------
        TrustError
            ``time-stamp``: it cannot be reached, or answers otherwise than a time-stamp server
        """
        if not self._url.startswith(("http://", "https://")):
            raise _refused(self._url, "an address of another kind", "http:// or https://")
        headers = {"Content-Type": "application/timestamp-query", "Accept": _REPLY}
        try:
            request = urllib.request.Request(self._url, req.dump(), headers)  # noqa: S310  asked for above
            with urllib.request.urlopen(request, timeout=_SECONDS) as answer:  # noqa: S310
                kind, data = answer.headers.get_content_type(), answer.read(_LARGEST)
        except (OSError, ValueError, urllib.error.URLError) as error:
            raise _refused(self._url, error, "a time-stamp server that answers") from error
        if kind != _REPLY:
            raise _refused(self._url, f"an answer of the kind {kind}", _REPLY)
        try:
            return tsp.TimeStampResp.load(data, strict=True)
        except ValueError as error:
            raise _refused(self._url, error, "a time stamp") from error


@dataclass(frozen=True, slots=True, kw_only=True)
class Stamp:
    """What a time stamp proves: that something was there ``at`` a time, by the word of ``by``."""

    at: dt.datetime
    by: str
    state: Literal["valid", "untrusted"]

    @property
    def text(self) -> str:
        """The stamp in words."""
        trusted = "" if self.state == "valid" else ", whom nobody here trusts"
        return f"time stamp of {self.at:%Y-%m-%dT%H:%M:%SZ} by {self.by}{trusted}"


def stamp(data: bytes, server: TimeStamper) -> bytes:
    """Return a time stamp of data, a token in DER.

    Raises
    ------
    TrustError
        ``time-stamp``: the server does not give one
    """
    from pyhanko.sign.timestamps import TimestampRequestError

    try:
        token = asyncio.run(server.async_timestamp(hashlib.sha256(data).digest(), "sha256"))
    except (OSError, ValueError, TimestampRequestError) as error:
        raise _refused("the time-stamp server", error, "a time stamp") from error
    return bytes(token.dump())


def check_stamp(token: bytes, data: bytes, trust: Trust) -> Stamp:
    """Return what a time stamp proves of data.

    Raises
    ------
    TrustError
        ``time-stamp``: it is none, of other data, or too weak
    """
    roots = [asn1.Certificate.load(c.public_bytes(Encoding.DER)) for c in trust.certificates]
    context = ValidationContext(trust_roots=roots, allow_fetching=False, revocation_mode="soft-fail")
    logging.getLogger("pyhanko").setLevel(logging.CRITICAL)
    try:
        signed = cms.ContentInfo.load(token, strict=True)["content"]
        parts = asyncio.run(validate_tst_signed_data(signed, context, lambda name: _digest(name, data)))
        status = TimestampSignatureStatus(**parts)
        signer = load_certificate(status.signing_cert.dump())
    except (ValueError, TypeError, KeyError, AttributeError, SignatureValidationError) as error:
        raise _refused("a document", " ".join(str(error).split())[:120], "a time stamp") from error
    if not (status.intact and status.valid) or status.md_algorithm not in HASHES:
        raise _refused("a document", "a time stamp of something else", "that of its checkpoint")
    trusted = status.trusted and not weak_certificate(signer)
    return Stamp(at=status.timestamp, by=subject(signer), state="valid" if trusted else "untrusted")


def _digest(name: str, data: bytes) -> bytes:
    return hashlib.new(name, data).digest() if name in HASHES else b""


def _refused(where: object, got: object, expected: str) -> TrustError:
    return TrustError(
        "there is no time stamp", where=where, got=got, expected=expected,
        next_step="check --time-stamp, or take the document as it was issued; nothing was made",
        rule="time-stamp",
    )  # fmt: skip
