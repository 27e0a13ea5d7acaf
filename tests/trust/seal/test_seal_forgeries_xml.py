"""Forged XML seals, none of which is valid: changed, wrapped, of another form, or by somebody else."""

from __future__ import annotations

import copy
import datetime as dt
from collections.abc import Callable
from typing import Any

import pytest
from cryptography.hazmat.primitives.asymmetric import rsa
from lxml import etree

from tests.trust.seal.authority import make_authority
from tests.trust.seal.seal_factory import (
    DAY,
    DCC,
    NOW,
    authority,
    flipped,
    foreign_xml,
    key,
    sealed_xml,
    spread,
    trust,
)
from toolkit.errors import TrustError
from toolkit.recording.marks import OWN_OUTPUT
from toolkit.trust.seal.check import SealCheck
from toolkit.trust.seal.key import SealKey
from toolkit.trust.seal.x509 import Trust
from toolkit.trust.seal.xml import DS, XADES, check_xml, seal_xml

PLACES = 80
C14N11 = "http://www.w3.org/2006/12/xml-c14n11"


def _checked(data: bytes, trusted: Trust | None = None) -> SealCheck:
    try:
        # signxml stamps the hour of the day itself: a run of many minutes is past the factory's NOW
        return check_xml(data, trusted or trust(), now=dt.datetime.now(dt.UTC) + dt.timedelta(minutes=10))
    except TrustError as error:
        return SealCheck(signature="invalid", why=str(error))


@pytest.mark.parametrize("share", range(PLACES))
def test_a_changed_byte_breaks_the_seal(share: int) -> None:
    place = spread(len(sealed_xml()), PLACES)[share]
    for mask in (1, 0x20):
        assert _checked(flipped(sealed_xml(), place, mask)).signature == "invalid"


@pytest.mark.parametrize("share", range(1, 10))
def test_a_file_that_was_cut_is_not_valid(share: int) -> None:
    assert _checked(sealed_xml()[: len(sealed_xml()) * share // 10]).signature == "invalid"


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"<dcc:serial>", b"<dcc:serial >"),
        (b"<dcc:serial>4711", b"<dcc:serial>&#52;711"),
        (b"<dcc:serial>4711", b"<dcc:serial><![CDATA[4711]]>"),
        (b"<dcc:serial>4711", b"<dcc:serial>4<!-- -->711"),
        (b"<dcc:serial>4711", b"<?note?><dcc:serial>4711"),
        (b'unit="newton"', b"unit='newton'"),
        (b"<ds:SignedInfo>", b"\n<ds:SignedInfo>"),
        (b"toolkit-output", b"another note  "),
        (b"</dcc:certificate>\n", b"</dcc:certificate>"),
        (b"</dcc:certificate>\n", b"</dcc:certificate>\n<!-- note -->"),
        (b"</ds:SignatureValue>", b"\n</ds:SignatureValue>"),
        (b"</ds:Object>", b"</ds:Object><ds:Object></ds:Object>"),
    ],
)
def test_bytes_that_mean_the_same_break_an_exact_seal(old: bytes, new: bytes) -> None:
    assert sealed_xml().count(old) == 1
    assert _checked(sealed_xml().replace(old, new)).signature == "invalid"


def test_the_toolkit_knows_a_sealed_file_as_its_own() -> None:
    assert OWN_OUTPUT.encode() in sealed_xml()[:200]


def test_of_a_foreign_seal_comments_are_nobodys_and_are_not_read() -> None:
    """The rule of canonical XML: what is not signed may change, and is no part of what is used."""
    commented = foreign_xml().replace(b"<dcc:serial>4711", b"<dcc:serial>4<!-- 2 -->711")
    check = _checked(commented)
    assert check.signature == "valid"
    assert b"<dcc:serial>4711</dcc:serial>" in check.content


# Wrapping: the signed content moves to where the signature still finds it, other content to where it is read.


def _parts() -> tuple[Any, Any]:
    root = etree.fromstring(foreign_xml())
    signature = root.find(f"{{{DS}}}Signature")
    assert signature is not None
    return root, signature


def _evil() -> Any:
    root = etree.fromstring(DCC.replace(b"4711", b"4712"))
    etree.strip_tags(root, etree.Comment)
    return root


def _inside_an_object() -> Any:
    root, signature = _parts()
    evil, original = _evil(), copy.deepcopy(root)
    original.remove(original.find(f"{{{DS}}}Signature"))
    etree.SubElement(signature, f"{{{DS}}}Object").append(original)
    evil.append(signature)
    return evil


