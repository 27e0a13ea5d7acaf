"""The PDF of filled documents: converted in one call, tables of contents with the pages of the print."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from toolkit.errors import RenderError
from toolkit.report.pdf import Office
from toolkit.report.template.filled import Filled


@dataclass(frozen=True, slots=True, kw_only=True)
class Printed:
    """A document as it is handed over, with the pages in its contents, and its PDF."""

    docx: bytes
    pdf: Path


def print_copies(filled: Sequence[Filled], office: Office, work: Path) -> list[Printed | RenderError]:
    """Convert filled documents in one call; each PDF, or why there is none, in the same order.

    A document whose headings Word numbers by itself is converted twice: the numbers of its contents are
    those of the first PDF.
    """
    every = range(len(filled))
    made = _converted(filled, dict(zip(every, (one.docx for one in filled), strict=True)), office, work)
    again = [
        i
        for i, (one, pdf) in enumerate(zip(filled, made, strict=True))
        if isinstance(pdf, Path) and any(entry.numbered for entry in one.contents.entries)
    ]
    documents = [one.docx for one in filled]
    if again:
        for i in again:
            documents[i] = _numbered(filled[i], made[i])
        second = _converted(filled, {i: documents[i] for i in again}, office, work)
        for i, pdf in zip(again, second, strict=True):
            made[i] = pdf
    return [
        one if isinstance(one, RenderError) else Printed(docx=_paged(own, data, one), pdf=one)
        for own, data, one in zip(filled, documents, made, strict=True)
    ]


def _converted(
    filled: Sequence[Filled], documents: Mapping[int, bytes], office: Office, work: Path
) -> list[Path | RenderError]:
    """Convert documents by their place in ``filled``: no PDF ever takes the name of another document's."""
    from toolkit.report.template.contents_pages import for_printing

    sources = []
    for index, data in documents.items():
        one = filled[index]
        source = work / f"{index:04d}.docx"
        source.write_bytes(for_printing(data, one.main_part, contents=bool(one.contents.entries)))
        sources.append(source)
    return office.convert_each(sources, work) if sources else []


def _numbered(filled: Filled, pdf: Path | RenderError) -> bytes:
    from toolkit.report.template.contents_pages import pdf_outline, titles_of, with_numbers

    if isinstance(pdf, RenderError):
        return filled.docx
    found = titles_of(filled.contents.headings, pdf_outline(pdf))
    numbered = {one.bookmark for one in filled.contents.entries if one.numbered}
    titles = {bookmark: title for bookmark, _, title, _ in found if bookmark in numbered}
    return with_numbers(filled.docx, filled.main_part, titles)


def _paged(filled: Filled, docx: bytes, pdf: Path) -> bytes:
    if not filled.contents.entries:
        return docx
    from toolkit.report.template.contents_pages import printed_pages, with_pages
    from toolkit.report.template.verify import pdf_text

    pages = printed_pages(pdf_text(pdf), filled.contents.entries)
    return with_pages(docx, filled.main_part, pages)
