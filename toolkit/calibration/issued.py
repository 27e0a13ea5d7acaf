"""The digits in which a coefficient is issued: to a certificate, and to an acquisition program.

They follow from how far the coefficient's term reaches.
"""

from __future__ import annotations

from decimal import Decimal

_FEWEST_DIGITS = 5
_ROUNDING = 1e-5  # of the largest load


def issued_value(coefficient: float, extent: float, largest: float) -> float:
    """Return a coefficient in as few digits as its use allows, at least five.

    ``extent`` is the largest absolute value of its term in the session, ``largest`` the largest load: the
    rounding may move a load by at most 1e-5 of the largest.

    >>> issued_value(0.997193821, 500.0, 500.0)
    0.99719
    """
    for digits in range(_FEWEST_DIGITS, 17):
        value = float(f"{coefficient:.{digits}g}")
        if abs(value - coefficient) * extent <= _ROUNDING * largest:
            return value
    return coefficient


def issued_text(value: float) -> str:
    """Return an issued coefficient in the digits in which it was issued: at least five, a last zero too.

    A digit beyond the fifth is one that its use asked for, so it is no zero; `issued_value` chose them.

    >>> issued_text(244.7), issued_text(-1486.06), issued_text(0.0027)
    ('244.70', '-1486.06', '0.0027000')
    """
    number = Decimal(repr(value))
    place = number.adjusted() - _FEWEST_DIGITS + 1
    if not number:
        return "0"
    if not -5 < number.adjusted() < 16:  # as Python and acquisition programs write it
        return repr(value) if len(number.normalize().as_tuple().digits) > _FEWEST_DIGITS else f"{value:.4e}"
    shown = number.normalize()
    return format(
        shown.quantize(Decimal(1).scaleb(place)) if int(shown.as_tuple().exponent) > place else shown, "f"
    )
