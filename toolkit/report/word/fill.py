"""Fill a template: conditions, tables, values, figures, captions, properties. Strict, and look-up only."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from toolkit.errors import TemplateError
from toolkit.files import sha256_bytes
from toolkit.report.content import SIGNATURE, ReportContent, Table
from toolkit.report.figures import Picture
from toolkit.report.tags import DRAWN, Tag, width_emu
from toolkit.report.word.bulk import Bulk, row_texts
from toolkit.report.word.chart import Chart
from toolkit.report.word.check import LintFinding, check_stories
from toolkit.report.word.closing import close
from toolkit.report.word.controls import (
    admit,
    apply_condition,
    fill_control,
    fill_literals,
    from_the_right,
    hold_anything,
    kept_whole,
    release,
    replace_content,
    settle,
)
from toolkit.report.word.fields import number_captions
from toolkit.report.word.filled import Entry, Filled
from toolkit.report.word.look import must_be_read
from toolkit.report.word.own import RED, own_paragraph
from toolkit.report.word.package import Template, open_package, undated
from toolkit.report.word.pages import PAGE_MARK, drop_notes, headers_shown, mark_pages, set_properties
from toolkit.report.word.pictures import Ids, chart_run, free_height, insert_at_mark, picture_run
from toolkit.report.word.rows import fill_table
from toolkit.report.word.scan import Site, row_in, scan, table_of, visible_texts
from toolkit.report.word.styles import levelled
from toolkit.report.word.toc import write_contents
from toolkit.report.word.xml import (
    W_P,
    W_TR,
    Element,
    Story,
    ancestor,
    new_run,
    paragraph_text,
    q,
    stories,
    write_back,
)
from toolkit.words.phrasebook import locale_of

_MARK = "\ufdd0"  # a noncharacter: it stands where a literal figure goes, and no value may hold it


@dataclass(frozen=True, slots=True, kw_only=True)
class Survey:
    """What a template asks for before anything is drawn: ``figures`` by name, and what its lint found."""

    lint: tuple[LintFinding, ...]
    figures: tuple[str, ...]


def survey(template: Template, content: ReportContent, *, fonts: bool = False) -> Survey:
    """Return which figures the template will show for this content, and the findings of its lint.

    ``fonts`` also warns of fonts that are not installed.

    Raises
    ------
    TemplateError
        the lint finds an error
    """
    package = open_package(template)
    parts = stories(package)
    lint = check_stories(package, parts, content.style, content.vocabulary, fonts=fonts)
    errors = [finding for finding in lint if finding.level == "error"]
    if errors:
        raise _lint_error(template, errors)
    names = [site.tag.name for site in scan(parts) if site.tag.family == "figure"]
    return Survey(lint=lint, figures=tuple(dict.fromkeys(name for name in names if name in content.plots)))


def fill(
    template: Template,
    content: ReportContent,
    pictures: Mapping[str, Picture],
    *,
    allow_missing: bool = False,
    surveyed: Survey | None = None,
) -> Filled:
    """Fill a template.

    Parameters
    ----------
    template : a template that is safe to open
    content : what the report says
    pictures : the drawn figures by name, those of its `survey` at least
    allow_missing : print a visible mark for a value that the test has not, in place of an error
    surveyed : the survey of this template for this content, where it was made before

    Raises
    ------
    TemplateError
        the lint finds an error, or a value, figure or table of the template is not in this test
    """
    lint = (surveyed or survey(template, content)).lint
    package: Any = open_package(template)
    parts = stories(package)
    return _Filler(package, parts, template, content, pictures, allow_missing).run(lint)


def _lint_error(template: Template, errors: list[LintFinding]) -> TemplateError:
    first = errors[0]
    further = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
    return TemplateError(
        f"the template has errors: {first.message}{further}",
        where=f"{template.path}: {first.part}, {first.place}",
        got="; ".join(f"{error.rule}: {error.message}" for error in errors[:10]),
        expected="a template that 'toolkit template check' finds no error in",
        next_step=f"run 'toolkit template check {template.path}' and correct what it names",
        rule=first.rule,
    )


@dataclass(slots=True)
class _Log:
    manifest: list[Entry] = field(default_factory=list)
    figures: list[tuple[str, str]] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    rows: list[Element | tuple[str, ...]] = field(default_factory=list)
    pictures: list[str] = field(default_factory=list)
    of_the_run: set[str] = field(default_factory=set)
    rows_of_the_run: set[int] = field(default_factory=set)
    in_margins: set[str] = field(default_factory=set)
    elsewhere: set[str] = field(default_factory=set)
    charts: list[Chart] = field(default_factory=list)
    drawn_in: list[tuple[str, str]] = field(default_factory=list)


class _Filler:
    def __init__(
        self,
        package: Any,
        parts: list[Story],
        template: Template,
        content: ReportContent,
        pictures: Mapping[str, Picture],
        allow_missing: bool,
    ) -> None:
        self.package, self.parts, self.template, self.content = package, parts, template, content
        self.pictures, self.allow_missing = pictures, allow_missing
        self.ids, self.log = Ids.of(parts), _Log()
        self.bulk = Bulk.of(parts, cache(lambda: levelled(package)))
        self.printed = kept_whole if from_the_right(package, parts) else str

    def run(self, lint: tuple[LintFinding, ...]) -> Filled:
        places = scan(self.parts)
        witnesses = [_witness(site) for site in places]
        body = self.parts[0].root
        self._conditions()
        drop_notes(self.parts)
        never, perhaps = headers_shown(self.package, self.parts)
        unsure = {*never, *(name for name, _ in perhaps)}
        paths = {
            site.tag.path
            for site, witness in zip(places, witnesses, strict=True)
            if site.story.name not in unsure and _stands(witness, site.story)
        }
        sites = scan(self.parts)
        self._demand(sites)
        # Everything is located before anything is written: a value that reads like a tag stays a value.
        tables = [(site, table_of(site)) for site in sites if site.tag.family == "table"]
        patterns = [row for _, table in tables for row in _prototypes(table, sites)]
        kept = {
            id(site)
            for site in sites
            if site.tag.family != "table"
            and any(element is row for element in site.element.iterancestors(W_TR) for row in patterns)
        }
        outside = [site for site in sites if id(site) not in kept]
        for site, table in tables:
            self._table(site, table)
        self._literals([site for site in outside if site.form == "literal"])
        for site in outside:
            if site.form == "control" and site.tag.family == "value":
                free_height(ancestor(site.element, W_P))
                date = self.content.values.get(site.tag.path)
                iso = (
                    str(date.value) if date is not None and date.kind == "date" and not date.missing else None
                )
                fill_control(site.element, self._value(site.tag, site), iso_date=iso)
        for site in outside:
            if site.form == "control" and site.tag.family in DRAWN:
                self._figure_control(site)
        added = self._marks(paths)
        for name, text in close(body.find(q("w:body")), self.content, signed=SIGNATURE in paths):
            self.log.manifest.append(Entry(tag=f"closing:{name}", text=text, part=self.parts[0].name))
        page_mark = self.content.page_mark
        if page_mark is not None:
            mark_pages(self.package, page_mark)
            self.log.manifest.append(Entry(tag=PAGE_MARK, text=page_mark, part=self.parts[0].name))
        number_captions(body)
        contents = write_contents(self.package, body)
        cells = tuple(row if isinstance(row, tuple) else row_texts(row) for row in self.log.rows)
        for story in self.parts:
            write_back(story)
        set_properties(self.package, self.content)
        stream = io.BytesIO()
        self.package.save(stream)
        return Filled(
            docx=undated(self.bulk.written(stream.getvalue())),
            manifest=tuple(self.log.manifest),
            figures=tuple(self.log.figures),
            cells=cells,
            missing=tuple(dict.fromkeys(self.log.missing)),
            lint=lint,
            marks_added=added,
            page_mark=page_mark,
            contents=contents,
            main_part=self.parts[0].name,
            pictures=tuple(dict.fromkeys(self.log.pictures)),
            never_shown=never,
            perhaps_shown=perhaps,
            of_the_run=frozenset(self.log.of_the_run),
            rows_of_the_run=frozenset(self.log.rows_of_the_run),
            charts=tuple(self.log.charts),
            to_be_read=must_be_read(self.content.vocabulary, self.content.style)
            | {entry.tag for entry in self.log.manifest if not entry.tag.startswith("tk:")},
            in_margins=frozenset(self.log.in_margins - self.log.elsewhere),
            demanded=self.content.vocabulary.demanded(self.content.style.required),
            drawn_in=tuple(self.log.drawn_in),
        )

    def _conditions(self) -> None:
        for site in scan(self.parts):
            if site.tag.family != "if":
                continue
            attached = any(element is site.story.root for element in site.element.iterancestors())
            if attached:
                apply_condition(site.element, self.content.holds(site.tag.name))

    def _demand(self, sites: list[Site]) -> None:
        """Refuse a template that asks for what this test has not, naming everything at once."""
        absent: dict[str, str] = {}
        for site in sites:
            tag = site.tag
            if tag.family == "value":
                value = self.content.values.get(tag.path)
                if value is None or value.missing:
                    absent[f"tk:{tag.path}"] = f"{site.story.name}, {site.place}"
            elif tag.family in DRAWN and tag.name not in self.content.plots:
                absent[f"tk:{tag.path}"] = f"{site.story.name}, {site.place}"
            elif tag.family == "table" and (problem := _unprintable(self.content.tables.get(tag.name))):
                absent[f"tk:{tag.path}{problem}"] = f"{site.story.name}, {site.place}"
        if not absent or self.allow_missing:
            return
        raise TemplateError(
            f"the test has no value for {', '.join(absent)}",
            where=f"{self.template.path}: {next(iter(absent.values()))}",
            got=f"nothing for {len(absent)} tag{'s' if len(absent) > 1 else ''}",
            expected="a value for every tag of the template",
            next_step="add it to test.toml or complete the test, put the place into a tk:if control, "
            "or print a visible mark with --allow-missing",
            rule="missing-value",
        )

    def _value(self, tag: Tag, site: Site | None, part: str | None = None) -> str:
        value = self.content.values.get(tag.path)
        name = part or (site.story.name if site else "")
        if value is None or value.missing:
            text = self.content.style.missing
            self.log.missing.append(f"tk:{tag.path}")
        else:
            text = value.text(tag.spec, self.content.style).replace(_MARK, "\ufffd")
        if site is None or not site.fallback:
            self.log.manifest.append(Entry(tag=f"tk:{tag.path}", text=text, part=name))
        return self.printed(text)

    def _table(self, site: Site, element: Element | None) -> None:
        table = self.content.tables.get(site.tag.name)
        if element is None or table is None:
            return
        if not table.rows:
            self.log.missing.append(f"tk:{site.tag.path}")
            blank = (self.content.style.missing,) + ("",) * (len(table.columns) - 1)
            table = Table(name=table.name, columns=table.columns, rows=(blank,))
        if site.form == "control":
            settle(site.element)

        def said(column: str, text: str) -> None:
            if not site.fallback:
                self.log.manifest.append(
                    Entry(tag=f"tk:{site.tag.path}.{column}", text=text, part=site.story.name)
                )

        filled_table = fill_table(
            element,
            table,
            lambda tag: self._value(tag, None, site.story.name),
            said,
            self.content.style,
            self.ids,
            self.bulk,
            self.printed,
        )
        if not site.fallback:
            passing = {f"tk:{site.tag.path}.{column.name}" for column in table.columns if column.of_the_run}
            if passing:
                self.log.of_the_run |= passing
                self.log.rows_of_the_run |= set(
                    range(len(self.log.rows), len(self.log.rows) + len(filled_table))
                )
            self.log.rows += filled_table

    def _literals(self, sites: list[Site]) -> None:
        paragraphs: set[int] = set()
        naming = {id(site.element) for site in sites if site.tag.family == "table"}
        for site in sites:
            if id(site.element) in paragraphs:
                continue
            paragraphs.add(id(site.element))
            free_height(site.element)
            release(site.element)
            figures: list[Tag] = []

            def resolve(tag: Tag, site: Site = site, figures: list[Tag] = figures) -> str:
                if tag.family == "table":
                    return ""
                if tag.family not in DRAWN:
                    return self._value(tag, site)
                if not self._drawable(tag):
                    return self._no_figure(tag, site)
                figures.append(tag)
                return _MARK

            fill_literals(site.element, resolve)
            for tag in figures:
                insert_at_mark(site.element, _MARK, self._picture(tag, site))
            admit(site.element)
            if id(site.element) in naming:
                _drop_if_empty(site.element)

    def _figure_control(self, site: Site) -> None:
        free_height(next(site.element.iter(W_P), ancestor(site.element, W_P)))
        if self._drawable(site.tag):
            run = self._picture(site.tag, site)
        else:
            run = new_run(self._no_figure(site.tag, site), None)
        settle(site.element)
        if site.tag.family == "chart":
            hold_anything(site.element)
        replace_content(site.element, run)
        admit(site.element)

    def _drawable(self, tag: Tag) -> bool:
        return tag.name in (self.pictures if tag.family == "figure" else self.content.plots)

    def _no_figure(self, tag: Tag, site: Site) -> str:
        self.log.missing.append(f"tk:{tag.path}")
        if not site.fallback:
            self.log.manifest.append(
                Entry(tag=f"tk:{tag.path}", text=self.content.style.missing, part=site.story.name)
            )
        return self.content.style.missing

    def _picture(self, tag: Tag, site: Site) -> Element:
        plot = self.content.plots[tag.name]
        width = width_emu(tag.spec)
        if tag.family == "chart":
            language = locale_of(self.content.style.language)
            run, drawn, chart = chart_run(
                site.story, self.package, site.element, plot, width, self.ids, language
            )
            self.log.charts.append(chart)
        else:
            drawn = self.pictures[tag.name].png
            run = picture_run(
                site.story, self.package, site.element, self.pictures[tag.name], plot.alt, tag.name, width,
                self.ids,
            )  # fmt: skip
        if not site.fallback:
            self.log.figures.append((f"tk:{tag.path}", plot.alt))
            self.log.drawn_in.append((f"tk:{tag.path}", site.story.name))
            margin = site.story.root.tag in (q("w:hdr"), q("w:ftr"))
            (self.log.in_margins if margin else self.log.elsewhere).add(f"tk:{tag.path}")
            self.log.pictures.append(f"{tag.name} {sha256_bytes(drawn)}")
        return run

    def _marks(self, paths: set[str]) -> tuple[str, ...]:
        """Say what must be said (simulated, unverified, draft) where the template has no place for it."""
        places = self.content.vocabulary.marks
        body = self.parts[0].root.find(q("w:body"))
        added = []
        for name, text in reversed(self.content.marks):
            if paths & places[name]:
                continue
            body.insert(0, own_paragraph(text, bold=True, colour=RED))
            self.log.manifest.append(Entry(tag=f"mark:{name}", text=text, part=self.parts[0].name))
            added.append(name)
        return tuple(added)


def _witness(site: Site) -> Element | None:
    """Return what must still stand in the filled document for a place to be printed; None for no place.

    A condition is a place by the words within it: its control goes.
    """
    if site.fallback:
        return None
    return site.element if site.tag.family != "if" else next(_words_in(site.element), None)


def _words_in(control: Element) -> Iterator[Element]:
    # A control stands around paragraphs, or within one.
    paragraphs = list(control.iter(W_P)) or list(control.iterancestors(W_P))[:1]
    texts = (text for paragraph in paragraphs for text in visible_texts(paragraph))
    within = set(control.iter())
    return (text for text in texts if text in within and (text.text or "").strip())


def _stands(witness: Element | None, story: Story) -> bool:
    return witness is not None and any(element is story.root for element in witness.iterancestors())


def _prototypes(table: Element | None, sites: list[Site]) -> list[Element]:
    """Return a table's rows that hold a ``tk:row.`` tag, through any table within."""
    if table is None:
        return []
    rows = (row_in(table, site.element) for site in sites if site.tag.family == "row")
    return [row for row in rows if row is not None]


def _drop_if_empty(paragraph: Element) -> None:
    # The paragraph that only named a table goes with its tag.
    parent = paragraph.getparent()
    if (
        parent is not None
        and not paragraph_text(paragraph).strip()
        and len(list(paragraph.iter(q("w:drawing")))) == 0
    ):
        parent.remove(paragraph)


def _unprintable(table: Table | None) -> str:
    if table is None or not table.rows:
        return " (no rows)"
    for row in table.rows:
        for column, cell in zip(table.columns, row, strict=True):
            if isinstance(cell, float) and cell - cell != 0:
                return f" ({column.name} is not finite)"
    return ""


__all__ = ["Entry", "Filled", "Survey", "fill", "survey"]
