"""The bytes of a proof stand in the picture, module by module."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from toolkit.errors import TrustError
from toolkit.trust.seal.qr import MOST_BYTES, qr_png


def _modules(data: bytes) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    picture = np.asarray(Image.open(io.BytesIO(qr_png(data, module_px=2))).convert("L"))
    return picture[::2, ::2] < 128


def test_the_picture_has_finder_patterns_and_a_quiet_zone() -> None:
    modules = _modules(b"m15.calibrations 41")
    assert not modules[:4].any()
    assert not modules[:, :4].any()
    finder = modules[4:11, 4:11]
    # ISO/IEC 18004, 6.3.3: concentric squares of 7, 5 and 3 modules.
    assert finder[0].all()
    assert not finder[1, 1:6].any()
    assert finder[2:5, 2:5].all()


def test_two_kilobytes_fit_and_the_largest_symbol_has_177_modules() -> None:
    assert _modules(b"\x00\xff" * 1024).shape[0] <= 177 + 8
    assert _modules(b"a" * MOST_BYTES).shape == (185, 185)


def test_more_is_refused_and_the_same_bytes_are_the_same_picture() -> None:
    with pytest.raises(TrustError) as caught:
        qr_png(b"a" * (MOST_BYTES + 1))
    assert caught.value.rule == "proof-size"
    assert qr_png(b"proof") == qr_png(b"proof")
