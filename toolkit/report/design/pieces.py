"""Larger pieces of a template: contents, sections, letterhead."""
# ruff: noqa: E501  lines of WordprocessingML read best whole

from __future__ import annotations

import struct
import zlib

from toolkit.report.design.blocks import MM, RULE, TWIP_MM, paragraph, row, run, table
from toolkit.report.template.xml import NS


def contents(title: str, *, levels: str = "1-2", line: str = "update the field") -> str:
    """Return a table of contents as Word makes it: a block with its title and a TOC field."""
    begin = (
        '<w:r><w:fldChar w:fldCharType="begin"/></w:r><w:r><w:instrText xml:space="preserve"> TOC \\o '
        f'"{levels}" \\h \\z \\u </w:instrText></w:r><w:r><w:fldChar w:fldCharType="separate"/></w:r>'
    )
    end = '<w:r><w:fldChar w:fldCharType="end"/></w:r>'
    return (
        '<w:sdt><w:sdtPr><w:docPartObj><w:docPartGallery w:val="Table of Contents"/><w:docPartUnique/>'
        "</w:docPartObj></w:sdtPr><w:sdtContent>"
        + paragraph(run(title), style="TOCHeading")
        + paragraph(begin + run(line) + end, style="TOC1")
        + "</w:sdtContent></w:sdt>"
    )


def section_break(*, landscape: bool, margins_mm: tuple[float, float, float, float]) -> str:
    """Return the paragraph that ends a section; ``margins_mm``: top, right, bottom, left."""
    return f"<w:p><w:pPr>{section(landscape=landscape, margins_mm=margins_mm)}</w:pPr></w:p>"


def section(*, landscape: bool, margins_mm: tuple[float, float, float, float], title: bool = False) -> str:
    """Return the properties of an A4 section; ``title`` gives its first page a header of its own."""
    wide, tall = (16838, 11906) if landscape else (11906, 16838)
    turned = ' w:orient="landscape"' if landscape else ""
    top, right, bottom, left = (round(one * TWIP_MM) for one in margins_mm)
    return (
        f'<w:sectPr><w:type w:val="nextPage"/><w:pgSz w:w="{wide}" w:h="{tall}"{turned}/><w:pgMar w:top="{top}" '
        f'w:right="{right}" w:bottom="{bottom}" w:left="{left}" w:header="567" w:footer="567" w:gutter="0"/>'
        f"{'<w:titlePg/>' if title else ''}</w:sectPr>"
    )


def across(cells: str, widths_mm: tuple[float, ...]) -> str:
    """Return a row without rules over the whole width of the page, upright or landscape."""
    made = one_rule(table(row(cells), widths_mm, rules="none"))
    start = made.index("<w:tblW ")
    wide = made[:start] + '<w:tblW w:w="5000" w:type="pct"/>' + made[made.index("/>", start) + 2 :]
    return wide.replace('<w:tblLayout w:type="fixed"/>', "") + paragraph("", style="Gap")


def one_rule(grid: str) -> str:
    """Return a header's or footer's table with one rule over its whole width, in place of one in each cell.

    The styles of headers and footers rule each paragraph: beside each other these would be broken lines.
    """
    for style, edge in (("Header", "bottom"), ("Footer", "top")):
        named = f'<w:pStyle w:val="{style}"/>'
        if named in grid:
            grid = grid.replace(named, f'{named}<w:pBdr><w:{edge} w:val="nil"/></w:pBdr>')
            line = f'<w:{edge} w:val="single" w:sz="4" w:space="0" w:color="{RULE}"/>'
            grid = grid.replace(f'<w:{edge} w:val="nil"/>', line, 1)  # of the table, which stands first
    return grid


def logo(rel: str, size_mm: float, *, number: int, text: str) -> str:
    """Return the run of a square picture with its alternative text."""
    edge = int(size_mm * MM)
    return (
        f'<w:r><w:drawing><wp:inline distT="0" distB="0" distL="0" distR="0"><wp:extent cx="{edge}" cy="{edge}"/>'
        f'<wp:docPr id="{number}" name="logo" descr="{text}"/><wp:cNvGraphicFramePr/><a:graphic><a:graphicData '
        f'uri="{NS["pic"]}"><pic:pic><pic:nvPicPr><pic:cNvPr id="{number}" name="logo"/><pic:cNvPicPr/>'
        f'</pic:nvPicPr><pic:blipFill><a:blip r:embed="{rel}"/><a:stretch><a:fillRect/></a:stretch></pic:blipFill>'
        f'<pic:spPr><a:xfrm><a:off x="0" y="0"/><a:ext cx="{edge}" cy="{edge}"/></a:xfrm><a:prstGeom prst="rect">'
        "<a:avLst/></a:prstGeom></pic:spPr></pic:pic></a:graphicData></a:graphic></wp:inline></w:drawing></w:r>"
    )


def logo_png(colour: str, *, pixels: int = 240) -> bytes:
    """Return the mark of a tire in one colour on white: two rings and a tread."""
    ink = bytes.fromhex(colour)
    half = pixels / 2
    lines = []
    for y in range(pixels):
        line = bytearray(b"\0")
        for x in range(pixels):
            dx, dy = (x + 0.5 - half) / half, (y + 0.5 - half) / half
            radius = (dx * dx + dy * dy) ** 0.5
            tread = 0.80 < radius <= 0.97 and abs((dx + dy) * 6 % 1 - 0.5) > 0.12
            line += ink if tread or 0.62 < radius <= 0.76 or radius <= 0.17 else b"\xff\xff\xff"
        lines.append(bytes(line))

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", pixels, pixels, 8, 2, 0, 0, 0)
    packed = zlib.compress(b"".join(lines), 9)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", packed) + chunk(b"IEND", b"")
