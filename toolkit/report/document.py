"""A kind of document, as declared: each value, figure and table beside the function that builds it.

A kind's package holds one `Document`; its modules declare with it, and the document finds what they declare
by a scan. From the declarations follow the vocabulary, with it the list of tags, the check of templates and
the reference page, and the content of every document. A new table is one function under one declaration.
"""

from __future__ import annotations

import datetime as dt
import math
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import import_module
from pkgutil import iter_modules
from typing import Any, Generic, TypeVar, cast

from toolkit.calibration.records.use import CalibrationUse
from toolkit.estimate import Estimate, has_interval
from toolkit.findings import Finding
from toolkit.report.content import (
    SIGNATURE,
    Cell,
    Plot,
    ReportContent,
    Table,
    Value,
    in_print,
    in_words_of,
    signature_text,
)
from toolkit.report.style import Style, kept
from toolkit.report.vocabulary import Column, Entry, TableEntry, Vocabulary, columns_of

Source = TypeVar("Source")
Other = TypeVar("Other")
Row = Sequence[Cell] | Mapping[str, Cell]
Rows = Iterable[Row]
Number = float | Estimate | None
MESSAGE = "message"  # the column of a table of findings that holds their sentences

_SIGNED = Entry(
    path=SIGNATURE,
    kind="text",
    description="who signed the record's decisions and issued the document, or 'unsigned'; at the end of the "
    "document where a template has no place for it",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Declaration(Generic[Source]):
    """What a kind of document has, and the function that builds it from the document's source and style.

    A subclass says what it is; ``build`` returns a `Value`, rows, figures, whether a condition holds, or
    the text of a mark.
    """

    build: Callable[[Source, Style], object]

    def of(self, part: Callable[[Other], Source | None]) -> Declaration[Other]:
        """Return the declaration for a document that may have such a source as a part of its own."""

        def build(source: Other, style: Style) -> object:
            mine = part(source)
            return None if mine is None else self.build(mine, style)

        return cast("Declaration[Other]", replace(self, build=build))  # type: ignore[arg-type]


@dataclass(frozen=True, slots=True, kw_only=True)
class DeclaredValue(Declaration[Source]):
    """A value: its entry in the list of tags."""

    entry: Entry


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenValues(Declaration[Source]):
    """Values whose names only a content has; ``entries`` are examples of paths that ``pattern`` allows."""

    pattern: re.Pattern[str]
    entries: tuple[Entry, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class DeclaredTable(Declaration[Source]):
    """A table by its name."""

    name: str
    entry: TableEntry


@dataclass(frozen=True, slots=True, kw_only=True)
class DeclaredFigures(Declaration[Source]):
    """Figures that one function draws, name to description; those without data it leaves out.

    ``charts``: they have numbers on both axes, and can stand as charts of Word's own.
    """

    figures: Mapping[str, str]
    charts: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class DeclaredCondition(Declaration[Source]):
    """A condition that ``tk:if.<name>`` asks for."""

    name: str
    description: str


@dataclass(frozen=True, slots=True, kw_only=True)
class DeclaredMark(Declaration[Source]):
    """A sentence that must stand in the document; tags at ``places`` make a place for it."""

    name: str
    places: frozenset[str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Chapter:
    """What a module of another kind of document declares, as a part of this one.

    ``part`` returns that kind's source from this document's, None where there is none: then the values are
    missing, the tables have no rows, and there are no figures.
    """

    module: str
    part: Callable[[Any], object]


Declared = TypeVar("Declared", bound=Declaration[Any])


@dataclass(frozen=True, kw_only=True, eq=False)
class Document(Generic[Source]):
    """A kind of document.

    Attributes
    ----------
    name : of the kind: ``report``, ``certificate`` ...
    package : the package whose modules declare what it has
    required : tags that every template of the kind must hold
    family : what the paths of its values begin with; empty where each is written out
    foreign : see `Vocabulary`
    """

    name: str
    package: str
    required: tuple[str, ...]
    family: str = ""
    foreign: tuple[str, ...] = ()

    def _path(self, name: str) -> str:
        return f"{self.family}.{name}" if self.family else name

    def text(
        self, name: str, description: str, build: Callable[[Source, Style], str | None]
    ) -> DeclaredValue[Source]:
        """Declare a text; the function returns None where there is none."""
        entry = Entry(path=self._path(name), kind="text", description=description)
        return DeclaredValue(
            entry=entry, build=lambda source, style: Value(kind="text", value=build(source, style))
        )

    def date(
        self, name: str, description: str, build: Callable[[Source, Style], dt.date | str | None]
    ) -> DeclaredValue[Source]:
        """Declare a date."""

        def value(source: Source, style: Style) -> Value:
            day = build(source, style)
            return Value(kind="date", value=day.isoformat() if isinstance(day, dt.date) else day)

        return DeclaredValue(
            entry=Entry(path=self._path(name), kind="date", description=description), build=value
        )

    def number(
        self,
        name: str,
        description: str,
        build: Callable[[Source, Style], Number],
        *,
        unit: str | None = None,
        spec: str = "g",
    ) -> DeclaredValue[Source]:
        """Declare a number in its unit; an estimate is printed to the last place of its uncertainty."""
        path = self._path(name)
        entry = Entry(path=path, kind="number", description=description, unit=unit, spec=spec)
        return DeclaredValue(
            entry=entry, build=lambda source, style: printed_number(build(source, style), entry, style)
        )

    def open_values(
        self, pattern: str, entries: Iterable[Entry]
    ) -> Callable[[Callable[[Source, Style], Mapping[str, Value]]], OpenValues[Source]]:
        """Declare values whose paths match a pattern, with the entries that stand for all in the list."""

        def declare(build: Callable[[Source, Style], Mapping[str, Value]]) -> OpenValues[Source]:
            return OpenValues(pattern=re.compile(pattern), entries=tuple(entries), build=build)

        return declare

    def table(
        self, name: str, description: str, columns: str | Sequence[Column]
    ) -> Callable[[Callable[[Source, Style], Rows]], DeclaredTable[Source]]:
        """Declare a table above the function that returns its rows: tuples of cells, or cells by column.

        Columns are lines as `columns_of` reads them.
        """
        listed = columns_of(columns) if isinstance(columns, str) else tuple(columns)

        def declare(build: Callable[[Source, Style], Rows]) -> DeclaredTable[Source]:
            return DeclaredTable(
                name=name, entry=TableEntry(description=description, columns=listed), build=build
            )

        return declare

    def figures(
        self, figures: Mapping[str, str], *, charts: bool = True
    ) -> Callable[[Callable[[Source, Style], Iterable[Plot | None]]], DeclaredFigures[Source]]:
        """Declare figures, name to description, above the function that returns those that there are.

        ``charts`` is false where an axis has names in place of numbers.
        """

        def declare(build: Callable[[Source, Style], Iterable[Plot | None]]) -> DeclaredFigures[Source]:
            return DeclaredFigures(figures=figures, charts=charts, build=build)

        return declare

    def condition(
        self, name: str, description: str, build: Callable[[Source, Style], bool]
    ) -> DeclaredCondition[Source]:
        """Declare a condition that holds or not."""
        return DeclaredCondition(name=name, description=description, build=build)

    def mark(
        self, name: str, places: str, build: Callable[[Source, Style], str | None]
    ) -> DeclaredMark[Source]:
        """Declare a sentence that must stand in the document, and the tags that make a place for it."""
        return DeclaredMark(name=name, places=frozenset(places.split()), build=build)

    @cached_property
    def declarations(self) -> tuple[Declaration[Source], ...]:
        """What the modules of the package declare, by the names of the modules and in their order."""
        package = import_module(self.package)
        names = sorted(module.name for module in iter_modules(package.__path__))
        declared: dict[int, Declaration[Source]] = {}
        for name in names:
            for declaration in declared_in(f"{self.package}.{name}"):
                # A module may import what another one declares.
                declared.setdefault(id(declaration), declaration)
        return tuple(declared.values())

    def _all(self, kind: type[Declared]) -> Iterator[Declared]:
        return (declaration for declaration in self.declarations if isinstance(declaration, kind))

    @cached_property
    def vocabulary(self) -> Vocabulary:
        """What templates of the kind can ask for."""
        open_values = next(self._all(OpenValues), None)
        return Vocabulary(
            name=self.name,
            values=(
                *(declared.entry for declared in self._all(DeclaredValue)),
                _SIGNED,
                *(open_values.entries if open_values else ()),
            ),
            figures={
                name: text
                for declared in self._all(DeclaredFigures)
                for name, text in declared.figures.items()
            },
            tables={declared.name: declared.entry for declared in self._all(DeclaredTable)},
            conditions={declared.name: declared.description for declared in self._all(DeclaredCondition)},
            required=self.required,
            marks={declared.name: declared.places for declared in self._all(DeclaredMark)},
            open_values=open_values.pattern if open_values else None,
            foreign=self.foreign,
            charts=frozenset(
                name
                for declared in self._all(DeclaredFigures)
                if declared.charts
                for name in declared.figures
            ),
        )

    def plots(self, source: Source, style: Style) -> dict[str, Plot]:
        """Return the figures that the source has data for, by name."""
        return {
            plot.name: replace(plot, decimal_comma=style.decimal_comma)
            for declared in self._all(DeclaredFigures)
            for plot in cast("Iterable[Plot | None]", declared.build(source, style) or ())
            if plot is not None
        }

    def content(
        self,
        source: Source,
        style: Style,
        *,
        calibrations: Sequence[CalibrationUse] = (),
        title: str,
        author: str | None = None,
        identity: str,
        subject: str,
        issued: dt.date,
        people: Collection[str] = (),
    ) -> ReportContent:
        """Return the content of declared document: everything that a template of the kind can ask for.

        It is in the language and the words of the style, but for what ``people`` wrote; without an ``author``
        it is the style's laboratory's.
        """
        plots = self.plots(source, style)
        tables = {
            declared.name: printed_table(declared, cast("Rows", declared.build(source, style) or ()), style)
            for declared in self._all(DeclaredTable)
        }
        values = {
            declared.entry.path: cast("Value | None", declared.build(source, style))
            or Value(kind=cast("Any", declared.entry.kind), value=None)
            for declared in self._all(DeclaredValue)
        }
        values[SIGNATURE] = Value(kind="text", value=signature_text(calibrations))
        for declared in self._all(OpenValues):
            values |= cast("Mapping[str, Value]", declared.build(source, style))
        for name in self.vocabulary.figures:
            caption = plots[name].caption if name in plots else None
            values[f"caption.{name}"] = Value(kind="text", value=caption)
        conditions = dict.fromkeys(self.vocabulary.asked, False)
        conditions |= {path: not value.missing for path, value in values.items()}
        conditions |= {name: bool(table.rows) for name, table in tables.items()} | dict.fromkeys(plots, True)
        conditions |= {
            declared.name: bool(declared.build(source, style)) for declared in self._all(DeclaredCondition)
        }
        marks = ((declared.name, declared.build(source, style)) for declared in self._all(DeclaredMark))
        content = ReportContent(
            values=values,
            tables=tables,
            plots=plots,
            conditions=conditions,
            calibrations=tuple(calibrations),
            title=title,
            author=author or style.laboratory or "toolkit",
            identity=identity,
            subject=subject,
            issued=issued.isoformat(),
            marks=tuple((name, str(text)) for name, text in marks if text),
            style=style,
            vocabulary=self.vocabulary,
            untranslated=_untranslated(tables, style),
        )
        return in_print(in_words_of(content, style, people))


def _untranslated(tables: Mapping[str, Table], style: Style) -> tuple[str, ...]:
    """Return the sentences of findings that have no translation in the style's language."""
    messages = (
        str(row[at])
        for table in tables.values()
        for at, column in enumerate(table.columns)
        if column.name == MESSAGE
        for row in table.rows
    )
    return tuple(message for message in dict.fromkeys(messages) if style.lacks(message))


def declared_in(module: str) -> Iterator[Declaration[Any]]:
    """Return what a module declares, in its order; declarations may stand in tuples."""
    for member in vars(import_module(module)).values():
        if isinstance(member, Chapter):
            yield from (declaration.of(member.part) for declaration in declared_in(member.module))
        for declaration in member if isinstance(member, tuple) else (member,):
            if isinstance(declaration, Declaration):
                yield declaration


def printed_number(number: Number, entry: Entry, style: Style) -> Value:
    """Return a number in the organisation's unit and with its decimals.

    Decimals that the style file gives this very tag rule; those of its unit are for numbers without an
    uncertainty.
    """
    unit_text, factor = style.unit(entry.unit)
    digits = style.digits(entry.path, unit_text)
    spec = f".{digits}f" if digits is not None and entry.spec.endswith("f") else kept(entry.spec, factor)
    if not isinstance(number, Estimate):
        return Value(
            kind="number", value=None if number is None else number * factor, unit=unit_text, spec=spec
        )
    scaled = number.scaled(factor, "")
    U = scaled.expanded()[0] if style.digits(entry.path) is None else math.nan
    stated = U if has_interval(scaled.value, U) else None
    return Value(kind="number", value=scaled.value, unit=unit_text, spec=spec, U=stated)


def printed_table(declared: DeclaredTable[Source], rows: Rows, style: Style) -> Table:
    """Return a table in the organisation's units: its columns as they are headed, its cells converted."""
    columns, factors = [], []
    for column in declared.entry.columns:
        unit, factor = style.unit(column.unit)
        full = f"{declared.name}.{column.name}"
        digits = style.digits(full, column.name, unit)
        stated = digits is not None and column.spec.endswith("f")
        spec = f".{digits}f" if stated else kept(column.spec, factor if column.quantity else 1.0)
        # Decimals by the column's full name rule; those by unit are for numbers without an uncertainty.
        U = column.U if style.digits(full) is None else None
        columns.append(replace(column, unit=unit, spec=spec, U=U))
        factors.append(factor if column.quantity else 1.0)
    cells = (
        [row.get(column.name) for column in columns] if isinstance(row, Mapping) else row for row in rows
    )
    return Table(
        name=declared.name,
        columns=tuple(columns),
        rows=tuple(
            tuple(
                cell if cell is None or isinstance(cell, str) else cell * factor
                for cell, factor in zip(row, factors, strict=True)
            )
            for row in cells
        ),
    )


def finding_table(
    document: Document[Source], name: str, where: str, findings: Callable[[Source], Iterable[Finding]]
) -> DeclaredTable[Source]:
    """Return the declaration of a table of findings; ``where`` says what its places are."""
    table = document.table(
        name,
        "departures from what was expected",
        f"""
        rule|rule, for 'toolkit explain'
        level|error, warning or note
        where|{where}
        message|what was found
        """,
    )
    return table(
        lambda source, _: (
            (finding.rule, finding.level, finding.where, finding.message) for finding in findings(source)
        )
    )
