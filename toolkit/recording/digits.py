"""Printed digits: how far a value in a file may lie from the one that was measured.

The acquisition program prints a fixed number of digits, and a workbook keeps no trailing zeros. So the last
printed place of a value is the finest that occurs in its column among values of the same decade; where
that takes 15 or more significant digits, the file holds full doubles and nothing was rounded.

A program that prints into a field of fixed width has one place less beside a minus sign (-0.35393, 371.3554
and -182.415 in Figure 4.4 of the source document are all of eight characters). So where a decade holds both
signs, and six or more values of one of them never show the finest place, those have the place that they show:
by chance that happens to one in a million columns whose values were all printed alike.

A program that measures in single precision writes numbers of that lattice, in as many digits as it likes:
1.2345678806304932, 1.23456788 and 1.2345679 are one single float. Where every value of a column lies as near
to a single float as its own digits can tell, and numbers that lie anywhere would do so once in 10^9 columns,
the column's rounding is that of the single floats and of their digits together. Values of seven digits do
not tell: as printed digits they are rounded as far.
"""

from __future__ import annotations

import math
from decimal import Decimal
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from toolkit.recording.model import Series

FULL_DIGITS = 15
_FEW = 6
_FULL = 999
_SMALL = -8  # below this decade the powers of ten that are needed are no longer exact in a double
_TEN = 10.0 ** np.arange(23)
_LEAST = 307
_POWER = 10.0 ** np.arange(-_LEAST, 309)
_SMALLEST_SINGLE, _LARGEST_SINGLE = 1e-37, 3e38  # normal ones
_BY_CHANCE = -9.0  # log10 of the share of columns of any other numbers that look like single floats
_HALF = np.array([0.5 * float(f"1e{-places}") for places in range(_FULL)] + [0.0])  # by decimals


def half_last_place(values: ArrayLike) -> NDArray[np.float64]:
    """Return half a unit of the last printed place of every value, 0 where it is a full double.

    Of a column of single floats it is half their step, with what printing moved them.

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
    >>> half_last_place([1.2345678806304932, 0.1234567984938621]).tolist()
    [5.960464477539063e-08, 3.725290353973065e-09]
    """
    array = np.asarray(values, dtype=np.float64)
    table = array.reshape(len(array), math.prod(array.shape[1:]))
    return np.ascontiguousarray(_halves(np.ascontiguousarray(table.T)).T).reshape(array.shape)


def rounding(series: Series) -> NDArray[np.float64]:
    """Return how far each value may lie from the one that was measured (rows,), in the channel's unit.

    Half a unit of its last printed place, or half the step in which a binary file stores it if that is more.
    """
    return np.asarray(roundings([series])[0])


def roundings(series: Sequence[Series]) -> NDArray[np.float64]:
    """Return `rounding` of several channels of one file (channels, rows)."""
    printed = _halves(np.stack([channel.values for channel in series]))
    for channel, half in zip(series, printed, strict=True):
        if channel.half is not None:
            np.maximum(half, channel.half, out=half)
    return printed


