"""Put a figure into a template: in the placeholder's width, with the alternative text of its data."""

from __future__ import annotations

import io
import re
from copy import deepcopy
from dataclasses import dataclass
from typing import Any
from xml.sax.saxutils import quoteattr

from lxml import etree

from toolkit.report.content import Plot
from toolkit.report.figures import LETTERS_PT, SIZE_IN, Picture
from toolkit.report.word.chart import (
    BOOK_RELATION,
    BOOK_TYPE,
    CHART_TYPE,
    Chart,
    chart_book,
    chart_texts,
    chart_xml,
)
from toolkit.report.word.scan import own_rows
from toolkit.report.word.styles import paragraph_styles
from toolkit.report.word.xml import (
    NS,
    P_PR,
    W_P,
    W_R,
    W_T,
    W_TBL,
    W_TC,
    W_TR,
    Element,
    Story,
    ancestor,
    clean,
    is_on,
    q,
)

EMU_TWIP, EMU_INCH = 635, 914400
_VML_EMU = {"pt": 12700, "in": 914400, "cm": 360000, "mm": 36000, "px": 9525}
_CELL_MARGIN = 2 * 108
_LETTER = (12240, 15840, 1440)


@dataclass(slots=True)
class Ids:
    """Fresh ids for drawings and controls of a document."""

    drawing: int
    control: int

    @classmethod
    def of(cls, stories: list[Story]) -> Ids:
        """Start above every id that the template uses."""
        highest = 0
        for story in stories:
            for picture in story.root.iter(q("wp:docPr")):
                text = picture.get("id") or "0"
                highest = max(highest, int(text) if text.isdigit() else 0)
        return cls(drawing=min(highest, 2**30), control=1_000_000)

    def next_drawing(self) -> int:
        """Return the next id of a drawing."""
        self.drawing += 1
        return self.drawing


def picture_run(
    story: Story,
    package: Any,
    at: Element,
    picture: Picture,
    alt: str,
    name: str,
    width: int | None,
    ids: Ids,
) -> Element:
    """Return a run with the picture, as wide as asked, as the placeholder, or as the place allows."""
    from docx.opc.constants import RELATIONSHIP_TYPE

    image = package.get_or_add_image_part(io.BytesIO(picture.png))
    rel = story.part.relate_to(image, RELATIONSHIP_TYPE.IMAGE)
    cx, cy = _size(at, story, width, picture.height_px / picture.width_px)
    properties = _named(ids.next_drawing(), name, alt)
    return _drawing_run(at, _inline(cx, cy, properties, _picture_graphic(rel, cx, cy, properties)))


def chart_run(
    story: Story, package: Any, at: Element, plot: Plot, width: int | None, ids: Ids, language: str
) -> tuple[Element, bytes, Chart]:
    """Return a run with a figure as a chart, as wide as a picture of it; its part, and what it shows."""
    from docx.opc.constants import RELATIONSHIP_TYPE
    from docx.opc.packuri import PackURI
    from docx.opc.part import Part

    identity = ids.next_drawing()
    width_in, height_in = SIZE_IN
    cx, cy = _size(at, story, width, height_in / width_in)
    xml = chart_xml(plot, language, scale=min(1.0, cx / EMU_INCH / width_in))
    chart = Part(PackURI(f"/word/charts/chart{identity}.xml"), CHART_TYPE, xml, package)
    path = PackURI(f"/word/embeddings/chart{identity}.xlsx")
    chart.load_rel(RELATIONSHIP_TYPE.PACKAGE, Part(path, BOOK_TYPE, chart_book(plot), package), BOOK_RELATION)
    rel = story.part.relate_to(chart, RELATIONSHIP_TYPE.CHART)
    graphic = f'<a:graphicData uri="{NS["c"]}"><c:chart xmlns:c="{NS["c"]}" r:id="{rel}"/></a:graphicData>'
    run = _drawing_run(at, _inline(cx, cy, _named(identity, plot.name, plot.alt), graphic))
    shown = Chart(
        tag=f"tk:chart.{plot.name}", alt=plot.alt, width_emu=cx, height_emu=cy, texts=chart_texts(plot)
    )
    return run, xml, shown


