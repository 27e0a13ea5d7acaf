"""The default template: the source document's title page (its Figure 5.3) and a whole test report.

`build_default` made ``report_templates/org.docx``; ``toolkit template new`` writes a fresh copy for an
organisation to make its own in Word.
"""

from __future__ import annotations

import datetime as dt
import io
import zipfile
from typing import Any

from toolkit.report.blocks import (
    INK,
    RULE,
    Pieces,
    elements,
    field,
    literal,
    paragraph,
    placeholder_png,
    run,
)
from toolkit.report.xml import Element, q

STYLE_FILE = """\
# Style file of org.docx: how the report writes numbers and dates, and what the template must hold.
schema = 1
decimal_comma = false
dates = "%Y-%m-%d"
missing = "n/a"                       # what --allow-missing prints
required = ["tk:calibration.hash", "tk:calibration.id", "tk:report.id", "tk:test.name"]

[laboratory]
name = "Tire Force and Moment Laboratory"

[units]                               # force = "lbf", moment = "lbf*ft" for a report in those
force = "N"
moment = "N*m"

[styles]                              # names of the template's Word styles
heading = "Heading 1"
caption = "Caption"

[decimals]                            # by unit, by tag or by table.column
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

_WIDE = 166.0


def build_default() -> bytes:
    """Return the default template as the bytes of a .docx, the same on every call."""
    import docx
    from docx.opc.constants import RELATIONSHIP_TYPE
    from docx.shared import Mm

    document: Any = docx.Document()
    _styles(document)
    section = document.sections[0]
    section.page_width, section.page_height = Mm(210), Mm(297)
    section.left_margin = section.right_margin = Mm(22)
    section.top_margin, section.bottom_margin = Mm(27), Mm(22)
    section.header_distance = section.footer_distance = Mm(11)
    part = document.part
    image = part.package.get_or_add_image_part(io.BytesIO(placeholder_png()))
    pieces = Pieces(part.relate_to(image, RELATIONSHIP_TYPE.IMAGE))
    body = document.element.body
    for element in list(body):
        if element.tag != q("w:sectPr"):
            body.remove(element)
    for fragment in (*_title(pieces), *_chapters(pieces)):
        for element in elements(fragment):
            body.insert(len(body) - 1, element)
    _replace(section.header._element, _header(pieces))
    _replace(section.footer._element, _footer(pieces))
    core = document.core_properties
    core.author, core.title, core.comments = "", "Tire force and moment test report", ""
    core.created = core.modified = dt.datetime(2026, 11, 21)  # noqa: DTZ001  python-docx wants it naive
    core.revision = 1
    stream = io.BytesIO()
    document.save(stream)
    return _same_bytes(stream.getvalue())


def _same_bytes(data: bytes) -> bytes:
    # python-docx stamps the members with the time of day; a file under version control should not change.
    stream = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as source, zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as target:
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


def _title(p: Pieces) -> list[str]:
    quarter = (31.0, 52.0, 31.0, 52.0)
    return [
        paragraph(p.inline("tk:laboratory.name", "laboratory"), style="Laboratory"),
        paragraph(run("M-15 Tire Test"), style="Title"),
        paragraph(run("Force and Moment"), style="Subtitle"),
        p.block("tk:if.simulated", paragraph(run("SIMULATED DATA: made by simulation, not a measurement of a tire."),
                                             style="Notice")),
        p.block("tk:if.unverified", paragraph(
            run("UNVERIFIED CALIBRATION: the record is a legacy import; its coefficients are not reproduced from "
                "reference data."), style="Notice")),
        p.facts(
            [
                [("TIRE SIZE", "tire.size"), ("COMPANY", "tire.company")],
                [("DOT", "tire.DOT"), ("SERIES", "tire.series")],
                [("TEST PRESSURE", "test.pressure"), ("OPERATOR", "test.operator")],
                [("REQUESTOR", "test.requestor"), ("TEST DATE", "test.date")],
                [("SPECIAL?", "test.special")],
            ],
            quarter,
        ),
        paragraph("", style="Gap"),
        paragraph(run("Calibration"), style="BoxTitle"),
        p.facts(
            [
                [("RECORD", "calibration.id"), ("STATUS", "calibration.status")],
                [("SHA-256", "calibration.hash")],
            ],
            quarter,
        ),
        paragraph("", style="Gap"),
        p.block(
            "tk:if.summary.load",
            paragraph(run("Results at ") + p.inline("tk:summary.load", "load")
                      + literal(" {{tk:unit.force}}"), style="BoxTitle")
            + _summary(p, quarter),
        ),
        paragraph("", style="Gap"),
        paragraph(run("Report"), style="BoxTitle"),
        p.facts(
            [
                [("REPORT ID", "report.id"), ("ISSUED", "report.date")],
                [("TEST", "test.name"), ("DATA", "simulated")],
            ],
            quarter,
        ),
        paragraph(
            run("The results relate only to the item tested, as received. The report may be reproduced only as a whole. "
                "Expanded uncertainties have a coverage probability of about 95 %."), style="Small"),
    ]  # fmt: skip


def _summary(p: Pieces, widths: tuple[float, ...]) -> str:
    def fact(label: str, name: str, unit: str) -> tuple[str, str]:
        return label, f"{{{{tk:summary.{name}}}}} {{{{tk:unit.{unit}}}}}"

    rows = [
        p.block("tk:if.summary.cornering_stiffness", _rows(p, [[fact("CORNERING", "cornering_stiffness", "force_per_angle"),
                fact("ALIGNING", "aligning_stiffness", "moment_per_angle")]], widths)),
        p.block("tk:if.summary.conicity", _rows(p, [[fact("CONICITY", "conicity", "force"), fact("PLYSTEER", "plysteer", "force")],
                [fact("CRAT", "CRAT", "moment"), fact("PRAT", "PRAT", "moment")]], widths)),
    ]  # fmt: skip
    outer = p.facts([], widths)
    return outer.replace("</w:tblGrid>", "</w:tblGrid>" + "".join(rows))


def _rows(p: Pieces, rows: list[list[tuple[str, str]]], widths: tuple[float, ...]) -> str:
    made = p.facts([list(row) for row in rows], widths)
    return made.partition("</w:tblGrid>")[2].removesuffix("</w:tbl>")


def _chapters(p: Pieces) -> list[str]:
    def heading(text: str, *, fresh: bool = False) -> str:
        return paragraph(run(text), style="Heading1").replace(
            "</w:pPr>", "<w:pageBreakBefore/></w:pPr>" if fresh else "</w:pPr>", 1
        )

    def text(words: str) -> str:
        return paragraph(literal(words))

    force, moment = "{{tk:unit.force}}", "{{tk:unit.moment}}"
    stiff = "{{tk:unit.force_per_angle}}", "{{tk:unit.moment_per_angle}}"
    return [
        heading("1  Test", fresh=True),
        p.facts(
            [
                [("MACHINE", "test.machine")],
                [("SURFACE?", "test.surface")],
                [("RIM?", "tire.rim")],
                [("CONSTRUCTION?", "tire.construction")],
                [("LOADS", "test.loads")],
                [("SLIP ANGLES?", "test.slip_angles")],
                [("DIRECTIONS", "test.directions")],
                [("AVERAGING", "test.averaging")],
                [("TARE", "test.tare")],
                [("AXES", "test.axes")],
            ],
            (38.0, 128.0),
        ),
        p.block("tk:if.test.speed", text("The drum's surface ran at {{tk:test.speed}} km/h.")),
        text("{{tk:test.files}} recordings gave {{tk:test.conditions}} conditions. Every force and moment was computed from "
             "the load cells by calibration record {{tk:calibration.id}}; all results are in {{tk:test.axes}} axes: z down, "
             "y to the right, a positive slip angle gives a negative lateral force and a positive aligning moment."),
        heading("2  Lateral force and aligning moment"),
        p.figure("fy_vs_slip", 160), p.figure("mz_vs_slip", 160), p.figure("fy_vs_load", 160),
        p.figure("mz_vs_load", 160), p.figure("gough", 160),
        p.block("tk:if.stiffness", heading("3  Cornering and aligning stiffness")
            + text("Both are positive in SAE axes. The secant runs through the ±1 deg steps, as the source standard has it; "
                   "the slope is that of the fitted curve at 0 deg.")
            + p.figure("cornering_stiffness", 160) + p.figure("aligning_stiffness", 160)
            + p.table(
                "stiffness", "Cornering and aligning stiffness with expanded uncertainties (95 %).",
                [f"load [{force}]", "direction", f"cornering, secant [{stiff[0]}]", f"cornering, slope [{stiff[0]}]",
                 f"aligning, secant [{stiff[1]}]", f"aligning, slope [{stiff[1]}]"],
                ["load", "rotation", "cornering_secant ± U_cornering_secant", "cornering_slope ± U_cornering_slope",
                 "aligning_secant ± U_aligning_secant", "aligning_slope ± U_aligning_slope"],
                [20, 22, 31, 31, 31, 31], "rlrrrr")),
        heading("4  Pull"),
        p.block("tk:if.no_pull", text("The test has no pull characteristics: they need a forward and a reversed run.")),
        p.block("tk:if.pull",
            text("From the forward and the reversed run at slip angle zero, read off each direction's own curve at a common "
                 "load. Conicity keeps its sign when the drum is reversed; plysteer changes it.")
            + p.figure("conicity", 160) + p.figure("plysteer", 160) + p.figure("crat", 160) + p.figure("prat", 160)
            + p.table(
                "pull", "Pull characteristics by symmetry with expanded uncertainties (95 %).",
                [f"load [{force}]", f"conicity [{force}]", f"plysteer [{force}]", f"CRAT [{moment}]",
                 f"PRAT at 0 deg [{moment}]", f"PRAT at FY = 0 [{moment}]"],
                ["load", "conicity ± U_conicity", "plysteer ± U_plysteer", "CRAT ± U_CRAT", "PRAT ± U_PRAT",
                 "PRAT_at_FY_zero ± U_PRAT_at_FY_zero"], [22, 28, 28, 28, 30, 30], "rrrrrr")
            + p.table(
                "pull_thesis", "CRAT and PRAT by the formulas of the machine's source document, which pair the directions "
                "the other way round, and the moment at zero lateral force of each direction by itself.",
                [f"load [{force}]", f"CRAT, source [{moment}]", f"PRAT, source [{moment}]",
                 f"residual, forward [{moment}]", f"residual, reverse [{moment}]"],
                ["load", "thesis_CRAT ± U_thesis_CRAT", "thesis_PRAT ± U_thesis_PRAT",
                 "residual_forward ± U_residual_forward", "residual_reverse ± U_residual_reverse"],
                [22, 36, 36, 36, 36], "rrrrr")),
        p.block("tk:if.fits", heading("5  Fitted curves")
            + text("Magic Formula y = D sin(C arctan(Bx - E(Bx - arctan Bx))) + Sv with x = SA + Sh, one curve a load. D and Sv "
                   "are in the channel's unit; below each parameter stands its standard error, n/a where the data do not "
                   "determine it. The error is 100 √(Σ(model - measured)² / Σ measured²); the floor is the same for the "
                   "measurements about their means.")
            + p.table(
                "fits", "Parameters of the fitted curves.",
                ["", "direction", f"load [{force}]", "B [1/rad]", "C", "D", "E", "Sh [deg]", "Sv", "error [%]", "floor [%]"],
                ["channel", "rotation", "load", "B ± u_B", "C ± u_C", "D ± u_D", "E ± u_E", "Sh ± u_Sh", "Sv ± u_Sv",
                 "error", "floor"], [9, 17, 16, 17, 14.5, 18.5, 15, 15, 16, 14, 14], "llrrrrrrrrr")),
        heading("6  Calibration"),
        p.table(
            "calibration", "Coefficients of the calibration record.",
            ["load", "term", "coefficient", "as issued", "standard error", "unit"],
            ["load", "term", "coefficient", "issued", "standard_error", "unit"], [16, 26, 30, 30, 30, 34], "llrrrl"),
        p.table(
            "acquisition", "The acquisition program's own values against this report's: largest differences a file.",
            ["recording", f"FY [{force}]", f"MZ [{moment}]"], ["file", "FY_difference", "MZ_difference"],
            [90, 38, 38], "lrr"),
        heading("7  Findings"),
        p.block("tk:if.no_findings", text("There are no findings.")),
        p.table("findings", "Departures from what was expected.", ["rule", "level", "where", "finding"],
                ["rule", "level", "where", "message"], [30, 16, 36, 84], "llll"),
        heading("8  Measured conditions"),
        p.table(
            "results", "Means of the load blocks as measured; U is the repeatability of the mean, k = 2.",
            ["direction", "SA [deg]", f"FZ [{force}]", f"FY [{force}]", f"U [{force}]", f"MZ [{moment}]", f"U [{moment}]",
             "recording"],
            ["rotation", "SA", "FZ", "FY", "U_FY", "MZ", "U_MZ", "file"], [19, 17, 19, 20, 17, 20, 17, 37], "lrrrrrrl"),
        heading("9  Provenance"),
        text("Made by {{tk:software.name}} {{tk:software.version}} from the recordings below and calibration record "
             "{{tk:calibration.id}}, SHA-256 {{tk:calibration.hash}}."),
        p.table("files", "Recordings and their SHA-256.", ["recording", "direction", "SHA-256"],
                ["file", "rotation", "sha256"], [36, 20, 110], "lll"),
        paragraph(run("End of report ") + p.inline("tk:report.id", "report id"), style="EndMark"),
    ]  # fmt: skip


def _header(p: Pieces) -> str:
    line = (
        p.inline("tk:laboratory.name", "laboratory") + "<w:r><w:tab/></w:r>"
        + p.block("tk:if.simulated", run("SIMULATED DATA", bold=True, style="Mark"))
        + p.block("tk:if.unverified", run("  UNVERIFIED CALIBRATION", bold=True, style="Mark"))
        + "<w:r><w:tab/></w:r>" + p.inline("tk:report.id", "report id")
    )  # fmt: skip
    return paragraph(line, style="Header")


def _footer(p: Pieces) -> str:
    line = (
        p.inline("tk:test.name", "test") + "<w:r><w:tab/></w:r>" + run("calibration ")
        + p.inline("tk:calibration.id", "record") + "<w:r><w:tab/></w:r>" + run("page ") + field("PAGE")
        + run(" of ") + field("NUMPAGES")
    )  # fmt: skip
    return paragraph(line, style="Footer")


def _styles(document: Any) -> None:
    from docx.enum.style import WD_STYLE_TYPE
    from docx.enum.text import WD_ALIGN_PARAGRAPH, WD_TAB_ALIGNMENT
    from docx.shared import Mm, Pt, RGBColor

    ink, grey = RGBColor.from_string(INK), RGBColor(0x55, 0x5F, 0x6B)
    styles = document.styles

    def style(name: str, size: float, *, before: float = 0, after: float = 0, bold: bool = False, colour: Any = None,
              based: str = "Normal", align: Any = None, next_: str | None = None) -> Any:  # fmt: skip
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
    style("Fact", 11, before=3, after=3)
    style("FactLabel", 9, before=3, after=3, colour=ink)
    style("BoxTitle", 11, before=4, after=3, bold=True, colour=ink).paragraph_format.keep_with_next = True
    style("Gap", 6)
    style("Small", 8.5, before=16, colour=grey)
    style("EndMark", 10, before=18, colour=grey, align=centre)
    notice = style("Notice", 11.5, before=2, after=8, bold=True, colour=RGBColor(0x9C, 0x1C, 0x1C), align=centre)
    _boxed(notice.element, "9C1C1C", "FBEDED")
    for name in ("Header", "Footer"):
        one = style(name, 9, colour=grey)
        for tab in list(one.paragraph_format.tab_stops):
            one.paragraph_format.tab_stops.clear_all()
            break
        one.paragraph_format.tab_stops.add_tab_stop(Mm(_WIDE / 2), WD_TAB_ALIGNMENT.CENTER)
        one.paragraph_format.tab_stops.add_tab_stop(Mm(_WIDE), WD_TAB_ALIGNMENT.RIGHT)
        _ruled(one.element, "bottom" if name == "Header" else "top")
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
    first = ("pStyle", "keepNext", "keepLines", "pageBreakBefore", "framePr", "widowControl", "numPr", "suppressLineNumbers")
    at = sum(1 for child in properties if child.tag in {q(f"w:{one}") for one in first})
    for child in reversed(list(made)):
        properties.insert(at, child)


def _boxed(style: Element, colour: str, fill: str) -> None:
    inner = "".join(_edge(side, colour, 6, 4) for side in ("top", "left", "bottom", "right"))
    _borders(style, inner, f'<w:shd w:val="clear" w:color="auto" w:fill="{fill}"/>')


def _ruled(style: Element, side: str) -> None:
    _borders(style, _edge(side, RULE, 4, 4))
