"""Forged PDFs, none of which is valid: changed, cut, updated, sealed by somebody else, or too weakly."""

from __future__ import annotations

import datetime as dt
import io
import re
from collections.abc import Callable

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec, rsa

from tests.trust.seal.authority import Authority, make_authority
from tests.trust.seal.seal_factory import (
    DAY,
    NOW,
    authority,
    flipped,
    key,
    plain_pdf,
    sealed_pdf,
    spread,
    trust,
)
from toolkit.trust.seal.check import SealCheck
from toolkit.trust.seal.key import SealKey
from toolkit.trust.seal.pdf import check_pdf, seal_pdf
from toolkit.trust.seal.x509 import Trust


def _contents() -> tuple[int, int]:
    """Return where the hexadecimal digits of the signature begin and end."""
    match = re.search(rb"/ByteRange \[0 (\d+) (\d+) ", sealed_pdf())
    assert match is not None
    return int(match[1]) + 1, int(match[2]) - 1


def _message_end() -> int:
    start, end = _contents()
    return start + len(sealed_pdf()[start:end].rstrip(b"0"))


def _checked(data: bytes, trusted: Trust | None = None) -> SealCheck:
    check = check_pdf(data, trusted or trust(), now=dt.datetime.now(dt.UTC))
    if check.signature in ("valid", "untrusted"):
        assert _holds_for_pyhanko(data)
    return check


def _holds_for_pyhanko(data: bytes) -> bool:
    """Tell whether pyHanko's own check of a whole PDF finds its signature whole: a second opinion."""
    from pyhanko.pdf_utils.reader import PdfFileReader
    from pyhanko.sign.validation import validate_pdf_signature
    from pyhanko.sign.validation.status import SignatureCoverageLevel
    from pyhanko_certvalidator import ValidationContext

    (embedded,) = PdfFileReader(io.BytesIO(data), strict=True).embedded_signatures
    status = validate_pdf_signature(embedded, ValidationContext(trust_roots=[embedded.signer_cert]))
    return status.intact and status.valid and status.coverage == SignatureCoverageLevel.ENTIRE_FILE


PLAIN = len(plain_pdf())
COUNTS = {"document": 24, "revision": 16, "message": 40, "padding": 4, "end": 12}


def _part(name: str) -> tuple[int, int]:
    start, end = _contents()
    parts = {
        "document": (5, PLAIN),
        "revision": (PLAIN, start),
        "message": (start, _message_end()),
        "padding": (_message_end() + 1, end),
        "end": (end, len(sealed_pdf())),
    }
    return parts[name]


# The places are shares of a part: a seal is not the same bytes twice.
@pytest.mark.parametrize(
    ("part", "share"), [(part, at) for part, count in COUNTS.items() for at in range(count)]
)
def test_a_changed_byte_breaks_the_seal(part: str, share: int) -> None:
    first, last = _part(part)
    place = first + spread(last - first, COUNTS[part])[share]
    assert _checked(flipped(sealed_pdf(), place)).signature == "invalid"


@pytest.mark.parametrize("share", range(8))
def test_a_digit_in_the_other_case_breaks_the_seal(share: int) -> None:
    letters = [at for at in range(*_part("message")) if sealed_pdf()[at : at + 1].isalpha()]
    place = letters[spread(len(letters), 8)[share]]
    assert _checked(flipped(sealed_pdf(), place, 0x20)).signature == "invalid"


@pytest.mark.parametrize("part", COUNTS)
def test_a_file_that_was_cut_is_not_valid(part: str) -> None:
    assert _checked(sealed_pdf()[: _part(part)[1] - 1]).signature != "valid"


def test_without_its_last_revision_the_file_is_unsigned() -> None:
    assert _checked(sealed_pdf()[:PLAIN]).signature == "unsigned"


@pytest.mark.parametrize("text", [b"\n", b" ", b"\0" * 512, b"%%EOF\n", b"% a note\n", sealed_pdf()])
def test_bytes_after_the_end_break_the_seal(text: bytes) -> None:
    assert _checked(sealed_pdf() + text).signature == "invalid"


def test_bytes_before_the_beginning_break_the_seal() -> None:
    assert _checked(b"%PDF-1.4\n" + sealed_pdf()).signature == "invalid"


def _update(change: Callable[[object], None]) -> bytes:
    from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter

    writer = IncrementalPdfFileWriter(io.BytesIO(sealed_pdf()))
    change(writer)
    updated = io.BytesIO()
    writer.write(updated)
    return updated.getvalue()


def _change_page(writer: object) -> None:
    from pyhanko.pdf_utils import generic

    page = writer.root["/Pages"]["/Kids"][0]  # type: ignore[attr-defined]
    content = b"BT /F1 12 Tf 72 720 Td (U = 0.01 N) Tj ET"
    page["/Contents"] = writer.add_object(generic.StreamObject({}, stream_data=content))  # type: ignore[attr-defined]
    writer.update_container(page)  # type: ignore[attr-defined]


