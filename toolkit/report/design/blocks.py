"""Pieces of a template as WordprocessingML: controls, figures with captions, tables with a prototype row."""

# ruff: noqa: E501  lines of WordprocessingML read best whole
from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from html import escape
from itertools import count

from lxml import etree

from toolkit.report.template.xml import NS, Element

_SPACES = " ".join(f'xmlns:{p}="{NS[p]}"' for p in ("w", "wp", "a", "pic", "r"))
MM = 36000
TWIP_MM = 1440 / 25.4
INK, RULE, SHADE = "1F3A5F", "9AA5B1", "EEF2F6"


class Pieces:
    """Makes pieces with ids of their own; ``placeholder_rel`` is the relation of the placeholder picture."""

    def __init__(self, placeholder_rel: str) -> None:
        self.rel = placeholder_rel
        self.ids = count(1001)

    def inline(self, tag: str, shown: str, *, properties: str = "") -> str:
        """Return a run-level plain-text control that shows a grey prompt."""
        return (
            f"<w:sdt>{self._head(tag, '<w:showingPlcHdr/><w:text/>', properties)}<w:sdtContent><w:r><w:rPr>"
            f'<w:rStyle w:val="PlaceholderText"/></w:rPr><w:t>{escape(shown)}</w:t></w:r></w:sdtContent></w:sdt>'
        )

    def block(self, tag: str, content: str) -> str:
        """Return a control around paragraphs, tables or rows."""
        return f"<w:sdt>{self._head(tag, '')}<w:sdtContent>{content}</w:sdtContent></w:sdt>"

    def _head(self, tag: str, kind: str, properties: str = "") -> str:
        rpr = f"<w:rPr>{properties}</w:rPr>" if properties else ""
        alias = tag.removeprefix("tk:").partition("|")[0]
        return (
            f'<w:sdtPr>{rpr}<w:alias w:val="{escape(alias)}"/><w:tag w:val="{escape(tag)}"/>'
            f'<w:id w:val="{next(self.ids)}"/><w:lock w:val="sdtLocked"/>{kind}</w:sdtPr>'
        )

    def figure(self, name: str, width_mm: float, *, kind: str = "Figure", caption: str | None = None) -> str:
        """Return a figure with its numbered caption, kept only when the test has it.

        ``caption`` is the template's own text; default: the one that the report makes from its data.
        """
        control = self.picture(name, width_mm)
        text = self.inline(f"tk:caption.{name}", "caption") if caption is None else run(caption)
        return self.block(f"tk:if.{name}", paragraph(control, style="Figure") + self.caption(kind, text))

    def picture(self, name: str, width_mm: float) -> str:
        """Return the control of a figure alone."""
        cx, cy = int(width_mm * MM), int(width_mm * MM * 3.7 / 6.3)
        number = next(self.ids)
        picture = (
            f'<w:drawing><wp:inline distT="0" distB="0" distL="0" distR="0"><wp:extent cx="{cx}" cy="{cy}"/>'
            f'<wp:docPr id="{number}" name="{name}" descr="placeholder of the figure {name}"/><wp:cNvGraphicFramePr/>'
            f'<a:graphic><a:graphicData uri="{NS["pic"]}"><pic:pic><pic:nvPicPr><pic:cNvPr id="{number}" name="{name}"/>'
            f'<pic:cNvPicPr/></pic:nvPicPr><pic:blipFill><a:blip r:embed="{self.rel}"/><a:stretch><a:fillRect/>'
            f'</a:stretch></pic:blipFill><pic:spPr><a:xfrm><a:off x="0" y="0"/><a:ext cx="{cx}" cy="{cy}"/></a:xfrm>'
            '<a:prstGeom prst="rect"><a:avLst/></a:prstGeom></pic:spPr></pic:pic></a:graphicData></a:graphic>'
            "</wp:inline></w:drawing>"
        )
        return (
            f"<w:sdt>{self._head(f'tk:figure.{name}', '<w:picture/>')}<w:sdtContent><w:r>{picture}</w:r>"
            "</w:sdtContent></w:sdt>"
        )

    def caption(self, kind: str, content: str, *, before: bool = False) -> str:
        """Return a caption with a SEQ field; ``before`` keeps it with what follows."""
        field = (
            f'<w:r><w:t xml:space="preserve">{kind} </w:t></w:r><w:r><w:fldChar w:fldCharType="begin"/></w:r><w:r>'
            f'<w:instrText xml:space="preserve"> SEQ {kind} \\* ARABIC </w:instrText></w:r><w:r><w:fldChar '
            'w:fldCharType="separate"/></w:r><w:r><w:t>0</w:t></w:r><w:r><w:fldChar w:fldCharType="end"/></w:r>'
            '<w:r><w:t xml:space="preserve">. </w:t></w:r>'
        )
        return paragraph(field + content, style="Caption", keep=before)

    def table(
        self,
        name: str,
        caption: str,
        head: Sequence[str],
        cells: Sequence[str],
        widths_mm: Sequence[float],
        align: str,
        *,
        kind: str = "Table",
        together: bool = False,
    ) -> str:
        """Return a captioned data table with one prototype row, kept only when it has rows.

        ``together`` keeps a short table on one page. ``head`` and ``cells`` may hold tags in double braces; ``align`` has ``l`` or ``r`` a column.
        """
        header = "".join(
            cell(literal(text), width, style="TableHead", align=side, shade=SHADE)
            for text, width, side in zip(head, widths_mm, align, strict=True)
        )
        prototype = "".join(
            cell(self._row_cell(text), width, style="TableText", align=side)
            for text, width, side in zip(cells, widths_mm, align, strict=True)
        )
        if together:
            mark = '<w:pStyle w:val="{}"/>'
            for style in ("TableHead", "TableText"):
                named = mark.format(style)
                header = header.replace(named, f"{named}<w:keepNext/>")
                prototype = prototype.replace(named, f"{named}<w:keepNext/>")
        grid = table(row(header, header=True) + row(prototype), widths_mm, rules="data")
        return self.block(
            f"tk:if.{name}",
            self.caption(kind, run(caption), before=True)
            + self.block(f"tk:table.{name}", grid)
            + paragraph("", style="Gap"),
        )

    def _row_cell(self, text: str) -> str:
        """``D51`` is a control; ``B ± u_B`` two controls over two lines."""
        first, plus, second = text.partition(" ± ")
        made = self.inline(f"tk:row.{first}", first)
        return made + (
            f'<w:r><w:br/><w:t xml:space="preserve">± </w:t></w:r>{self.inline(f"tk:row.{second}", second)}'
            if plus
            else ""
        )

    def facts(self, rows: Sequence[Sequence[tuple[str, str] | None]], widths_mm: Sequence[float]) -> str:
        """Return a table of labels and values; a row with one fact that a test may lack goes when it does."""
        made = ""
        for facts in rows:
            cells, optional = "", None
            for i, fact in enumerate(facts):
                label, tag = fact if fact else ("", "")
                if label.endswith("?"):
                    label, optional = label[:-1], tag
                last = i == len(facts) - 1
                span = (len(widths_mm) - 2 * i) - 1 if last else 1
                width = sum(widths_mm[2 * i + 1 :]) if last else widths_mm[2 * i + 1]
                value = self.inline(f"tk:{tag}", label.lower()) if tag and "{{" not in tag else literal(tag)
                cells += cell(run(label, bold=True), widths_mm[2 * i], style="FactLabel", shade=SHADE)
                cells += cell(value, width, style="Fact", span=span)
            line = row(cells)
            made += self.block(f"tk:if.{optional}", line) if optional else line
        return table(made, widths_mm, rules="box")


