"""A vocabulary: every tag, figure, table and condition that one kind of document can be asked for.

A test report and a calibration certificate are filled, checked and verified by the same machinery; what
differs is the vocabulary, and the content that goes with it. Both follow from what the kind declares
(`toolkit.report.document`).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

Kind = Literal["text", "number", "date", "figure", "chart", "table", "if", "row"]

# What an organisation chooses the unit of, and the unit where it does not.
UNITS = {"force": "N", "moment": "N*m", "force/angle": "N/deg", "moment/angle": "N*m/deg"}
QUANTITIES = {unit: quantity for quantity, unit in UNITS.items()}


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A column of a table; ``unit`` is the SI-side default, shown in the heading.

    ``quantity`` names what an organisation chooses the unit of, and the cells are converted to.
    ``of_the_run`` says that its cells differ from run to run: the hash of the content leaves them out.
    ``U`` names the column of the uncertainty to whose last place its cells are printed; an uncertainty's own
    column names itself.
    """

    name: str
    kind: Literal["text", "number"]
    description: str
    unit: str | None = None
    spec: str = "g"
    quantity: str | None = None
    of_the_run: bool = False
    U: str | None = None


def columns_of(lines: str) -> tuple[Column, ...]:
    r"""Return columns from lines: ``name|description`` of texts, ``name|description|unit|format`` of numbers.

    The unit is a quantity whose unit an organisation chooses (`UNITS`), a unit, or empty. After the format
    may stand ``U of the column``: its cells are printed to the last place of that column's, and ``run``: they
    differ from run to run. A name with ``±`` makes two columns, the value's and ``U_<name>``.

    >>> [column.name for column in columns_of("load|load of the row\nFY ±|lateral force|force|.1f")]
    ['load', 'FY', 'U_FY']
    """
    return tuple(column for line in lines.strip().splitlines() for column in _columns(line.strip()))


def _columns(line: str) -> list[Column]:
    name, description, *formats = line.split("|")
    if not formats:
        return [Column(name=name, kind="text", description=description)]
    unit, spec, *options = formats
    if name.endswith(" ±"):
        name = name.removesuffix(" ±")
        U = f"U_{name}"
        return [
            number_column(name, description, unit, spec, U=U),
            number_column(U, f"expanded uncertainty (95 %) of {name}", unit, spec, U=U),
        ]
    U = next((option.removeprefix("U of ") for option in options if option.startswith("U of ")), "")
    return [number_column(name, description, unit, spec, U=U or None, of_the_run="run" in options)]


