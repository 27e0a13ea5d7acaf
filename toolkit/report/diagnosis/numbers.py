"""Words and numbers in the text of a diagnosis: few digits, and powers of ten only where they are needed."""

from __future__ import annotations

import math
from collections.abc import Sequence

_PLAIN = 1e7
_DECADES = 100.0  # from one end of an interval to the other: its half width rounds the value away


def few(value: float, digits: int = 3) -> str:
    """Return a number with its significant digits, those before the point never rounded away.

    >>> few(1112.4), few(0.012345), few(3e6), few(-469.68, 4), few(1.8118e8, 4)
    ('1112', '0.0123', '3000000', '-469.7', '1.812e+08')
    """
    if math.isfinite(value) and 10.0**digits <= abs(value) < _PLAIN:
        return f"{value:.0f}"
    return f"{value:.{digits}g}"


UNRESOLVED = "not resolved"


def rounded(value: float, interval: tuple[float, float] | None) -> tuple[str, str]:
    """Return a fitted value and its interval, to the digits that the interval knows; no interval is no text.

    >>> rounded(0.158312, (0.15511, 0.16149)), rounded(1.667e-18, (-0.0034, 0.0034))
    (('0.1583', '0.1551 to 0.1615'), ('0.0000', '-0.0034 to 0.0034'))
    >>> rounded(5463.5, (5120.0, 5800.0)), rounded(0.2, None)
    (('5460', '5120 to 5800'), ('0.2', ''))

    Of a size that is known to a power of ten or two, each number has its own digits:

    >>> rounded(0.368, (0.00012, 1100.0))
    ('0.37', '0.00012 to 1100')

    A size that cannot be negative, of which the interval leaves nothing but that it is small, has no digits:

    >>> rounded(1.28e-17, (0.0, 3.1e-5)), rounded(2e-6, (0.0, 0.31))
    (('not resolved', 'below 3.1e-05'), ('not resolved', 'below 0.31'))
    """
    if interval is None:
        return few(value, 4), ""
    low, high = interval
    if low > 0 and high > _DECADES * low:
        return few(value, 2), f"{few(low, 2)} to {few(high, 2)}"
    half = max(high - value, value - low)
    if not (math.isfinite(half) and half > 0):
        return few(value, 4), f"{few(low, 4)} to {few(high, 4)}"
    place = math.floor(math.log10(half)) - 1  # the second digit of the interval's half
    size = max(abs(number) for number in (value, low, high))
    if size >= _PLAIN or (place < -6 and size < 1e-3):
        if low == 0 and value < 10.0**place:
            return UNRESOLVED, f"below {few(high, 2)}"
        digits = max(math.floor(math.log10(size)) - place + 1, 2)
        return f"{value:.{digits}g}", f"{low:.{digits}g} to {high:.{digits}g}"

    def text(number: float) -> str:
        at = round(number, -place)
        return f"{at + 0.0:.{max(-place, 0)}f}"

    if low == 0 and float(text(value)) == 0:
        return UNRESOLVED, f"below {few(high, 2)}"
    return text(value), f"{text(low)} to {text(high)}"


_REASONS = {"more than": "is off by", "a ": "leaves"}


def over(channel: str, variables: Sequence[str], reason: str = "") -> str:
    """Return what an output's mismatch depends on, and which line or event it is; or the reason alone.

    >>> over("FY", ["SA", "FZ"]), over("FY", [], "more than its stated noise"), over("FY", [], "a slow rest")
    ('FY over SA and FZ', 'FY is off by more than its stated noise', 'FY leaves a slow rest')
    >>> over("FY", ["time"], "a line at 24 Hz")
    'FY over time (a line at 24 Hz)'
    >>> over("FY", ["FY"]), over("FY", ["FY", "SA"]), over("FY", ["a", "v"])
    ('FY over its own size', 'FY over its own size and SA', 'FY over a and v')
    """
    names = " and ".join("its own size" if name == channel else name for name in variables)
    # Answers of earlier versions have the reason among the variables.
    if len(variables) == 1 and names.startswith(tuple(_REASONS)):
        reason, names = names, ""
    if names:
        return f"{channel} over {names} ({reason})" if reason else f"{channel} over {names}"
    verb = next((verb for start, verb in _REASONS.items() if reason.startswith(start)), "over")
    return f"{channel} {verb} {reason or names}"


# How small a chance is said to be: none is zero.


_LEAST = 1e-300


def chance(p_value: float) -> str:
    """Return a p-value in words for people.

    >>> chance(0.0312), chance(0.0)
    ('p = 0.031', 'p < 1e-300')
    """
    if math.isnan(p_value):
        return "p unknown"
    return f"p = {p_value:.2g}" if p_value >= _LEAST else f"p < {_LEAST:g}"
