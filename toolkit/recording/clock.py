"""Whether the times of rows rise: a time that stands twice is another fault than rows out of order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.arrays import Array

_LISTED = 5
"""Places that are named one by one: a reader needs them to find the rows, and a count of the others."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeFault:
    """What keeps times from rising: what it is, in which rows (counted from 1), and what helps."""

    problem: str
    rows: tuple[int, ...]
    remedy: str


def time_fault(t: Array) -> TimeFault | None:
    """Return why times (n,) do not rise from row to row, None where they do.

    Rows out of order are told before times that stand twice: of those, sorting shows which there are.

    >>> time_fault(np.array([0.0, 0.1, 0.1, 0.2, 0.2])), time_fault(np.array([0.0, 0.1]))
    (TimeFault(problem='a time stands twice', rows=(3, 5), remedy='drop one row ...'), None)
    """
    steps = np.diff(t, prepend=-np.inf)
    for problem, faulty, remedy in (
        ("a row has no time", ~np.isfinite(t), "remove the row, or give its time"),
        ("time does not rise", steps < 0, "sort the rows, or split the file into runs"),
        (
            "a time stands twice",
            steps == 0,
            "drop one row of each pair, put their mean in its place, or write the times with more digits",
        ),
    ):
        if faulty.any():
            rows = tuple((np.flatnonzero(faulty) + 1).tolist())
            return TimeFault(problem=problem, rows=rows, remedy=remedy)
    return None


def listed(rows: Sequence[int]) -> str:
    """Return rows for a sentence, at most some of them.

    >>> listed((7,)), listed((2, 3, 5, 7, 11, 13, 17))
    ('row 7', 'rows 2, 3, 5, 7, 11 and 2 more')
    """
    if len(rows) == 1:
        return f"row {rows[0]}"
    if len(rows) <= _LISTED:
        return f"rows {', '.join(map(str, rows[:-1]))} and {rows[-1]}"
    return f"rows {', '.join(map(str, rows[:_LISTED]))} and {len(rows) - _LISTED} more"
