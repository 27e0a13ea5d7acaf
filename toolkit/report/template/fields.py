"""Number the captions: the results of SEQ fields, and of REF fields that point at them."""

from __future__ import annotations

import re
from dataclasses import dataclass

from lxml import etree

from toolkit.report.template.xml import W_R, W_T, Element, q


@dataclass(slots=True, eq=False)
class _Field:
    code: str
    results: list[Element]
    end: Element | None
    separate: Element | None


def number_captions(body: Element) -> None:
    """Write the running number into every SEQ field, and the bookmarked text into every REF field.

    Word shows the stored result until someone updates the fields; removed blocks leave gaps in it.
    """
    counters: dict[str, int] = {}
    fields = list(_fields(body))
    for field in fields:
        words = field.code.split()
        if len(words) < 2 or words[0].upper() != "SEQ":
            continue
        name = words[1].lower()
        reset = re.search(r"\\r\s*(\d+)", field.code)
        if reset:
            counters[name] = int(reset[1])
        elif "\\c" not in words:
            counters[name] = counters.get(name, 0) + 1
        _write(field, str(counters.get(name, 0)))
    marks = _bookmarks(body)
    for field in fields:
        words = field.code.split()
        if len(words) > 1 and words[0].upper() == "REF" and words[1] in marks:
            _write(field, marks[words[1]])


def _write(field: _Field, text: str) -> None:
    if field.results:
        field.results[0].text = text
        for other in field.results[1:]:
            other.text = ""
        return
    if field.end is None:
        return
    owner = field.end.getparent()
    if field.separate is None:
        run = etree.Element(W_R)
        etree.SubElement(run, q("w:fldChar")).set(q("w:fldCharType"), "separate")
        owner.addprevious(run)
    run = etree.Element(W_R)
    etree.SubElement(run, W_T).text = text
    owner.addprevious(run)


def _fields(body: Element) -> list[_Field]:
    found: list[_Field] = []
    stack: list[_Field] = []
    for element in body.iter(q("w:fldSimple"), q("w:fldChar"), q("w:instrText"), W_T):
        if element.tag == q("w:fldSimple"):
            found.append(_Field(element.get(q("w:instr")) or "", list(element.iter(W_T)), None, None))
            if not found[-1].results:
                run = etree.SubElement(element, W_R)
                found[-1].results = [etree.SubElement(run, W_T)]
        elif element.tag == q("w:instrText"):
            if stack and stack[-1].separate is None:
                stack[-1].code += element.text or ""
        elif element.tag == W_T:
            for field in stack:
                if field.separate is not None:
                    field.results.append(element)
        elif (kind := element.get(q("w:fldCharType"))) == "begin":
            stack.append(_Field("", [], None, None))
            found.append(stack[-1])
        elif kind == "separate" and stack:
            stack[-1].separate = element
        elif kind == "end" and stack:
            stack.pop().end = element
    return found


def _bookmarks(body: Element) -> dict[str, str]:
    open_: dict[str, str] = {}
    texts: dict[str, str] = {}
    for element in body.iter(q("w:bookmarkStart"), q("w:bookmarkEnd"), W_T):
        if element.tag == q("w:bookmarkStart"):
            name = element.get(q("w:name")) or ""
            open_[element.get(q("w:id")) or ""] = name
            texts[name] = ""
        elif element.tag == q("w:bookmarkEnd"):
            open_.pop(element.get(q("w:id")) or "", None)
        else:
            for name in open_.values():
                texts[name] += element.text or ""
    return texts
