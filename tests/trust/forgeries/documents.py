"""Sealed documents: bytes of every part, updates, wrapping, weak and foreign seals, another instrument's."""

from __future__ import annotations

import copy
import datetime as dt
import functools
import io
import re
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from cryptography.hazmat.primitives.asymmetric import rsa
from lxml import etree

from tests.calibration.calibration_factory import write_session
from tests.calibration.dcc.dcc_factory import REFERENCE, STANDARDS, plain_dcc, write_dcc
from tests.trust.forgeries.changes import Forgery, bytes_changed
from tests.trust.seal.authority import make_authority
from tests.trust.seal.seal_factory import (
    DAY,
    DCC,
    NOW,
    authority,
    key,
    plain_pdf,
    sealed_pdf,
    sealed_xml,
    trust,
)
from toolkit.calibration.session.read import read_session
from toolkit.errors import ToolkitError
from toolkit.trust.seal.key import SealKey
from toolkit.trust.seal.pdf import check_pdf, seal_pdf
from toolkit.trust.seal.xml import DS, check_xml, seal_xml

_AFTER = NOW + dt.timedelta(minutes=10)
_COUNT = 4  # places of each part: the seals' own tests look at some hundred


def forgeries() -> Iterator[Forgery]:
    """Yield forged PDFs and digital certificates."""
    for part, (first, last) in _pdf_parts().items():
        for what, data in bytes_changed(sealed_pdf(), first, last, _COUNT):
            yield _pdf(f"{part}: {what}", functools.partial(bytes, data))
    for part, (first, last) in _xml_parts().items():
        for what, data in bytes_changed(sealed_xml(), first, last, _COUNT):
            yield _xml(f"{part}: {what}", functools.partial(bytes, data))
    yield _pdf("incremental update", _updated)
    yield _pdf("bytes appended", lambda: sealed_pdf() + b"\n% note\n")
    yield _pdf("sealed twice", lambda: seal_pdf(sealed_pdf(), key(), reason="again"))
    for name, build in _WRAPPED.items():
        yield _xml(f"wrapped, {name}", functools.partial(_wrapped, build))
    for name, signer in _SIGNERS.items():
        yield _pdf(f"signer: {name}", functools.partial(_pdf_by, signer))
        yield _xml(f"signer: {name}", functools.partial(_xml_by, signer))
    for name, words in _OTHERS.items():
        yield Forgery(kind="DCC of another", what=name, accepted=functools.partial(_dcc_taken, words))


def _pdf(what: str, build: Callable[[], bytes]) -> Forgery:
    def accepted() -> bool:
        try:
            return check_pdf(build(), trust(), now=_AFTER).signature == "valid"
        except ToolkitError:
            return False

    return Forgery(kind="sealed PDF", what=what, accepted=accepted)


def _xml(what: str, build: Callable[[], bytes]) -> Forgery:
    def accepted() -> bool:
        try:
            return check_xml(build(), trust(), now=_AFTER).signature == "valid"
        except ToolkitError:
            return False

    return Forgery(kind="sealed DCC", what=what, accepted=accepted)


def _pdf_by(signer: Callable[[], SealKey]) -> bytes:
    return seal_pdf(plain_pdf(), signer(), reason="issued")


def _xml_by(signer: Callable[[], SealKey]) -> bytes:
    return seal_xml(DCC, signer())


def _pdf_parts() -> dict[str, tuple[int, int]]:
    match = re.search(rb"/ByteRange \[0 (\d+) (\d+) ", sealed_pdf())
    assert match is not None
    first, last = int(match[1]), int(match[2])
    end = first + 1 + len(sealed_pdf()[first + 1 : last - 1].rstrip(b"0"))
    return {
        "document": (9, len(plain_pdf())), "revision": (len(plain_pdf()), first), "message": (first + 1, end),
        "after the signature": (last, len(sealed_pdf())),
    }  # fmt: skip


