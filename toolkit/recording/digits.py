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

from collections.abc import Sequence
from decimal import Decimal

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.recording.model import Series

FULL_DIGITS = 15
_FEW = 6
_FULL = 999
_ROWS = 1 << 15  # at a time
_LOWEST = 325  # decades below one, down to the smallest double
_ZERO = 2 * (_LOWEST + 309)  # decades and signs; as a value's own, that it is zero
_SMALL = -8  # below this decade the powers of ten that are needed are no longer exact in a double
_TEN = 10.0 ** np.arange(23)
_LEAST = 307
_POWER = 10.0 ** np.arange(-_LEAST, 309)
_SMALLEST_SINGLE, _LARGEST_SINGLE = 1e-37, 3e38  # normal ones
_BY_CHANCE = -9.0  # log10 of the share of columns of any other numbers that look like single floats
_HALF = np.array([0.5 * float(f"1e{-places}") for places in range(_FULL)] + [0.0])  # by decimals


def rounding(series: Series) -> Array:
    """Return how far each value may lie from the one that was measured (rows,), in the channel's unit.

    Half a unit of its last printed place, or half the step in which a binary file stores it if that is more.
    """
    return np.asarray(roundings([series])[0])


def roundings(series: Sequence[Series]) -> Array:
    """Return `rounding` of several channels of one file (channels, rows)."""
    printed = half_last_places(np.stack([channel.values for channel in series]))
    for channel, half in zip(series, printed, strict=True):
        if channel.half is not None:
            np.maximum(half, channel.half, out=half)
    return printed


