"""WordprocessingML by lxml: names, parts to walk, small helpers."""

from __future__ import annotations

import re
import unicodedata
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

from lxml import etree

from toolkit.printable import escaped

Element = Any  # lxml's own class; its stubs do not cover the custom classes of python-docx

NS = {
    "w": "http://schemas.openxmlformats.org/wordprocessingml/2006/main",
    "r": "http://schemas.openxmlformats.org/officeDocument/2006/relationships",
    "mc": "http://schemas.openxmlformats.org/markup-compatibility/2006",
    "wp": "http://schemas.openxmlformats.org/drawingml/2006/wordprocessingDrawing",
    "a": "http://schemas.openxmlformats.org/drawingml/2006/main",
    "c": "http://schemas.openxmlformats.org/drawingml/2006/chart",
    "pic": "http://schemas.openxmlformats.org/drawingml/2006/picture",
    "v": "urn:schemas-microsoft-com:vml",
    "o": "urn:schemas-microsoft-com:office:office",
    "w14": "http://schemas.microsoft.com/office/word/2010/wordml",
    "w15": "http://schemas.microsoft.com/office/word/2012/wordml",
}
XML_SPACE = "{http://www.w3.org/XML/1998/namespace}space"
_ILLEGAL = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def q(name: str) -> str:
    """Return ``w:t`` in Clark notation."""
    prefix, _, local = name.partition(":")
    return f"{{{NS[prefix]}}}{local}"


W_P, W_R, W_T, W_TBL, W_TR, W_TC, W_SDT = (q(f"w:{one}") for one in "p r t tbl tr tc sdt".split())
P_PR, R_PR = q("w:pPr"), q("w:rPr")
SDT_PR, SDT_CONTENT = q("w:sdtPr"), q("w:sdtContent")
FALLBACK = q("mc:Fallback")


def is_on(stated: str) -> bool:
    """Tell whether a switch is on, as an attribute states it."""
    return stated.lower() not in ("0", "false", "off")


def switch_is_on(switch: Element) -> bool:
    """Tell whether an element that is a switch is on: by itself it is."""
    return is_on(switch.get(q("w:val")) or "1")


def parser() -> etree.XMLParser:
    """Return a parser that resolves nothing, fetches nothing and refuses to grow without bound."""
    return etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, huge_tree=False)


def element(name: str, /, *inner: Element, **values: str | int) -> Element:
    """Return an element with others inside and with attributes, all of WordprocessingML."""
    written = etree.Element(q(name), {q(f"w:{key}"): str(value) for key, value in values.items()})
    written.extend(inner)
    return written


def field_mark(kind: str) -> Element:
    """Return a run with a mark of a field: ``begin``, ``separate`` or ``end``."""
    return element("w:r", element("w:fldChar", fldCharType=kind))


def text_run(text: str, kind: str = W_T) -> Element:
    """Return a run of text as it is, spaces at its ends too; ``kind`` a text's, or a field's code."""
    content = etree.Element(kind, {XML_SPACE: "preserve"})
    content.text = text
    return element("w:r", content)


@dataclass(slots=True, kw_only=True)
class Story:
    """A part that holds text: body, header, footer, footnotes or endnotes.

    ``sections`` are the body's section properties once someone asked for them.
    """

    name: str
    root: Element
    part: Any
    blob: bool
    sections: list[Element] | None = None

    @property
    def body(self) -> bool:
        """True for the main document."""
        return bool(self.root.tag == q("w:document"))


STORIES = ("header", "footer", "footnotes", "endnotes")


def stories(package: Any) -> list[Story]:
    """Return the parts with text of an opened package, the body first."""
    main = package.main_document_part
    collected = [Story(name=_name(main), root=main.element, part=main, blob=False)]
    names = {_name(main)}
    for rel in sorted(main.rels.values(), key=lambda rel: rel.rId):
        kind = rel.reltype.rpartition("/")[2]
        if rel.is_external or kind not in STORIES or _name(rel.target_part) in names:
            continue
        part = rel.target_part
        names.add(_name(part))
        if hasattr(part, "element"):
            collected.append(Story(name=_name(part), root=part.element, part=part, blob=False))
        else:
            root = etree.fromstring(part.blob, parser())
            collected.append(Story(name=_name(part), root=root, part=part, blob=True))
    return collected


def write_back(story: Story) -> None:
    """Put the tree of a part that python-docx holds as bytes back into it."""
    if story.blob:
        story.part._blob = etree.tostring(story.root, xml_declaration=True, encoding="UTF-8", standalone=True)


def _name(part: Any) -> str:
    return str(part.partname).lstrip("/")


def ancestor(element: Element, tag: str) -> Any:
    """Return the nearest ancestor with a tag."""
    return next(element.iterancestors(tag), None)


def in_fallback(element: Element) -> bool:
    """Tell whether an element is the second copy of a text box (mc:Fallback)."""
    return ancestor(element, FALLBACK) is not None


def own_texts(paragraph: Element) -> list[Element]:
    """Return the w:t of a paragraph that belong to it, not to a text box inside it, nor to deleted text."""
    return [t for t in paragraph.iter(W_T) if ancestor(t, W_P) is paragraph]


def paragraph_text(paragraph: Element) -> str:
    """Return a paragraph's own text."""
    return "".join(t.text or "" for t in own_texts(paragraph))


def clean(text: str) -> str:
    """Return text with the characters that XML cannot hold as escapes."""
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    return _ILLEGAL.sub(lambda match: escaped(match[0]), text)


def right_to_left(text: str) -> bool:
    """Tell whether a text begins, by its first strong character, from the right."""
    for character in text:
        kind = unicodedata.bidirectional(character)
        if kind in ("R", "AL"):
            return True
        if kind == "L":
            return False
    return False


def set_text(t: Element, text: str) -> None:
    """Put text into a w:t; line breaks and tabs become their elements after it."""
    pieces = re.split("([\n\t])", clean(text))
    _plain(t, pieces[0])
    last = t
    for piece in pieces[1:]:
        if not piece:
            continue
        if piece in "\n\t":
            new = etree.Element(q("w:br" if piece == "\n" else "w:tab"))
        else:
            new = etree.Element(W_T)
            _plain(new, piece)
        last.addnext(new)
        last = new


def _plain(t: Element, text: str) -> None:
    t.text = text
    if text != text.strip():
        t.set(XML_SPACE, "preserve")


def new_run(text: str | None, properties: Element | None) -> Element:
    """Return a w:r with properties copied and a text."""
    run = etree.Element(W_R)
    if properties is not None:
        run.append(deepcopy(properties))
    if text is not None:
        t = etree.SubElement(run, W_T)
        set_text(t, text)
        if right_to_left(text):
            _mark_right_to_left(run)
    return run


# Elements of w:rPr that come after w:rtl in the schema's sequence.
_AFTER_RTL = tuple(q(f"w:{one}") for one in ("cs", "em", "lang", "eastAsianLayout", "specVanish", "oMath"))


def _mark_right_to_left(run: Element) -> None:
    properties = run.find(q("w:rPr"))
    if properties is None:
        properties = etree.Element(q("w:rPr"))
        run.insert(0, properties)
    if properties.find(q("w:rtl")) is not None:
        return
    mark = etree.Element(q("w:rtl"))
    later = next((child for child in properties if child.tag in _AFTER_RTL), None)
    if later is None:
        properties.append(mark)
    else:
        later.addprevious(mark)
