"""PAdES: a PDF is sealed as a whole, and whoever changes or adds one byte breaks the seal.

What a document carries enters it before the seal, as a revision of its own: the attachments, the mark of
PDF/A-3 where the file was PDF/A-2, the code on its last page. The seal is the last revision (ETSI EN
319 142-1, B-B, with a time stamp B-T). A sealed file has one signature, which covers all of it. Later
revisions are never looked into: a file that has any is not the one that was sealed.

Attachments are associated files of PDF/A-3 (ISO 19005-3).
"""

from __future__ import annotations

import datetime as dt
import io
import logging
import re
from collections.abc import Iterator, Mapping
from itertools import islice
from typing import TYPE_CHECKING, Any

from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

from toolkit.errors import TrustError
from toolkit.trust.seal.check import Forged, SealCheck, Sealed, judged
from toolkit.trust.seal.cms import Message, check_message
from toolkit.trust.seal.qr import Place, draw, qr_modules
from toolkit.trust.seal.x509 import Trust

if TYPE_CHECKING:
    from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter
    from pyhanko.pdf_utils.reader import PdfFileReader
    from pyhanko.sign.timestamps import TimeStamper

    from toolkit.trust.seal.key import SealKey

FIELD = "Seal"
_MOST_FIELDS = 1000
_RANGE = re.compile(rb"/ByteRange")
_HEX = re.compile(rb"<(?:[0-9a-f]+|[0-9A-F]+)>")


def seal_pdf(
    data: bytes,
    key: SealKey,
    *,
    reason: str,
    attachments: Mapping[str, bytes] | None = None,
    stamps: TimeStamper | None = None,
) -> bytes:
    """Return a PDF with its seal, an invisible signature that allows no change.

    Parameters
    ----------
    reason : what the seal means, as readers show it
    attachments : files that go into the PDF as associated data, by name; JSON by their ending
    stamps : an RFC 3161 client of pyHanko; a server that does not answer is an error

    Raises
    ------
    TrustError
        ``seal``: no PDF that can be sealed, or one that has a seal already
    """
    from pyhanko.pdf_utils.misc import PdfError
    from pyhanko.sign import PdfSignatureMetadata, PdfSigner
    from pyhanko.sign.fields import MDPPerm, SigSeedSubFilter
    from pyhanko.sign.general import SigningError
    from pyhanko.sign.timestamps.common_utils import TimestampRequestError

    try:
        writer = pdf_writer(data)
        if writer.prev.embedded_signatures:
            raise _unsealable("the PDF has a seal already", "a signature in the file", "a PDF without one")
        attach(writer, attachments or {})
        metadata = PdfSignatureMetadata(
            field_name=FIELD, md_algorithm="sha256", subfilter=SigSeedSubFilter.PADES, certify=True,
            docmdp_permissions=MDPPerm.NO_CHANGES, reason=reason, name=key.name,
        )  # fmt: skip
        sealed = io.BytesIO()
        PdfSigner(metadata, _signer(key), timestamper=stamps).sign_pdf(writer, output=sealed)
    except TimestampRequestError as error:
        raise _unsealable(
            "the time-stamp server gave no stamp", str(error), "an RFC 3161 response"
        ) from error
    except (PdfError, SigningError, OSError, ValueError) as error:
        raise _unsealable("the PDF cannot be sealed", str(error), "a PDF that LibreOffice wrote") from error
    return sealed.getvalue()


def proved_pdf(data: bytes, files: Mapping[str, bytes], code: bytes, place: Place) -> bytes:
    """Return a PDF that carries files and, on a page, a QR code; it can be sealed then.

    Raises
    ------
    TrustError
        ``seal``: no PDF that can be changed; ``proof-size``
    """
    from pyhanko.pdf_utils.misc import PdfError

    modules, changed = qr_modules(code), io.BytesIO()
    try:
        writer = pdf_writer(data)
        attach(writer, files)
        draw(writer, modules, place)
        writer.write(changed)
    except (PdfError, OSError, ValueError) as error:
        raise _unsealable(
            "the PDF cannot carry a proof", str(error), "a PDF that LibreOffice wrote"
        ) from error
    return changed.getvalue()


def carried_by(data: bytes) -> dict[str, bytes]:
    """Return the files that a PDF carries, by name, sealed or not: what they say has yet to be proved.

    Raises
    ------
    TrustError
        ``unreadable-document``: no PDF that can be read
    """
    from pyhanko.pdf_utils.reader import PdfFileReader

    try:
        return attachments_of(PdfFileReader(io.BytesIO(data), strict=True))
    except Exception as error:
        # Hostile bytes: a file that cannot be read carries nothing.
        raise TrustError(
            "the PDF cannot be read", where="PDF", got=f"{type(error).__name__}: {error}"[:200],
            expected="a PDF as it was issued", next_step="take the document as it was issued",
            rule="unreadable-document",
        ) from error  # fmt: skip