def _around() -> Any:
    root, _ = _parts()
    evil = _evil()
    evil.append(root)
    return evil


def _before() -> Any:
    root, _ = _parts()
    root.insert(0, _evil())
    return root


def _in_the_signature() -> Any:
    root, signature = _parts()
    etree.SubElement(signature, f"{{{DS}}}Object").append(_evil())
    serial = root.find("{https://ptb.de/dcc}serial")
    signature[-1].append(serial)
    root.insert(0, etree.fromstring(b'<dcc:serial xmlns:dcc="https://ptb.de/dcc">4712</dcc:serial>'))
    return root


def _by_id() -> Any:
    root, signature = _parts()
    evil = _evil()
    root.remove(signature)
    root.set("Id", "signed")
    reference = signature.find(f"{{{DS}}}SignedInfo/{{{DS}}}Reference")
    reference.set("URI", "#signed")
    etree.SubElement(signature, f"{{{DS}}}Object").append(root)
    evil.append(signature)
    return evil


def _two_signatures() -> Any:
    root, signature = _parts()
    root.append(copy.deepcopy(signature))
    return root


def _deeper() -> Any:
    root, signature = _parts()
    root[0].append(signature)
    return root


def _same_id() -> Any:
    root, signature = _parts()
    properties = signature.find(f".//{{{XADES}}}SignedProperties")
    root[0].set("Id", properties.get("Id"))
    return root


def _other_properties() -> Any:
    root, signature = _parts()
    holder = etree.SubElement(signature, f"{{{DS}}}Object")
    qualifying = copy.deepcopy(signature.find(f".//{{{XADES}}}QualifyingProperties"))
    qualifying.find(f".//{{{XADES}}}SigningTime").text = "2001-01-01T00:00:00Z"
    qualifying.find(f"{{{XADES}}}SignedProperties").set("Id", "other")
    holder.append(qualifying)
    return root


def _without_the_document() -> Any:
    root, signature = _parts()
    info = signature.find(f"{{{DS}}}SignedInfo")
    info.remove(info.find(f"{{{DS}}}Reference[@URI='']"))
    return root


def _transform(algorithm: str) -> Callable[[], Any]:
    def build() -> Any:
        root, signature = _parts()
        transforms = signature.find(f"{{{DS}}}SignedInfo/{{{DS}}}Reference/{{{DS}}}Transforms")
        added = etree.SubElement(transforms, f"{{{DS}}}Transform", Algorithm=algorithm)
        if "xpath" in algorithm:
            etree.SubElement(added, f"{{{DS}}}XPath").text = "false()"
        return root

    return build


def _method(algorithm: str) -> Callable[[], Any]:
    def build() -> Any:
        root, signature = _parts()
        signature.find(f".//{{{DS}}}SignatureMethod").set("Algorithm", algorithm)
        return root

    return build


def _digest(algorithm: str) -> Callable[[], Any]:
    def build() -> Any:
        root, signature = _parts()
        signature.find(f".//{{{DS}}}DigestMethod").set("Algorithm", algorithm)
        return root

    return build


def _key_value() -> Any:
    root, signature = _parts()
    data = signature.find(f"{{{DS}}}KeyInfo/{{{DS}}}X509Data")
    data.getparent().remove(data)
    return root


def _changed_value() -> Any:
    root, _ = _parts()
    root[1].text = "0 1000 3000"
    return root


def _changed_time() -> Any:
    root, signature = _parts()
    signature.find(f".//{{{XADES}}}SigningTime").text = "2001-01-01T00:00:00Z"
    return root


def _no_properties() -> Any:
    from signxml.signer import XMLSigner

    return XMLSigner(signature_algorithm="ecdsa-sha256").sign(
        etree.fromstring(DCC), key=key().private, cert=list(key().chain)
    )


