"""Fill a table: the prototype row is cloned once a data row, header and following rows stay."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from copy import deepcopy

from lxml import etree

from toolkit.estimate import has_interval, round_to_uncertainty
from toolkit.report.content import Cell, Table
from toolkit.report.style import Style
from toolkit.report.tags import Tag, format_number, parse_tag
from toolkit.report.word.bulk import MANY, Bulk, Mould, fresh_ids
from toolkit.report.word.controls import fill_control, fill_literals, set_cell
from toolkit.report.word.pictures import Ids, free_row
from toolkit.report.word.scan import LITERAL, control_tag, own_rows, row_in, visible_texts
from toolkit.report.word.xml import W_P, W_SDT, W_TC, W_TR, Element, ancestor, paragraph_text, q

Said = Callable[[str, str], None]


def cell_text(value: Cell, spec: str, style: Style, U: Cell = None) -> str:
    """Return a cell's text; what is absent or not finite is the style's visible mark.

    With an uncertainty ``U`` the value has the last place of its two significant digits.
    """
    if isinstance(value, str):
        return value
    if value is None or not math.isfinite(value):
        return style.missing
    if isinstance(U, float) and has_interval(value, U):
        return style.decimal(round_to_uncertainty(value, U))
    return format_number(value, spec, decimal_comma=style.decimal_comma)


def fill_table(
    element: Element,
    table: Table,
    resolve: Callable[[Tag], str],
    said: Said,
    style: Style,
    ids: Ids,
    bulk: Bulk | None = None,
    printed: Callable[[str], str] = str,
) -> list[Element | tuple[str, ...]]:
    """Fill a w:tbl and return its new rows, or of each row kept as bytes the texts of its cells.

    Parameters
    ----------
    element : the w:tbl, already checked against the catalogue
    table : what to print
    resolve : text of a value tag that stands in the prototype row
    said : receives (column, text) of every cell value
    bulk : takes the rows of a table that has very many
    printed : makes of a cell's text what is written
    """
    prototype = _prototype(element)
    tagged = _has_tags(prototype)
    index = {column.name: i for i, column in enumerate(table.columns)}
    free_row(prototype)
    _keep_on_one_page(prototype)
    pattern = deepcopy(prototype)
    _forget_identity(pattern)
    literals, controls = _places(pattern)

    def texts(values: tuple[Cell, ...]) -> Callable[[Tag], str]:
        def text(tag: Tag) -> str:
            if tag.family != "row":
                return resolve(tag)
            column = table.columns[index[tag.name]]
            U = None if tag.spec or column.U not in index else values[index[column.U]]
            shown = cell_text(values[index[tag.name]], tag.spec or column.spec, style, U)
            said(tag.name, shown)
            return printed(shown)

        return text

    def put(row: Element, text: Callable[[Tag], str]) -> None:
        if tagged:
            # Literals first: what a control then receives is never read as a literal.
            nodes = list(row.iter())
            for place in literals:
                fill_literals(nodes[place], text)
            for place, tag in controls:
                fill_control(nodes[place], text(tag))
        else:
            cells = [cell for cell in row.iter(W_TC) if ancestor(cell, W_TR) is row]
            for cell, column in zip(cells, table.columns, strict=True):
                set_cell(cell, text(Tag(path=f"row.{column.name}")))

    elements: list[Element | tuple[str, ...]] = []
    if bulk is not None and len(table.rows) > MANY and bulk.takes(element, pattern):
        mould = Mould(pattern, put, ids, element.getroottree().getroot())
        rows = []
        for xml, cells in mould.cast(map(texts, table.rows)):
            rows.append(xml)
            elements.append(cells)
        bulk.add(prototype, rows)
    else:
        last = prototype
        for values in table.rows:
            row = deepcopy(pattern)
            last.addnext(row)
            last = row
            put(row, texts(values))
            fresh_ids(row, ids)
            elements.append(row)
    prototype.getparent().remove(prototype)
    return elements


def _keep_on_one_page(row: Element) -> None:
    """Let no page end within a row, where a value is cut; a row that is longer than a page goes on."""
    properties = row.find(q("w:trPr"))
    if properties is None:
        properties = etree.Element(q("w:trPr"))
        before = row.find(q("w:tblPrEx"))
        row.insert(0 if before is None else row.index(before) + 1, properties)
    for stated in properties.findall(q("w:cantSplit")):
        properties.remove(stated)
    properties.insert(0, etree.Element(q("w:cantSplit")))


def _prototype(table: Element) -> Element:
    for element, tag in _tags(table):
        if tag.family == "row":
            row = row_in(table, element)
            if row is not None:
                return row
    return own_rows(table)[-1]


def _has_tags(row: Element) -> bool:
    return any(tag.family == "row" for _, tag in _tags(row))


def _tags(root: Element) -> Iterator[tuple[Element, Tag]]:
    for element in root.iter(W_SDT, W_P):
        if element.tag == W_SDT:
            tag = control_tag(element)
            if tag is not None:
                yield element, tag
            continue
        for match in LITERAL.finditer(paragraph_text(element)):
            parsed = parse_tag(match[1])
            if parsed is not None:
                yield element, parsed


def _places(pattern: Element) -> tuple[list[int], list[tuple[int, Tag]]]:
    """Return where a row has literals and controls, counted over its elements: the same in every clone."""
    literals, controls = [], []
    for place, element in enumerate(list(pattern.iter())):
        if element.tag == W_P and any(
            parse_tag(match[1]) is not None
            for match in LITERAL.finditer("".join(t.text or "" for t in visible_texts(element)))
        ):
            literals.append(place)
        elif element.tag == W_SDT:
            tag = control_tag(element)
            if tag is not None and tag.family in ("row", "value"):
                controls.append((place, tag))
    return literals, controls


_BOOKMARKS = (q("w:bookmarkStart"), q("w:bookmarkEnd"), q("w:commentRangeStart"), q("w:commentRangeEnd"))


def _forget_identity(row: Element) -> None:
    """Take off what must be unique in a document before a row is cloned."""
    for element in list(row.iter(*_BOOKMARKS)):
        element.getparent().remove(element)
    for element in row.iter():
        for name in ("w14:paraId", "w14:textId"):
            element.attrib.pop(q(name), None)
