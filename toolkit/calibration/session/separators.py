"""What a table was saved with, where it cannot be read: said in the words of the program that saved it.

A spreadsheet of a country with a decimal comma writes semicolons between the cells. Nothing is guessed from
such a file: 1,5 might be one number or two.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d+,\d+(?:[eE][+-]?\d+)?\s*\Z")
HOW_TO_SAVE = (
    "save it again with commas between the cells and a point in the numbers: from a spreadsheet as 'CSV "
    "UTF-8 (comma delimited)' with a point as its decimal separator, from a program with sep=',' and "
    "decimal='.'; nothing was written"
)


def separator_seen(header: Sequence[str]) -> str | None:
    """Return what a header is separated by, where that is no comma; None where it seems to be.

    >>> separator_seen(["D51 [mV/V];FY [N];run;direction"])
    'semicolons'
    """
    for mark, name in ((";", "semicolons"), ("\t", "tabs"), ("|", "bars")):
        if any(mark in cell for cell in header) and sum(cell.count(mark) for cell in header) >= len(header):
            return name
    return None


def has_decimal_comma(cell: str) -> bool:
    """Tell whether a cell holds a number with a decimal comma.

    >>> has_decimal_comma("-1,25"), has_decimal_comma("1,234,567")
    (True, False)
    """
    return _DECIMAL_COMMA.match(cell) is not None
