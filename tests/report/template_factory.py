# ruff: noqa: E501  lines of WordprocessingML read best whole
"""Small Word templates for the report's tests, built part by part."""

from __future__ import annotations

import functools
import io
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import docx
from lxml import etree
from PIL import Image

from toolkit.report.word.package import Template, read_template
from toolkit.report.word.xml import NS, Element

HASH = "{{tk:calibration.hash}}"
FOOTNOTES = (
    "http://schemas.openxmlformats.org/officeDocument/2006/relationships/footnotes",
    "application/vnd.openxmlformats-officedocument.wordprocessingml.footnotes+xml",
)
W = "http://schemas.openxmlformats.org/wordprocessingml/2006/main"
FOLDER = Path(__file__).resolve().parents[2] / "report_templates"
_SPACES = " ".join(f'xmlns:{prefix}="{NS[prefix]}"' for prefix in ("w", "wp", "a", "pic", "r"))


def elements(fragment: str) -> list[Element]:
    """Parse a fragment of WordprocessingML into elements."""
    return list(etree.fromstring(f"<w:body {_SPACES}>{fragment}</w:body>"))


def grey_png(width: int, height: int) -> bytes:
    """Return a plain grey picture."""
    stream = io.BytesIO()
    Image.new("L", (width, height), 225).save(stream, "PNG")
    return stream.getvalue()


def p(*runs: str) -> str:
    """Return a paragraph of runs; a run that begins with ``<`` is taken as it is."""
    inner = "".join(
        r if r.startswith("<") else f'<w:r><w:t xml:space="preserve">{r}</w:t></w:r>' for r in runs
    )
    return f"<w:p>{inner}</w:p>"


def sdt(tag: str, content: str, more: str = "") -> str:
    return f'<w:sdt><w:sdtPr><w:tag w:val="{tag}"/>{more}</w:sdtPr><w:sdtContent>{content}</w:sdtContent></w:sdt>'


def run(text: str) -> str:
    return f"<w:r><w:t>{text}</w:t></w:r>"


def tbl(*rows: list[str]) -> str:
    made = "".join(
        "<w:tr>" + "".join(f"<w:tc>{c if c.startswith('<w:p') else p(c)}</w:tc>" for c in row) + "</w:tr>"
        for row in rows
    )
    grid = "<w:gridCol/>" * len(rows[0])
    return f"<w:tbl><w:tblPr/><w:tblGrid>{grid}</w:tblGrid>{made}</w:tbl>"


def make(
    folder: Path,
    body: str,
    *,
    header: str = "",
    footnote: str = "",
    hash_: bool = True,
    name: str = "t.docx",
    edit: Callable[[dict[str, bytes]], None] | None = None,
) -> Path:
    """Write a template; ``edit`` may change the members of the package afterwards."""
    body += p(HASH) if hash_ else ""
    path = folder / name
    members = _with_more(body, header, footnote) if header or footnote else _with_body(body)
    if edit is not None:
        edit(members)
    with zipfile.ZipFile(path, "w") as archive:
        for one, content in members.items():
            archive.writestr(one, content)
    return path


@functools.cache
def _blank() -> dict[str, bytes]:
    """Return the members of a document without content."""
    return _members(docx.Document())


def _members(document: Any) -> dict[str, bytes]:
    stream = io.BytesIO()
    document.save(stream)
    with zipfile.ZipFile(stream) as archive:
        return {one: archive.read(one) for one in archive.namelist()}


def _with_body(body: str) -> dict[str, bytes]:
    root = etree.fromstring(_blank()["word/document.xml"])
    for element in elements(body):
        root[0].insert(len(root[0]) - 1, element)
    text = etree.tostring(root, encoding="UTF-8", standalone=True)
    return {**_blank(), "word/document.xml": text}


def _with_more(body: str, header: str, footnote: str) -> dict[str, bytes]:
    document = docx.Document()
    for element in elements(body):
        document.element.body.insert(len(document.element.body) - 1, element)
    if header:
        root = document.sections[0].header._element
        for child in list(root):
            root.remove(child)
        for element in elements(header):
            root.append(element)
    if footnote:
        from docx.opc.packuri import PackURI
        from docx.opc.part import Part

        blob = (
            f'<w:footnotes xmlns:w="{W}"><w:footnote w:id="2">{footnote}</w:footnote></w:footnotes>'.encode()
        )
        part = Part(PackURI("/word/footnotes.xml"), FOOTNOTES[1], blob, document.part.package)
        document.part.relate_to(part, FOOTNOTES[0])
    return _members(document)


def opened(folder: Path, body: str, **more: object) -> Template:
    return read_template(make(folder, body, **more))  # type: ignore[arg-type]


def texts(data: bytes, part: str = "word/document.xml") -> str:
    """Return the text of a part, paragraphs by line."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        root = etree.fromstring(archive.read(part))
    return "\n".join("".join(t.text or "" for t in para.iter(f"{{{W}}}t")) for para in root.iter(f"{{{W}}}p"))
