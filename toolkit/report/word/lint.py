"""What the template lint says: its rules, and a finding with its rule and place.

A condition may cut in two what it stands around, a field or a section: where it is not fulfilled, its control
goes with all that is in it. Half a field left behind takes
all the text after it; a section's break that goes alone gives its pages the paper of the next section.

What a document must show is printed whatever the test has, and however long it is.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal
from urllib.parse import unquote

from lxml import etree

from toolkit.report.style import Style
from toolkit.report.word.fields import fields_of
from toolkit.report.word.pages import headers_shown
from toolkit.report.word.scan import LITERAL, Site, control_tag, place_of
from toolkit.report.word.styles import StyleSheet
from toolkit.report.word.toc import can_update, contents_fields
from toolkit.report.word.xml import (
    SDT_CONTENT,
    W_P,
    W_SDT,
    W_TBL,
    Element,
    Story,
    ancestor,
    parser,
    q,
)

RULES = {
    "no-tags": "the template has no tag of the toolkit",
    "unknown-tag": "a tag is not in the catalogue",
    "malformed-tag": "a literal tag is not closed or has no path",
    "missing-required": "a required tag is not in the template",
    "unprinted-required": "a required tag stands only where a report may not print it",
    "not-as-chart": "a figure cannot be a chart of Word's own",
    "doubled-tag": "a figure or table stands twice in the body",
    "figure-small": "a figure is so narrow where it stands that its letters cannot be read",
    "coarse-decimals": "decimals by name are too few for the unit that the style file chooses",
    "bad-format": "the format after the bar does not fit the tag",
    "wrong-place": "a tag stands where it cannot be filled",
    "overlapping-tags": "a tag stands inside a control that will be filled as a whole",
    "cut-by-condition": "a condition holds a part of a field or of a section",
    "no-table": "a table tag has no table",
    "prototype": "a table has no prototype row, or more than one",
    "unknown-column": "a prototype row names a column that the table has not",
    "column-count": "a prototype row without tags has more or fewer cells than the table has columns",
    "unreadable-tag": "a tag that must be read would be hidden, tiny, or of the colour behind it",
    "tracked-changes": "the template holds tracked changes",
    "comments": "the template holds comments",
    "date-field": "a DATE or TIME field becomes the day of printing",
    "if-field": "an IF field is not evaluated",
    "stale-field": "a field is not computed when the report is printed",
    "broken-reference": "a field refers to a bookmark that is not there",
    "contents": "a table of contents or an index is of a kind that is not updated",
    "missing-style": "a style that the style file names is not in the template",
    "font-unavailable": "a font is not installed and will be replaced",
    "character-undrawn": "no installed font has a character of the text",
    "placeholder": "a text stands for what somebody was to write there",
    "header-row": "the header row of a table is not repeated on the next page",
    "table-paragraph": "the paragraph of a table tag holds other text",
}


Level = Literal["error", "warning", "note"]


@dataclass(frozen=True, slots=True, kw_only=True)
class LintFinding:
    """One finding: rule, level, the part of the package, the place in it, and a sentence."""

    rule: str
    level: Level
    part: str
    place: str
    message: str


# The lint around the tags: tracked changes, comments, fields, styles, and tags where nothing is filled.


def at_element(
    rule: str, story: Story, element: Element, message: str, level: Level = "warning"
) -> LintFinding:
    """Return what the lint says of an element of a story."""
    return LintFinding(
        rule=rule, level=level, part=story.name, place=place_of(element, story), message=message
    )


# Fields that the print shows as they must be: LibreOffice computes the first, the others are what they were.
# Of any other the print holds what stood in the template, nothing, or the name of a temporary file.
_COMPUTED = "PAGE NUMPAGES SEQ REF PAGEREF TITLE SUBJECT KEYWORDS COMMENTS".split()
_CONSTANT = (
    "DOCPROPERTY DOCVARIABLE QUOTE HYPERLINK EQ ADVANCE AUTOTEXT MACROBUTTON GOTOBUTTON FORMTEXT "
    "FORMCHECKBOX FORMDROPDOWN DISPLAYBARCODE XE TC TA"
).split()
_INDEXES = ("TOC", "INDEX", "TOA", "BIBLIOGRAPHY")
_TRACKED = tuple(q(f"w:{one}") for one in ("ins", "del", "moveFrom", "moveTo", "rPrChange", "pPrChange"))


def surroundings(package: object, parts: list[Story], style: Style) -> Iterator[LintFinding]:
    """Yield what around the tags asks for a look, and tags that stand where nothing is filled."""

    # Their elements are held, so that an identity stays that of one element.
    written = [field.begin for field in contents_fields(parts[0].root) if can_update(field)]
    placed = {id(one) for one in written}
    bookmarks = {e.get(q("w:name"), "").lower() for s in parts for e in s.root.iter(q("w:bookmarkStart"))}
    for story in parts:
        for element in story.root.iter(*_TRACKED):
            yield at_element(
                "tracked-changes", story, element, "tracked changes: accept or reject them before use"
            )
            break
        yield from _deleted_tags(story)
        for element in story.root.iter(q("w:commentReference")):
            yield at_element("comments", story, element, "a comment will stand in the report")
            break
        for field in fields_of(story.root):
            element, code = field.begin, field.whole
            word = code.split()[0].upper() if code.split() else ""
            if word in ("DATE", "TIME"):
                yield at_element(
                    "date-field", story, element, f"{word} becomes the day of printing; use tk:report.date"
                )
            elif word == "IF":
                yield at_element(
                    "if-field", story, element, "an IF field is not evaluated; use a tk:if control"
                )
            elif word in _INDEXES and id(element) not in placed:
                yield at_element(
                    "contents",
                    story,
                    element,
                    f"this {word} field is updated by Word alone, not in the PDF: contents of headings, of "
                    "styles or of captions, in the body, are",
                )
            elif word and word not in (*_INDEXES, *_COMPUTED, *_CONSTANT):
                message = (
                    f"{word} is not computed for the PDF, which shows what stands in the template or nothing"
                )
                yield at_element("stale-field", story, element, message)
            elif word in ("REF", "PAGEREF") and _target(code) not in bookmarks:
                message = f"{word} refers to a bookmark that is not there: {_target(code) or 'none'}"
                yield at_element("broken-reference", story, element, message, "error")
    yield from _unreached(package, parts)
    for story in parts:
        yield from _aside(story)
    names = set(StyleSheet.of(package).names.values())
    for use, name in style.styles:
        if name.lower() not in names:
            yield LintFinding(
                rule="missing-style",
                level="warning",
                part="word/styles.xml",
                place=name,
                message=f"the style file names {name!r} for {use}; the template has no such style",
            )


_DELETIONS = (q("w:del"), q("w:moveFrom"))


def _target(code: str) -> str:
    """Return the bookmark that a field refers to, which Word knows whatever its case."""
    return next(iter(code.split()[1:]), "").strip('"').lower()


def _deleted_tags(story: Story) -> Iterator[LintFinding]:
    """Find tags that a tracked deletion touches: what it deletes would be printed, inside the value too."""
    for control in story.root.iter(W_SDT):
        if control_tag(control) is not None and _is_deleted(control):
            message = "a tag stands in a tracked deletion and would be printed: accept the deletion"
            yield at_element("tracked-changes", story, control, message, "error")
    for paragraph in story.root.iter(W_P):
        pieces = [
            (piece.text or "", _is_deleted(piece))
            for piece in paragraph.iter(q("w:t"), q("w:delText"))
            if ancestor(piece, W_P) is paragraph
        ]
        if any(deleted for _, deleted in pieces) and _touches_a_tag(pieces):
            message = (
                "a tracked deletion takes a tag or a part of it, and would be printed: accept or reject it"
            )
            yield at_element("tracked-changes", story, paragraph, message, "error")


def _is_deleted(element: Element) -> bool:
    """Tell whether a text or control is deleted: by itself, with its row or with its cell."""
    return any(
        outer.tag in _DELETIONS
        or outer.find(f"{q('w:trPr')}/{q('w:del')}") is not None
        or outer.find(f"{q('w:tcPr')}/{q('w:cellDel')}") is not None
        for outer in element.iterancestors()
    )


def _touches_a_tag(pieces: list[tuple[str, bool]]) -> bool:
    """Tell whether a deletion lies in a tag, in the text as it stands or as it is once accepted."""
    whole = "".join(text for text, _ in pieces)
    marks = [deleted for text, deleted in pieces for _ in text]
    if any(any(marks[tag.start() : tag.end()]) for tag in _WHOLE_TAG.finditer(whole)):
        return True
    remains = "".join(text for text, deleted in pieces if not deleted)
    places, at = [], 0
    for text, deleted in pieces:
        places += [at] if deleted else []
        at += 0 if deleted else len(text)
    return any(tag.start() < place < tag.end() for tag in LITERAL.finditer(remains) for place in places)


_TAG = re.compile(r"\{\{\s*tk:")
_WHOLE_TAG = re.compile(rf"{LITERAL.pattern}|{_TAG.pattern}")
_TEXTS = ("t", "v")  # a:t of drawings and diagrams, m:t of formulas, c:v of charts
_WORDS = q("w:t")[: -len("t")]


def _unreached(package: Any, parts: list[Story]) -> Iterator[LintFinding]:
    """Find literal tags in formulas, diagrams and charts: they would be printed as they are."""
    trees = [(story.name, story.root) for story in parts]
    walked = {name for name, _ in trees}
    for part in package.iter_parts():
        name = str(part.partname).lstrip("/")
        if name in walked or not re.search(r"/(charts|diagrams|drawings)/[^/]*\.xml$", name):
            continue
        trees.append((name, etree.fromstring(part.blob, parser())))
    for name, root in trees:
        text = "".join(
            e.text or ""
            for e in root.iter()
            if isinstance(e.tag, str) and e.tag.rpartition("}")[2] in _TEXTS and not e.tag.startswith(_WORDS)
        )
        if _TAG.search(text):
            yield LintFinding(
                rule="wrong-place",
                level="error",
                part=name,
                place="part",
                message="a literal tag stands in a formula, a diagram or a chart, where nothing is filled",
            )


def _aside(story: Story) -> Iterator[LintFinding]:
    """Find literal tags beside the text: in alternative texts, drawn words, codes of fields, links."""
    findings = [
        (element, "an alternative text, a drawn word or another property")
        for element in story.root.iter(etree.Element)
        if element.tag != q("w:alias") and any(_TAG.search(str(value)) for value in element.attrib.values())
    ]
    findings += [
        (field.begin, "the code of a field") for field in fields_of(story.root) if _TAG.search(field.whole)
    ]
    targets = {rel.rId for rel in story.part.rels.values() if _TAG.search(unquote(rel.target_ref))}
    findings += [
        (element, "the address of a link")
        for element in story.root.iter(q("w:hyperlink"))
        if element.get(q("r:id")) in targets
    ]
    for element, where in {id(element): (element, where) for element, where in findings}.values():
        message = f"a literal tag stands in {where}, where nothing is filled"
        yield at_element("wrong-place", story, element, message, "error")


_CHANGES = {"begin": 1, "end": -1}
_BLOCKS = (W_P, W_TBL, W_SDT)


def cut_in_two(sites: list[Site]) -> Iterator[LintFinding]:
    """Yield an error for each condition that holds a part of a field, or the break of a section it is in."""
    for site in sites:
        if site.tag.family != "if" or site.form != "control":
            continue
        if _holds_half_a_field(site.element):
            message = (
                f"{site.tag} holds one end of a field, and the other is outside: take the whole field in"
            )
            yield at_element("cut-by-condition", site.story, site.element, message, "error")
        if _holds_the_break_of_what_is_before(site.element):
            message = (
                f"{site.tag} holds the break of a section that begins before it: without it the section "
                "takes the paper and the headers of the next one: take the whole section in, or none of it"
            )
            yield at_element("cut-by-condition", site.story, site.element, message, "error")


def _holds_half_a_field(control: Element) -> bool:
    depth = 0
    for mark in control.iter(q("w:fldChar")):
        kind = mark.get(q("w:fldCharType")) or ""
        if depth == 0 and kind != "begin":
            return True
        depth += _CHANGES.get(kind, 0)
    return depth != 0


def _holds_the_break_of_what_is_before(control: Element) -> bool:
    if next(_breaks(control), None) is None:
        return False
    before = _block_before(control)
    return before is not None and not _ends_a_section(before)


def _breaks(element: Element) -> Iterator[Element]:
    return (section for section in element.iter(q("w:sectPr")) if ancestor(section, W_P) is not None)


def _block_before(control: Element) -> Element | None:
    """Return what stands before a control in the body, through the controls around it."""
    element = control
    while element is not None:
        for sibling in element.itersiblings(preceding=True):
            if sibling.tag in _BLOCKS:
                return sibling
        element = element.getparent()
        if element is None or element.tag not in (SDT_CONTENT, W_SDT):
            return None
    return None


def _ends_a_section(block: Element) -> bool:
    """Tell whether a block ends with a section's break; a control's properties are none."""
    paragraphs = [block] if block.tag == W_P else list(block.iter(W_P))
    return bool(paragraphs) and next(_breaks(paragraphs[-1]), None) is not None


def conditions_around(element: Element) -> Iterator[str]:
    """Yield the names of the ``tk:if`` controls around an element, the nearest first."""
    for control in element.iterancestors(W_SDT):
        tag = control_tag(control)
        if tag is not None and tag.family == "if":
            yield tag.name


def unprinted(
    package: Any, parts: list[Story], sites: Sequence[Site], tags: Sequence[str]
) -> Iterator[LintFinding]:
    """Yield an error for each demanded tag that stands only where a report may not print it.

    A condition that asks for the tag itself keeps it wherever there is something to print. A header that
    depends on the number of pages alone is judged when a report is made.
    """
    sections = [
        section
        for section in package.main_document_part.element.iter(q("w:sectPr"))
        if not any(conditions_around(section))
    ]
    never, _ = headers_shown(package, parts, sections)
    for tag in tags:
        places = [site for site in sites if f"tk:{site.tag.path}" == tag]
        reasons = [_why(site, never) for site in places]
        if places and all(reasons):
            site = places[0]
            yield LintFinding(
                rule="unprinted-required", level="error", part=site.story.name, place=site.place,
                message=f"{tag} is required, and may not be printed: it stands {reasons[0]}",
            )  # fmt: skip


def _why(site: Site, never: Sequence[str]) -> str:
    path = site.tag.path
    own = (path, site.tag.name)
    condition = next((name for name in conditions_around(site.element) if name not in own), None)
    if condition is not None:
        return f"in tk:if.{condition}, which goes where the test has no such result"
    return (
        f"in {site.story.name}, which no page shows without a condition" if site.story.name in never else ""
    )
