"""A text file that ends within a number: a copy that broke off, a disk that was full, a killed program.

The part of a number is a number: nothing in it is wrong by itself. What tells it is that the last line has no
end, and that its last number is printed to fewer places than nearly all others of its column: a program
that drops last zeros prints few so by chance.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from toolkit.findings import Finding

_NUMBER = re.compile(r"\s*[+-]?[0-9]*(?:[.,]([0-9]*))?(?:[eE][+-]?[0-9]+)?\s*\Z")
_FEWEST_ROWS = 10
"""Of shorter tables a last number of fewer places than all others is no rare chance."""
_BY_CHANCE = 0.01
"""Share of the numbers of a column that may have as few places: so often a whole file is told."""


def cut_number(text: str, separator: str) -> str | None:
    r"""Return the number within which a table's text ends; None where it ends with a line or a whole number.

    >>> rows = "".join(f"{row},0.{row}25\n" for row in range(10, 30))
    >>> cut_number("x,y\n" + rows + "30,0.3", ","), cut_number("x,y\n" + rows + "30,0.3025", ",")
    ('0.3', None)
    """
    if text.endswith(("\n", "\r")):
        return None
    last, *others = (line.rpartition(separator)[2] for line in reversed(text.splitlines()))
    places = [_places(cell) for cell in others]
    stated = [number for number in places if number is not None]
    own = _places(last)
    if own is None or len(stated) < _FEWEST_ROWS:
        return None
    if sum(number <= own for number in stated) > _BY_CHANCE * len(stated):
        return None
    return last.strip()


def _places(cell: str) -> int | None:
    match = _NUMBER.match(cell)
    return len(match[1] or "") if match and cell.strip() else None


def cut_findings(number: str | None, where: str) -> Sequence[Finding]:
    """Return that a file ends within a number, which is then another one; nothing where it does not."""
    if number is None:
        return ()
    message = (
        f"the file ends within its last line: its last number, {number}, has fewer places than nearly all "
        "others of its column"
    )
    return (Finding(rule="cut-number", where=where, message=message),)