def letters_of(at: Element, story: Story, width: int | None) -> float:
    """Return how large the numbers at a figure's axes are [pt] where it stands as wide as asked."""
    width_in, height_in = SIZE_IN
    cx, _ = _size(at, story, width, height_in / width_in)
    return LETTERS_PT * cx / (width_in * EMU_INCH)


def _size(at: Element, story: Story, width: int | None, slope: float) -> tuple[int, int]:
    """Return width and height [EMU] of a drawing whose height is ``slope`` times its width."""
    room, tall = _room(at, story)
    page = max(_section(at, story)[0] - _indentation(at, story), 144) * EMU_TWIP
    cx = min(width, page) if width else _placeholder_width(at) or room
    cy = round(cx * slope)
    return (round(cx * tall / cy), tall) if cy > tall else (cx, cy)


def _drawing_run(at: Element, inline: Element) -> Element:
    anchor = next(at.iter(q("wp:anchor")), None)
    run = etree.Element(W_R)
    drawing = etree.SubElement(run, q("w:drawing"))
    if anchor is None:
        drawing.append(inline)
        return run
    # A floating placeholder keeps its position and wrapping; only its picture changes.
    frame = deepcopy(anchor)
    for tag in ("wp:extent", "wp:docPr", "a:graphic"):
        old, new = frame.find(q(tag)), inline.find(q(tag))
        if old is not None and new is not None:
            frame.replace(old, new)
    drawing.append(frame)
    return run


def _inline(cx: int, cy: int, properties: str, graphic: str) -> Element:
    spaces = " ".join(f'xmlns:{p}="{NS[p]}"' for p in ("wp", "a", "pic", "r"))
    return etree.fromstring(
        f'<wp:inline {spaces} distT="0" distB="0" distL="0" distR="0"><wp:extent cx="{cx}" cy="{cy}"/>'
        f"<wp:docPr {properties}/>"
        '<wp:cNvGraphicFramePr><a:graphicFrameLocks noChangeAspect="1"/></wp:cNvGraphicFramePr>'
        f"<a:graphic>{graphic}</a:graphic></wp:inline>"
    )


def _picture_graphic(rel: str, cx: int, cy: int, properties: str) -> str:
    return (
        f'<a:graphicData uri="{NS["pic"]}"><pic:pic><pic:nvPicPr><pic:cNvPr {properties}/><pic:cNvPicPr/>'
        f'</pic:nvPicPr><pic:blipFill><a:blip r:embed="{rel}"/><a:stretch><a:fillRect/></a:stretch>'
        f'</pic:blipFill><pic:spPr><a:xfrm><a:off x="0" y="0"/><a:ext cx="{cx}" cy="{cy}"/></a:xfrm>'
        '<a:prstGeom prst="rect"><a:avLst/></a:prstGeom></pic:spPr></pic:pic></a:graphicData>'
    )


def _named(identity: int, name: str, alt: str) -> str:
    label, text = quoteattr(f"Figure {name}"), quoteattr(clean(alt).replace("\n", " "))
    return f'id="{identity}" name={label} descr={text}'


def insert_at_mark(paragraph: Element, mark: str, run: Element) -> None:
    """Put a run where a mark character stands in a paragraph's text, splitting the run around it."""
    for t in paragraph.iter(W_T):
        before, mark_text, after = (t.text or "").partition(mark)
        if not mark_text:
            continue
        owner = ancestor(t, W_R)
        remainder = deepcopy(owner)
        index = list(owner.iter()).index(t)
        twin = list(remainder.iter())[index]
        t.text, twin.text = before, after
        for element in list(t.itersiblings()):
            owner.remove(element)
        for element in list(twin.itersiblings(preceding=True)):
            if element.tag != q("w:rPr"):
                remainder.remove(element)
        owner.addnext(remainder)
        owner.addnext(run)
        return