def check_pdf(data: bytes, trust: Trust, *, now: dt.datetime | None = None) -> SealCheck:
    """Return whether the seal of a PDF holds; nothing of the file is used but what the signature covers.

    Raises
    ------
    TrustError
        ``unreadable-document``: no PDF
    """
    if not data.startswith(b"%PDF-"):
        raise TrustError(
            "the file is no PDF", where="first bytes", got=repr(data[:8]), expected="%PDF-",
            next_step="name the file as it was issued", rule="unreadable-document",
        )  # fmt: skip
    # What a library warns of in a damaged file is told by the check's own answer.
    logging.getLogger("pyhanko").setLevel(logging.CRITICAL)
    try:
        sealed = _signature(data, trust)
    except Forged as error:
        return SealCheck(signature="invalid", why=str(error))
    if sealed is None:
        return SealCheck(signature="unsigned", why="the PDF has no seal")
    return judged(sealed, trust, now=now)


def _signature(data: bytes, trust: Trust) -> Sealed | None:
    from pyhanko.pdf_utils.misc import PdfError

    try:
        return _read(data, trust)
    except Forged:
        raise
    except PdfError as error:
        raise Forged(f"the file or its signature is damaged: {' '.join(str(error).split())[:200]}") from error
    except Exception as error:
        # Hostile bytes: what cannot be checked does not hold.
        raise Forged(f"the file or its signature cannot be read: {type(error).__name__}") from error


def _read(data: bytes, trust: Trust) -> Sealed | None:
    from pyhanko.pdf_utils.generic import parse_pdf_date
    from pyhanko.pdf_utils.reader import PdfFileReader

    reader = PdfFileReader(io.BytesIO(data), strict=True)
    if reader.encrypted:
        raise Forged("the PDF is encrypted")
    signatures = _signatures(reader)
    if not signatures:
        if _RANGE.search(data):
            raise Forged("a signature that no field refers to: the file was changed after it was sealed")
        return None
    if len(signatures) > 1:
        raise Forged(f"{len(signatures)} signatures: only the last covers the file, and it is not the seal")
    (seal,) = signatures
    if reader.xrefs.hybrid_xrefs_present:
        raise Forged("readers differ about which objects the file has")
    first, second = _gap(data, seal)
    message = check_message(_message(data[first:second], seal), (data[:first], data[second:]))
    at, stamped = message.at or parse_pdf_date(_part(seal, "/M"), strict=True), False
    if message.stamp is not None:
        at, stamped = _stamped(message, at, trust)
    if at.tzinfo is None:
        raise Forged("the signature states no time")
    return Sealed(
        signer=message.signer, intermediates=message.intermediates, at=at, stamped=stamped,
        attachments=attachments_of(reader),
    )  # fmt: skip


def _signatures(reader: PdfFileReader) -> list[Any]:
    """Return the signatures of the file's form."""
    fields = _fields(_part(_part(reader.root, "/AcroForm", {}), "/Fields", ()))
    counted = list(islice(fields, _MOST_FIELDS + 1))
    if len(counted) > _MOST_FIELDS:  # a few that contain one another twice would take for ever
        raise Forged(f"more than {_MOST_FIELDS} fields in the form of a document that has none to fill in")
    return [field["/V"] for field, kind in counted if kind == "/Sig" and "/V" in field]


def _fields(fields: Any, kind: object = None) -> Iterator[tuple[Any, object]]:
    """Yield fields with their kinds; one below another has its kind."""
    for place in range(len(fields)):
        field = fields[place]
        own = _part(field, "/FT", kind)
        yield field, own
        yield from _fields(_part(field, "/Kids", ()), own)


def _part(entries: Any, key: str, otherwise: Any = None) -> Any:
    """Return an entry, wherever in the file it stands."""
    return entries[key] if key in entries else otherwise  # noqa: SIM401  its `get` returns a reference


def _gap(data: bytes, seal: Any) -> tuple[int, int]:
    """Return where the signature itself lies; everything else in the file must be what it covers."""
    first, length, second, rest = (int(n) for n in seal.raw_get("/ByteRange"))
    if first != 0 or length <= 0 or second <= length or second + rest != len(data):
        raise Forged(
            f"the signature covers {length + rest} of {len(data)} bytes: something was added after it"
        )
    if len(_RANGE.findall(data)) != 1:
        raise Forged("the file speaks of more than one signature")
    return length, second


def _message(contents: bytes, seal: Any) -> bytes:
    """Return the signature's own bytes, the only ones that it does not cover."""
    if not _HEX.fullmatch(contents):
        raise Forged("more than the signature itself lies outside of what it covers")
    raw = bytes.fromhex(contents[1:-1].decode())
    size = _der_length(raw)
    if raw[size:].strip(b"\0") or raw != seal.raw_get("/Contents").original_bytes:
        raise Forged("bytes beside the signature were changed")
    return raw[:size]


def _stamped(message: Message, at: dt.datetime, trust: Trust) -> tuple[dt.datetime, bool]:
    """Return the time that a trusted time stamp proves, else the one that the signer states."""
    from toolkit.trust.seal.stamps import check_stamp

    try:
        stamp = check_stamp(message.stamp or b"", message.value, trust)
    except TrustError as error:
        raise Forged("the time stamp is not of this signature") from error
    return (stamp.at, True) if stamp.state == "valid" else (at, False)


