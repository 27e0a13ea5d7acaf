"""Fill one place: a content control or the literals of a paragraph, keeping the look that stands there."""

from __future__ import annotations

import unicodedata
from collections.abc import Callable, Sequence
from copy import deepcopy
from typing import Any

from lxml import etree

from toolkit.report.tags import Tag, parse_tag
from toolkit.report.word.scan import LITERAL, visible_texts
from toolkit.report.word.styles import styles_root
from toolkit.report.word.xml import (
    P_PR,
    R_PR,
    SDT_CONTENT,
    SDT_PR,
    W_P,
    W_R,
    W_SDT,
    W_T,
    W_TBL,
    W_TC,
    W_TR,
    Element,
    Story,
    new_run,
    q,
    set_text,
    switch_is_on,
)

TC_PR = q("w:tcPr")


def fill_control(sdt: Element, text: str, *, iso_date: str | None = None) -> None:
    """Put a text into a control at run, paragraph or cell level; tag and lock stay, the placeholder goes."""
    run = new_run(text, run_properties(sdt))
    if run.find(q("w:br")) is not None:
        hold_anything(sdt)  # LibreOffice 7.4 drops line breaks of plain text: two words would be one
    settle(sdt, iso_date)
    replace_content(sdt, run)


def settle(sdt: Element, iso_date: str | None = None) -> None:
    """Take the placeholder state and the data binding off a control."""
    properties = sdt.find(SDT_PR)
    if properties is None:
        return
    for name in ("w:showingPlcHdr", "w:dataBinding", "w15:dataBinding"):
        for element in properties.findall(q(name)):
            properties.remove(element)
    date = properties.find(q("w:date"))
    if date is not None:
        # A stale full date would be shown by Word instead of the text once the control is touched.
        date.attrib.pop(q("w:fullDate"), None)
        if iso_date is not None:
            date.set(q("w:fullDate"), f"{iso_date}T00:00:00Z")


def hold_anything(sdt: Element) -> None:
    """Make a control one of rich text: one of a picture or of plain text may not hold a chart."""
    properties = sdt.find(SDT_PR)
    if properties is None:
        return
    for kind in ("w:picture", "w:text"):
        for element in properties.findall(q(kind)):
            properties.remove(element)


def admit(element: Element) -> None:
    """Make controls of plain text in and around an element ones of rich text, where they hold more than text.

    Word takes a document for damaged whose control of plain text holds a picture.
    """
    for sdt in (*element.iter(W_SDT), *element.iterancestors(W_SDT)):
        properties = sdt.find(SDT_PR)
        if properties is not None and next(sdt.iter(q("w:drawing"), q("w:br")), None) is not None:
            for plain in properties.findall(q("w:text")):
                properties.remove(plain)


def release(paragraph: Element) -> None:
    """Settle the controls of others around a paragraph's literals: Word would show their own data again."""
    holders = [t for t in visible_texts(paragraph) if "{{" in (t.text or "") or "}}" in (t.text or "")]
    for element in [paragraph, *holders]:
        for outer in element.iterancestors(W_SDT):
            settle(outer)


def replace_content(sdt: Element, run: Element) -> None:
    """Make one run the whole content of a control, in the first paragraph or cell that it has."""
    content = sdt.find(SDT_CONTENT)
    cell = content.find(W_TC)
    holder = cell if cell is not None else content
    paragraph = next(holder.iter(W_P), None)
    if cell is None and paragraph is None and in_line(sdt):
        _clear(content)
        content.append(run)
        return
    keep = paragraph if paragraph is not None else etree.Element(W_P)
    fresh = etree.Element(W_P)
    properties = keep.find(P_PR)
    if properties is not None:
        fresh.append(deepcopy(properties))
    fresh.append(run)
    if cell is not None:
        for child in list(content):
            if child is not cell:
                content.remove(child)
        for child in list(cell):
            if child.tag != TC_PR:
                cell.remove(child)
        cell.append(fresh)
    else:
        _clear(content)
        content.append(fresh)


def in_line(element: Element) -> bool:
    """Tell whether an element stands in a line of text, and not between paragraphs, in a text box too."""
    holder = next(element.iterancestors(W_P, q("w:txbxContent")), None)
    return holder is not None and holder.tag == W_P


def run_properties(sdt: Element) -> Element | None:
    """Return the run properties that a control's text keeps: its first run's, no placeholder style."""
    properties = sdt.find(SDT_PR)
    showing = properties.find(q("w:showingPlcHdr")) is not None
    first = next(sdt.find(SDT_CONTENT).iter(W_R), None)
    copied = None if first is None else first.find(R_PR)
    of_the_control = properties.find(R_PR)
    if showing and of_the_control is not None:
        return of_the_control
    if copied is None:
        return of_the_control
    copied = deepcopy(copied)
    style = copied.find(q("w:rStyle"))
    if style is not None and (showing or style.get(q("w:val")) == "PlaceholderText"):
        copied.remove(style)
    return copied


