"""The header of reference-load data: names of the session, each with its unit.

A unit stands in brackets, ``FY [kN]`` or ``FY (kN)``, or alone in the row below the names. Names are those of
the session; where nothing else can be meant, another case is the same name.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

from toolkit.calibration.session.cells import Cells, is_empty
from toolkit.errors import SessionError, ToolkitError
from toolkit.spelling import nearest
from toolkit.units import split_header, unit

COMMENT = "comment"
RUNS = ("run", "direction", "rotation")


class Wanted(NamedTuple):
    """What `read_table` was asked for."""

    required: tuple[str, ...]
    optional: tuple[str, ...]
    labels: tuple[str, ...]
    passed: tuple[str, ...]
    runs: bool

    @property
    def needed(self) -> tuple[str, ...]:
        """Names of the columns that must be there."""
        return (*self.required, *(RUNS[:2] if self.runs else ()))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all columns that may be there."""
        return tuple(
            dict.fromkeys(
                (*self.needed, *self.optional, *self.labels, *(RUNS if self.runs else ()), *self.passed)
            )
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Head:
    """Index of the columns that are read, by name; ``numeric`` and ``units`` of loads, cells, uncertainties.

    ``labels`` are columns of names.
    """

    columns: Mapping[str, int]
    numeric: tuple[str, ...]
    units: tuple[str, ...]
    labels: tuple[str, ...]


def is_known(text: str, layout: Wanted) -> bool:
    """Tell whether a header's text names a column of the session."""
    return _split(text, layout)[0] in layout.names


def with_units_row(cells: Cells, layout: Wanted) -> Cells:
    """Return the cells with the units of a row below the names in the header, where there is such a row.

    It is one where no header has a unit and every column that needs one has a text below that is no number.
    """
    split = [_split(text, layout) for text in cells.header]
    labels = (name for name in layout.labels if name not in layout.required)
    plain = (*(RUNS if layout.runs else ()), *layout.passed, *labels)
    needing = [at for at, (name, _) in enumerate(split) if name and name not in plain]
    if not cells.lines or not needing or any(text is not None for _, text in split):
        return cells
    below = [column[0] for column in cells.columns]
    if not all(isinstance(below[at], str) and re.search(r"[^\W\d_]|%", below[at]) for at in needing):
        return cells
    header = tuple(
        f"{text} [{below[at].strip().strip('[]()').strip()}]" if at in needing else text
        for at, text in enumerate(cells.header)
    )
    return dataclasses.replace(
        cells, header=header, columns=tuple(column[1:] for column in cells.columns), lines=cells.lines[1:]
    )


def read_head(cells: Cells, layout: Wanted) -> Head:
    """Return what the columns are.

    Raises
    ------
    SessionError
        a column is missing, doubled, unknown, without a name or without a unit
    UnitError
        a unit is unknown
    """
    if not any(_split(text, layout)[0] in layout.names for text in cells.header):
        raise header_error(
            cells.where, "the first row is no header of the session",
            ", ".join(text for text in cells.header if text), ", ".join(layout.needed), "columns",
            "write the names of the session and their units in the first row that is not empty, and a title "
            "elsewhere; nothing was written",
        )  # fmt: skip
    for at, text in enumerate(cells.header):
        filled = () if text else [row for row, cell in enumerate(cells.columns[at], 1) if not is_empty(cell)]
        if filled:
            raise header_error(
                cells.place(filled[0], at), "a column has no header", cells.columns[at][filled[0] - 1],
                "a header above every column that has values", "columns",
            )  # fmt: skip
    try:
        return _known_head(cells.header, layout)
    except ToolkitError:
        # Said again with the file's name.
        return _read_head(cells.header, layout, cells.where)


@lru_cache(maxsize=256)
def _known_head(header: tuple[str, ...], layout: Wanted) -> Head:
    # The files of a history have one header.
    return _read_head(header, layout, "")


def _read_head(header: tuple[str, ...], layout: Wanted, where: str) -> Head:
    split = [_split(text.strip(), layout) for text in header]
    _check_names([name for name, _ in split if name], header, layout, where)
    columns, numeric, units, labels = {}, [], [], []
    for at, (name, text) in enumerate(split):
        if not name or name in layout.passed:
            continue
        if layout.runs and name in RUNS:
            columns[name] = at
            continue
        if text is None:
            if name not in layout.labels or name in layout.required:
                raise header_error(
                    f"{where}, column {name}", f"column {name} has no unit", header[at],
                    f"a header such as '{name} [N]' or '{name} [mV/V]', or a row of units below the header",
                    "no-unit",
                )  # fmt: skip
            labels.append(name)
        else:
            numeric.append(name)
            units.append(unit(text.strip(), where=f"{where}, column {name}").text)
        columns[name] = at
    return Head(columns=columns, numeric=tuple(numeric), units=tuple(units), labels=tuple(labels))


@lru_cache(maxsize=1024)
def _split(text: str, layout: Wanted) -> tuple[str, str | None]:
    """Return a header's name, as the session writes it where it is one of its, and its unit."""
    name, stated = split_header(
        " ".join(text.split()), lambda name: _session_name(name, layout) in layout.names
    )
    return _session_name(name, layout), stated


def _session_name(name: str, layout: Wanted) -> str:
    name = name.strip()
    if name in layout.names:
        return name
    fits = [candidate for candidate in layout.names if candidate.casefold() == name.casefold()]
    return fits[0] if len(fits) == 1 else name


def _check_names(names: list[str], header: Sequence[str], layout: Wanted, where: str) -> None:
    present = ", ".join(text for text in header if text)
    for name in names:
        if names.count(name) > 1:
            raise header_error(where, f"column {name} stands twice", present, f"one column {name}", "columns")
    missing = [name for name in layout.needed if name not in names]
    if missing:
        problem = f"column {missing[0]} is missing" if len(missing) == 1 else (
            f"columns {', '.join(missing)} are missing"
        )  # fmt: skip
        raise header_error(where, problem, present, ", ".join(layout.needed), "columns")
    for name in names:
        if name not in layout.names:
            near = nearest(name, layout.names)
            hint = f"did you mean {near!r}? " if near else ""
            raise header_error(
                where, f"unknown column {name!r}", name, ", ".join(layout.names), "columns",
                hint + "name it in indications or loads of the session, or remove it; nothing was written",
            )  # fmt: skip


def header_error(
    where: str,
    problem: str,
    actual: object,
    expected: object,
    rule: str,
    next_step: str = "correct the file; nothing was written",
) -> SessionError:
    """Return the error of a file whose header or rows cannot be used."""
    return SessionError(problem, where=where, got=actual, expected=expected, next_step=next_step, rule=rule)