def _der_length(raw: bytes) -> int:
    if len(raw) < 2 or raw[0] != 0x30:
        raise Forged("the signature is no CMS message")
    if raw[1] < 0x80:
        return 2 + raw[1]
    count = raw[1] & 0x7F
    size = int.from_bytes(raw[2 : 2 + count])
    if not 1 <= count <= 4 or size < 0x80 or raw[2] == 0:
        raise Forged("the signature is not in DER")
    return 2 + count + size


def pdf_writer(data: bytes) -> IncrementalPdfFileWriter:
    """Return a writer that adds a revision to a PDF/A and leaves what the file says of itself alone."""
    from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter

    class Writer(IncrementalPdfFileWriter):
        """Stays PDF 1.7, which PDF/A-2 and 3 are made of."""

        def ensure_output_version(self, version: tuple[int, int]) -> None:
            super().ensure_output_version(min(version, (1, 7)))  # type: ignore[no-untyped-call]

        def _update_meta(self) -> None:
            """Leave the metadata alone: pyHanko would write its own, without the mark of PDF/A."""

        def register_extension(self, ext: Any) -> None:
            if ext.base_version == "/1.7":
                super().register_extension(ext)

    return Writer(io.BytesIO(data))


def _signer(key: SealKey) -> Any:
    from asn1crypto import keys
    from asn1crypto import x509 as asn1
    from pyhanko.sign.signers import SimpleSigner
    from pyhanko_certvalidator.registry import SimpleCertificateStore

    chain = [asn1.Certificate.load(c.public_bytes(Encoding.DER)) for c in key.chain]
    private = key.private.private_bytes(Encoding.DER, PrivateFormat.PKCS8, NoEncryption())
    store = SimpleCertificateStore()
    store.register_multiple(chain[1:])
    return SimpleSigner(
        signing_cert=chain[0],
        signing_key=keys.PrivateKeyInfo.load(private),
        cert_registry=store,
        embed_roots=False,
    )


def _unsealable(what: str, got: str, expected: str) -> TrustError:
    return TrustError(
        what, where="PDF", got=" ".join(got.split())[:200], expected=expected,
        next_step="nothing was sealed; issue the document again", rule="seal",
    )  # fmt: skip


_PART = re.compile(rb"(<pdfaid:part>|pdfaid:part=['\"])([12])(?=[<'\"])")
_TYPES = {".json": "application/json", ".xml": "application/xml"}
_MOST_BYTES = 16 * 2**20


def attach(writer: IncrementalPdfFileWriter, files: Mapping[str, bytes]) -> None:
    """Attach files by name and, where the file says PDF/A-2, say PDF/A-3: only that may carry any file."""
    from pyhanko.pdf_utils import generic
    from pyhanko.pdf_utils.embed import EmbeddedFileObject, EmbeddedFileParams, FileSpec, embed_file

    if not files:
        return
    now = dt.datetime.now(dt.UTC)
    for name, data in files.items():
        kind = _TYPES.get("." + name.rpartition(".")[2], "application/octet-stream")
        params = EmbeddedFileParams(creation_date=now, modification_date=now)
        embedded = EmbeddedFileObject.from_file_data(writer, data, mime_type=kind, params=params)
        embed_file(
            writer, FileSpec(file_spec_string=name, file_name=name, embedded_data=embedded, description=name)
        )
        # By pyHanko's own argument the file would become PDF 2.0, which PDF/A-3 is not.
        specification = writer.root["/Names"]["/EmbeddedFiles"]["/Names"].raw_get(-1)
        described = specification.get_object()
        described["/AFRelationship"] = generic.NameObject("/Data")
        if "/AF" not in writer.root:
            writer.root["/AF"] = generic.ArrayObject()
        writer.root["/AF"].append(specification)
    writer.update_root()
    _say_part_3(writer)


def attachments_of(reader: PdfFileReader) -> dict[str, bytes]:
    """Return the files that a PDF carries, by name.

    Raises
    ------
    Forged
        they are too large
    """
    names: Any = reader.root
    for key in ("/Names", "/EmbeddedFiles", "/Names"):
        if key not in names:
            return {}
        names = names[key]
    files: dict[str, bytes] = {}
    for index in range(0, len(names) - 1, 2):
        specification: Any = names[index + 1]
        data = specification["/EF"]["/F"].data
        if len(data) > _MOST_BYTES:
            raise Forged("a file in the PDF is larger than any that is attached to a certificate")
        files[str(names[index])] = data
    return files


def _say_part_3(writer: IncrementalPdfFileWriter) -> None:
    from pyhanko.pdf_utils import generic

    if "/Metadata" not in writer.root or not _PART.search(writer.root["/Metadata"].data):
        return
    stream = generic.StreamObject(
        {"/Type": generic.NameObject("/Metadata"), "/Subtype": generic.NameObject("/XML")},
        stream_data=_PART.sub(rb"\g<1>3", writer.root["/Metadata"].data),
    )
    writer.root["/Metadata"] = writer.add_object(stream)
    writer.update_root()
