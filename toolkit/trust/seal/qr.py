"""A proof on paper: bytes as a QR code (ISO/IEC 18004) on a page of a PDF, read by any telephone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from toolkit.errors import TrustError

if TYPE_CHECKING:
    from pyhanko.pdf_utils.incremental_writer import IncrementalPdfFileWriter

MOST_BYTES = 2331
"""What the largest symbol holds at level M, which repairs 15 % of it."""
QUIET = 4
"""Modules of white around a symbol."""
_PIXELS = 8  # of a module's side: viewers blur a picture of few pixels, and a row is whole bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """A square on a page (from 0): its distance from the left and upper edge, and its side, in points."""

    page: int
    left: float
    top: float
    size: float


def qr_modules(data: bytes) -> tuple[tuple[bool, ...], ...]:
    """Return the symbol of some bytes, row by row, True for black, without its quiet zone.

    Raises
    ------
    TrustError
        ``proof-size``: more bytes than a symbol holds
    """
    import segno

    if len(data) > MOST_BYTES:
        raise TrustError(
            "the proof does not fit into a QR code", where="QR code", got=f"{len(data)} bytes",
            expected=f"at most {MOST_BYTES}", next_step="print its compact form; the whole is in the PDF",
            rule="proof-size",
        )  # fmt: skip
    symbol = segno.make_qr(data, mode="byte", error="m", boost_error=False)
    return tuple(tuple(bool(module) for module in row) for row in symbol.matrix)


def draw(writer: IncrementalPdfFileWriter, modules: Sequence[Sequence[bool]], place: Place) -> None:
    """Draw a symbol with its quiet zone into a square of a page.

    It is a picture in one grey channel, as PDF/A allows it, and no part of the tagged text.
    """
    from pyhanko.pdf_utils import generic

    name = generic.NameObject
    side = _PIXELS * (len(modules) + 2 * QUIET)
    white, blank = [False] * QUIET, [[False] * (len(modules) + 2 * QUIET)] * QUIET
    rows = [*blank, *([*white, *row, *white] for row in modules), *blank]
    picture = generic.StreamObject(
        {
            name("/Type"): name("/XObject"),
            name("/Subtype"): name("/Image"),
            name("/Width"): generic.NumberObject(side),
            name("/Height"): generic.NumberObject(side),
            name("/ColorSpace"): name("/DeviceGray"),
            name("/BitsPerComponent"): generic.NumberObject(1),
        },
        stream_data=b"".join(_PIXELS * _packed(row) for row in rows),
    )
    picture.compress()
    page = writer.find_page_for_modification(place.page)[0].get_object()
    left, _, _, top = (float(edge) for edge in _inherited(page, "/CropBox") or _inherited(page, "/MediaBox"))
    matrix = (
        f"{place.size:.3f} 0 0 {place.size:.3f} {left + place.left:.3f} {top - place.top - place.size:.3f}"
    )
    # Whatever the page has left behind of its own state is taken back first.
    drawing = f"\nQ /Artifact BMC q {matrix} cm /LedgerProof Do Q EMC\n".encode()
    objects = generic.DictionaryObject({name("/LedgerProof"): writer.add_object(picture)})
    resources = generic.DictionaryObject({name("/XObject"): objects})
    before = writer.add_object(generic.StreamObject(stream_data=b"q\n"))
    writer.add_stream_to_page(place.page, before, prepend=True)
    after = writer.add_object(generic.StreamObject(stream_data=drawing))
    writer.add_stream_to_page(place.page, after, resources=resources)


def _packed(row: Sequence[bool]) -> bytes:
    """Return a row of pixels, one bit each, 1 for white."""
    bits = "".join(_PIXELS * ("0" if black else "1") for black in row)
    return int(bits, 2).to_bytes(len(bits) // 8, "big")


def _inherited(page: Any, key: str) -> Any:
    """Return an entry of a page, which may stand above it in the tree of pages."""
    if key in page:
        return page[key]
    return _inherited(page["/Parent"], key) if "/Parent" in page else None
