"""A Word file as it was written, read back piece by piece: its tables may be of any length."""

from __future__ import annotations

import io
import posixpath
import zipfile
from collections.abc import Iterator

from lxml import etree

from toolkit.report.template.xml import STORIES, W_P, W_SDT, W_TR, Element, ancestor, q

_RELATIONS = "{http://schemas.openxmlformats.org/package/2006/relationships}Relationship"


def text_elements(docx: bytes, main_part: str) -> Iterator[Element]:
    """Yield each paragraph, control and drawing of the parts with text; a row is let go when it ends."""
    with zipfile.ZipFile(io.BytesIO(docx)) as archive:
        for name in _parts(archive, main_part):
            with archive.open(name) as part:
                yield from _elements(part)


def _elements(part: object) -> Iterator[Element]:
    wanted = (W_P, W_SDT, q("wp:docPr"), W_TR)
    events = etree.iterparse(
        part, events=("end",), tag=wanted, resolve_entities=False, no_network=True, load_dtd=False
    )
    for _, element in events:
        if element.tag != W_TR:
            yield element
        elif ancestor(element, W_TR) is None:
            element.clear()


def _parts(archive: zipfile.ZipFile, main: str) -> list[str]:
    """Return the main part, and the headers, footers and notes that it refers to."""
    folder, name = posixpath.split(main)
    relations = posixpath.join(folder, "_rels", f"{name}.rels")
    found = [main]
    if relations not in archive.namelist():
        return found
    for one in etree.fromstring(archive.read(relations)).iter(_RELATIONS):
        kind = (one.get("Type") or "").rpartition("/")[2]
        if kind in STORIES and one.get("TargetMode") != "External":
            # An absolute target begins at the root of the package.
            path = posixpath.normpath(posixpath.join("/", folder, one.get("Target") or "")).lstrip("/")
            found += [path] if path not in found else []
    return found
