"""A sealed XML document: what was signed is all that is used, and xmlsec1 agrees."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric import rsa

from tests.conftest import SHARED_DATA
from tests.trust.seal.seal_factory import DCC, NOW, authority, key, sealed_xml, trust
from toolkit.errors import TrustError
from toolkit.trust.seal.x509 import Trust, load_certificate
from toolkit.trust.seal.xml import check_xml, seal_xml

SIGNED_EXAMPLE = SHARED_DATA / "dcc_examples" / "dcc_gp_temperature_typical_v12_v3.2.0_signed.xml"


def test_a_sealed_document_is_valid_and_gives_what_was_signed() -> None:
    check = check_xml(sealed_xml(), trust())
    assert (check.signature, check.issued_by) == ("valid", "Tire laboratory")
    assert b"<dcc:serial>4711</dcc:serial>" in check.content
    assert b"Signature" not in check.content
    assert b"a note" not in check.content


def test_the_time_is_the_one_that_was_stated() -> None:
    assert check_xml(seal_xml(DCC, key(), at=NOW.replace(microsecond=0)), trust()).at == NOW.replace(
        microsecond=0
    )


def test_an_rsa_key_seals_too() -> None:
    private = rsa.generate_private_key(public_exponent=65537, key_size=3072)
    sealed = seal_xml(DCC, authority().issue("Other", private=private))
    assert check_xml(sealed, trust()).signature == "valid"


def test_a_document_without_a_seal_is_unsigned_and_nobody_is_trusted_by_default() -> None:
    assert check_xml(DCC, trust()).signature == "unsigned"
    assert check_xml(sealed_xml(), Trust()).signature == "untrusted"


def test_a_document_is_sealed_once() -> None:
    with pytest.raises(TrustError, match="cannot be sealed"):
        seal_xml(sealed_xml(), key())


@pytest.mark.parametrize(
    "text",
    [
        b'<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>',
        b'<!DOCTYPE a SYSTEM "http://127.0.0.1/x.dtd"><a/>',
        b'<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]><a>&b;</a>',
        "<!DOCTYPE a [<!ENTITY b 'c'>]><a>&b;</a>".encode("utf-16"),
        b"<a>",
        b"",
        b"\0" * 100,
    ],
)
def test_a_dtd_an_entity_or_no_xml_is_unreadable(text: bytes) -> None:
    with pytest.raises(TrustError) as caught:
        check_xml(text, trust())
    assert caught.value.rule == "unreadable-document"


@pytest.mark.skipif(shutil.which("xmlsec1") is None, reason="xmlsec1 is not installed")
def test_xmlsec1_verifies_every_reference(tmp_path: Path) -> None:
    (tmp_path / "sealed.xml").write_bytes(sealed_xml())
    (tmp_path / "root.pem").write_bytes(authority().pem)
    command = ["xmlsec1", "--verify", "--trusted-pem", "root.pem", "--id-attr:Id", "SignedProperties",
               "--id-attr:Id", "KeyInfo", "sealed.xml"]  # fmt: skip
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert "SignedInfo References (ok/all): 3/3" in result.stderr


@pytest.mark.skipif(not SIGNED_EXAMPLE.is_file(), reason="the DCC examples are not here")
def test_the_published_example_holds_only_where_its_certificate_is_enrolled() -> None:
    import re
    from base64 import b64decode

    data = SIGNED_EXAMPLE.read_bytes()
    check = check_xml(data, trust())
    assert (check.signature, check.issued_by) == ("untrusted", "Calibration Lab A1, Calibration A GmbH")
    assert check.time == "2023-03-27T15:14:30Z"
    match = re.search(rb"<ds:X509Certificate>(.*?)<", data)
    assert match is not None
    enrolled = Trust(certificates=(load_certificate(b64decode(match[1])),))
    assert check_xml(data, enrolled).signature == "valid"
    changed = data.replace(b"0.072 0.089", b"0.071 0.089")
    assert changed != data
    assert check_xml(changed, enrolled).signature == "invalid"
