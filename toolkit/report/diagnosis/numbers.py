"""Numbers in the text of a diagnosis: few digits, and powers of ten only where a reader needs them."""

from __future__ import annotations

import math

_PLAIN = 1e7


def few(value: float, digits: int = 3) -> str:
    """Return a number with its significant digits, those before the point never rounded away.

    >>> few(1112.4), few(0.012345), few(3e6), few(-469.68, 4), few(1.8118e8, 4)
    ('1112', '0.0123', '3000000', '-469.7', '1.812e+08')
    """
    if math.isfinite(value) and 10.0**digits <= abs(value) < _PLAIN:
        return f"{value:.0f}"
    return f"{value:.{digits}g}"
