"""The lint around the tags: tracked changes, comments, fields, styles, and tags where nothing is filled."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from lxml import etree

from toolkit.report.style import Style
from toolkit.report.template.contents import can_update, contents_fields
from toolkit.report.template.lint import LintFinding
from toolkit.report.template.scan import place_of
from toolkit.report.template.xml import Element, Story, parser, q, walk_fields

_INDEXES = ("TOC", "INDEX", "TOA", "BIBLIOGRAPHY")
_TRACKED = tuple(q(f"w:{one}") for one in ("ins", "del", "moveFrom", "moveTo", "rPrChange", "pPrChange"))


def surroundings(package: object, parts: list[Story], style: Style) -> Iterator[LintFinding]:
    """Yield what around the tags asks for a look, and tags that stand where nothing is filled."""

    def warn(rule: str, story: Story, element: Element, message: str) -> LintFinding:
        return LintFinding(
            rule=rule, level="warning", part=story.name, place=place_of(element, story), message=message
        )

    # Their elements are held, so that an identity stays that of one element.
    written = [one.begin for one in contents_fields(parts[0].root) if can_update(one)]
    known = {id(one) for one in written}
    for story in parts:
        for element in story.root.iter(*_TRACKED):
            yield warn("tracked-changes", story, element, "tracked changes: accept or reject them before use")
            break
        for element in story.root.iter(q("w:del"), q("w:moveFrom")):
            if _TAG.search("".join(one.text or "" for one in element.iter(q("w:delText"), q("w:t")))):
                yield LintFinding(
                    rule="tracked-changes",
                    level="error",
                    part=story.name,
                    place=place_of(element, story),
                    message="a tag stands in a tracked deletion and would be printed: accept the deletion",
                )
        for element in story.root.iter(q("w:commentReference")):
            yield warn("comments", story, element, "a comment will stand in the report")
            break
        for element, code in walk_fields(story.root):
            word = code.split()[0].upper() if code.split() else ""
            if word in ("DATE", "TIME"):
                yield warn(
                    "date-field", story, element, f"{word} becomes the day of printing; use tk:report.date"
                )
            elif word == "IF":
                yield warn("if-field", story, element, "an IF field is not evaluated; use a tk:if control")
            elif word in _INDEXES and id(element) not in known:
                yield warn(
                    "contents",
                    story,
                    element,
                    f"this {word} field is updated by Word alone, not in the PDF: contents of headings, of "
                    "styles or of captions, in the body, are",
                )
    yield from _unreached(package, parts)
    names = _style_names(package)
    for use, name in style.styles:
        if name.lower() not in names:
            yield LintFinding(
                rule="missing-style",
                level="warning",
                part="word/styles.xml",
                place=name,
                message=f"the style file names {name!r} for {use}; the template has no such style",
            )


def _style_names(package: object) -> set[str]:
    main = package.main_document_part  # type: ignore[attr-defined]
    return {
        (one.find(q("w:name")).get(q("w:val")) or "").lower()
        for one in main._styles_part.element.iter(q("w:style"))
        if one.find(q("w:name")) is not None
    }


_TAG = re.compile(r"\{\{\s*tk:")
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
