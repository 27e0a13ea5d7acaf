"""What filling a template made: the Word file, and all that must be found in it and in its PDF."""

from __future__ import annotations

import io
import posixpath
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass, field

from lxml import etree

from toolkit.report.word.chart import Chart
from toolkit.report.word.lint import LintFinding
from toolkit.report.word.toc import Contents
from toolkit.report.word.xml import STORIES, W_P, W_SDT, W_TR, Element, ancestor, q


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One value as it was printed: its tag, its text, the part that it stands in."""

    tag: str
    text: str
    part: str

    def as_dict(self) -> dict[str, str]:
        """Return the entry as a JSON-ready dict."""
        return {"tag": self.tag, "text": self.text, "part": self.part}


@dataclass(frozen=True, slots=True, kw_only=True)
class Filled:
    """A filled report: the .docx, and what must be found in it and in its PDF.

    ``figures`` are (tag, alt) of every picture; ``cells`` the rows of filled tables, cell by cell;
    ``missing`` the tags that print the visible mark; ``contents`` the lines of its tables of contents;
    ``pictures`` the SHA-256 of each figure as it was drawn; ``never_shown`` the headers and footers that no
    page can show, ``perhaps_shown`` those that depend on the number of pages, with their own words;
    ``of_the_run`` the tags whose values differ from run to run, and ``rows_of_the_run`` the rows with them;
    ``in_margins`` the figures that stand in headers and footers alone; ``page_mark`` the line that every page
    carries; ``charts`` those of the figures that are charts of Word's own, in their order; ``to_be_read`` the
    tags of the manifest whose text people must be able to read in the PDF; ``demanded`` the tags that a page
    must show, and ``drawn_in`` the parts that hold each figure.
    """

    docx: bytes
    manifest: tuple[Entry, ...]
    figures: tuple[tuple[str, str], ...]
    cells: tuple[tuple[str, ...], ...]
    missing: tuple[str, ...]
    lint: tuple[LintFinding, ...]
    marks_added: tuple[str, ...]
    contents: Contents = field(default_factory=Contents)
    main_part: str = "word/document.xml"
    pictures: tuple[str, ...] = ()
    never_shown: tuple[str, ...] = ()
    perhaps_shown: tuple[tuple[str, tuple[str, ...]], ...] = ()
    of_the_run: frozenset[str] = frozenset()
    rows_of_the_run: frozenset[int] = frozenset()
    in_margins: frozenset[str] = frozenset()
    page_mark: str | None = None
    charts: tuple[Chart, ...] = ()
    to_be_read: frozenset[str] = frozenset()
    demanded: tuple[str, ...] = ()
    drawn_in: tuple[tuple[str, str], ...] = ()


# A Word file as it was written, read back piece by piece: its tables may be of any length.


_RELATIONS = "{http://schemas.openxmlformats.org/package/2006/relationships}Relationship"


def text_elements(docx: bytes, main_part: str) -> Iterator[Element]:
    """Yield each paragraph, control and drawing of the parts with text; a row is let go when it ends."""
    with zipfile.ZipFile(io.BytesIO(docx)) as archive:
        for name in parts_of(archive, main_part):
            with archive.open(name) as part:
                yield from _elements(part)


def _elements(part: object) -> Iterator[Element]:
    tags = (W_P, W_SDT, q("wp:docPr"), W_TR)
    events = etree.iterparse(
        part, events=("end",), tag=tags, resolve_entities=False, no_network=True, load_dtd=False
    )
    for _, element in events:
        if element.tag != W_TR:
            yield element
        elif ancestor(element, W_TR) is None:
            element.clear()


def parts_of(archive: zipfile.ZipFile, main: str) -> list[str]:
    """Return the main part, and the headers, footers and notes that it refers to."""
    folder, name = posixpath.split(main)
    relations = posixpath.join(folder, "_rels", f"{name}.rels")
    paths = [main]
    if relations not in archive.namelist():
        return paths
    for relation in etree.fromstring(archive.read(relations)).iter(_RELATIONS):
        kind = (relation.get("Type") or "").rpartition("/")[2]
        if kind in STORIES and relation.get("TargetMode") != "External":
            # An absolute target begins at the root of the package.
            path = posixpath.normpath(posixpath.join("/", folder, relation.get("Target") or "")).lstrip("/")
            paths += [path] if path not in paths else []
    return paths
