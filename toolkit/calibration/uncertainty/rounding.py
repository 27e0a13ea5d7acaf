"""Rounding of an expanded uncertainty for a certificate: at most two significant digits (ILAC-P14)."""

from __future__ import annotations

import math
from decimal import ROUND_CEILING, ROUND_HALF_EVEN, Decimal

MOST_LOWERED = Decimal("0.05")


def round_uncertainty(U: float, *, digits: int = 2) -> str:
    """Return U in at most two significant digits, as decimal text without an exponent.

    ILAC-P14:09/2020 asks for at most two significant digits. Rounding is to nearest, and up where that would
    lower U by more than 5 % (EA-4/02 M, 6.3).

    >>> round_uncertainty(0.17984), round_uncertainty(1234.0), round_uncertainty(0.996)
    ('0.18', '1200', '1.0')
    >>> round_uncertainty(1.45, digits=1)
    '2'
    """
    if U == 0:
        return "0"
    if not (math.isfinite(U) and U > 0):
        return "not determined"
    whole, place = _rounded(U, digits)
    return format(whole.scaleb(place), "f")


def round_to_uncertainty(value: float, U: float, *, digits: int = 2) -> str:
    """Return a value to the last place of its rounded expanded uncertainty (GUM 7.2.6).

    >>> round_to_uncertainty(1184.6932, 0.17984), round_to_uncertainty(1184.6932, 1234.0)
    ('1184.69', '1200')
    """
    if not (math.isfinite(U) and U > 0 and math.isfinite(value)):
        return repr(float(value))
    place = last_place(U, digits=digits)
    # int drops the exponent of a zero, which would print as 0 where its neighbours print 0.00.
    whole = int(Decimal(repr(float(value))).scaleb(-place).to_integral_value(rounding=ROUND_HALF_EVEN))
    return format(Decimal(whole).scaleb(place) + 0, "f")


def last_place(U: float, *, digits: int = 2) -> int:
    """Return the power of ten of a rounded uncertainty's last digit (l of JCGM 101, 7.9.2).

    >>> last_place(0.17984), last_place(0.996), last_place(1234.0)
    (-2, -1, 2)
    """
    return _rounded(U, digits)[1]


def _rounded(U: float, digits: int) -> tuple[Decimal, int]:
    """Return the whole number of ``digits`` digits and the power of ten that it is multiplied by."""
    if digits not in (1, 2):
        raise ValueError("an uncertainty is stated in one or two significant digits")
    exact = Decimal(repr(float(U)))
    place = exact.adjusted() - digits + 1
    scaled = exact.scaleb(-place)
    whole = scaled.to_integral_value(rounding=ROUND_HALF_EVEN)
    if scaled - whole > MOST_LOWERED * scaled:
        whole = scaled.to_integral_value(rounding=ROUND_CEILING)
    if whole == 10**digits:
        return whole / 10, place + 1
    return whole, place
