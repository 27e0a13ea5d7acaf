"""What lies in the folder of trusted certificates, and a time stamp beside a revocation."""

from __future__ import annotations

from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.hazmat.primitives.serialization import Encoding

from tests.trust.seal.authority import make_authority
from tests.trust.seal.seal_factory import DAY, NOW, authority, key, plain_pdf, trust
from toolkit.errors import TrustError
from toolkit.trust.seal.key import SealKey
from toolkit.trust.seal.pdf import check_pdf, seal_pdf
from toolkit.trust.seal.x509 import Trust, judge, read_trust, with_files


def test_a_folder_is_read_pem_der_several_and_lists(tmp_path: Path) -> None:
    other = make_authority("Other")
    (tmp_path / "a.pem").write_bytes(authority().pem + other.pem)
    (tmp_path / "b.der").write_bytes(key().certificate.public_bytes(Encoding.DER))
    (tmp_path / "c.crl").write_bytes(authority().revoke(key(), on=NOW).public_bytes(Encoding.PEM))
    (tmp_path / "notes.txt").write_text("not a certificate")
    read = read_trust(tmp_path)
    assert set(read.certificates) == {authority().certificate, other.certificate, key().certificate}
    assert len(read.revocations) == 1


def test_no_folder_trusts_nobody_and_a_file_without_a_certificate_is_an_error(tmp_path: Path) -> None:
    assert read_trust(tmp_path / "none") == Trust()
    for name in ("a.pem", "a.crl"):
        (tmp_path / name).write_text("nothing")
        with pytest.raises(TrustError) as caught:
            read_trust(tmp_path)
        assert caught.value.rule == "trust-certificate"
        (tmp_path / name).unlink()
    with pytest.raises(TrustError):
        with_files(Trust(), [tmp_path / "missing.pem"])


def test_a_revocation_after_a_proven_time_does_not_count() -> None:
    listed = Trust(certificates=trust().certificates, revocations=(authority().revoke(key(), on=NOW),))
    at = NOW - DAY / 2
    assert judge(key().certificate, (), listed, at=at).state == "untrusted"
    assert judge(key().certificate, (), listed, at=at, stamped=True).state == "valid"


def _stamped(server: SealKey) -> bytes:
    from asn1crypto import keys
    from asn1crypto import x509 as asn1
    from cryptography.hazmat.primitives.serialization import NoEncryption, PrivateFormat
    from pyhanko.sign.timestamps import DummyTimeStamper

    private = server.private.private_bytes(Encoding.DER, PrivateFormat.PKCS8, NoEncryption())
    stamper = DummyTimeStamper(
        asn1.Certificate.load(server.certificate.public_bytes(Encoding.DER)),
        keys.PrivateKeyInfo.load(private),
    )
    return seal_pdf(plain_pdf(), key(), reason="issued", stamps=stamper)


def test_a_time_stamp_of_an_enrolled_server_proves_the_time() -> None:
    private = rsa.generate_private_key(public_exponent=65537, key_size=3072)
    server = make_authority("Stamps").issue("Time", private=private, time_stamps=True)
    enrolled = Trust(certificates=(*trust().certificates, server.certificate))
    check = check_pdf(_stamped(server), enrolled)
    assert (check.signature, check.stamped) == ("valid", True)
    assert check_pdf(_stamped(server), trust()).stamped is False