def _change_title(writer: object) -> None:
    from pyhanko.pdf_utils import generic

    title = generic.DictionaryObject({generic.pdf_name("/Title"): generic.pdf_string("another")})
    writer.set_info(writer.add_object(title))  # type: ignore[attr-defined]


def _remove_page(writer: object) -> None:
    pages = writer.root["/Pages"]  # type: ignore[attr-defined]
    del pages["/Kids"][1]
    writer.update_container(pages)  # type: ignore[attr-defined]


def _remove_form(writer: object) -> None:
    del writer.root["/AcroForm"]  # type: ignore[attr-defined]
    writer.update_root()  # type: ignore[attr-defined]


def _change_attachment(writer: object) -> None:
    names = writer.root["/Names"]["/EmbeddedFiles"]["/Names"]  # type: ignore[attr-defined]
    stream = names[1]["/EF"]["/F"]
    stream._data, stream._encoded_data = b"{}", None
    writer.update_container(stream)  # type: ignore[attr-defined]


def _nothing(writer: object) -> None:
    writer.update_root()  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    "change", [_change_page, _change_title, _remove_page, _remove_form, _change_attachment, _nothing]
)
def test_any_later_revision_breaks_the_seal(change: Callable[[object], None]) -> None:
    forged = _update(change)
    assert forged.startswith(sealed_pdf())
    assert len(forged) > len(sealed_pdf())
    assert _checked(forged).signature == "invalid"


def test_fields_that_contain_one_another_twice_end() -> None:
    fields = [b"<</T(%d)/Kids[%d 0 R %d 0 R]>>" % (n, n + 1, n + 1) for n in range(9, 49)]
    data = plain_pdf()[: plain_pdf().index(b"xref\n")].replace(
        b"/Catalog", b"/Catalog/AcroForm<</Fields[9 0 R]>>"
    )
    for number, body in enumerate([*fields, b"<</T(x)>>"], start=9):
        data += b"%d 0 obj%s\nendobj\n" % (number, body)
    places = [data.index(b"\n%d 0 obj" % number) + 1 for number in range(1, 50)]
    start = len(data)
    data += b"xref\n0 50\n0000000000 65535 f \n" + b"".join(b"%010d 00000 n \n" % place for place in places)
    data += b"trailer<</Size 50/Root 1 0 R>>\nstartxref\n%d\n%%%%EOF\n" % start
    check = _checked(data)
    assert (check.signature, "fields in the form" in check.why) == ("invalid", True), check.why


def test_a_second_signature_breaks_the_seal() -> None:
    from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter
    from pyhanko.sign import PdfSignatureMetadata, signers

    from toolkit.trust.seal.pdf import _signer

    writer = IncrementalPdfFileWriter(io.BytesIO(seal_pdf(plain_pdf(), _stranger(), reason="issued")))
    twice = io.BytesIO()
    metadata = PdfSignatureMetadata(field_name="Second")
    # Certified against changes: pyHanko itself refuses, so the first one only approves.
    with pytest.raises(Exception, match=r"."):
        signers.sign_pdf(writer, metadata, _signer(key()), output=twice)
    approved = io.BytesIO()
    signers.sign_pdf(
        IncrementalPdfFileWriter(io.BytesIO(plain_pdf())), PdfSignatureMetadata(field_name="First"),
        _signer(_stranger()), output=approved,
    )  # fmt: skip
    signers.sign_pdf(IncrementalPdfFileWriter(approved), metadata, _signer(key()), output=twice)
    assert _checked(twice.getvalue()).signature == "invalid"


def _stranger() -> SealKey:
    return make_authority("Throw-away authority").issue("Tire laboratory")


def _sealed_by(signer: SealKey) -> bytes:
    return seal_pdf(plain_pdf(), signer, reason="issued")


def test_the_signature_of_another_file_does_not_hold() -> None:
    other = seal_pdf(plain_pdf("U = 0.62 N"), key(), reason="issued", attachments={"toolkit.json": b"{}"})
    match = re.search(rb"<([0-9a-fA-F]{1000,})>", other)
    assert match is not None
    start, end = _contents()
    digits = match[1].rstrip(b"0").ljust(end - start, b"0")
    forged = sealed_pdf()[:start] + digits + sealed_pdf()[end:]
    assert len(forged) == len(sealed_pdf())
    assert _checked(forged).signature == "invalid"


def test_the_names_of_laboratory_and_authority_make_no_trust() -> None:
    check = _checked(_sealed_by(_stranger()))
    assert (check.signature, check.issued_by) == ("untrusted", "Tire laboratory")


