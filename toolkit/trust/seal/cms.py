"""The CMS message of a seal (RFC 5652): whether the key of its certificate signed a document's bytes.

It signs the attributes, and by them the document. Version numbers, the outer list of digests and the
certificates lie outside. A message in which one of them differs would verify all the same; such a message
was changed after it was made, and is refused.

pyHanko says the same of a whole PDF, and loads a web client to do so: half a second of every process that
verifies. Of it only the signature of bytes is used here; tests hold both against each other.
"""

from __future__ import annotations

import datetime as dt
import hashlib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from asn1crypto import cms, tsp
from cryptography import x509
from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm

from toolkit.trust.seal.check import Forged
from toolkit.trust.seal.x509 import HASHES, load_certificate

_TIME_STAMP = "signature_time_stamp_token"


@dataclass(frozen=True, slots=True, kw_only=True)
class Message:
    """What a message says whose signature holds: the signer's certificate and those beside it.

    ``at`` is the time in its attributes, ``value`` the signature itself, ``stamp`` a time stamp (DER) of it;
    None where there is none.
    """

    signer: x509.Certificate
    intermediates: tuple[x509.Certificate, ...]
    value: bytes
    at: dt.datetime | None
    stamp: bytes | None


def check_message(message: bytes, parts: Iterable[bytes]) -> Message:
    """Return what a CMS message (DER) says that signs the bytes of a document, given in parts.

    Raises
    ------
    Forged
        it is no signature of these bytes by the key of its certificate, or it was changed since
    ValueError, TypeError, KeyError
        it cannot be read
    """
    signed = demand_plain(message)
    (info,) = signed["signer_infos"]
    name = str(info["digest_algorithm"]["algorithm"].native)
    digest = hashlib.new(name)
    for part in parts:
        digest.update(part)
    certificates = [part.chosen for part in signed["certificates"]]
    (signer,) = (c for c in certificates if c.serial_number == info["sid"].chosen["serial_number"].native)
    _demand(signer.issuer == info["sid"].chosen["issuer"], "signer")
    attributes = _attributes(info)
    if attributes["content_type"].native != "data" or attributes["message_digest"].native != digest.digest():
        raise Forged("the file was changed after it was sealed: its digest differs")
    _demand_its_own(attributes, signer, info)
    _demand_signed(info, signer, name)
    at, unsigned = attributes.get("signing_time"), info["unsigned_attrs"]
    return Message(
        signer=load_certificate(signer.dump()),
        intermediates=tuple(load_certificate(c.dump()) for c in certificates if c is not signer),
        value=info["signature"].native,
        at=None if at is None else at.native,
        stamp=unsigned[0]["values"][0].dump() if unsigned.native else None,
    )


def _attributes(info: cms.SignerInfo) -> dict[str, Any]:
    """Return the signed attributes by name; each is there once, with one value."""
    attributes: dict[str, Any] = {}
    for attribute in info["signed_attrs"]:
        name = attribute["type"].native
        if name in attributes or len(attribute["values"]) != 1:
            raise Forged(f"the signature states more than one {name}")
        attributes[name] = attribute["values"][0]
    if not {"content_type", "message_digest"} <= {*attributes}:
        raise Forged("the signature does not say what it signs")
    return attributes


def _demand_its_own(attributes: dict[str, Any], signer: Any, info: cms.SignerInfo) -> None:
    """Refuse attributes that name another certificate or other algorithms than the message has."""
    if "signing_certificate" in attributes:
        raise Forged("weak algorithm: the signature names its certificate by SHA1")
    if (named := attributes.get("signing_certificate_v2")) is not None:
        first: tsp.ESSCertIDv2 = named["certs"][0]
        digest = hashlib.new(str(first["hash_algorithm"]["algorithm"].native), signer.dump()).digest()
        place = first["issuer_serial"].native
        same = place is None or place["serial_number"] == signer.serial_number
        if first["cert_hash"].native != digest or not same:
            raise Forged("the signature was made with another certificate than it holds")
    if (protected := attributes.get("cms_algorithm_protection")) is not None:
        for name in ("digest_algorithm", "signature_algorithm"):
            _demand(protected[name].native == info[name].native, "algorithms")


