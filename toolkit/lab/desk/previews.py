"""A report before it is issued: the home's templates, page by page, and the pages that one makes of a test.

A preview is a whole report, delivered and verified, in the folder of the home's jobs: nothing of it counts as
issued. What the test does not have prints its mark, and the manifest names it.
"""

from __future__ import annotations

import json
import os
import threading
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.declared import json_value
from toolkit.errors import ToolkitError
from toolkit.files import sha256_bytes, write_atomic
from toolkit.inputs import PDF_FILE, RESULT_FILE, read_regular
from toolkit.lab.desk.holdings import holding_id
from toolkit.lab.desk.jobs import FOLDER
from toolkit.lab.home import TEMPLATES

if TYPE_CHECKING:
    from toolkit.report.word.preview import MarkedPage, SeenPage


PREVIEWS, REPORTS = f"{FOLDER}/previews", "reports"
PDF = "report.pdf"
WORD = (".docx", ".dotx")


@dataclass(frozen=True, slots=True, kw_only=True)
class Preview:
    """A report as it will print. ``missing`` are the tags that nothing fills."""

    folder: Path
    manifest: dict[str, Any]
    pages: tuple[SeenPage, ...]

    @property
    def missing(self) -> tuple[str, ...]:
        """The tags whose value the test has not, in the order of the document."""
        return tuple(map(str, self.manifest.get("missing", ())))


def templates_of(home: Path, kind: str | None = None) -> dict[str, str]:
    """Return the Word templates of a home by id, all or those of one kind of documents; links are left out.

    One that cannot be read is of no kind.
    """
    try:
        entries = sorted(os.scandir(home / TEMPLATES), key=lambda entry: entry.name)
    except OSError:
        return {}
    return {
        holding_id(f"{TEMPLATES}/{entry.name}"): entry.name
        for entry in entries
        if entry.is_file(follow_symlinks=False)
        and entry.name.lower().endswith(WORD)
        and (
            kind is None
            or kind == _kind_of(Path(entry.path), (state := entry.stat()).st_mtime_ns, state.st_size)
        )
    }


@lru_cache(maxsize=256)
def _kind_of(template: Path, _changed: int, _size: int) -> str:
    from toolkit.report.kinds import kind_of
    from toolkit.report.word.package import read_template

    try:
        return kind_of(read_template(template))
    except ToolkitError:
        return ""


def preview_words(place: str, template: str, test_id: str) -> tuple[str, ...]:
    """Return the command that makes the preview of a test: holes are printed, drafts are allowed."""
    return (
        "report", f"./{place}", "--template", f"{TEMPLATES}/{template}", "--out", f"{PREVIEWS}/{test_id}",
        "--draft", "--allow-missing", "--home", ".",
    )  # fmt: skip


def report_words(place: str, template: str, *, allow_missing: bool) -> tuple[str, ...]:
    """Return the command that issues the report of a test: it is an entry of the ledger."""
    holes = ("--allow-missing",) if allow_missing else ()
    return (
        "report", f"./{place}", "--template", f"{TEMPLATES}/{template}", "--out", f"{REPORTS}/{place}",
        "--issue", *holes, "--home", ".",
    )  # fmt: skip


def read_preview(home: Path, test_id: str) -> Preview | None:
    """Return the preview of a test; None where none was made, or its folder is damaged.

    Raises
    ------
    ToolkitError
        poppler is not installed, or the style file of the template cannot be read
    """
    from toolkit.report.deliver import MANIFEST
    from toolkit.report.style import read_style, style_file
    from toolkit.report.word.preview import pages_of

    folder = home / PREVIEWS / test_id
    try:
        manifest = json.loads(read_regular(folder / MANIFEST, RESULT_FILE))
        template = home / TEMPLATES / os.path.basename(manifest["template"]["name"])  # noqa: PTH119  a name
    except (OSError, ValueError, TypeError, KeyError):
        return None
    pdf = preview_pdf(home, test_id)
    if pdf is None:
        return None
    mark = read_style(style_file(template)).missing
    return Preview(folder=folder, manifest=manifest, pages=pages_of(pdf, mark))


def preview_pdf(home: Path, test_id: str) -> Path | None:
    """Return the PDF of a test's preview; None where there is none."""
    pdf = home / PREVIEWS / test_id / PDF
    return pdf if pdf.is_file() else None


def template_findings(template: Path) -> list[dict[str, Any]]:
    """Return what `template check` finds.

    Raises
    ------
    ToolkitError
        it is no Word file, or not safe to open
    """
    from toolkit.report.kinds import check
    from toolkit.report.style import read_style, style_file
    from toolkit.report.word.package import read_template

    findings = check(read_template(template), read_style(style_file(template)))
    rows: list[dict[str, Any]] = json_value(findings)
    return rows


PRINTS = f"{FOLDER}/templates"
"""Folder of the home with the prints of templates, each named by what it was printed of."""
_PRINTING = threading.Lock()  # one LibreOffice for all who look


@dataclass(frozen=True, slots=True, kw_only=True)
class TemplatePages:
    """What `template check` finds, and the pages; a mark names a finding by its number, from 1."""

    findings: list[dict[str, Any]]
    pages: tuple[MarkedPage, ...]


def template_pages(home: Path, template: Path) -> TemplatePages:
    """Return the pages of a template with the places of its findings; it is printed where it was not yet.

    Raises
    ------
    TemplateError
        it is no Word file, or not safe to open
    RenderError
        LibreOffice or poppler is not installed, or prints nothing
    """
    from toolkit.report.word.preview import marked_pages

    findings = template_findings(template)
    return TemplatePages(findings=findings, pages=marked_pages(template_print(home, template, findings)))


def template_print(home: Path, template: Path, findings: list[dict[str, Any]] | None = None) -> Path:
    """Return the print of a template, with an unseen word at each finding's place; errors as above."""
    import tempfile

    from toolkit.report.word.office import Office
    from toolkit.report.word.package import read_template
    from toolkit.report.word.preview import marked_template

    findings = template_findings(template) if findings is None else findings
    places = [(finding["part"], finding["place"]) for finding in findings]
    source = read_template(template)
    pdf = home / PRINTS / f"{sha256_bytes(source.data + repr(places).encode())[:32]}.pdf"
    with _PRINTING:
        if not pdf.is_file():
            pdf.parent.mkdir(parents=True, exist_ok=True)
            with Office() as office, tempfile.TemporaryDirectory() as folder:
                document = Path(folder) / "template.docx"
                document.write_bytes(marked_template(source, places))
                (printed,) = office.convert([document], Path(folder))
                write_atomic(pdf, read_regular(printed, PDF_FILE))
    return pdf
