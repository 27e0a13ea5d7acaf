"""A proof on paper: bytes as a QR code (ISO/IEC 18004), read by any telephone."""

from __future__ import annotations

import io

from toolkit.errors import TrustError

MOST_BYTES = 2331
"""What the largest symbol holds at level M, which repairs 15 % of it."""


def qr_png(data: bytes, *, module_px: int = 4) -> bytes:
    """Return the symbol of some bytes as a PNG with its quiet zone of four modules.

    ``module_px`` is the size of a module in pixels. The same bytes give the same picture.

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
    picture = io.BytesIO()
    segno.make_qr(data, mode="byte", error="m", boost_error=False).save(
        picture, kind="png", scale=module_px, border=4
    )
    return picture.getvalue()
