"""Word styles of the default template: Calibri, one ink, hairlines."""

from __future__ import annotations

from typing import Any

from toolkit.report.design.blocks import INK, RULE, elements
from toolkit.report.template.xml import Element, q

_WIDE = 166.0


def make_styles(document: Any) -> None:
    """Give a python-docx document the styles that the template's pieces name."""
    from docx.enum.style import WD_STYLE_TYPE
    from docx.enum.text import WD_ALIGN_PARAGRAPH, WD_TAB_ALIGNMENT, WD_TAB_LEADER
    from docx.shared import Mm, Pt, RGBColor

    ink, grey = RGBColor.from_string(INK), RGBColor(0x55, 0x5F, 0x6B)
    styles = document.styles

    def style(
        name: str,
        size: float,
        *,
        before: float = 0,
        after: float = 0,
        bold: bool = False,
        colour: Any = None,
        based: str = "Normal",
        align: Any = None,
        next_: str | None = None,
    ) -> Any:
        one = styles[name] if name in styles else styles.add_style(name, WD_STYLE_TYPE.PARAGRAPH)
        if name != "Normal":
            one.base_style = styles[based]
        one.font.name, one.font.size, one.font.bold, one.font.italic = "Calibri", Pt(size), bold, False
        fonts = one.element.rPr.rFonts
        for key in list(fonts.attrib):
            if key.endswith("Theme"):
                del fonts.attrib[key]
        if colour is not None:
            one.font.color.rgb = colour
        layout = one.paragraph_format
        layout.space_before, layout.space_after = Pt(before), Pt(after)
        layout.line_spacing = 1.0 if name not in ("Normal",) else 1.08
        if align is not None:
            layout.alignment = align
        if next_:
            one.next_paragraph_style = styles[next_]
        one.hidden, one.quick_style = False, True
        return one

    centre = WD_ALIGN_PARAGRAPH.CENTER
    style("Normal", 10.5, after=6)
    style("Laboratory", 12, before=10, after=34, colour=grey, align=centre)
    title = style("Title", 28, after=2, bold=True, colour=ink, align=centre)
    style("Subtitle", 17, after=26, colour=ink, align=centre)
    for border in title.element.pPr.findall(q("w:pBdr")):
        title.element.pPr.remove(border)
    heading = style("Heading 1", 15, before=18, after=6, bold=True, colour=ink, next_="Normal")
    heading.paragraph_format.keep_with_next = True
    style("Caption", 9.5, before=2, after=10, colour=grey).paragraph_format.keep_together = True
    figure = style("Figure", 10.5, before=6)
    figure.paragraph_format.keep_with_next = True
    figure.paragraph_format.alignment = centre
    style("TableText", 8.5, before=1.5, after=1.5)
    style("TableHead", 8.5, before=2, after=2, bold=True)
    style("Fact", 11, before=3, after=3)
    style("FactLabel", 9, before=3, after=3, colour=ink)
    style("BoxTitle", 11, before=4, after=3, bold=True, colour=ink).paragraph_format.keep_with_next = True
    style("Gap", 6)
    style("Small", 8.5, before=16, colour=grey)
    style("EndMark", 10, before=18, colour=grey, align=centre)
    signature = style("Signature", 10.5, before=44)
    signature.paragraph_format.keep_together = True
    _borders(signature.element, _edge("top", RULE, 4, 4))
    signature.paragraph_format.right_indent = Mm(80)
    notice = style(
        "Notice", 11.5, before=2, after=8, bold=True, colour=RGBColor(0x9C, 0x1C, 0x1C), align=centre
    )
    _boxed(notice.element, "9C1C1C", "FBEDED")
    for name in ("Header", "Footer"):
        one = style(name, 9, colour=grey)
        one.paragraph_format.tab_stops.clear_all()
        one.paragraph_format.tab_stops.add_tab_stop(Mm(_WIDE / 2), WD_TAB_ALIGNMENT.CENTER)
        one.paragraph_format.tab_stops.add_tab_stop(Mm(_WIDE), WD_TAB_ALIGNMENT.RIGHT)
        _ruled(one.element, "bottom" if name == "Header" else "top")
    toc_heading = style("TOC Heading", 13, before=6, after=4, bold=True, colour=ink)
    toc_heading.element.set(q("w:styleId"), "TOCHeading")
    for level, indent in ((1, 0), (2, 5)):
        line = style(f"toc {level}", 10.5, after=2)
        line.element.set(q("w:styleId"), f"TOC{level}")
        line.paragraph_format.left_indent = Mm(indent)
        line.paragraph_format.tab_stops.add_tab_stop(Mm(_WIDE), WD_TAB_ALIGNMENT.RIGHT, WD_TAB_LEADER.DOTS)
    prompt = styles.add_style("Placeholder Text", WD_STYLE_TYPE.CHARACTER)
    prompt.element.set(q("w:styleId"), "PlaceholderText")
    prompt.font.color.rgb = RGBColor(0x80, 0x80, 0x80)
    styles.add_style("Mark", WD_STYLE_TYPE.CHARACTER).font.color.rgb = RGBColor(0x9C, 0x1C, 0x1C)


def _edge(side: str, colour: str, size: int, space: int) -> str:
    return f'<w:{side} w:val="single" w:sz="{size}" w:space="{space}" w:color="{colour}"/>'


def _borders(style: Element, inner: str, shade: str = "") -> None:
    made = elements(f"<w:pPr><w:pBdr>{inner}</w:pBdr>{shade}</w:pPr>")[0]
    properties = style.find(q("w:pPr"))
    # The schema wants borders and shading right after keepNext, keepLines and the like, before tabs.
    first = (
        "pStyle",
        "keepNext",
        "keepLines",
        "pageBreakBefore",
        "framePr",
        "widowControl",
        "numPr",
        "suppressLineNumbers",
    )
    at = sum(1 for child in properties if child.tag in {q(f"w:{one}") for one in first})
    for child in reversed(list(made)):
        properties.insert(at, child)


def _boxed(style: Element, colour: str, fill: str) -> None:
    inner = "".join(_edge(side, colour, 6, 4) for side in ("top", "left", "bottom", "right"))
    _borders(style, inner, f'<w:shd w:val="clear" w:color="auto" w:fill="{fill}"/>')


def _ruled(style: Element, side: str) -> None:
    _borders(style, _edge(side, RULE, 4, 4))
