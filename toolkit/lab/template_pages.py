"""A template of the home, page by page, with each finding of `template check` at its place."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolkit.files import sha256_bytes, write_atomic
from toolkit.inputs import PDF_FILE, read_regular
from toolkit.lab.jobs import FOLDER

if TYPE_CHECKING:
    from toolkit.report.word.marked_template import MarkedPage

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
    from toolkit.lab.previews import template_findings
    from toolkit.report.word.marked_template import marked_pages

    findings = template_findings(template)
    return TemplatePages(findings=findings, pages=marked_pages(template_print(home, template, findings)))


def template_print(home: Path, template: Path, findings: list[dict[str, Any]] | None = None) -> Path:
    """Return the print of a template, with an unseen word at each finding's place; errors as above."""
    import tempfile

    from toolkit.lab.previews import template_findings
    from toolkit.report.word.marked_template import marked_template
    from toolkit.report.word.office import Office
    from toolkit.report.word.package import read_template

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