def run(text: str, *, bold: bool = False, style: str = "") -> str:
    """Return a run."""
    inner = (f'<w:rStyle w:val="{style}"/>' if style else "") + ("<w:b/>" if bold else "")
    return f'<w:r><w:rPr>{inner}</w:rPr><w:t xml:space="preserve">{escape(text)}</w:t></w:r>'


def literal(text: str) -> str:
    """Return a run whose text holds literal tags."""
    return run(text)


def field(code: str, shown: str = "1") -> str:
    """Return a simple field."""
    return f'<w:fldSimple w:instr=" {code} "><w:r><w:t>{shown}</w:t></w:r></w:fldSimple>'


def paragraph(content: str, *, style: str = "Normal", keep: bool = False) -> str:
    """Return a paragraph."""
    more = "<w:keepNext/>" if keep else ""
    return f'<w:p><w:pPr><w:pStyle w:val="{style}"/>{more}</w:pPr>{content}</w:p>'


def cell(
    content: str, width_mm: float, *, style: str, align: str = "l", span: int = 1, shade: str = ""
) -> str:
    """Return a table cell with one paragraph."""
    side = '<w:jc w:val="right"/>' if align == "r" else ""
    fill = f'<w:shd w:val="clear" w:color="auto" w:fill="{shade}"/>' if shade else ""
    spans = f'<w:gridSpan w:val="{span}"/>' if span > 1 else ""
    return (
        f'<w:tc><w:tcPr><w:tcW w:w="{round(width_mm * TWIP_MM)}" w:type="dxa"/>{spans}{fill}<w:vAlign w:val="center"/></w:tcPr>'
        f'<w:p><w:pPr><w:pStyle w:val="{style}"/>{side}</w:pPr>{content}</w:p></w:tc>'
    )