def half_last_places(columns: Array) -> Array:
    """Return half a unit of the last printed place of every value, 0 where it is a full double.

    ``columns`` (columns, rows), finite. Of a column of single floats it is half their step, with what
    printing moved them. A zero has the finest place of its column.

    >>> half_last_places(np.array([[98.59261, 98.5926, 101.25], [1 / 3, 0.5, 0.25]])).tolist()
    [[5e-06, 5e-06, 0.005], [0.0, 0.0, 0.0]]
    >>> half_last_places(np.array([[1.2345678806304932, 0.1234567984938621]])).tolist()
    [[5.960464477539063e-08, 3.725290353973065e-09]]
    """
    # All columns at once, some thousand rows at a time: what is looked for is one number a column, decade and
    # sign, and of every value only these two are kept.
    n, rows = columns.shape
    if not columns.size:
        return np.zeros(columns.shape)
    sides = np.full(columns.shape, _ZERO, dtype=np.uint16)
    most = np.zeros((n, _ZERO), dtype=np.int64)
    count = np.zeros((n, _ZERO), dtype=np.int64)
    single = np.zeros(n, dtype=np.bool_)  # may be single floats: a value of enough digits,
    normal = np.ones(n, dtype=np.bool_)  # and none out of their range
    for part in _parts(rows):
        values = columns[:, part]
        size = np.abs(values)
        zero = size == 0
        part_zero = bool(zero.any())
        decade = _decades(np.where(zero, 1.0, size) if part_zero else size)
        places = _places(size, decade)
        side = 2 * (decade + _LOWEST) + (values < 0)
        sides[:, part] = np.where(zero, _ZERO, side) if part_zero else side
        index = side + _ZERO * np.arange(n)[:, None]
        counted = (index[~zero], places[~zero]) if part_zero else (index.ravel(), places.ravel())
        np.maximum.at(most.reshape(-1), *counted)
        count += np.bincount(counted[0], minlength=count.size).reshape(n, _ZERO)
        # Seven digits and less name a single float, whatever was measured: only longer values can tell.
        single |= (((places + decade >= FULL_DIGITS // 2) | (places == _FULL)) & ~zero).any(axis=1)
        normal &= ((size < _LARGEST_SINGLE) & ((size > _SMALLEST_SINGLE) | zero)).all(axis=1)
    shown = _shown(most.reshape(n, -1, 2), count.reshape(n, -1, 2))
    half = np.stack([of_column[side] for of_column, side in zip(shown, sides, strict=True)])
    for column in np.flatnonzero(single & normal):
        if not _single_floats(columns[column]):
            continue
        nearest = columns[column].astype(np.float32)
        step = np.abs(np.spacing(nearest)).astype(np.float64)
        off = np.abs(columns[column] - nearest)
        # Digits that are whole leave nothing out, however few they are: 101234.5 is a single float.
        printed = np.maximum(half[column], off) if off.any() else off
        half[column] = np.where(columns[column] == 0, 0.0, printed + step / 2)
    return half


def _parts(rows: int) -> list[slice]:
    return [slice(start, start + _ROWS) for start in range(0, rows, _ROWS)]


def _shown(most: NDArray[np.int64], count: NDArray[np.int64]) -> Array:
    """Return half a last place by column, decade and sign (columns, 2 decades + 1), that of zeros last.

    ``most`` and ``count`` (columns, decades, 2): decimals of the finest value, and how many values there are.
    """
    table = np.zeros((len(most), _ZERO + 1))
    there = np.flatnonzero(count.any(axis=(0, 2)))
    if not len(there):  # nothing but zeros
        return table
    decades = slice(int(there[0]), int(there[-1]) + 1)
    most, count = most[:, decades], count[:, decades]
    finest = most.max(axis=2)
    # A sign of which there are enough, beside the other one, has the place that it shows.
    enough = (count >= _FEW) & (count < count.sum(axis=2)[..., None]) & (finest != _FULL)[..., None]
    shown = _HALF[np.where(enough, most, finest[..., None])]
    table[:, 2 * decades.start : 2 * decades.stop] = shown.reshape(len(most), -1)
    smallest = np.where(count.any(axis=2), _HALF[finest], np.inf).min(axis=1)
    table[:, _ZERO] = np.where(np.isinf(smallest), 0.0, smallest)
    return table


def _single_floats(column: Array) -> bool:
    """Tell whether a column (rows,) holds single floats, by the digits that its values show."""
    log_chance = 0.0
    for part in _parts(len(column)):
        values = np.abs(column[part])
        values = values[values != 0]
        decade = _decades(values)
        places = _places(values, decade)
        decimals = np.where(places == _FULL, FULL_DIGITS - 1 - decade, places)
        halves = 0.5 * 10.0 ** -decimals.astype(np.float64)
        nearest = values.astype(np.float32)
        if not (np.abs(values - nearest) <= halves + np.spacing(values)).all():
            return False
        log_chance += float(np.log10(np.minimum(2 * halves / np.spacing(nearest), 1.0)).sum())
    return log_chance <= _BY_CHANCE


def _decades(size: Array) -> NDArray[np.int64]:
    # floor(log10), mended where the logarithm was rounded up to a whole number.
    decade = np.floor(np.log10(size)).astype(np.int64)
    too_high = _POWER[decade.clip(-_LEAST) + _LEAST] > size
    return np.where(too_high, decade - 1, decade)


def _places(size: Array, decade: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return how many decimals each value needs, `_FULL` for a full double; 0 or more.

    ``round(v 10^k) / 10^k == v`` is an exact test: both operands of the division are exact, so the
    quotient is the double nearest to that decimal number, as a reader of the text would have made it.
    """
    places = np.full(size.shape, _FULL)
    limit = FULL_DIGITS - 2 - decade  # decimals, with at most 14 significant digits
    small = decade < _SMALL
    if small.any():
        places[small] = [_decimals(value) for value in size[small].tolist()]
        limit[small] = -1
    undecided = limit >= 0
    for k, ten in enumerate(_TEN.tolist()):
        fits = np.rint(size * ten) / ten == size
        fits &= undecided
        places[fits] = k
        undecided &= ~fits
        undecided &= limit > k
        if not undecided.any():
            break
    return places


def _decimals(value: float) -> int:
    _, digits, exponent = Decimal(repr(value)).normalize().as_tuple()
    return _FULL if len(digits) >= FULL_DIGITS or not isinstance(exponent, int) else -exponent