def test_the_laboratorys_certificate_beside_a_strangers_key_is_no_signature() -> None:
    stolen = SealKey(private=_stranger().private, certificate=key().certificate)
    assert _checked(_sealed_by(stolen)).signature == "invalid"


def test_a_certificate_of_the_laboratory_cannot_issue_others() -> None:
    below = Authority(certificate=key().certificate, private=key().private).issue("Below")
    signer = SealKey(private=below.private, certificate=below.certificate, intermediates=(key().certificate,))
    assert _checked(_sealed_by(signer)).signature == "untrusted"


@pytest.mark.parametrize(
    ("first", "last", "words"),
    [
        (NOW - 20 * DAY, NOW - 10 * DAY, "had expired at the time of the seal"),
        (NOW + 10 * DAY, NOW + 20 * DAY, "was not yet valid at the time of the seal"),
        (NOW - 10 * DAY, NOW - dt.timedelta(minutes=1), "had expired"),
    ],
)
def test_a_certificate_holds_in_its_time_only(first: dt.datetime, last: dt.datetime, words: str) -> None:
    check = _checked(_sealed_by(authority().issue("Tire laboratory", first=first, last=last)))
    assert check.signature == "untrusted"
    assert words in check.why


@pytest.mark.parametrize(("days", "proof"), [(-5, ""), (5, "no time stamp proves")])
def test_a_revoked_certificate_does_not_hold_whatever_time_is_stated(days: int, proof: str) -> None:
    revoked = authority().revoke(key(), on=NOW + days * DAY)
    check = _checked(sealed_pdf(), Trust(certificates=trust().certificates, revocations=(revoked,)))
    assert check.signature == "untrusted"
    assert "was revoked" in check.why
    assert proof in check.why


def test_a_revocation_by_somebody_else_revokes_nothing() -> None:
    revoked = make_authority().revoke(key(), on=NOW - DAY)
    trusted = Trust(certificates=trust().certificates, revocations=(revoked,))
    assert _checked(sealed_pdf(), trusted).signature == "valid"


def test_a_seal_of_tomorrow_is_not_valid_today() -> None:
    assert check_pdf(sealed_pdf(), trust(), now=NOW - DAY).signature == "untrusted"


@pytest.mark.parametrize(
    "private",
    [
        rsa.generate_private_key(public_exponent=65537, key_size=1024),  # noqa: S505
        rsa.generate_private_key(public_exponent=65537, key_size=2048),
        ec.generate_private_key(ec.SECP192R1()),
        ec.generate_private_key(ec.SECP224R1()),
    ],
    ids=["rsa-1024", "rsa-2048", "p-192", "p-224"],
)
def test_a_weak_key_is_no_seal(private: object) -> None:
    check = _checked(_sealed_by(authority().issue("Tire laboratory", private=private)))
    assert check.signature == "invalid"
    assert "weak algorithm" in check.why


def test_a_weak_authority_is_no_authority() -> None:
    weak = make_authority(private=rsa.generate_private_key(public_exponent=65537, key_size=2048))
    trusted = Trust(certificates=(weak.certificate,))
    assert _checked(_sealed_by(weak.issue("Tire laboratory")), trusted).signature == "invalid"


def test_a_certificate_signed_by_a_weak_hash_is_refused() -> None:
    check = _checked(_sealed_by(authority().issue("Tire laboratory", digest=hashes.SHA224())))
    assert check.signature == "invalid"
    assert "SHA224" in check.why


@pytest.mark.parametrize("digest", ["sha1", "sha224"])
def test_a_weak_digest_is_no_seal(digest: str) -> None:
    from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter
    from pyhanko.sign import PdfSignatureMetadata, signers

    from toolkit.trust.seal.pdf import _signer

    sealed = io.BytesIO()
    metadata = PdfSignatureMetadata(field_name="Seal", md_algorithm=digest)
    signers.sign_pdf(
        IncrementalPdfFileWriter(io.BytesIO(plain_pdf())), metadata, _signer(key()), output=sealed
    )
    check = _checked(sealed.getvalue())
    assert check.signature == "invalid"
    assert "weak" in check.why


def test_a_certificate_that_does_not_belong_to_the_path_is_refused() -> None:
    signer = SealKey(
        private=key().private,
        certificate=key().certificate,
        intermediates=(authority().issue("Other").certificate,),
    )
    check = _checked(_sealed_by(signer))
    assert check.signature == "untrusted"
    assert "does not belong" in check.why


def test_an_enrolled_certificate_is_trusted_itself_but_makes_no_authority() -> None:
    enrolled: x509.Certificate = key().certificate
    assert _checked(sealed_pdf(), Trust(certificates=(enrolled,))).signature == "valid"
    other = _sealed_by(authority().issue("Another"))
    assert _checked(other, Trust(certificates=(enrolled,))).signature == "untrusted"
