"""Identification: what is known of the calibration that computed a file's own FY and MZ."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

Grade = Literal[
    "unreadable",
    "unknown",
    "ambiguous",
    "column_swap",
    "sign_variant",
    "stale",
    "undated",
    "rounding",
    "exact",
]
GRADES: tuple[Grade, ...] = get_args(Grade)
"""A file has the first grade that applies to any of its rows."""

CLEAN: tuple[Grade, ...] = ("rounding", "exact")
"""The grades of a file whose FY and MZ are those of the record in force."""

TELLS: dict[Grade, str] = {
    "unreadable": "cannot be read",
    "unknown": "by no record of the registry, nor by a sign or column variant of one",
    "ambiguous": "by one of several records or variants that this file cannot tell apart",
    "column_swap": "with load-cell columns exchanged",
    "sign_variant": "with a wrong sign",
    "stale": "by a record that was not the one in force",
    "undated": "by a record of the registry; without a test date nobody can say whether it was in force",
    "rounding": "by the record in force, its coefficients rounded",
    "exact": "by the record in force",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """Rows that one calibration computed; rows count from 1 at the first data row.

    ``record`` is None where unknown or ambiguous; ``candidates`` lists the ids of an ambiguous segment.
    """

    first_row: int
    last_row: int
    record: str | None
    variant: str | None
    grade: Grade
    candidates: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Repair:
    """Largest |recomputed by the record in force - value in the file| of FY [N] and MZ [N·m].

    None where the file has no such column.
    """

    FY_max_abs_N: float | None
    MZ_max_abs_Nm: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Skipped:
    """A record that is no candidate for this file, and why."""

    id: str
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Identification:
    """Which calibration computed a file.

    ``record`` and ``variant`` are those of the segment that decides the grade (None where there is none;
    ``variant`` None for a plain record). ``issued`` tells whether the record's issued digits fit, or only
    its full coefficients. ``in_force`` is the id of the record in force on the test's date, None without a
    date or a record; then ``repair`` is None too.
    """

    grade: Grade
    record: str | None
    variant: str | None
    issued: bool | None
    candidates: tuple[str, ...]
    segments: tuple[Segment, ...]
    in_force: str | None
    repair: Repair | None
    skipped: tuple[Skipped, ...] = ()


def worst(grades: tuple[Grade, ...]) -> Grade:
    """Return the first grade of the precedence that occurs.

    >>> worst(("exact", "sign_variant", "stale"))
    'sign_variant'
    """
    return min(grades, key=GRADES.index)