def free_height(paragraph: Element | None) -> None:
    """Let lines and rows of exact height around a picture grow, or it would be cut off."""
    if paragraph is None:
        return
    spacing = paragraph.find(f"{q('w:pPr')}/{q('w:spacing')}")
    if spacing is not None and spacing.get(q("w:lineRule")) == "exact":
        spacing.attrib.pop(q("w:lineRule"))
        spacing.attrib.pop(q("w:line"), None)
    row = ancestor(paragraph, W_TR)
    if row is not None:
        free_row(row)


def free_row(row: Element) -> None:
    """Let a row of exact height grow with its content."""
    for height in row.findall(f"{q('w:trPr')}/{q('w:trHeight')}"):
        if height.get(q("w:hRule")) == "exact":
            height.set(q("w:hRule"), "atLeast")


def _placeholder_width(at: Element) -> int | None:
    extent = next(at.iter(q("wp:extent")), None) if at.tag != W_P else None
    if extent is not None:
        return int(extent.get("cx") or 0) or None
    for shape in at.iter(q("v:shape")) if at.tag != W_P else ():
        width = re.search(r"(?:^|[;\s])width:\s*(\d+(?:\.\d+)?)(pt|in|cm|mm|px)?", shape.get("style") or "")
        if width:
            return round(float(width[1]) * _VML_EMU[width[2] or "px"])
    return None


def _room(at: Element, story: Story) -> tuple[int, int]:
    """Return width and height [EMU] that a picture may take where it stands."""
    width, height = _section(at, story)
    cell = next(at.iter(W_TC), None) if at.tag != W_P else None
    cell = cell if cell is not None else ancestor(at, W_TC)
    if cell is not None and ancestor(cell, W_TBL) is not None:
        width = _cell_room(cell, width)
    width -= _indentation(at, story)
    box = ancestor(at, q("w:txbxContent"))
    if box is not None:
        frame = next((e for tag in ("wp:anchor", "wp:inline") for e in box.iterancestors(q(tag))), None)
        extent = None if frame is None else frame.find(q("wp:extent"))
        if extent is not None:
            return max(int(extent.get("cx") or 0) - 2 * 91440, 91440), height * EMU_TWIP
    return max(width, 144) * EMU_TWIP, max(height, 144) * EMU_TWIP


def _indentation(at: Element, story: Story) -> int:
    """Return what the indentation of a paragraph takes from the width of its first line [twips]."""
    paragraph = at if at.tag == W_P else ancestor(at, W_P)
    paragraph = next(at.iter(W_P), None) if paragraph is None else paragraph
    if paragraph is None:
        return 0
    own, styles = paragraph.find(P_PR), paragraph_styles(story.part.package, paragraph, P_PR)
    stated = [p.find(q("w:ind")) for p in (own, *styles) if p is not None]

    def number(*names: str) -> int:
        texts = (ind.get(q(f"w:{name}")) for ind in stated if ind is not None for name in names)
        text = next(filter(None, texts), "0")
        return int(text) if text.removeprefix("-").isdigit() else 0

    first = number("firstLine") - number("hanging")
    return max(number("left", "start"), 0) + max(number("right", "end"), 0) + first


def _cell_room(cell: Element, page: int) -> int:
    """Return the width [twips] inside a cell: as stated, else its share of the room that its table has."""
    outer = ancestor(ancestor(cell, W_TBL), W_TC)
    room = page if outer is None else _cell_room(outer, page)
    return min(room, _cell_width(cell, room) or room)


