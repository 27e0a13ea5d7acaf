"""Printed digits: how far a value in a file may lie from the one that was measured.

The acquisition program prints a fixed number of digits, and a workbook keeps no trailing zeros. So the last
printed place of a value is the finest that occurs in its column among values of the same decade; where
that takes 15 or more significant digits, the file holds full doubles and nothing was rounded.

A program that prints into a field of fixed width has one place less beside a minus sign (-0.35393, 371.3554
and -182.415 in Figure 4.4 of the source document are all of eight characters). So where a decade holds both
signs, and six or more values of one of them never show the finest place, those have the place that they show:
by chance that happens to one in a million columns whose values were all printed alike.
"""

from __future__ import annotations

import math
from decimal import Decimal
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from toolkit.recording.model import Series

FULL_DIGITS = 15
_FEW = 6
_FULL = 999
_SMALL = -8  # below this decade the powers of ten that are needed are no longer exact in a double
_TEN = 10.0 ** np.arange(23)


def half_last_place(values: ArrayLike) -> NDArray[np.float64]:
    """Return half a unit of the last printed place of every value, 0 where it is a full double.

    Parameters
    ----------
    values : (rows,) a column, or (rows, columns); finite

    Returns
    -------
    the same shape, in the unit of ``values``. A zero has the finest place of its column.

    Examples
    --------
    >>> half_last_place([98.59261, 98.5926, 101.25]).tolist()
    [5e-06, 5e-06, 0.005]
    >>> half_last_place([1 / 3, 0.5]).tolist()
    [0.0, 0.0]
    """
    given = np.asarray(values, dtype=np.float64)
    table = given.reshape(len(given), math.prod(given.shape[1:]))
    half = np.zeros(table.shape)
    for column in range(table.shape[1]):
        _column(table[:, column], half[:, column])
    return half.reshape(given.shape)


def rounding(series: Series) -> NDArray[np.float64]:
    """Return how far each value may lie from the one that was measured (rows,), in the channel's unit.

    Half a unit of its last printed place, or half the step in which a binary file stores it if that is more.
    """
    printed = half_last_place(series.values)
    return printed if series.half is None else np.maximum(printed, series.half)


def _column(values: NDArray[np.float64], half: NDArray[np.float64]) -> None:
    size = np.abs(values)
    zero = size == 0
    any_zero = bool(zero.any())
    if bool(zero.all()):  # also of an empty column
        return
    mixed = bool(values.min() < 0 < values.max())
    decade = _decades(np.where(zero, 1.0, size) if any_zero else size)
    smallest = np.inf
    low, high = int(decade.min()), int(decade.max())
    for one in range(low, high + 1) if high - low < 8 else np.unique(decade).tolist():
        here = slice(None) if low == high else (decade == one)
        group = size[here]
        if any_zero:
            group = group[group > 0]
        if not len(group):
            continue
        place = _half_of(group, one)
        half[here] = place
        smallest = min(smallest, place)
        if mixed and place:
            inside = np.ones(len(values), dtype=bool) if isinstance(here, slice) else here
            for side in (inside & (values < 0), inside & (values > 0)):
                if _FEW <= int(np.count_nonzero(side)) < len(group):
                    half[side] = _half_of(size[side], one)
    if any_zero:
        half[zero] = smallest


def _decades(size: NDArray[np.float64]) -> NDArray[np.int64]:
    # floor(log10), mended where the logarithm was rounded up to a whole number.
    decade = np.floor(np.log10(size)).astype(np.int64)
    return np.where(10.0 ** decade.clip(-307).astype(np.float64) > size, decade - 1, decade)


def _half_of(group: NDArray[np.float64], decade: int) -> float:
    """Return half the last place of positive values of one decade, 0.0 for full doubles.

    ``round(v 10^k) / 10^k == v`` is an exact test: both operands of the division are exact, so the
    quotient is the double nearest to that decimal number, as a reader of the text would have made it.
    """
    if decade < _SMALL:
        most = max(_decimals(float(value)) for value in group)
    else:
        # The first value needs so many; the others may need more, up to a full double.
        most = max(_decimals(float(group[0])), 0)
        limit = FULL_DIGITS - 2 - decade  # the most decimals with at most 14 significant digits
        while most <= limit and not np.array_equal(np.rint(group * _TEN[most]) / _TEN[most], group):
            most += 1
        if most > limit:
            return 0.0
    return 0.0 if most == _FULL else 0.5 * float(f"1e{-most}")


def _decimals(value: float) -> int:
    _, digits, exponent = Decimal(repr(value)).normalize().as_tuple()
    return _FULL if len(digits) >= FULL_DIGITS or not isinstance(exponent, int) else -exponent