FORGERIES: dict[str, Callable[[], Any]] = {
    "wrapped-inside-an-object": _inside_an_object,
    "wrapped-around": _around,
    "wrapped-before": _before,
    "wrapped-in-the-signature": _in_the_signature,
    "wrapped-by-id": _by_id,
    "two-signatures": _two_signatures,
    "deeper": _deeper,
    "same-id": _same_id,
    "other-properties": _other_properties,
    "without-the-document": _without_the_document,
    "transform-xpath": _transform("http://www.w3.org/TR/1999/REC-xpath-19991116"),
    "transform-xpath-filter": _transform("http://www.w3.org/2002/06/xmldsig-filter2"),
    "transform-xslt": _transform("http://www.w3.org/TR/1999/REC-xslt-19991116"),
    "transform-base64": _transform(f"{DS}base64"),
    "transform-twice": _transform(C14N11),
    "transform-comments": _transform(f"{C14N11}#WithComments"),
    "method-hmac": _method("http://www.w3.org/2001/04/xmldsig-more#hmac-sha256"),
    "method-hmac-sha1": _method(f"{DS}hmac-sha1"),
    "method-rsa-sha1": _method(f"{DS}rsa-sha1"),
    "method-dsa": _method(f"{DS}dsa-sha1"),
    "method-ecdsa-sha1": _method("http://www.w3.org/2001/04/xmldsig-more#ecdsa-sha1"),
    "method-none": _method(""),
    "digest-sha1": _digest(f"{DS}sha1"),
    "digest-md5": _digest("http://www.w3.org/2001/04/xmldsig-more#md5"),
    "no-certificate": _key_value,
    "changed-value": _changed_value,
    "changed-time": _changed_time,
    "no-xades": _no_properties,
}


@pytest.mark.parametrize("forge", FORGERIES.values(), ids=FORGERIES.keys())
def test_a_document_of_another_form_is_no_sealed_one(forge: Callable[[], Any]) -> None:
    check = _checked(etree.tostring(forge()))
    assert check.signature == "invalid"
    assert check.content == b""


def test_without_its_signature_the_document_is_unsigned() -> None:
    root, signature = _parts()
    root.remove(signature)
    assert _checked(etree.tostring(root)).signature == "unsigned"


def _stranger() -> SealKey:
    return make_authority("Throw-away authority").issue("Tire laboratory")


def test_the_names_of_laboratory_and_authority_make_no_trust() -> None:
    assert _checked(seal_xml(DCC, _stranger())).signature == "untrusted"


@pytest.mark.parametrize("exact", [True, False])
def test_the_laboratorys_certificate_beside_a_strangers_key_is_no_signature(exact: bool) -> None:
    stolen = SealKey(private=_stranger().private, certificate=key().certificate)
    data = seal_xml(DCC, stolen) if exact else foreign_xml(signer=stolen)
    assert _checked(data).signature == "invalid"


def test_another_certificate_in_the_seal_breaks_it() -> None:
    root, signature = _parts()
    other = etree.fromstring(foreign_xml(signer=authority().issue("Tire laboratory")))
    element = signature.find(f".//{{{DS}}}X509Certificate")
    element.text = other.findtext(f".//{{{DS}}}X509Certificate")
    assert _checked(etree.tostring(root)).signature == "invalid"


@pytest.mark.parametrize(
    ("first", "last"),
    [(NOW - 20 * DAY, NOW - 10 * DAY), (NOW + 10 * DAY, NOW + 20 * DAY)],
    ids=["expired", "not-yet-valid"],
)
def test_a_certificate_holds_in_its_time_only(first: dt.datetime, last: dt.datetime) -> None:
    signer = authority().issue("Tire laboratory", first=first, last=last)
    assert _checked(seal_xml(DCC, signer)).signature == "untrusted"


@pytest.mark.parametrize("at", [NOW + 2 * DAY, NOW - 400 * DAY], ids=["future", "before-the-certificate"])
def test_a_time_outside_the_certificate_or_in_the_future_is_untrusted(at: dt.datetime) -> None:
    assert _checked(seal_xml(DCC, key(), at=at)).signature == "untrusted"


@pytest.mark.parametrize("days", [-5, 5])
def test_a_revoked_certificate_does_not_hold(days: int) -> None:
    revoked = authority().revoke(key(), on=NOW + days * DAY)
    trusted = Trust(certificates=trust().certificates, revocations=(revoked,))
    assert _checked(sealed_xml(), trusted).signature == "untrusted"


@pytest.mark.parametrize("bits", [1024, 2048])
def test_a_weak_key_is_no_seal(bits: int) -> None:
    weak = rsa.generate_private_key(public_exponent=65537, key_size=bits)
    check = _checked(seal_xml(DCC, authority().issue("Tire laboratory", private=weak)))
    assert check.signature == "invalid"
    assert "weak algorithm" in check.why
