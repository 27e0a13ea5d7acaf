"""Rows that a workbook hides, by hand or by a filter: readers take them like any other, and this says so."""

from __future__ import annotations

import re
from collections.abc import Collection

from toolkit.findings import Finding

_ROW = re.compile(rb"<(?:[\w.-]+:)?row(\s[^<>]*)?>")
_HIDDEN = re.compile(rb"""\shidden\s*=\s*["'](?:1|true|on)["']""")
_NUMBER = re.compile(rb"""\sr\s*=\s*["']([0-9]{1,7})["']""")
_MOST_NAMED = 10


def hidden_rows(xml: bytes) -> tuple[int, ...]:
    """Return the numbers of the rows that a worksheet hides, from its XML.

    >>> hidden_rows(b'<row r="2"><c r="A2"/></row><row hidden="1" r="3"><c r="A3"/></row>')
    (3,)
    """
    if b"hidden" not in xml:
        return ()
    rows, number = [], 0
    for row in _ROW.finditer(xml):
        attributes = row.group(1) or b""
        stated = _NUMBER.search(attributes)
        number = int(stated.group(1)) if stated else number + 1
        if _HIDDEN.search(attributes):
            rows.append(number)
    return tuple(rows)


def hidden_findings(rows: Collection[int], where: str) -> list[Finding]:
    """Return that hidden rows take part in what a file is used for; ``rows`` are numbers of the worksheet."""
    if not rows:
        return []
    named = ", ".join(map(str, sorted(rows)[:_MOST_NAMED]))
    more = f" and {len(rows) - _MOST_NAMED} more" if len(rows) > _MOST_NAMED else ""
    message = f"rows hidden in the workbook take part: {len(rows)}, worksheet rows {named}{more}"
    return [Finding(rule="hidden-rows", where=where, message=message)]