def _demand_signed(info: cms.SignerInfo, signer: Any, digest: str) -> None:
    from pyhanko_certvalidator.errors import AlgorithmNotSupported, PSSParameterMismatch
    from pyhanko_certvalidator.sig_validate import DefaultSignatureValidator, SignatureValidationContext

    algorithm = info["signature_algorithm"]
    try:
        hashes = {algorithm.hash_algo}
    except ValueError:  # it says none: that of the digest
        hashes = {digest}
    if algorithm["algorithm"].native == "rsassa_pss":
        hashes.add(algorithm["parameters"]["mask_gen_algorithm"]["parameters"]["algorithm"].native)
    if hashes != {digest}:
        raise Forged(f"weak algorithm: the signature is by {' and '.join(hashes)}, the digest by {digest}")
    try:
        # Its attributes are signed as a set, whatever tag they have in the message.
        DefaultSignatureValidator().validate_signature(
            info["signature"].native, info["signed_attrs"].untag().dump(), signer.public_key, algorithm,
            SignatureValidationContext(contextual_md_algorithm=digest, prehashed=False),
        )  # fmt: skip
    except (
        InvalidSignature, UnsupportedAlgorithm, AlgorithmNotSupported, PSSParameterMismatch
    ) as error:  # fmt: skip
        raise Forged("the signature was not made by the key of its certificate") from error


def demand_plain(message: bytes) -> cms.SignedData:
    """Return the signed data of a CMS message (DER) that has no more and no other parts than a seal has.

    Raises
    ------
    Forged
    """
    _demand(_is_der(message), "encoding, which is not DER")
    parsed = cms.ContentInfo.load(message, strict=True)
    _demand(parsed["content_type"].native == "signed_data", "kind")
    signed = parsed["content"]
    signers = signed["signer_infos"]
    if len(signers) != 1:
        raise Forged(f"{len(signers)} signers in one signature")
    signer = signers[0]
    digest = signer["digest_algorithm"]
    if digest["algorithm"].native not in {name.replace("-", "_") for name in HASHES} | set(HASHES):
        raise Forged(f"weak algorithm: the digest is {str(digest['algorithm'].native).upper()}")
    _demand(str(signed["version"].native) in ("v1", "v3"), "version")
    _demand(signer["version"].native == "v1" and signer["sid"].name == "issuer_and_serial_number", "signer")
    listed = signed["digest_algorithms"]
    _demand(len(listed) == 1 and listed[0]["algorithm"].native == digest["algorithm"].native, "digests")
    for algorithm in (listed[0], digest, signer["signature_algorithm"]):
        if algorithm["algorithm"].native not in ("rsassa_pss",):
            _demand(algorithm["parameters"].native is None, "parameters")
    _demand(not signed["crls"].native, "revocation lists")
    _demand(signed["encap_content_info"]["content"].native is None, "content")
    certificates = signed["certificates"]
    _demand(all(part.name == "certificate" for part in certificates), "certificates")
    number = signer["sid"].chosen["serial_number"].native
    _demand(sum(part.chosen.serial_number == number for part in certificates) == 1, "certificates")
    unsigned = signer["unsigned_attrs"]
    if unsigned.native:
        _demand(len(unsigned) == 1 and unsigned[0]["type"].native == _TIME_STAMP, "attributes")
        _demand(len(unsigned[0]["values"]) == 1, "attributes")
    return signed


def _is_der(data: bytes) -> bool:
    """Tell whether every element fills its length, which is as short as it can be, to the last byte."""
    at = 0
    while at < len(data):
        if len(data) - at < 2 or data[at] == 0 or data[at] & 0x1F == 0x1F:
            return False
        tag, size, start = data[at], data[at + 1], at + 2
        if size >= 0x80:
            count = size & 0x7F
            size = int.from_bytes(data[start : start + count])
            if not 1 <= count <= 4 or size < 0x80 or size.bit_length() <= 8 * (count - 1):
                return False
            start += count
        at = start + size
        if at > len(data) or (tag & 0x20 and not _is_der(data[start:at])):
            return False
    return True


def _demand(condition: bool, part: str) -> None:
    if not condition:
        raise Forged(f"the signature was changed after it was made: its {part}")
