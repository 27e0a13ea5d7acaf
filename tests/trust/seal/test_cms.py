"""The message of a seal: only DER, only what its signer said, and only by strong algorithms."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from typing import Any

import pytest
from asn1crypto import cms, core, tsp
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec, padding, rsa
from cryptography.hazmat.primitives.serialization import Encoding

from tests.trust.seal.seal_factory import authority, key, plain_pdf, sealed_pdf
from toolkit.trust.seal.check import Forged
from toolkit.trust.seal.cms import check_message, demand_plain
from toolkit.trust.seal.key import SealKey
from toolkit.trust.seal.pdf import seal_pdf

_CONTENT = b"what is signed"
_RSA = rsa.generate_private_key(public_exponent=65537, key_size=3072)
Change = Callable[[Any], None]


# X.690, 8.1.3 and 10.1: an indefinite length, a length longer than needed, trailing and missing bytes.
@pytest.mark.parametrize(
    "message",
    ["3080020101 0000", "308103020101", "30820003020101", "3003020101 00", "3005020101 0000", "300402010100",
     "3006020101", "3003020201", "3f0100", "1f", "30"],
)  # fmt: skip
def test_what_is_not_der_is_no_signature(message: str) -> None:
    with pytest.raises(Forged, match="not DER"):
        demand_plain(bytes.fromhex(message))


def test_der_of_another_kind_is_no_signature() -> None:
    with pytest.raises((Forged, ValueError, KeyError, TypeError)):
        demand_plain(bytes.fromhex("3003020101"))


def _message(change: Change = lambda _info: None, *, by: SealKey | None = None) -> bytes:
    """Return a message over the content, changed and then signed by the laboratory's own key."""
    by = by or key()
    sealed = sealed_pdf() if by == key() else seal_pdf(plain_pdf(), by, reason="issued")
    match = re.search(rb"<([0-9a-fA-F]{1000,})>", sealed)
    assert match is not None
    message = cms.ContentInfo.load(bytes.fromhex(match[1].decode()))
    info = message["content"]["signer_infos"][0]
    for attribute in info["signed_attrs"]:
        if attribute["type"].native == "message_digest":
            attribute["values"] = [hashlib.sha256(_CONTENT).digest()]
    change(info)
    signed = _CONTENT
    if not isinstance(info["signed_attrs"], core.Void):
        signed = info["signed_attrs"].untag().dump(force=True)
    if isinstance(by.private, ec.EllipticCurvePrivateKey):
        named = info["signature_algorithm"]["algorithm"].native
        digest = hashes.SHA384() if named == "sha384_ecdsa" else hashes.SHA256()
        info["signature"] = by.private.sign(signed, ec.ECDSA(digest))
    else:
        pss = info["signature_algorithm"]["parameters"]["mask_gen_algorithm"]["parameters"]
        mask = hashes.SHA1() if pss["algorithm"].native == "sha1" else hashes.SHA256()  # noqa: S303
        info["signature"] = by.private.sign(signed, padding.PSS(padding.MGF1(mask), 32), hashes.SHA256())
    dumped: bytes = message.dump(force=True)
    return dumped


def _with(name: str, value: Any) -> Change:
    """Return the change that gives a signed attribute another value, or adds it."""

    def change(info: Any) -> None:
        rows = [row for row in info["signed_attrs"] if row["type"].native != name]
        info["signed_attrs"] = cms.CMSAttributes([*rows, {"type": name, "values": [value]}])

    return change


def _doubled(info: Any) -> None:
    more = {"type": "message_digest", "values": [hashlib.sha256(b"something else").digest()]}
    info["signed_attrs"] = cms.CMSAttributes([*info["signed_attrs"], more])


def _bare(info: Any) -> None:
    info["signed_attrs"] = None


def _without_digest(info: Any) -> None:
    rows = [row for row in info["signed_attrs"] if row["type"].native != "message_digest"]
    info["signed_attrs"] = cms.CMSAttributes(rows)


def _stronger(info: Any) -> None:
    info["signature_algorithm"] = {"algorithm": "sha384_ecdsa"}


def _of_another(info: Any) -> None:
    other = hashlib.sha256(authority().certificate.public_bytes(Encoding.DER)).digest()
    _with("signing_certificate_v2", tsp.SigningCertificateV2({"certs": [{"cert_hash": other}]}))(info)


def _by_sha1(info: Any) -> None:
    own = hashlib.sha1(key().certificate.public_bytes(Encoding.DER)).digest()  # noqa: S324
    _with("signing_certificate", tsp.SigningCertificate({"certs": [{"cert_hash": own}]}))(info)


def _protecting(info: Any) -> None:
    other = {"digest_algorithm": {"algorithm": "sha512"}, "signature_algorithm": {"algorithm": "sha512_rsa"}}
    _with("cms_algorithm_protection", cms.CMSAlgorithmProtection(other))(info)


def _pss(mask: str) -> Change:
    def change(info: Any) -> None:
        parameters = {
            "hash_algorithm": {"algorithm": "sha256"}, "salt_length": 32,
            "mask_gen_algorithm": {"algorithm": "mgf1", "parameters": {"algorithm": mask}},
        }  # fmt: skip
        info["signature_algorithm"] = {"algorithm": "rsassa_pss", "parameters": parameters}
        rows = [row for row in info["signed_attrs"] if row["type"].native != "cms_algorithm_protection"]
        info["signed_attrs"] = cms.CMSAttributes(rows)

    return change


def test_what_its_key_signed_holds_for_these_bytes_alone() -> None:
    read = check_message(_message(), [_CONTENT[:4], _CONTENT[4:]])
    assert (read.signer, read.stamp) == (key().certificate, None)
    strong = check_message(_message(_pss("sha256"), by=authority().issue("RSA", private=_RSA)), [_CONTENT])
    assert strong.signer.public_key() == _RSA.public_key()
    with pytest.raises(Forged, match="changed after it was sealed"):
        check_message(_message(), [_CONTENT + b" "])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (_bare, "does not say what it signs"),
        (_without_digest, "does not say what it signs"),
        (_doubled, "more than one message_digest"),
        (_with("content_type", "signed_data"), "its digest differs"),
        (_of_another, "another certificate"),
        (_by_sha1, "SHA1"),
        (_protecting, "its algorithms"),
        (_stronger, "its algorithms|weak algorithm"),
    ],
    ids=lambda part: part if isinstance(part, str) else "",
)
def test_a_message_of_another_form_is_refused_though_the_laboratory_signed_it(
    change: Change, words: str
) -> None:
    with pytest.raises(Forged, match=words):
        check_message(_message(change), [_CONTENT])


def test_a_strong_signature_with_a_weak_mask_is_weak() -> None:
    weak = _message(_pss("sha1"), by=authority().issue("RSA", private=_RSA))
    with pytest.raises(Forged, match="weak algorithm"):
        check_message(weak, [_CONTENT])