def fill_literals(paragraph: Element, resolve: Callable[[Tag], str]) -> None:
    """Replace every ``{{tk:...}}`` of a paragraph; the first run of each tag gives the look.

    Values are never scanned again: the matches are found once, on the template's own text.
    """
    texts = visible_texts(paragraph)
    ends, total = [], 0
    for t in texts:
        total += len(t.text or "")
        ends.append(total)
    joined = "".join(t.text or "" for t in texts)
    replacements = []
    for match in LITERAL.finditer(joined):
        tag = parse_tag(match[1])
        if tag is not None:
            replacements.append((match.start(), match.end(), resolve(tag)))
    for start, end, text in reversed(replacements):
        first = next(i for i, stop in enumerate(ends) if start < stop)
        last = next(i for i, stop in enumerate(ends) if end <= stop)
        head = start - (ends[first - 1] if first else 0)
        tail = end - (ends[last - 1] if last else 0)
        after = (texts[last].text or "")[tail:]
        before = (texts[first].text or "")[:head]
        if first == last:
            set_text(texts[first], before + text + after)
            continue
        value = texts[first]
        if marks := _marks_between(paragraph, texts[first], texts[last]):
            # What marks a part of the tag marks the whole value, and nothing of what is before it.
            value, before = (_after(value, before), "") if before else (value, "")
            _around(value.getparent(), marks)
        for middle in texts[first + 1 : last]:
            middle.text = ""
        set_text(texts[last], after)
        set_text(value, before + text)


_STARTS = ("bookmarkStart", "commentRangeStart", "permStart")
_ENDS = ("bookmarkEnd", "commentRangeEnd", "permEnd")


def _marks_between(paragraph: Element, first: Element, last: Element) -> list[Element]:
    """Return the beginnings and ends of bookmarks and the like that stand between two texts."""
    inside, marks = False, []
    wanted = tuple(q(f"w:{name}") for name in (*_STARTS, *_ENDS))
    for element in paragraph.iter(W_T, *wanted):
        if element is first:
            inside = True
        elif element is last:
            break
        elif inside and element.tag in wanted:
            marks.append(element)
    return marks


def _after(text: Element, before: str) -> Element:
    """Leave a text in its run, and return an empty one in a run of the same look after it."""
    run = text.getparent()
    properties = run.find(R_PR)
    fresh = new_run("", properties)
    set_text(text, before)
    run.addnext(fresh)
    return fresh.find(W_T)


def _around(run: Element, marks: Sequence[Element]) -> None:
    """Put beginnings before a run and ends after it; a bookmark of another level of the line stays."""
    for mark in marks:
        if mark.getparent() is not run.getparent():
            continue
        name = mark.tag.rpartition("}")[2]
        mark.tail = None
        if name in _STARTS:
            run.addprevious(mark)
        else:
            run.addnext(mark)


def set_cell(cell: Element, text: str) -> None:
    """Make a text the whole content of a table cell, in the look of its first run."""
    paragraph = cell.find(W_P)
    first = next(cell.iter(W_R), None)
    run = new_run(text, None if first is None else first.find(R_PR))
    fresh = etree.Element(W_P)
    if paragraph is not None and paragraph.find(P_PR) is not None:
        fresh.append(deepcopy(paragraph.find(P_PR)))
    fresh.append(run)
    for child in list(cell):
        if child.tag != TC_PR:
            cell.remove(child)
    cell.append(fresh)


def apply_condition(sdt: Element, keep: bool) -> None:
    """Resolve a ``tk:if`` control: its wrapper goes, and with ``keep`` false its content too."""
    parent, content = sdt.getparent(), sdt.find(SDT_CONTENT)
    children = list(content) if content is not None else []
    cells = [child for child in children if child.tag == W_TC]
    if keep or cells:
        at = parent.index(sdt)
        for child in reversed(children):
            parent.insert(at, child)
        parent.remove(sdt)
        if not keep:
            # A cell that went away would tear the row: it stays, empty.
            for cell in cells:
                set_cell(cell, "")
        return
    parent.remove(sdt)
    _repair(parent)


def _repair(parent: Element) -> None:
    if parent.tag == W_TBL and next(parent.iter(W_TR), None) is None:
        above = parent.getparent()
        above.remove(parent)
        _repair(above)
        return
    holders = (W_TC, q("w:hdr"), q("w:ftr"), q("w:footnote"), q("w:endnote"), q("w:txbxContent"))
    if parent.tag in holders and (len(parent) == 0 or (parent.tag == W_TC and parent[-1].tag != W_P)):
        etree.SubElement(parent, W_P)


def _clear(element: Element) -> None:
    for child in list(element):
        element.remove(child)


# Values in a document that is read from the right: a number keeps its sign, a size its order.


_LRM = "\u200e"


def from_the_right(package: Any, parts: list[Story]) -> bool:
    """Tell whether some paragraph, table or style of a document is set from right to left."""
    styles = styles_root(package)
    roots = [story.root for story in parts] + ([] if styles is None else [styles])
    return any(switch_is_on(mark) for root in roots for mark in root.iter(q("w:bidi"), q("w:bidiVisual")))


def kept_whole(text: str) -> str:
    """Return a text with a digit, and no letter from the right, between marks from the left, line by line.

    >>> kept_whole("-33.4") == "\\u200e-33.4\\u200e", kept_whole("steel")
    (True, 'steel')
    """
    return "\n".join(f"{_LRM}{line}{_LRM}" if _wants_marks(line) else line for line in text.split("\n"))


def _wants_marks(line: str) -> bool:
    kinds = {unicodedata.bidirectional(character) for character in line}
    return "EN" in kinds and not kinds & {"R", "AL", "AN"}