def row(cells: str, *, header: bool = False) -> str:
    """Return a table row that does not break over a page."""
    mark = "<w:tblHeader/>" if header else ""
    return f"<w:tr><w:trPr><w:cantSplit/>{mark}</w:trPr>{cells}</w:tr>"


def table(rows: str, widths_mm: Sequence[float], *, rules: str) -> str:
    """Return a table of fixed columns; ``rules`` is ``data`` (horizontal hairlines), ``box`` or ``none``."""
    hair = f'w:val="single" w:sz="4" w:space="0" w:color="{RULE}"'
    thick = f'w:val="single" w:sz="8" w:space="0" w:color="{INK}"'
    none = 'w:val="nil"'
    outer = {"data": thick, "box": hair}.get(rules, none)
    side = hair if rules == "box" else none
    borders = "".join(
        f"<w:{edge} {kind}/>"
        for edge, kind in (
            ("top", outer),
            ("left", side),
            ("bottom", outer),
            ("right", side),
            ("insideH", none if rules == "none" else hair),
            ("insideV", side),
        )
    )
    grid = "".join(f'<w:gridCol w:w="{round(w * TWIP_MM)}"/>' for w in widths_mm)
    return (
        f'<w:tbl><w:tblPr><w:tblW w:w="{round(sum(widths_mm) * TWIP_MM)}" w:type="dxa"/><w:tblInd w:w="70" w:type="dxa"/><w:tblBorders>{borders}</w:tblBorders>'
        '<w:tblLayout w:type="fixed"/><w:tblCellMar><w:left w:w="70" w:type="dxa"/><w:right w:w="70" w:type="dxa"/>'
        f"</w:tblCellMar></w:tblPr><w:tblGrid>{grid}</w:tblGrid>{rows}</w:tbl>"
    )


def elements(fragment: str) -> list[Element]:
    """Parse a fragment into elements."""
    return list(etree.fromstring(f"<w:body {_SPACES}>{fragment}</w:body>"))


def placeholder_png(width: int = 630, height: int = 370, grey: int = 225) -> bytes:
    """Return a plain grey PNG: the picture that a figure's control shows until it is filled."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    lines = (b"\0" + bytes([grey]) * width) * height
    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", head)
        + chunk(b"IDAT", zlib.compress(lines))
        + chunk(b"IEND", b"")
    )
