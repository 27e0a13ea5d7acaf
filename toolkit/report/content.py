"""ReportContent: everything that a template can ask for, ready to be tested without drawing."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from toolkit.calibration.records.use import UNSIGNED, CalibrationUse, mark_of, signature_of
from toolkit.estimate import round_to_uncertainty
from toolkit.printable import escaped, unprintable
from toolkit.report.style import Style
from toolkit.report.tags import format_number
from toolkit.report.vocabulary import Column, Vocabulary

Cell = str | float | None


IMPOSSIBLE = "IMPOSSIBLE VALUES"
SIGNATURE = "signature"
RULE = "rule"  # a column of ids, the same in every language


@dataclass(frozen=True, slots=True, kw_only=True)
class Value:
    """One value: text as it is, a number with unit and default format, or an ISO date.

    A number with an expanded uncertainty ``U`` has the last place of its two digits in place of the format.
    """

    kind: Literal["text", "number", "date"]
    value: Cell
    unit: str | None = None
    spec: str = "g"
    U: float | None = None

    @property
    def missing(self) -> bool:
        """True where there is nothing to print: absent, empty, or not finite."""
        if isinstance(self.value, str):
            return not self.value.strip()
        return self.value is None or not math.isfinite(self.value)

    def text(self, spec: str | None, style: Style) -> str:
        """Return what the report prints; call only where the value is not missing."""
        if isinstance(self.value, str):
            return style.date(self.value) if self.kind == "date" else self.value
        assert self.value is not None  # noqa: S101  missing values are refused before
        if spec is None and self.U is not None:
            return style.decimal(round_to_uncertainty(self.value, self.U))
        return format_number(self.value, spec or self.spec, decimal_comma=style.decimal_comma)


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Columns with their units as shown, and rows of cells in the columns' order."""

    name: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """One line or point set: ``x``, ``y`` and optional standard error bars, in the axes' units.

    ``note`` stands at the end of a line, ``notes`` on each of its bars; bars are ``width`` wide.
    """

    label: str
    x: tuple[float, ...]
    y: tuple[float, ...]
    error: tuple[float, ...] | None = None
    group: int = 0
    style: Literal["points", "line", "both", "grid", "bars"] = "points"
    open: bool = False
    note: str | None = None
    notes: tuple[str, ...] = ()
    width: float = 0.38


@dataclass(frozen=True, slots=True, kw_only=True)
class Plot:
    """A figure before it is drawn: its curves, labels with units, caption and alternative text.

    ``names`` stand at x = 0, 1, 2 ... in place of numbers. ``zero_y``: y begins at zero or beyond it.
    """

    name: str
    x_label: str
    y_label: str
    curves: tuple[Curve, ...]
    caption: str
    alt: str
    watermark: str | None = None
    zero_x: bool = False
    zero_y: bool = True
    legend_title: str | None = None
    decimal_comma: bool = False
    names: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportContent:
    """A report's content. ``marks`` must stand in the document whatever the template says.

    What stands on every page, and the word in every figure, follows from ``calibrations``. ``symbol``: the
    document is issued, and its PDF carries the ledger's proof on the last page. ``untranslated``: sentences
    of findings that the document prints in English, for want of a translation.
    """

    values: dict[str, Value]
    tables: dict[str, Table]
    plots: dict[str, Plot]
    conditions: dict[str, bool]
    calibrations: tuple[CalibrationUse, ...]
    title: str
    author: str
    identity: str
    subject: str
    issued: str
    marks: tuple[tuple[str, str], ...] = ()
    style: Style = field(default_factory=Style)
    vocabulary: Vocabulary
    symbol: bool = False
    untranslated: tuple[str, ...] = ()

    @property
    def signature(self) -> str:
        """Who signed the decisions that the document rests on, and who issued it; or ``unsigned``."""
        return str(self.values[SIGNATURE].value)

    def issued_by(self, issuer: str | None) -> ReportContent:
        """Return the content of a document that is issued, by somebody who signs or, None, unsigned."""
        text = escaped(self.style.say(signature_text(self.calibrations, issuer)))
        return replace(self, values=self.values | {SIGNATURE: Value(kind="text", value=text)}, symbol=True)

    @property
    def page_mark(self) -> str | None:
        """The line that every page carries; None where every record may issue its numbers.

        Values that no tire has are told on every page too: a page is copied without its first one.
        """
        impossible = f"{IMPOSSIBLE}: see the findings" if self.conditions.get("impossible") else None
        mark = " - ".join(part for part in (mark_of(self.calibrations), impossible) if part)
        return self.style.say(mark) or None

    @property
    def draft_reasons(self) -> tuple[str, ...]:
        """Why this is a draft; empty where it is none."""
        return tuple(
            dict.fromkeys(
                f"{calibration.id}: {reason}"
                for calibration in self.calibrations
                for reason in calibration.draft_reasons
            )
        )

    def holds(self, name: str) -> bool:
        """Tell whether ``tk:if.<name>`` is kept: it is true, or the figure, table or value is there."""
        if name in self.conditions:
            return self.conditions[name]
        family, _, member = name.partition(".")
        if family == "figure":
            return member in self.plots
        if family == "table":
            return member in self.tables and bool(self.tables[member].rows)
        return name in self.values and not self.values[name].missing


