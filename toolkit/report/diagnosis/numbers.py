"""Words and numbers in the text of a diagnosis: few digits, and powers of ten only where they are needed."""

from __future__ import annotations

import math
from collections.abc import Sequence

_PLAIN = 1e7


def few(value: float, digits: int = 3) -> str:
    """Return a number with its significant digits, those before the point never rounded away.

    >>> few(1112.4), few(0.012345), few(3e6), few(-469.68, 4), few(1.8118e8, 4)
    ('1112', '0.0123', '3000000', '-469.7', '1.812e+08')
    """
    if math.isfinite(value) and 10.0**digits <= abs(value) < _PLAIN:
        return f"{value:.0f}"
    return f"{value:.{digits}g}"


def over(channel: str, variables: Sequence[str]) -> str:
    """Return what an output's mismatch depends on; where only its size tells, that it is too large.

    >>> over("FY", ["SA", "FZ"]), over("FY", ["more than its stated noise"])
    ('FY over SA and FZ', 'FY is off by more than its stated noise')
    """
    names = " and ".join(variables)
    return f"{channel} is off by {names}" if names.startswith("more than") else f"{channel} over {names}"


# How small a chance is said to be: none is zero.


_LEAST = 1e-300


def chance(p_value: float, *, decimal_comma: bool = False) -> str:
    """Return a p-value in words for people.

    >>> chance(0.0312), chance(0.0)
    ('p = 0.031', 'p < 1e-300')
    """
    if math.isnan(p_value):
        return "p unknown"
    text = f"p = {p_value:.2g}" if p_value >= _LEAST else f"p < {_LEAST:g}"
    return text.replace(".", ",") if decimal_comma else text
