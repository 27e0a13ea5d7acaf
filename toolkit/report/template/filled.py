"""What filling a template made: the Word file, and all that must be found in it and in its PDF."""

from __future__ import annotations

from dataclasses import dataclass, field

from toolkit.report.template.contents import Contents
from toolkit.report.template.lint import LintFinding


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
    carries.
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