def signature_text(calibrations: Sequence[CalibrationUse], issuer: str | None = None) -> str:
    """Return a document's line of signatures; ``issuer`` signs the document itself.

    >>> signature_text(())
    'unsigned'
    """
    records = signature_of(calibrations)
    if issuer is not None:
        return f"{'record unsigned' if records == UNSIGNED else records}; document issued by {issuer}"
    return records if records == UNSIGNED else f"{records}; document {UNSIGNED}"


# A document in the words of its organisation. What people wrote, names and notes, is never touched.


def in_words_of(content: ReportContent, style: Style, people: Collection[str]) -> ReportContent:
    """Return a content with all that the toolkit says in it in the language and the words of a style.

    ``people``: texts of the document's source that a person wrote.
    """
    stated = style.texts | set(people)
    plots = {name: _said_plot(plot, style) for name, plot in content.plots.items()}
    values = {
        path: replace(value, value=style.say(value.value))
        for path, value in content.values.items()
        if value.kind == "text" and isinstance(value.value, str) and value.value not in stated
    }
    captions = {f"caption.{name}": Value(kind="text", value=plot.caption) for name, plot in plots.items()}
    return replace(
        content,
        plots=plots,
        values=content.values | values | captions,
        tables={name: _said_table(table, style, stated) for name, table in content.tables.items()},
        marks=tuple((name, style.say(text)) for name, text in content.marks),
        title=style.say(content.title),
        subject=style.say(content.subject),
    )


def _said_table(table: Table, style: Style, stated: Collection[str]) -> Table:
    spoken = [column.name != RULE for column in table.columns]
    rows = tuple(
        tuple(
            style.say(cell) if says and isinstance(cell, str) and cell not in stated else cell
            for says, cell in zip(spoken, row, strict=True)
        )
        for row in table.rows
    )
    return replace(table, rows=rows)


def _said_plot(plot: Plot, style: Style) -> Plot:
    return replace(
        plot,
        alt=style.say(plot.alt, alternative=True),
        x_label=style.say(plot.x_label),
        y_label=style.say(plot.y_label),
        caption=style.say(plot.caption),
        watermark=None if plot.watermark is None else style.say(plot.watermark),
        legend_title=None if plot.legend_title is None else style.say(plot.legend_title),
        names=tuple(style.say(name) for name in plot.names),
        curves=tuple(replace(curve, label=style.say(curve.label)) for curve in plot.curves),
    )


# A document of texts that nobody can print: a ledger of former years may hold one, and so may a file's name.


def in_print(content: ReportContent) -> ReportContent:
    """Return a content whose texts can all be printed: what cannot be stands as its escape."""
    plots = {name: _in_print(plot) for name, plot in content.plots.items()}
    values = {path: _in_print(value) for path, value in content.values.items()}
    tables = {
        name: replace(table, rows=_in_print(table.rows)) if _unprintable_rows(table) else table
        for name, table in content.tables.items()
    }
    names = ("calibrations", "title", "author", "identity", "subject", "marks")
    texts = {name: _in_print(getattr(content, name)) for name in names}
    return replace(content, plots=plots, values=values, tables=tables, **texts)


def _unprintable_rows(table: Table) -> bool:
    return any(isinstance(cell, str) and unprintable(cell) for row in table.rows for cell in row)


def _in_print(value: Any) -> Any:
    if isinstance(value, str):
        return escaped(value)
    if isinstance(value, tuple):
        return tuple(map(_in_print, value))
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        parts = {field.name: getattr(value, field.name) for field in dataclasses.fields(value) if field.init}
        printed = {name: _in_print(part) for name, part in parts.items() if isinstance(part, str | tuple)}
        changed = {name: part for name, part in printed.items() if part != parts[name]}
        return replace(value, **changed) if changed else value
    return value