def number_column(
    name: str, description: str, unit: str, spec: str, *, U: str | None = None, of_the_run: bool = False
) -> Column:
    """Return a column of numbers; ``unit`` is a quantity, its default unit, another unit, or empty."""
    quantity = unit if unit in UNITS else None
    return Column(
        name=name, kind="number", description=description, unit=UNITS.get(unit, unit) or None, spec=spec,
        quantity=quantity, U=U, of_the_run=of_the_run,
    )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One entry of the list of tags: a path without ``tk:``, what it is, its unit and its default format."""

    path: str
    kind: Kind
    description: str
    unit: str | None = None
    spec: str = "g"
    columns: tuple[Column, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class TableEntry:
    """What a template can ask of a table: its columns, in the order of a row without tags."""

    description: str
    columns: tuple[Column, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Vocabulary:
    """What a kind of document can say.

    Attributes
    ----------
    name : ``report``, ``certificate`` ...
    values : every value, in the order of the manual
    figures : name to description
    charts : names of the figures that can stand as a chart of Word's own, numbers on both axes
    tables : name to description and columns
    conditions : names that ``tk:if.`` may have beside those of figures, tables and values
    required : tags that every template of the kind must hold
    marks : a mark that must stand in the document, and the tags that make a place for it
    open_values : values beyond the listed ones that some content can have; None for none
    foreign : names of the other kinds of documents, for a kind whose own tags have no common beginning
    """

    name: str
    values: tuple[Entry, ...]
    figures: Mapping[str, str]
    tables: Mapping[str, TableEntry]
    conditions: Mapping[str, str]
    required: tuple[str, ...]
    marks: Mapping[str, frozenset[str]]
    open_values: re.Pattern[str] | None = None
    foreign: tuple[str, ...] = ()
    charts: frozenset[str] = frozenset()

    @property
    def asked(self) -> dict[str, str]:
        """Every name that ``tk:if.<name>`` may have, and when it is kept.

        A condition and a table of one name ask the condition.
        """
        names = dict(self.conditions)
        names |= {name: f"there is a figure: {text}" for name, text in self.figures.items()}
        names |= {
            name: f"the table has rows: {table.description}"
            for name, table in self.tables.items()
            if name not in names
        }
        return names | {entry.path: f"there is a value: {entry.description}" for entry in self.values}

    @property
    def entries(self) -> tuple[Entry, ...]:
        """Every tag in the order of the manual: values, captions, figures, tables, conditions, rows."""
        return (
            *self.values,
            *(_entry(f"caption.{n}", "text", f"caption of the figure: {d}") for n, d in self.figures.items()),
            *(_entry(f"figure.{name}", "figure", text) for name, text in self.figures.items()),
            *(
                _entry(f"chart.{name}", "chart", f"{text}; as a chart that Word can edit")
                for name, text in self.figures.items()
                if name in self.charts
            ),
            *(
                Entry(path=f"table.{n}", kind="table", description=t.description, columns=t.columns)
                for n, t in self.tables.items()
            ),
            *(_entry(f"if.{name}", "if", f"kept when {text}") for name, text in self.asked.items()),
            *_rows(self.tables),
        )

    def value(self, path: str) -> Entry | None:
        """Return the entry of a value or of a caption, None for a value that only a content can define."""
        name = path.removeprefix("caption.")
        if name != path and name in self.figures:
            return _entry(path, "text", f"caption of the figure: {self.figures[name]}")
        return next((entry for entry in self.values if entry.path == path), None)

    def entry(self, path: str) -> Entry | None:
        """Return the entry of a path of any family."""
        return next((entry for entry in self.entries if entry.path == path), None)

    def knows(self, path: str) -> bool:
        """Tell whether a value of that path can exist in some content."""
        if self.value(path) is not None:
            return True
        return self.open_values is not None and self.open_values.fullmatch(path) is not None

    def knows_condition(self, name: str) -> bool:
        """Tell whether ``tk:if.<name>`` can be asked: a condition, a figure, a table or any value.

        ``tk:if.figure.gough`` and ``tk:if.gough`` ask the same.
        """
        family, _, member = name.partition(".")
        members: Mapping[str, object] = {"figure": self.figures, "table": self.tables}.get(family, {})
        return name in self.conditions or member in members or self._is_member(name) or self.knows(name)

    def _is_member(self, name: str) -> bool:
        return name in self.figures or name in self.tables

    def demanded(self, tags: Iterable[str]) -> tuple[str, ...]:
        """Return the tags that a template must hold: the kind's own, and those that a style file asks for.

        One style file serves an organisation's reports and its certificates: a tag of another kind of
        document is not asked of this one.
        """
        return tuple(dict.fromkeys([*self.required, *(tag for tag in tags if self.of_kind(tag))]))

    def of_kind(self, tag: str) -> bool:
        """Tell whether a required tag can be meant for this kind of document."""
        if self.foreign:
            return not tag.startswith(tuple(f"tk:{name}." for name in self.foreign))
        return tag.startswith(f"tk:{self.name}.")


def _entry(path: str, kind: Kind, description: str) -> Entry:
    return Entry(path=path, kind=kind, description=description)


def _rows(tables: Mapping[str, TableEntry]) -> Iterable[Entry]:
    for name, table in tables.items():
        for column in table.columns:
            yield Entry(
                path=f"row.{column.name}",
                kind="row",
                unit=column.unit,
                spec=column.spec,
                description=f"{column.description} (in the prototype row of tk:table.{name})",
            )
