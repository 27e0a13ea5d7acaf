"""The default template: the source document's title page (its Figure 5.3) and a whole test report.

`build_default` made ``report_templates/org.docx``; ``toolkit template new`` writes a fresh copy for an
organisation to make its own in Word.
"""

from __future__ import annotations

import datetime as dt
import io
import zipfile
from collections.abc import Callable
from typing import Any

from toolkit.report.design.blocks import Pieces, elements, placeholder_png, run
from toolkit.report.design.body import chapters
from toolkit.report.design.opening import mark, page_footer, page_header
from toolkit.report.design.styles import make_styles
from toolkit.report.design.title import title_page
from toolkit.report.template.xml import Element, q

STYLE_FILE = """\
# Style file of org.docx: how the report writes numbers and dates, and what the template must hold.
schema = 1
decimal_comma = false
dates = "%Y-%m-%d"
missing = "n/a"                       # what --allow-missing prints
required = ["tk:calibration.hash", "tk:calibration.id", "tk:report.id", "tk:test.name"]

[laboratory]                          # certificates: address, place, country (ISO 3166-1), accreditation
name = "Tire Force and Moment Laboratory"

[units]                               # force = "lbf", moment = "lbf*ft" for a report in those
force = "N"
moment = "N*m"

[styles]                              # names of the template's Word styles
heading = "Heading 1"
caption = "Caption"

# By unit, by tag or by table.column. A value with an uncertainty ends at the last place of two digits of the
# uncertainty: only its tag or table.column changes that, its unit does not.
[decimals]
N = 1
"N*m" = 2
"N/deg" = 1
"N*m/deg" = 2
deg = 2
FZ = 0
load = 0
"summary.load" = 0
"test.rated_load" = 0
"""


def build_default() -> bytes:
    """Return the default template as the bytes of a .docx, the same on every call."""
    return build_document(
        title="Tire force and moment test report",
        body=lambda pieces: [*title_page(pieces), *chapters(pieces)],
        header=_header,
        footer=_footer,
    )


def build_document(
    *,
    title: str,
    body: Callable[[Pieces], list[str]],
    header: Callable[[Pieces], str],
    footer: Callable[[Pieces], str],
    styles: Callable[[Any], None] = make_styles,
    margins_mm: tuple[float, float, float, float] = (27.0, 22.0, 22.0, 22.0),
    letterhead: tuple[bytes, Callable[[Pieces, str], str]] | None = None,
) -> bytes:
    """Return a template in the house's layout: an A4 page, its styles, header and footer on every page.

    Parameters
    ----------
    margins_mm : top, right, bottom, left of the page
    letterhead : a picture, and the first page's own header, given the picture's relation
    """
    import docx
    from docx.opc.constants import RELATIONSHIP_TYPE
    from docx.shared import Mm

    document: Any = docx.Document()
    styles(document)
    section = document.sections[0]
    section.page_width, section.page_height = Mm(210), Mm(297)
    section.top_margin, section.right_margin, section.bottom_margin, section.left_margin = map(Mm, margins_mm)
    section.header_distance = section.footer_distance = Mm(11)
    part = document.part
    image = part.package.get_or_add_image_part(io.BytesIO(placeholder_png()))
    pieces = Pieces(part.relate_to(image, RELATIONSHIP_TYPE.IMAGE))
    story = document.element.body
    for element in list(story):
        if element.tag != q("w:sectPr"):
            story.remove(element)
    for fragment in body(pieces):
        for element in elements(fragment):
            story.insert(len(story) - 1, element)
    _replace(section.header._element, header(pieces))
    _replace(section.footer._element, footer(pieces))
    if letterhead is not None:
        section.different_first_page_header_footer = True
        first = section.first_page_header
        emblem = part.package.get_or_add_image_part(io.BytesIO(letterhead[0]))
        rel = first.part.relate_to(emblem, RELATIONSHIP_TYPE.IMAGE)
        _replace(first._element, letterhead[1](pieces, rel))
        _replace(section.first_page_footer._element, footer(pieces))
    _lead_the_first_section(story)
    core = document.core_properties
    core.author, core.title, core.comments = "", title, ""
    core.created = core.modified = dt.datetime(2026, 11, 21)  # noqa: DTZ001  python-docx wants it naive
    core.revision = 1
    stream = io.BytesIO()
    document.save(stream)
    return _same_bytes(stream.getvalue())


def _lead_the_first_section(story: Element) -> None:
    """Move headers and footers to the first section, whose followers inherit them."""
    sections = list(story.iter(q("w:sectPr")))
    first, last = sections[0], sections[-1]
    if first is last:
        return
    for tag in ("w:footerReference", "w:headerReference"):
        for reference in reversed(last.findall(q(tag))):
            first.insert(0, reference)
    for title in last.findall(q("w:titlePg")):
        last.remove(title)
        first.append(title)


def _same_bytes(data: bytes) -> bytes:
    # python-docx stamps the members with the time of day; a file under version control should not change.
    stream = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(data)) as source,
        zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as target,
    ):
        for name in source.namelist():
            if name == "docProps/thumbnail.jpeg":
                continue
            content = source.read(name)
            if name in ("_rels/.rels", "[Content_Types].xml"):
                content = _without_thumbnail(content)
            target.writestr(zipfile.ZipInfo(name, (2026, 11, 21, 0, 0, 0)), content, zipfile.ZIP_DEFLATED)
    return stream.getvalue()


def _without_thumbnail(content: bytes) -> bytes:
    from lxml import etree

    root = etree.fromstring(content)
    for child in list(root):
        if (child.get("Target") or "").endswith("thumbnail.jpeg") or child.get("Extension") == "jpeg":
            root.remove(child)
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8", standalone=True)


def _replace(element: Element, fragment: str) -> None:
    for child in list(element):
        element.remove(child)
    for child in elements(fragment):
        element.append(child)


def _header(p: Pieces) -> str:
    return page_header(
        p.inline("tk:laboratory.name", "laboratory"),
        mark(p, "simulated", "SIMULATED DATA") + mark(p, "unverified", "  UNVERIFIED CALIBRATION"),
        p.inline("tk:report.id", "report id"),
    )


def _footer(p: Pieces) -> str:
    return page_footer(
        p.inline("tk:test.name", "test"), run("calibration ") + p.inline("tk:calibration.id", "record")
    )
