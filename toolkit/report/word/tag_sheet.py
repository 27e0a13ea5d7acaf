"""The tags of a kind of document as a Word file to print and to copy from, grouped by purpose."""

from __future__ import annotations

import datetime as dt
import io
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from toolkit.report.style import Style
from toolkit.report.tags import format_number
from toolkit.report.vocabulary import Entry, Vocabulary

if TYPE_CHECKING:
    from docx.document import Document

_SAMPLE, _DAY = 1234.5678, dt.date(2026, 3, 17)  # shown where no test gives an example
_WIDTHS_MM = (72, 62, 36)
_HOW = (
    "Copy a tag as it stands here, in double braces, into the text of a template; or insert a content "
    "control (Developer, Plain Text or Picture) and write the tag without braces under Properties, Tag. A "
    "number takes a format after a bar, {{tk:test.speed|.1f}}, a figure its width. Examples of numbers and "
    "dates are samples of their form; those of a test stand here with --test TEST."
)


def tag_sheet(
    vocabulary: Vocabulary, style: Style, *, title: str, values: Mapping[str, Any], day: dt.date
) -> bytes:
    """Return the Word file.

    Parameters
    ----------
    vocabulary : of the kind of document
    style : how its numbers and dates are written
    title : of the kind of document
    values : examples by tag, such as ``tk:tire.size``, of a test; a sample stands for what it lacks
    day : the day of its making
    """
    import docx
    from docx.shared import Mm, Pt

    document = docx.Document()
    section = document.sections[0]
    section.page_width, section.page_height = Mm(210), Mm(297)
    section.left_margin = section.right_margin = Mm(20)
    document.styles["Normal"].font.size = Pt(9)
    core = document.core_properties
    core.title, core.author, core.language = f"Tags: {title}", "toolkit", "en-US"
    core.created = core.modified = dt.datetime.combine(day, dt.time())
    document.add_heading(f"Tags: {title}", level=0)
    document.add_paragraph(_HOW)

    def example(entry: Entry) -> str:
        value = values.get(f"tk:{entry.path}")
        return _sample(entry, style) if value is None else str(value)

    groups: dict[str, list[Entry]] = {}
    for entry in vocabulary.values:
        groups.setdefault(entry.path.partition(".")[0], []).append(entry)
    for purpose, entries in groups.items():
        document.add_heading(purpose, level=1)
        rows = [
            (_literal(entry.path), _what(entry.description, entry.unit), example(entry)) for entry in entries
        ]
        _table(document, ("tag", "what it prints", "example"), rows)
    document.add_heading("figures", level=1)
    rows = [
        (_literal(f"{family}.{name}|width=120mm"), f"{text}{how}", _literal(f"caption.{name}"))
        for name, text in vocabulary.figures.items()
        for family, how in (("figure", ""), ("chart", "; as a chart that Word can edit"))
        if family == "figure" or name in vocabulary.charts
    ]
    _table(document, ("tag", "figure", "its caption"), rows)
    for name, table in vocabulary.tables.items():
        document.add_heading(f"table {name}", level=2)
        document.add_paragraph(f"{_literal(f'table.{name}')} in the paragraph before it: {table.description}")
        columns = [
            (
                _literal(f"row.{column.name}"),
                _what(column.description, column.unit),
                _sample(Entry(path="", kind=column.kind, description="", spec=column.spec), style),
            )
            for column in table.columns
        ]
        _table(document, ("tag of the prototype row", "column", "example"), columns)
    document.add_heading("conditions", level=1)
    conditions = [(f"tk:if.{name}", f"kept when {text}", "") for name, text in vocabulary.conditions.items()]
    _table(document, ("tag of a control around what it keeps", "when", ""), conditions)
    stream = io.BytesIO()
    document.save(stream)
    return stream.getvalue()


def _literal(path: str) -> str:
    return f"{{{{tk:{path}}}}}"


def _what(description: str, unit: str | None) -> str:
    return f"{description} [{unit.replace('*', '·')}]" if unit and unit != "1" else description


def _sample(entry: Entry, style: Style) -> str:
    if entry.kind == "number":
        value = round(_SAMPLE) if entry.spec.endswith("d") else _SAMPLE
        return format_number(value, entry.spec, decimal_comma=style.decimal_comma)
    return style.date(_DAY.isoformat()) if entry.kind == "date" else ""


def _table(document: Document, head: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Add a table whose head is repeated on every page and whose rows stay whole."""
    from docx.oxml import OxmlElement
    from docx.shared import Mm

    table = document.add_table(rows=1, cols=len(head), style="Light Grid Accent 1")
    table.autofit = False
    for cells in (head, *rows):
        row = table.rows[0] if cells is head else table.add_row()
        for cell, text, width in zip(row.cells, cells, _WIDTHS_MM, strict=True):
            cell.text, cell.width = text, Mm(width)
        properties = row._tr.get_or_add_trPr()
        properties.append(OxmlElement("w:cantSplit"))
        if cells is head:
            properties.append(OxmlElement("w:tblHeader"))
