"""The digits of a coefficient that a certificate prints and an acquisition program is given."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

FEWEST_DIGITS = 5
ROUNDING = 1e-5


def issued_value(coefficient: float, extent: float, largest: float) -> float:
    """Return a coefficient in as few digits as its use allows, at least five.

    ``extent`` is the largest absolute value of its term in the session, ``largest`` the largest load: the
    rounding may move a load by at most 1e-5 of the largest.

    >>> issued_value(0.997193821, 500.0, 500.0)
    0.99719
    """
    for digits in range(FEWEST_DIGITS, 17):
        value = float(f"{coefficient:.{digits}g}")
        if abs(value - coefficient) * extent <= ROUNDING * largest:
            return value
    return coefficient


def term_reach(terms: NDArray[np.float64], has_constant: bool) -> NDArray[np.float64]:
    """Return the range of each term over the rows; 1 for the constant."""
    reach: NDArray[np.float64] = np.ptp(terms, axis=0)
    if has_constant:
        reach[-1] = 1.0
    return reach
