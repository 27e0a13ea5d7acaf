"""A sealed PDF: still PDF/A, signed as a whole, and what poppler and openssl say of it."""

from __future__ import annotations

import io
import re
import subprocess
import sys
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.asymmetric import rsa

from tests.trust.seal.authority import make_authority
from tests.trust.seal.seal_factory import PROOF, XMP, authority, key, plain_pdf, sealed_pdf, trust
from toolkit.errors import TrustError
from toolkit.trust.seal.pdf import check_pdf, seal_pdf
from toolkit.trust.seal.x509 import Trust, fingerprint


def test_a_sealed_file_is_valid_and_says_by_whom_and_when() -> None:
    check = check_pdf(sealed_pdf(), trust())
    assert (check.signature, check.issued_by) == ("valid", "Tire laboratory")
    assert check.certificate == fingerprint(key().certificate)
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", str(check.time))
    assert check.attachments == {"toolkit.json": PROOF}


def test_the_file_as_it_was_is_the_beginning_of_the_sealed_one() -> None:
    assert sealed_pdf().startswith(plain_pdf())


def test_a_file_with_an_attachment_says_pdf_a_3_and_stays_pdf_1_7() -> None:
    from pyhanko.pdf_utils.reader import PdfFileReader

    root = PdfFileReader(io.BytesIO(sealed_pdf())).root
    # Nothing but the part is another: pyHanko by itself writes metadata without the mark.
    assert root["/Metadata"].data == XMP.replace(b"part>2<", b"part>3<")
    assert "/Version" not in root
    specification = root["/AF"][0]
    assert specification["/AFRelationship"] == "/Data"
    assert specification["/EF"]["/F"]["/Subtype"] == "/application/json"
    assert {"/F", "/UF"} <= set(specification)


def test_a_file_without_attachments_stays_pdf_a_2() -> None:
    sealed = seal_pdf(plain_pdf(), key(), reason="issued")
    assert b"<pdfaid:part>3" not in sealed
    assert check_pdf(sealed, trust()).signature == "valid"


def test_an_rsa_key_seals_too() -> None:
    private = rsa.generate_private_key(public_exponent=65537, key_size=3072)
    sealed = seal_pdf(plain_pdf(), authority().issue("Other", private=private), reason="issued")
    assert check_pdf(sealed, trust()).signature == "valid"


def test_a_path_through_an_authority_between_is_found() -> None:
    between = make_authority("Between", above=authority())
    signer = between.issue("Deep laboratory", between=())
    assert check_pdf(seal_pdf(plain_pdf(), signer, reason="issued"), trust()).signature == "valid"


def test_a_file_is_sealed_once() -> None:
    with pytest.raises(TrustError, match="has a seal already"):
        seal_pdf(sealed_pdf(), key(), reason="again")


def test_bytes_that_are_no_pdf_are_unreadable() -> None:
    with pytest.raises(TrustError) as caught:
        check_pdf(b"PK\x03\x04", trust())
    assert caught.value.rule == "unreadable-document"
    with pytest.raises(TrustError, match="cannot be sealed"):
        seal_pdf(b"%PDF-1.7\nnothing", key(), reason="issued")


def test_a_file_without_a_seal_is_unsigned_and_nobody_is_trusted_by_default() -> None:
    assert check_pdf(plain_pdf(), trust()).signature == "unsigned"
    assert check_pdf(sealed_pdf(), Trust()).signature == "untrusted"


def test_poppler_finds_the_signature_valid_over_the_whole_document(tmp_path: Path) -> None:
    (tmp_path / "sealed.pdf").write_bytes(sealed_pdf())
    said = subprocess.run(
        ["pdfsig", "-nocert", str(tmp_path / "sealed.pdf")], capture_output=True, text=True, check=False
    ).stdout
    assert "Signature is Valid" in said
    assert "Total document signed" in said
    assert "ETSI.CAdES.detached" in said


def test_openssl_verifies_the_message_over_the_signed_bytes(tmp_path: Path) -> None:
    data = sealed_pdf()
    match = re.search(rb"/ByteRange \[(\d+) (\d+) (\d+) (\d+)\s*\]", data)
    assert match is not None
    start, length, second, rest = map(int, match.groups())
    (tmp_path / "content").write_bytes(data[start : start + length] + data[second : second + rest])
    message = bytes.fromhex(data[length + 1 : second - 1].decode())
    size = 4 + int.from_bytes(message[2:4])
    (tmp_path / "seal.der").write_bytes(message[:size])
    (tmp_path / "root.pem").write_bytes(authority().pem)
    command = ["openssl", "cms", "-verify", "-binary", "-inform", "DER", "-in", "seal.der",
               "-out", "verified", "-content", "content", "-CAfile", "root.pem",
               "-purpose", "any"]  # fmt: skip
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert (tmp_path / "verified").read_bytes() == (tmp_path / "content").read_bytes()


def test_a_check_loads_no_web_client(tmp_path: Path) -> None:
    (tmp_path / "sealed.pdf").write_bytes(sealed_pdf())
    (tmp_path / "root.pem").write_bytes(authority().pem)
    script = (
        "import sys; from pathlib import Path; from toolkit.trust.seal.pdf import check_pdf; "
        "from toolkit.trust.seal.x509 import Trust, with_files; "
        "check = check_pdf(Path('sealed.pdf').read_bytes(), with_files(Trust(), [Path('root.pem')])); "
        "print(check.signature, "
        "{'aiohttp', 'requests', 'pyhanko.sign'} & {*sys.modules})"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stdout == "valid set()\n"