def _cell_width(cell: Element, room: int) -> int | None:
    stated = cell.find(f"{q('w:tcPr')}/{q('w:tcW')}")
    if stated is not None and stated.get(q("w:type")) == "dxa" and (stated.get(q("w:w")) or "").isdigit():
        return int(stated.get(q("w:w"))) - _CELL_MARGIN
    table, row = ancestor(cell, W_TBL), ancestor(cell, W_TR)
    grid = [int(float(g.get(q("w:w")) or 0)) for g in table.findall(f"{q('w:tblGrid')}/{q('w:gridCol')}")]
    if row not in own_rows(table):
        return None
    grid = grid if any(grid) else [room // max(len(grid), 1)] * len(grid)
    at = 0
    for cell_before in (cell_ for cell_ in row.iter(W_TC) if ancestor(cell_, W_TR) is row):
        span = _columns_of(cell_before)
        if cell_before is cell:
            inside = sum(grid[at : at + span])
            return inside - _CELL_MARGIN if inside > _CELL_MARGIN else None
        at += span
    return None


def _columns_of(cell: Element) -> int:
    element = cell.find(f"{q('w:tcPr')}/{q('w:gridSpan')}")
    text = "" if element is None else element.get(q("w:val")) or ""
    return max(int(text), 1) if text.isdigit() else 1


def _section(at: Element, story: Story) -> tuple[int, int]:
    """Return width of one column and height of the text area [twips] of the section around an element."""
    section = _of_body(at, story) if story.body else _of_part(story)
    if section is None:
        return _LETTER[0] - 2 * _LETTER[2], _LETTER[1] - 2 * _LETTER[2]
    return section_room(section)


def _of_body(at: Element, story: Story) -> Element | None:
    if story.sections is None:
        story.sections = list(story.root.iter(q("w:sectPr")))
    if len(story.sections) < 2:
        return next(iter(story.sections), None)
    # A section's properties stand in its last paragraph, or at the end of the body.
    for paragraph in at.iterancestors(W_P):
        last_section = paragraph.find(f"{q('w:pPr')}/{q('w:sectPr')}")
        if last_section is not None:
            return last_section
    inside = next(at.iter(q("w:sectPr")), None)
    if inside is not None:
        return inside
    inner = at
    while inner is not None:
        for sibling in inner.itersiblings():
            section = next(sibling.iter(q("w:sectPr")), None)
            if section is not None:
                return section
        inner = inner.getparent()
    return None


def _of_part(story: Story) -> Element | None:
    """Return the properties of the section that a header or footer belongs to; a note's are the last ones."""
    main = story.part.package.main_document_part
    sections = list(main.element.iter(q("w:sectPr")))
    ids = {rel.rId for rel in main.rels.values() if not rel.is_external and rel.target_part is story.part}
    for section in sections:
        for reference in section.iter(q("w:headerReference"), q("w:footerReference")):
            if reference.get(q("r:id")) in ids:
                return section
    return sections[-1] if sections else None


def section_room(section: Element) -> tuple[int, int]:
    """Return width of one column and height of the text area [twips] of a section."""
    size, margin, columns = (section.find(q(f"w:{part}")) for part in ("pgSz", "pgMar", "cols"))

    def number(element: Element | None, name: str, default: int) -> int:
        text = None if element is None else element.get(q(f"w:{name}"))
        return abs(int(text)) if text and text.lstrip("-").isdigit() else default

    width = (
        number(size, "w", _LETTER[0])
        - number(margin, "left", _LETTER[2])
        - number(margin, "right", _LETTER[2])
    )
    height = (
        number(size, "h", _LETTER[1])
        - number(margin, "top", _LETTER[2])
        - number(margin, "bottom", _LETTER[2])
    )
    own = [number(column, "w", width) for column in section.iter(q("w:col"))]
    if own and not is_on(columns.get(q("w:equalWidth")) or "1"):
        return min(own), int(height * 0.92)  # it does not say in which of them
    count = max(number(columns, "num", 1), 1)
    return (width - (count - 1) * number(columns, "space", 720)) // count, int(height * 0.92)
