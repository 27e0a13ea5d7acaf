"""The template lint: what a template must be before it is filled, each finding with a rule and a place.

Errors keep a report from being made; warnings do not. What makes a file unsafe to open is refused
earlier, by `toolkit.report.word.package`.

It advises, too: on tables over several pages, and on texts that nobody filled in.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import replace

from toolkit.report.style import Style
from toolkit.report.tags import DRAWN, Tag, format_problem, parse_tag, width_emu
from toolkit.report.vocabulary import Vocabulary
from toolkit.report.word.decimals import coarse_decimals
from toolkit.report.word.fonts import missing_fonts, undrawn
from toolkit.report.word.lint import RULES, LintFinding, at_element, cut_in_two, surroundings, unprinted
from toolkit.report.word.look import LEAST_SIZE, must_be_read, unreadable
from toolkit.report.word.package import Template, open_package
from toolkit.report.word.pictures import letters_of
from toolkit.report.word.scan import (
    LITERAL,
    Site,
    broken_literals,
    control_tag,
    filled_by,
    fixed_texts,
    misspelt,
    own_rows,
    row_in,
    scan,
    table_of,
    unbraced,
)
from toolkit.report.word.styles import BODY, StyleSheet
from toolkit.report.word.xml import (
    SDT_CONTENT,
    SDT_PR,
    W_P,
    W_SDT,
    W_T,
    W_TC,
    W_TR,
    Element,
    Story,
    ancestor,
    own_texts,
    q,
    stories,
)
from toolkit.spelling import nearest


def check_template(
    template: Template, style: Style, vocabularies: Mapping[str, Vocabulary], *, fonts: bool = True
) -> tuple[LintFinding, ...]:
    """Return what is wrong with a template, errors first, in document order; notes are advice.

    Parameters
    ----------
    template : a template that is safe to open
    style : its style file, for required tags and style names
    vocabularies : of the kinds of documents that it may be of, by their names (see `vocabulary_of`)
    fonts : also ask the system which fonts it has
    """
    package = open_package(template)
    parts = stories(package)
    sites = scan(parts)
    vocabulary = vocabulary_of(sites, vocabularies)
    return (*check_stories(package, parts, style, vocabulary, fonts=fonts), *advice(sites))


def check_stories(
    package: object, parts: list[Story], style: Style, words: Vocabulary, *, fonts: bool
) -> tuple[LintFinding, ...]:
    """Return the findings of an opened package (see `check_template`)."""
    sites = scan(parts)
    findings = [
        *_tags(sites, style, words),
        *unprinted(package, parts, sites, words.demanded(style.required)),
        *cut_in_two(sites),
        *_tables(sites, words),
        *_broken(parts, words),
        *surroundings(package, parts, style),
        *placeholders(parts, style),
        *coarse_decimals(style, words),
        *unreadable(package, sites, must_be_read(words, style)),
    ]
    if fonts:
        findings += [
            LintFinding(
                rule="font-unavailable",
                level="warning",
                part="word/styles.xml",
                place=name,
                message=f"font {name!r} is not installed and will be replaced: check the layout of the PDF",
            )
            for name in missing_fonts(package, parts)
        ]
        findings += [
            LintFinding(
                rule="character-undrawn",
                level="warning",
                part=story.name,
                place="text",
                message=f"no installed font has {', '.join(boxes[:5])}: empty boxes are printed",
            )
            for story in parts
            if (boxes := undrawn("".join(text.text or "" for text in story.root.iter(W_T))))
        ]
    return tuple(sorted(findings, key=lambda finding: finding.level != "error"))


def vocabulary_of(sites: list[Site], vocabularies: Mapping[str, Vocabulary]) -> Vocabulary:
    """Return the vocabulary that a template was made for, by its tags: the first one where none tells.

    The first kind may have the tags of another one too, a report those of a diagnosis: it is meant where the
    template also has a value that the other kind does not know.
    """
    first, *further = vocabularies
    for name in further:
        beginning = f"{name}."
        if any(site.tag.path.startswith(beginning) for site in sites):
            default, further_words = vocabularies[first], vocabularies[name]
            shared = any(entry.path.startswith(beginning) for entry in default.values)
            return default if shared and _beyond(sites, default, further_words) else further_words
    return vocabularies[first]


def _beyond(sites: list[Site], first: Vocabulary, vocabulary: Vocabulary) -> bool:
    paths = {site.tag.path for site in sites if site.tag.family == "value"}
    return any(first.knows(path) and not vocabulary.knows(path) for path in paths)


def _at(site: Site, rule: str, message: str) -> LintFinding:
    return LintFinding(rule=rule, level="error", part=site.story.name, place=site.place, message=message)


def _tags(sites: list[Site], style: Style, words: Vocabulary) -> Iterator[LintFinding]:
    main = sites[0].story.name if sites else "word/document.xml"
    if not sites:
        yield LintFinding(
            rule="no-tags",
            level="error",
            part=main,
            place="part",
            message="the template has no tag: neither a content control tagged tk:... nor {{tk:...}}",
        )
    present = {f"tk:{site.tag.path}" for site in sites}
    for required in words.demanded(style.required):
        if required not in present:
            yield LintFinding(
                rule="missing-required",
                level="error",
                part=main,
                place="part",
                message=f"the template lacks the required tag {required}",
            )
    counted: dict[str, int] = {}
    for site in sites:
        yield from _one(site, words)
        if site.tag.family in (*DRAWN, "table") and site.story.body and not site.fallback:
            counted[site.tag.path] = counted.get(site.tag.path, 0) + 1
            if counted[site.tag.path] == 2:
                yield _at(
                    site, "doubled-tag", f"tk:{site.tag.path} stands twice in the body; once is allowed"
                )


def _one(site: Site, words: Vocabulary) -> Iterator[LintFinding]:
    tag, family = site.tag, site.tag.family
    families: dict[str, Mapping[str, object]] = {
        "figure": words.figures,
        "chart": dict.fromkeys(words.charts),
        "table": words.tables,
    }
    if not tag.path or re.search(r"[\s|{}]", tag.path):
        yield _at(site, "malformed-tag", f"'{tag}' has no path, or white space in it")
        return
    if family == "chart" and tag.name in words.figures and tag.name not in words.charts:
        yield _at(
            site,
            "not-as-chart",
            f"{tag}: an axis of this figure has names in place of numbers, so that it stands as a picture "
            f"alone: write tk:figure.{tag.name}",
        )
        return
    unknown_condition = family == "if" and not words.knows_condition(tag.name)
    if (
        unknown_condition
        or (family == "value" and not words.knows(tag.path))
        or (tag.name not in families.get(family, {tag.name: ""}))
    ):
        yield _at(site, "unknown-tag", f"{tag} is not known: {_near(tag, words)}")
        return
    kind = family
    if family == "value":
        entry = words.value(tag.path)
        kind = entry.kind if entry else "number"
    if family != "row" and (problem := format_problem(kind, tag.spec)):
        yield _at(site, "bad-format", f"{tag}: {problem}")
    if family == "if" and site.form == "literal":
        yield _at(site, "wrong-place", f"{tag} must be a content control around what it keeps, not a literal")
    if family in DRAWN and _in_heading(site):
        yield _at(site, "wrong-place", f"{tag}: a figure cannot stand in a heading")
    if family in DRAWN and site.story.root.tag in (q("w:footnotes"), q("w:endnotes")):
        # LibreOffice 7.4 loses every picture of a note when it reads a .docx.
        yield _at(site, "wrong-place", f"{tag}: a figure in a note would be missing from the PDF")
    if family in DRAWN and not format_problem(family, tag.spec):
        letters, smallest = letters_of(site.element, site.story, width_emu(tag.spec)), LEAST_SIZE / 2
        if letters < smallest:
            finding = _at(
                site, "figure-small",
                f"{tag}: the letters of the figure would be {letters:.2g} pt high where it stands; nobody "
                f"reads letters below {smallest:g} pt",
            )  # fmt: skip
            # Somewhat larger it is a small picture of its curves, which an organisation may want.
            yield finding if letters < _SEEN_PT else replace(finding, level="warning")
    if site.form == "control":
        content = site.element.find(SDT_CONTENT)
        if content is None:
            yield _at(site, "wrong-place", f"{tag}: the control has no content")
        elif family not in ("if", "table") and content.find(W_TR) is not None:
            yield _at(site, "wrong-place", f"{tag}: a value or figure cannot stand around a table row")
        if family in ("value", "row", *DRAWN):
            yield from _swallowed(site)
        outer = next(
            (
                s
                for s in site.element.iterancestors(W_SDT)
                if (t := control_tag(s)) and t.family in ("value", "row", *DRAWN)
            ),
            None,
        )
        if outer is not None:
            yield _at(
                site, "overlapping-tags", f"{tag} stands inside {control_tag(outer)}, which replaces it"
            )


def _swallowed(site: Site) -> Iterator[LintFinding]:
    """Find literals of other tags inside a control that will be filled as a whole; its own is its prompt."""
    for paragraph in {id(p): p for p in [*site.element.iter(W_P), *site.element.iterancestors(W_P)]}.values():
        inside = [t for t in own_texts(paragraph) if filled_by(t) is site.element]
        for match in LITERAL.finditer("".join(t.text or "" for t in inside)):
            tag = parse_tag(match[1])
            if tag is not None and tag.path != site.tag.path:
                yield _at(site, "overlapping-tags", f"{tag} stands inside {site.tag}, which replaces it")


def _near(tag: Tag, words: Vocabulary) -> str:
    """Name a near tag of the same kind; of a value any tag, for its kind may be misspelt."""
    kind = "" if tag.family == "value" else tag.path.partition(".")[0] + "."
    names = [entry.path.removeprefix(kind) for entry in words.entries if entry.path.startswith(kind)]
    near = nearest(tag.path.removeprefix(kind), names)
    return f"did you mean tk:{kind}{near}?" if near else "see 'toolkit template tags'"


def _in_heading(site: Site) -> bool:
    element = site.element
    first = element if element.tag == W_P else ancestor(element, W_P)
    if first is None:
        first = next(element.iter(W_P), None)
    sheet = StyleSheet.of(site.story.part.package)
    return first is not None and sheet.level_of(first) < BODY


def _tables(sites: list[Site], words: Vocabulary) -> Iterator[LintFinding]:
    inside: set[int] = set()
    for site in sites:
        if site.tag.family != "table" or site.tag.name not in words.tables:
            continue
        table = table_of(site)
        if table is None:
            yield _at(
                site, "no-table", f"{site.tag}: no table inside the control, nor right after its paragraph"
            )
            continue
        columns = [column.name for column in words.tables[site.tag.name].columns]
        rows: list[Element] = []
        for other in sites:
            row = row_in(table, other.element) if other.story is site.story else None
            if row is None:
                continue
            inside.add(id(other))
            if other.tag.family == "row":
                if row not in rows:
                    rows.append(row)
                if other.tag.name not in columns:
                    yield _at(
                        other,
                        "unknown-column",
                        f"{other.tag} is no column of {site.tag}; it has {', '.join(columns)}",
                    )
                else:
                    kind = next(
                        c.kind for c in words.tables[site.tag.name].columns if c.name == other.tag.name
                    )
                    if problem := format_problem(kind, other.tag.spec):
                        yield _at(other, "bad-format", f"{other.tag}: {problem}")
            elif other.tag.family == "table" and other is not site:
                yield _at(other, "overlapping-tags", f"{other.tag} stands inside {site.tag}")
        if len(rows) > 1:
            yield _at(
                site,
                "prototype",
                f"{site.tag}: {len(rows)} rows hold tk:row tags; one prototype row is expected",
            )
        if not rows:
            yield from _untagged(site, table, columns)
        elif any(o.tag.family in DRAWN and row_in(table, o.element) is rows[0] for o in sites):
            yield _at(site, "wrong-place", f"{site.tag}: a figure cannot stand in the prototype row")
    for site in sites:
        if site.tag.family == "row" and id(site) not in inside:
            yield _at(site, "wrong-place", f"{site.tag} stands outside the table of a tk:table tag")


def _untagged(site: Site, table: Element, columns: list[str]) -> Iterator[LintFinding]:
    rows = own_rows(table)
    if len(rows) < 2:
        yield _at(
            site,
            "prototype",
            f"{site.tag}: the table has {len(rows)} rows; a header and a prototype row are expected",
        )
        return
    cells = [cell for cell in rows[-1].iter(W_TC) if ancestor(cell, W_TR) is rows[-1]]
    if len(cells) != len(columns):
        yield _at(
            site,
            "column-count",
            f"{site.tag}: the prototype row has {len(cells)} cells and no tags, the table has "
            f"{len(columns)} columns: {', '.join(columns)}",
        )


def _broken(parts: list[Story], words: Vocabulary) -> Iterator[LintFinding]:
    for story in parts:
        for paragraph in broken_literals(story):
            message = "a literal {{tk: is not closed by }} in the same paragraph"
            yield at_element("malformed-tag", story, paragraph, message, "error")
        for element, text in misspelt(story):
            message = f"{text!r} would be printed as it stands: a tag begins with 'tk:' in small letters"
            yield at_element("malformed-tag", story, element, message, "error")
        for element, path in unbraced(story):
            if words.entry(path) is not None:
                message = f"tk:{path} would be printed as it stands: write {{{{tk:{path}}}}}"
                yield at_element("malformed-tag", story, element, message, "error")


_SEEN_PT = 1.0
"""Of the letters of a figure: below, no more than a spot is printed."""

__all__ = ["RULES", "LintFinding", "check_stories", "check_template"]


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
        match = _PLACEHOLDER.search(element.text or "")
        if match:
            story = next(story for story in parts if element in story.root.iter(W_T))
            yield at_element(
                "placeholder", story, element, f"{match[0]!r} stands for a text of yours: write it"
            )
    for story in parts:
        for control in story.root.iter(W_SDT):
            prompt = control.find(f"{SDT_PR}/{q('w:showingPlcHdr')}")
            if prompt is not None and control_tag(control) is None:
                message = "a control that is not the toolkit's shows its prompt, which would be printed"
                yield at_element("placeholder", story, control, message)
    for text in sorted(style.texts):
        match = _PLACEHOLDER.search(text)
        if match:
            yield LintFinding(
                rule="placeholder", level="warning", part="style file", place=text,
                message=f"{match[0]!r} stands for a text of yours: write it",
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
        if site.form == "literal" and site.element.tag == W_P:
            remainder = LITERAL.sub("", "".join(text.text or "" for text in site.element.iter(W_T))).strip()
            if remainder:
                yield _note(
                    site, site.element, "table-paragraph",
                    f"{site.tag} shares its paragraph with {remainder[:40]!r}: let the tag stand alone in it",
                )  # fmt: skip


def _note(site: Site, element: Element, rule: str, message: str) -> LintFinding:
    return at_element(rule, site.story, element, message, "note")
