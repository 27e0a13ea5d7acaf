"""The parts of a CMS message that its signature does not cover: each must be what the signed parts make it.

RFC 5652 signs the attributes, and by them the document. Version numbers, the outer list of digests and the
certificates lie outside. A message in which one of them differs would verify all the same; such a message
was changed after it was made, and is refused.
"""

from __future__ import annotations

from toolkit.trust.seal.check import Forged
from toolkit.trust.seal.x509 import HASHES

_TIME_STAMP = "signature_time_stamp_token"


def demand_plain(message: bytes) -> None:
    """Refuse a CMS message (DER) that has more or other parts than a seal has.

    Raises
    ------
    Forged
    """
    from asn1crypto import cms

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
