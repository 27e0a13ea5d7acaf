"""Identification: what it needs of a file, and what is known then of the calibration that computed its FY and
MZ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.declared import Entry
from toolkit.recording.digits import roundings
from toolkit.recording.model import Recording

LOADS = ("FY", "MZ")
INDEX = "corrected.json"
"""The index of a folder of corrected copies."""
Grade = Literal[
    "no_recording",
    "unreadable",
    "unknown",
    "altered_cells",
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

NOT_IDENTIFIED: tuple[Grade, ...] = ("no_recording", "unreadable")
"""The grades of a file that holds nothing to identify."""

TELLS: dict[Grade, str] = {
    "no_recording": "is no recording",
    "unreadable": "cannot be read",
    "altered_cells": "from other cells than those in the file: a cell column was changed",
    "unknown": "by no record of the registry, nor by a sign or column variant of one",
    "ambiguous": "in one of several ways that this file cannot tell apart",
    "column_swap": "with load-cell columns exchanged",
    "sign_variant": "with a wrong sign",
    "stale": "by a record that was not the one in force",
    "undated": "by a record of the registry; without a test date nobody can say whether it was in force",
    "rounding": "by the record in force, its coefficients rounded",
    "exact": "by the record in force",
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Columns:
    """A file's columns in its own units.

    ``x`` (rows, n) indications as the header names them, ``half_x`` their half last printed place;
    ``y`` and ``half_y`` (rows,) of each acquired channel that the file has.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    x: Array
    half_x: Array
    y: dict[str, Array]
    half_y: dict[str, Array]
    y_units: dict[str, str]

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.x)

    def part(self, rows: slice | NDArray[np.int64]) -> Columns:
        """Return some of the rows; each keeps the last place that the whole file gave it."""
        return replace(
            self,
            x=self.x[rows],
            half_x=self.half_x[rows],
            y={load: values[rows] for load, values in self.y.items()},
            half_y={load: values[rows] for load, values in self.half_y.items()},
        )

    @property
    def loads(self) -> tuple[str, ...]:
        """The acquired channels that the file has."""
        return tuple(self.y)


def columns_of(recording: Recording) -> Columns:
    """Return a recording's columns for identification."""
    cells = [channel for channel in recording.series if channel.role == "indication"]
    loads = [
        channel for channel in recording.series if channel.role == "acquired" and channel.symbol in LOADS
    ]
    x = np.column_stack([cell.values for cell in cells]) if cells else np.empty((recording.rows, 0))
    half = roundings([*cells, *loads]) if cells or loads else np.empty((0, recording.rows))
    return Columns(
        names=tuple(cell.symbol for cell in cells),
        units=tuple(cell.unit for cell in cells),
        x=x,
        half_x=np.ascontiguousarray(half[: len(cells)].T),
        y={channel.symbol: channel.values for channel in loads},
        half_y={channel.symbol: values for channel, values in zip(loads, half[len(cells) :], strict=True)},
        y_units={channel.symbol: channel.unit for channel in loads},
    )


def in_words(record: str | None, candidates: Sequence[str], variant: str | None) -> str:
    """Return the record, or those of which one may have computed a file, and how all of them were changed."""
    return ", ".join(filter(None, (record or " or ".join(candidates), variant)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """Rows that one record computed."""

    first_row: Annotated[int, Entry("from 1 at the first row of data")]
    last_row: int
    record: Annotated[str | None, Entry("null where it is unknown or ambiguous")]
    variant: Annotated[
        str | None, Entry("how the record was changed: E5 negative in FY, MZ; what all candidates share")
    ]
    grade: Grade
    candidates: Annotated[tuple[str, ...], Entry("of an ambiguous segment")] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Repair:
    """The largest difference between the file and the record in force."""

    FY_max_abs_N: Annotated[float | None, Entry("null where the file has no such column")]
    MZ_max_abs_Nm: Annotated[float | None, Entry("null where the file has no such column")]


@dataclass(frozen=True, slots=True, kw_only=True)
class SkippedRecord:
    """A record that could not be a candidate."""

    id: str
    reason: str


Which = Literal["forces", "cells", "open"]


@dataclass(frozen=True, slots=True, kw_only=True)
class DisagreeingSides:
    """Which side is wrong where Fy and Mz disagree with the cells beside them."""

    side: Which
    reason: str
    grade: Annotated[Grade, Entry("of the file if Fy and Mz are the wrong side")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Identification:
    """Which calibration computed a file.

    ``record`` and ``variant`` are those of the segment that decides the grade (None where there is none;
    ``variant`` None for a plain record). ``issued`` tells whether the record's issued digits fit, or only
    its full coefficients. ``in_force`` is the id of the record in force on the test's date, None without a
    date or a record; then ``repair`` is None too. ``sides`` says where rows disagree whether Fy and Mz or the
    cells are wrong (`toolkit.audit.sides`); None where nothing disagrees.
    """

    grade: Grade
    record: str | None
    variant: str | None
    issued: bool | None
    candidates: tuple[str, ...]
    segments: tuple[Segment, ...]
    in_force: str | None
    repair: Repair | None
    skipped: tuple[SkippedRecord, ...] = ()
    sides: DisagreeingSides | None = None


def worst(grades: tuple[Grade, ...]) -> Grade:
    """Return the first grade of the precedence that occurs.

    >>> worst(("exact", "sign_variant", "stale"))
    'sign_variant'
    """
    return min(grades, key=GRADES.index)
