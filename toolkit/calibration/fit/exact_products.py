"""Products of tall matrices without their rounding: matrices cut into parts whose products are exact.

A double has 53 bits. Where each factor of a product keeps only the leading ``bits`` of them, counted from
the largest value of its column, every product and every sum of ``rows`` products is a whole number of one
grid and below 2^53 of it: exact in any order, so that the fastest matrix product gives it. What is cut off is
small, and its products may round. Two parts carry a gradient to some 70 bits.

Reference: Ozaki, Ogita, Oishi, Rump, Numerical Algorithms 59 (2012) 95, error-free transformations of matrix
multiplication.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_MANTISSA = 53


def exact_bits(rows: int) -> int:
    """Return how many bits two factors may each keep so that a sum of ``rows`` products is exact.

    >>> exact_bits(1024)
    21
    """
    return (_MANTISSA - max(rows - 1, 1).bit_length()) // 2


def leading(values: NDArray[np.float64], bits: int) -> NDArray[np.float64]:
    """Return the leading bits of each line of (lines, rows), on a grid of 2^-bits of its largest value.

    What is left, ``values`` minus the result, is exact.
    """
    _, exponent = np.frexp(_largest(values))
    # Added to a number of this size, a value is rounded to the grid; taken away again, it stands there.
    size = np.ldexp(1.5, exponent + (_MANTISSA - 1 - bits))[:, None]
    moved: NDArray[np.float64] = values + size
    moved -= size
    return moved


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Residuals:
    """``high`` + ``low`` (loads, rows), the first cut to the bits that exact products allow."""

    high: NDArray[np.float64]
    low: NDArray[np.float64]

    @classmethod
    def of(cls, values: NDArray[np.float64], bits: int) -> Residuals:
        """Cut residuals (loads, rows)."""
        high = leading(values, bits)
        return cls(high=high, low=values - high)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CutDesign:
    """A design in two parts (terms, rows), ``high`` + ``low``, exactly."""

    high: NDArray[np.float64]
    low: NDArray[np.float64]
    bits: int

    @classmethod
    def of(cls, design: NDArray[np.float64]) -> CutDesign:
        """Cut a design (terms, rows)."""
        bits = exact_bits(design.shape[1])
        high = leading(design, bits)
        return cls(high=high, low=design - high, bits=bits)

    def residuals(self, loads: NDArray[np.float64], solution: NDArray[np.longdouble]) -> Residuals:
        """Return loads (loads, rows) minus solution (loads, terms) times design, to 70 bits or so."""
        x = np.asarray(solution, dtype=np.float64)
        _, of_terms = np.frexp(_largest(self.high))
        _, of_sums = np.frexp(np.abs(x) @ np.ldexp(1.0, of_terms))
        # One grid for the products of all terms: a small term's coefficient keeps fewer bits.
        grid = np.ldexp(1.0, of_sums[:, None] - _MANTISSA + 1 - of_terms[None, :] + self.bits)
        head = np.rint(x / grid) * grid
        fitted = head @ self.high
        left = loads - fitted
        # What that difference rounds away (Knuth, The Art of Computer Programming 2, 4.2.2, theorem B).
        back = loads - left
        lost = (loads - (left + back)) + (back - fitted)
        rest = np.asarray(solution - head, dtype=np.float64) @ self.high
        rest += x @ self.low
        high = leading(left - rest, self.bits)
        left -= high
        left -= rest
        left += lost
        return Residuals(high=high, low=left)

    def gradient(self, residuals: Residuals) -> NDArray[np.longdouble]:
        """Return the products of residuals and design (loads, terms)."""
        exact = residuals.high @ self.high.T
        rest = residuals.low @ self.high.T + (residuals.high + residuals.low) @ self.low.T
        return np.asarray(exact, dtype=np.longdouble) + rest


def _largest(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.maximum(values.max(axis=1), -values.min(axis=1)), dtype=np.float64)