def _xml_parts() -> dict[str, tuple[int, int]]:
    names = (b"dcc:values", b"ds:SignedInfo", b"ds:SignatureValue", b"ds:KeyInfo", b"xades:SignedProperties")
    parts = {}
    for name in names:
        first, last = sealed_xml().find(b"<" + name), sealed_xml().find(b"</" + name)
        if 0 <= first < last:
            parts[name.decode()] = (first, last)
    return parts


def _updated() -> bytes:
    from pyhanko.pdf_utils.generic import NameObject, TextStringObject
    from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter

    writer = IncrementalPdfFileWriter(io.BytesIO(sealed_pdf()))
    writer.root[NameObject("/Note")] = TextStringObject("U = 0.01 N")
    writer.update_root()
    out = io.BytesIO()
    writer.write(out)
    return out.getvalue()


Build = Callable[[etree._Element, etree._Element], etree._Element]


def _wrapped(build: Build) -> bytes:
    """Return a forged document beside the signed one, in one of the ways of signature wrapping."""
    root = etree.fromstring(sealed_xml())
    forged = etree.fromstring(DCC.replace(b"4711", b"0815"))
    return bytes(etree.tostring(build(root, forged), xml_declaration=True, encoding="UTF-8"))


def _signed_inside(root: etree._Element, forged: etree._Element) -> etree._Element:
    forged.append(root)
    return forged


def _signature_moved(root: etree._Element, forged: etree._Element) -> etree._Element:
    signature = root.find(f"{{{DS}}}Signature")
    assert signature is not None
    forged.append(copy.deepcopy(signature))
    return forged


def _in_object(root: etree._Element, forged: etree._Element) -> etree._Element:
    moved = _signature_moved(root, forged)
    signature = moved.find(f"{{{DS}}}Signature")
    assert signature is not None
    etree.SubElement(signature, f"{{{DS}}}Object").append(root)
    return moved


def _forged_inside(root: etree._Element, forged: etree._Element) -> etree._Element:
    root.insert(0, forged)
    return root


def _two_signatures(root: etree._Element, forged: etree._Element) -> etree._Element:
    del forged
    signature = root.find(f"{{{DS}}}Signature")
    assert signature is not None
    root.append(copy.deepcopy(signature))
    return root


_WRAPPED: dict[str, Build] = {
    "the signed document inside": _signed_inside, "the signature moved": _signature_moved,
    "the signed document in an object": _in_object, "the forged document inside": _forged_inside,
    "two signatures": _two_signatures,
}  # fmt: skip


def _short() -> SealKey:
    return authority().issue("x", private=rsa.generate_private_key(public_exponent=65537, key_size=2048))


_SIGNERS: dict[str, Callable[[], SealKey]] = {
    "another authority": lambda: make_authority().issue("Tire laboratory"),
    "expired": lambda: authority().issue("x", first=NOW - 9 * DAY, last=NOW - DAY),
    "not yet valid": lambda: authority().issue("x", first=NOW + DAY, last=NOW + 9 * DAY),
    "RSA of 2048 bits": _short,
}

_OTHERS: dict[str, dict[str, str]] = {
    "instrument": {"serial": "FS-0815"},
    "instrument, by one digit": {"serial": "FS-4712"},
    "time, after the session": {"calibrated": "2099-01-01", "due": "2100-01-01"},
    "time, due before the session": {"due": "2025-07-01"},
}


def _dcc_taken(words: dict[str, str]) -> bool:
    """Tell whether a session takes its numbers from a sealed certificate that is not its standard's."""
    with tempfile.TemporaryDirectory() as place:
        path = write_session(Path(place), tail=REFERENCE + 'standard = "Force standard, FS-4711"\n')
        write_dcc(path.parent, plain_dcc(**words))
        try:
            read_session(path, standards=STANDARDS)
        except ToolkitError:
            return False
    return True
