"""The bytes of a proof stand in the symbol, and the symbol on the page, module by module."""

from __future__ import annotations

import io

import numpy as np
import pytest

from tests.trust.seal.seal_factory import plain_pdf
from toolkit.errors import TrustError
from toolkit.trust.seal.pdf import carried_by, proved_pdf
from toolkit.trust.seal.qr import MOST_BYTES, QUIET, Place, qr_modules


def _modules(data: bytes) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    return np.array(qr_modules(data))


def test_the_symbol_has_finder_patterns() -> None:
    finder = _modules(b"m15.calibrations 41")[:7, :7]
    # ISO/IEC 18004, 6.3.3: concentric squares of 7, 5 and 3 modules.
    assert finder[0].all()
    assert not finder[1, 1:6].any()
    assert finder[2:5, 2:5].all()


def test_two_kilobytes_fit_and_the_largest_symbol_has_177_modules() -> None:
    assert _modules(b"\x00\xff" * 1024).shape[0] <= 177
    assert _modules(b"a" * MOST_BYTES).shape == (177, 177)


def test_more_is_refused_and_the_same_bytes_are_the_same_picture() -> None:
    with pytest.raises(TrustError) as caught:
        qr_modules(b"a" * (MOST_BYTES + 1))
    assert caught.value.rule == "proof-size"
    assert qr_modules(b"proof") == qr_modules(b"proof")


def test_the_page_shows_the_symbol_with_its_quiet_zone_and_the_pdf_carries_the_file() -> None:
    from pyhanko.pdf_utils.reader import PdfFileReader

    place = Place(page=0, left=50, top=60, size=170)
    pdf = proved_pdf(plain_pdf(), {"toolkit.json": b"{}"}, b"proof", place)
    assert carried_by(pdf) == {"toolkit.json": b"{}"}
    page = PdfFileReader(io.BytesIO(pdf)).root["/Pages"]["/Kids"][0]
    picture = page["/Resources"]["/XObject"]["/LedgerProof"]
    side = int(picture["/Width"])
    pixels = np.unpackbits(np.frombuffer(picture.data, np.uint8)).reshape(side, side) == 0
    scale = side // (len(qr_modules(b"proof")) + 2 * QUIET)
    shown = pixels[::scale, ::scale]
    assert (np.kron(shown, np.ones((scale, scale), bool)) == pixels).all()
    assert (shown[QUIET:-QUIET, QUIET:-QUIET] == _modules(b"proof")).all()
    assert not shown[:QUIET].any()
    assert not shown[:, -QUIET:].any()
    drawn = page["/Contents"][-1].data
    # From the page's lower edge: 842 - 60 - 170.
    assert b"170.000 0 0 170.000 50.000 612.000 cm" in drawn
