"""The rectangle of numbers in a worksheet's XML: found as a pattern of bytes, read without a parser.

Nearly all of a recording's sheet is rows of ``<c r="B7"><v>1.5</v></c>``, one like the other. Where every
byte below the first row is of that pattern, with references that count from column A and from row to row, the
numbers are read from where they stand; the rest of the sheet (its first row) is still a parser's. A sheet
that departs from the pattern in a single byte has no grid and is the parser's as a whole, so that a grid is
only ever what a parser would have read too.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array

_LARGEST = 16 * 2**20  # bytes of XML; beyond, the places of all tags would take too much memory
_MOST_COLUMNS = 26
_OPEN, _ROW_END, _CLOSE = b"<sheetData>", b"</row>", b"</sheetData>"
_ROW = re.compile(rb'<row[^<>]*><c r="A([1-9][0-9]{0,6})(" t="n">|">)<v>')
_ATTRIBUTES = re.compile(rb'"(?: [A-Za-z][\w:.]*="[^"<>&]*")*>')
_NAME = re.compile(rb' ([\w:.]+)="')
_NUMBER = re.compile(rb"-?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,4})?")
_EXACT = 15  # characters: as many digits are a whole number that a double holds
_TEN = 10.0 ** np.arange(_EXACT + 2)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Grid:
    """Where the numbers of a worksheet stand in its XML.

    ``begin``, ``end``: the bytes of the rows. ``first_row``: the spreadsheet's number of the first of them.
    ``starts``, ``stops`` (rows, columns): where the text of each number begins and ends; column A is first.
    """

    begin: int
    end: int
    first_row: int
    starts: NDArray[np.int64]
    stops: NDArray[np.int64]

    def without_rows(self, xml: bytes) -> bytes:
        """Return the worksheet without these rows."""
        return xml[: self.begin] + xml[self.end :]

    def numbers(self, xml: bytes) -> Array | None:
        """Return the numbers (rows, columns), each the double nearest to its text.

        None where a text is no finite number in plain digits: a parser then tells what stands there.
        """
        starts, stops = self.starts.ravel(), self.stops.ravel()
        values, read = _decimals(np.frombuffer(xml, np.uint8), starts, stops)
        for at in np.flatnonzero(~read).tolist():
            text = xml[starts[at] : stops[at]]
            if _NUMBER.fullmatch(text) is None:
                return None
            values[at] = float(text)
        if not np.isfinite(values).all():
            return None
        return values.reshape(self.starts.shape)


def find_grid(xml: bytes) -> Grid | None:
    """Return the grid below the first row of a worksheet, None where the rows are of any other pattern."""
    top, end = xml.find(_OPEN), xml.rfind(_CLOSE)
    first = xml.find(_ROW_END, top, end)
    begin = first + len(_ROW_END)
    if len(xml) > _LARGEST or top < 0 or first < 0:
        return None
    row = _ROW.match(xml, begin, end)
    outside = xml[:begin] + xml[end:]
    # A comment, or a second list of rows, could make other rows of these; a declaration may begin the file.
    if row is None or b"<!" in outside or b"<?" in outside[5:] or outside.count(b"sheetData") != 2:
        return None
    # Within the rows every < is counted for: nothing can stand there that was not looked at.
    tags = np.flatnonzero(np.frombuffer(xml, np.uint8, count=end - begin, offset=begin) == ord("<"))
    a_row = xml.count(b"<", begin, xml.find(_ROW_END, begin, end)) + 1
    columns = (a_row - 2) // 4
    if a_row != 4 * columns + 2 or not 1 <= columns <= _MOST_COLUMNS or len(tags) % a_row:
        return None
    places = (tags + begin).reshape(-1, a_row)
    first_row = int(row.group(1))
    if not _regular(xml, places, first_row, row.group(2), end):
        return None
    return Grid(
        begin=begin, end=end, first_row=first_row, starts=places[:, 2::4] + len(b"<v>"), stops=places[:, 3::4]
    )


def _regular(xml: bytes, places: NDArray[np.int64], first_row: int, tail: bytes, end: int) -> bool:
    """Tell whether rows and cells are what the pattern says; ``places`` (rows, tags): of every ``<``."""
    # Eight bytes at any place as one number; </sheetData> stands behind the last of them.
    words = np.ndarray((len(xml) - 7,), np.dtype("<u8"), xml, 0, (1,))
    rows, cells, values, stops = places[:, 0], places[:, 1:-1:4], places[:, 2::4], places[:, 3::4]
    row_ends = places[:, -1]
    digits, reference, mask = _references(first_row, len(places))
    quotes = cells + 7 + digits[:, None]
    return (
        _all(words[stops] == _word(b"</v></c>"))
        and _all(places[:, 5::4] == stops + 8)
        and _all(words[row_ends] & _bits(6) == _word(_ROW_END))
        and _all(rows[1:] == row_ends[:-1] + 6)
        and int(row_ends[-1]) + 6 == end
        and _all(words[cells] & _bits(7) == _letters(cells.shape[1]))
        and _all(words[cells + 7] & mask[:, None] == reference[:, None])
        and _all(values - quotes == len(tail))
        and _all(words[quotes] & _bits(len(tail)) == _word(tail))
        and _all(words[values] & _bits(3) == _word(b"<v>"))
        and _all(stops > values + 3)
        and _all(words[rows] == _word(b'<row r="'))
        and _all(words[rows + 8] & mask == reference)
        and _row_attributes(xml, (rows + 8 + digits).tolist(), cells[:, 0].tolist())
    )


def _row_attributes(xml: bytes, quotes: list[int], cells: list[int]) -> bool:
    # From the quotation mark behind the row's number to its first cell: one text, or a few.
    for text in {xml[a:b] for a, b in zip(quotes, cells, strict=True)}:
        names = _NAME.findall(text)
        if _ATTRIBUTES.fullmatch(text) is None or len({b"r", *names}) != len(names) + 1:
            return False
    return True


def _decimals(
    octets: NDArray[np.uint8], starts: NDArray[np.int64], stops: NDArray[np.int64]
) -> tuple[Array, NDArray[np.bool_]]:
    """Return the values of plain decimals, and which texts are such (texts,).

    At most `_EXACT` characters: digits and power of ten are exact in a double, so their quotient is the
    nearest one (Clinger 1990, the fast path).
    """
    length = stops - starts
    width = int(min(length.max(), _EXACT))
    back = np.arange(width, dtype=np.uint8)[:, None]
    text = octets[stops - 1 - back]  # (width, texts): from the last character back, beyond the first one too
    text *= back < np.minimum(length, _EXACT).astype(np.uint8)
    digit = text - np.uint8(ord("0"))  # wraps round for whatever is none
    is_digit = digit < 10
    digit *= is_digit
    dot = text == ord(".")
    dots, after = _sum(dot), _sum(dot * (back + np.uint8(1)))  # after: decimals + 1, of a single point
    minus = octets[starts] == ord("-")
    counted = _sum(is_digit)
    plain = (length <= _EXACT) & (dots <= 1) & (counted > 0) & (counted + dots + minus == length)
    # A point counts as a digit 0 so far: the digits before it come down by one place.
    decimals = np.where(plain & (dots > 0), after, 1) - 1
    mantissa = _TEN[:width] @ digit.astype(np.float64)
    below = np.fmod(mantissa, _TEN[decimals + 1])
    size = np.where(dots > 0, below + (mantissa - below) / 10, mantissa) / _TEN[decimals]
    return np.where(minus, -size, size), plain


def _sum(counts: NDArray[Any]) -> NDArray[np.uint8]:
    total: NDArray[np.uint8] = counts.sum(axis=0, dtype=np.uint8)  # of 15 places each at most 15
    return total


@lru_cache(maxsize=16)
def _references(first: int, rows: int) -> tuple[NDArray[np.int64], NDArray[np.uint64], NDArray[np.uint64]]:
    """Return how many digits each row's number has, its digits with ``"`` as a word, and their mask."""
    numbers = np.arange(first, first + rows)
    digits = 1 + sum((numbers >= 10**k).astype(np.int64) for k in range(1, 8))
    words, mask = np.zeros(rows, np.uint64), np.zeros(rows, np.uint64)
    for k in range(8):
        power = 10 ** np.maximum(digits - 1 - k, 0)
        octet = np.where(k < digits, ord("0") + numbers // power % 10, np.where(k == digits, ord('"'), 0))
        words |= octet.astype(np.uint64) << np.uint64(8 * k)
        mask |= np.where(k <= digits, np.uint64(0xFF), np.uint64(0)) << np.uint64(8 * k)
    return digits, words, mask


@lru_cache(maxsize=_MOST_COLUMNS)
def _letters(columns: int) -> NDArray[np.uint64]:
    return np.array([_word(b'<c r="%c' % (ord("A") + i)) for i in range(columns)])


def _word(text: bytes) -> np.uint64:
    return np.uint64(int.from_bytes(text, "little"))


def _bits(octets: int) -> np.uint64:
    return np.uint64((1 << 8 * octets) - 1)


def _all(agree: NDArray[np.bool_]) -> bool:
    return bool(agree.all())
