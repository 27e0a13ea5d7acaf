"""How small a chance is said to be: none is zero."""

from __future__ import annotations

import math

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