def _halves(columns: NDArray[np.float64]) -> NDArray[np.float64]:
    # All columns (columns, rows) at once: what is looked for is one number a column, decade and sign.
    if not columns.size:
        return np.zeros(columns.shape)
    size = np.abs(columns)
    zero = size == 0
    any_zero = bool(zero.any())
    decade = _decades(np.where(zero, 1.0, size) if any_zero else size)
    places = _places(size, decade)
    low = int(decade.min())
    n, decades = len(columns), int(decade.max()) - low + 1
    group = (decade - low) + decades * np.arange(n)[:, None]
    side = 2 * group + (columns < 0)
    counted = (side[~zero], places[~zero]) if any_zero else (side.ravel(), places.ravel())
    most = np.zeros(2 * n * decades, dtype=np.int64)
    np.maximum.at(most, *counted)
    count = np.bincount(counted[0], minlength=len(most)).reshape(-1, 2)
    sides = most.reshape(-1, 2)
    finest = sides.max(axis=1)
    # A sign of which there are enough, beside the other one, has the place that it shows.
    enough = (count >= _FEW) & (count < count.sum(axis=1)[:, None]) & (finest != _FULL)[:, None]
    half: NDArray[np.float64] = _HALF[np.where(enough, sides, finest[:, None]).ravel()[side]]
    single = _single_floats(columns, size, decade, places, zero)
    if any_zero:
        there = (count.sum(axis=1) > 0).reshape(n, decades)
        smallest = np.where(there, _HALF[finest].reshape(n, decades), np.inf).min(axis=1)
        half = np.where(zero, np.where(np.isinf(smallest), 0.0, smallest)[:, None], half)
    for column in np.flatnonzero(single):
        nearest = columns[column].astype(np.float32)
        step = np.abs(np.spacing(nearest)).astype(np.float64)
        off = np.abs(columns[column] - nearest)
        # Digits that are whole leave nothing out, however few they are: 101234.5 is a single float.
        printed = np.maximum(half[column], off) if off.any() else off
        half[column] = np.where(zero[column], 0.0, printed + step / 2)
    return half


def _single_floats(
    columns: NDArray[np.float64],
    size: NDArray[np.float64],
    decade: NDArray[np.int64],
    places: NDArray[np.int64],
    zero: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """Return which columns (columns,) hold single floats, by the digits that their values show."""
    single = np.zeros(len(columns), dtype=np.bool_)
    # Seven digits and less name a single float, whatever was measured: only longer values can tell.
    may = (((places + decade >= FULL_DIGITS // 2) | (places == _FULL)) & ~zero).any(axis=1)
    may &= ((size < _LARGEST_SINGLE) & ((size > _SMALLEST_SINGLE) | zero)).all(axis=1)
    for column in np.flatnonzero(may):
        values = size[column][~zero[column]]
        decimals = np.where(places[column] == _FULL, FULL_DIGITS - 1 - decade[column], places[column])[
            ~zero[column]
        ]
        shown = 0.5 * 10.0 ** -decimals.astype(np.float64)
        nearest = values.astype(np.float32)
        if (np.abs(values - nearest) <= shown + np.spacing(values)).all():
            chance = np.minimum(2 * shown / np.spacing(nearest), 1.0)
            single[column] = np.log10(chance).sum() <= _BY_CHANCE
    return single


def _decades(size: NDArray[np.float64]) -> NDArray[np.int64]:
    # floor(log10), mended where the logarithm was rounded up to a whole number.
    decade = np.floor(np.log10(size)).astype(np.int64)
    too_high = _POWER[decade.clip(-_LEAST) + _LEAST] > size
    return np.where(too_high, decade - 1, decade)


def _places(size: NDArray[np.float64], decade: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return how many decimals each value needs, `_FULL` for a full double; 0 or more.

    ``round(v 10^k) / 10^k == v`` is an exact test: both operands of the division are exact, so the
    quotient is the double nearest to that decimal number, as a reader of the text would have made it.
    """
    places = np.full(size.shape, _FULL)
    most = FULL_DIGITS - 2 - decade  # decimals, with at most 14 significant digits
    small = decade < _SMALL
    if small.any():
        places[small] = [_decimals(value) for value in size[small].tolist()]
        most[small] = -1
    undecided = most >= 0
    for k, ten in enumerate(_TEN.tolist()):
        fits = np.rint(size * ten) / ten == size
        fits &= undecided
        places[fits] = k
        undecided &= ~fits
        undecided &= most > k
        if not undecided.any():
            break
    return places


def _decimals(value: float) -> int:
    _, digits, exponent = Decimal(repr(value)).normalize().as_tuple()
    return _FULL if len(digits) >= FULL_DIGITS or not isinstance(exponent, int) else -exponent
