"""The fields of a document, each with its code and its result; and the numbers of its captions."""

from __future__ import annotations

import dataclasses
import re
from dataclasses import dataclass

from lxml import etree

from toolkit.report.word.xml import W_P, W_R, W_T, Element, ancestor, field_mark, q

SIMPLE, CHAR, CODE = q("w:fldSimple"), q("w:fldChar"), q("w:instrText")


@dataclass(slots=True, eq=False)
class Field:
    """A field: its ``code``, and the ``whole`` one with the codes of the fields inside it.

    ``begin`` is its first mark, or the element of a simple field; ``separate`` and ``end`` are None where the
    document has none, as of a simple field. ``results`` are the texts that it shows.
    """

    begin: Element
    code: str = ""
    whole: str = ""
    separate: Element | None = None
    end: Element | None = None
    results: list[Element] = dataclasses.field(default_factory=list)

    @property
    def words(self) -> list[str]:
        """The words of its code, the first in capitals: what kind of field it is."""
        kind, *words = self.code.split() or [""]
        return [kind.upper(), *words]

    @property
    def paragraphs(self) -> list[Element] | None:
        """The paragraphs that it fills, from first to last; None where they are no neighbours."""
        first, last = ancestor(self.begin, W_P), None if self.end is None else ancestor(self.end, W_P)
        if first is None or last is None or first.getparent() is not last.getparent():
            return None
        members = [first]
        while members[-1] is not last:
            following = members[-1].getnext()
            if following is None:
                return None
            members.append(following)
        return members

    def show(self, text: str) -> None:
        """Write the text that it shows, in place of the one that is stored."""
        if self.results:
            self.results[0].text = text
            for result in self.results[1:]:
                result.text = ""
            return
        run = etree.Element(W_R)
        etree.SubElement(run, W_T).text = text
        if self.begin.tag == SIMPLE:
            self.begin.append(run)
        elif self.end is not None:
            owner = self.end.getparent()
            if self.separate is None:
                owner.addprevious(field_mark("separate"))
            owner.addprevious(run)


def fields_of(root: Element) -> list[Field]:
    """Return the fields below an element by their places, those inside others too.

    A code outside every field, which Word does not show, is one that consists of it alone.
    """
    fields: list[Field] = []
    open_: list[Field] = []
    for element in root.iter(SIMPLE, CHAR, CODE, W_T):
        text = element.text or ""
        if element.tag == SIMPLE:
            code = element.get(q("w:instr")) or ""
            fields.append(Field(element, code, code, results=list(element.iter(W_T))))
        elif element.tag == W_T:
            for outer in open_:
                if outer.separate is not None:
                    outer.results.append(element)
        elif element.tag == CODE and not open_:
            fields.append(Field(element, whole=text))
        elif element.tag == CODE:
            if open_[-1].separate is None:
                open_[-1].code += text
            for outer in open_:
                outer.whole += "" if outer.separate is not None else text
        elif (kind := element.get(q("w:fldCharType"))) == "begin":
            open_.append(Field(element))
            fields.append(open_[-1])
        elif kind == "separate" and open_:
            open_[-1].separate = element
        elif kind == "end" and open_:
            open_.pop().end = element
    return fields


def number_captions(body: Element) -> None:
    """Write the running number into every SEQ field, and the bookmarked text into every REF field.

    Word shows the stored result until someone updates the fields; removed blocks leave gaps in it.
    """
    counters: dict[str, int] = {}
    named = [field for field in fields_of(body) if len(field.words) > 1]
    for field in named:
        kind, name, *_ = field.words
        if kind != "SEQ":
            continue
        name = name.lower()
        reset = re.search(r"\\r\s*(\d+)", field.code)
        if reset:
            counters[name] = int(reset[1])
        elif "\\c" not in field.words:
            counters[name] = counters.get(name, 0) + 1
        field.show(str(counters.get(name, 0)))
    marks = _bookmarks(body)
    for field in named:
        kind, name, *_ = field.words
        if kind == "REF" and name in marks:
            field.show(marks[name])


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
