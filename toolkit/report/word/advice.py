"""What a template check advises: on tables over several pages, and on texts that nobody filled in."""

from __future__ import annotations

import re
from collections.abc import Iterator

from toolkit.report.style import Style
from toolkit.report.word.language import fixed_texts
from toolkit.report.word.lint import LintFinding
from toolkit.report.word.scan import LITERAL, Site, control_tag, own_rows, place_of, row_in, table_of
from toolkit.report.word.xml import SDT_PR, W_P, W_SDT, W_T, Element, Story, q

# A text that stands for another one: marks of work undone, the filler of printers, the towns and people of
# specimen forms, a name in brackets, and the domains that RFC 2606 keeps for examples.
_PLACEHOLDER = re.compile(
    r"\b(?:TODO|TBD|FIXME|X{3,}|lorem ipsum|Muster(?:stadt|straße|mann|frau|firma)|Anytown"
    r"|(?:\w+\.)?example\.(?:com|org|net)|Ville-Exemple)\b"
    r"|[\[<](?!\s)[^\W\d_]+ [^\[\]<>{}]+[\]>]",
    re.IGNORECASE,
)


def placeholders(parts: list[Story], style: Style) -> Iterator[LintFinding]:
    """Yield texts of a template and its style file that stand for what somebody was to write there."""
    for element in fixed_texts(parts):
        found = _PLACEHOLDER.search(element.text or "")
        if found:
            story = next(story for story in parts if element in story.root.iter(W_T))
            yield _finding(
                "placeholder", story, element, f"{found[0]!r} stands for a text of yours: write it"
            )
    for story in parts:
        for control in story.root.iter(W_SDT):
            prompt = control.find(f"{SDT_PR}/{q('w:showingPlcHdr')}")
            if prompt is not None and control_tag(control) is None:
                message = "a control that is not the toolkit's shows its prompt, which would be printed"
                yield _finding("placeholder", story, control, message)
    for text in sorted(style.texts):
        found = _PLACEHOLDER.search(text)
        if found:
            yield LintFinding(
                rule="placeholder", level="warning", part="style file", place=text,
                message=f"{found[0]!r} stands for a text of yours: write it",
            )  # fmt: skip


def advice(sites: list[Site]) -> Iterator[LintFinding]:
    """Yield notes on tables that will not read well over several pages, and words that will vanish."""
    for site in sites:
        if site.tag.family != "table" or (table := table_of(site)) is None:
            continue
        rows = own_rows(table)
        if len(rows) > 1 and rows[0].find(f"{q('w:trPr')}/{q('w:tblHeader')}") is None:
            yield _note(
                site, rows[0], "header-row",
                f"{site.tag}: no header row is repeated on the next page: Table Layout, Repeat Header Rows",
            )  # fmt: skip
        patterns = {id(row): row for other in sites if (row := _prototype(table, other)) is not None}
        for row in patterns.values() if patterns else rows[-1:]:
            if row.find(f"{q('w:trPr')}/{q('w:cantSplit')}") is None:
                yield _note(
                    site, row, "split-row",
                    f"{site.tag}: a row may break across pages: Table Properties, Row, clear 'Allow row to "
                    "break across pages'",
                )  # fmt: skip
        if site.form == "literal" and site.element.tag == W_P:
            rest = LITERAL.sub("", "".join(text.text or "" for text in site.element.iter(W_T))).strip()
            if rest:
                yield _note(
                    site, site.element, "table-paragraph",
                    f"{site.tag} shares its paragraph with {rest[:40]!r}: let the tag stand alone in it",
                )  # fmt: skip


def _prototype(table: Element, site: Site) -> Element | None:
    return row_in(table, site.element) if site.tag.family == "row" else None


def _finding(rule: str, story: Story, element: Element, message: str) -> LintFinding:
    return LintFinding(
        rule=rule, level="warning", part=story.name, place=place_of(element, story), message=message
    )


def _note(site: Site, element: Element, rule: str, message: str) -> LintFinding:
    return LintFinding(
        rule=rule, level="note", part=site.story.name, place=place_of(element, site.story), message=message
    )
