# ruff: noqa: E501  lines of WordprocessingML read best whole
"""A German letter template that knows nothing of the toolkit: written part by part, without python-docx."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path

from tests.report.template_factory import W, grey_png
from toolkit.report.word.xml import NS

_SPACES = " ".join(f'xmlns:{prefix}="{uri}"' for prefix, uri in NS.items()) + (
    ' xmlns:wps="http://schemas.microsoft.com/office/word/2010/wordprocessingShape" mc:Ignorable="w14 w15"'
)
_R = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
_PACKAGE = "http://schemas.openxmlformats.org/package/2006"
_WORD = "application/vnd.openxmlformats-officedocument.wordprocessingml."
SHOWING = "<w:showingPlcHdr/>"
BOUND = '<w:dataBinding w:xpath="/root[1]/size[1]" w:storeItemID="{11111111-2222-3333-4444-555555555555}"/>'


def t(text: str, look: str = "") -> str:
    look = f"<w:rPr>{look}</w:rPr>" if look else ""
    return f'<w:r>{look}<w:t xml:space="preserve">{text}</w:t></w:r>'


def p(*runs: str, style: str = "", more: str = "") -> str:
    named = f'<w:pStyle w:val="{style}"/>' if style else ""
    inner = "".join(r if r.startswith("<") else t(r) for r in runs)
    return f"<w:p><w:pPr>{named}{more}</w:pPr>{inner}</w:p>"


def sdt(tag: str, content: str, more: str = "") -> str:
    return f'<w:sdt><w:sdtPr><w:alias w:val="x"/><w:tag w:val="{tag}"/>{more}</w:sdtPr><w:sdtContent>{content}</w:sdtContent></w:sdt>'


def field(code: str, result: str = "?") -> str:
    return (
        '<w:r><w:fldChar w:fldCharType="begin"/></w:r>'
        f'<w:r><w:instrText xml:space="preserve"> {code} </w:instrText></w:r>'
        f'<w:r><w:fldChar w:fldCharType="separate"/></w:r>{t(result)}<w:r><w:fldChar w:fldCharType="end"/></w:r>'
    )


def cell(content: str, *, span: int = 1, width: int = 2000) -> str:
    merged = f'<w:gridSpan w:val="{span}"/>' if span > 1 else ""
    return f'<w:tc><w:tcPr><w:tcW w:w="{width * span}" w:type="dxa"/>{merged}</w:tcPr>{content}</w:tc>'


def row(*cells: str, head: bool = False) -> str:
    return f"<w:tr>{'<w:trPr><w:tblHeader/></w:trPr>' if head else ''}{''.join(cells)}</w:tr>"


def table(columns: int, *rows: str, width: int = 2000) -> str:
    grid = f'<w:gridCol w:w="{width}"/>' * columns
    return f'<w:tbl><w:tblPr><w:tblW w:w="0" w:type="auto"/></w:tblPr><w:tblGrid>{grid}</w:tblGrid>{"".join(rows)}</w:tbl>'


def picture(rel: str, width: int, height: int, number: int) -> str:
    return (
        f'<w:r><w:drawing><wp:inline><wp:extent cx="{width}" cy="{height}"/><wp:docPr id="{number}" name="p" descr="logo"/>'
        f'<a:graphic><a:graphicData uri="{NS["pic"]}"><pic:pic><pic:nvPicPr><pic:cNvPr id="{number}" name="p"/><pic:cNvPicPr/>'
        f'</pic:nvPicPr><pic:blipFill><a:blip r:embed="{rel}"/><a:stretch><a:fillRect/></a:stretch></pic:blipFill><pic:spPr>'
        f'<a:xfrm><a:off x="0" y="0"/><a:ext cx="{width}" cy="{height}"/></a:xfrm><a:prstGeom prst="rect"><a:avLst/></a:prstGeom>'
        "</pic:spPr></pic:pic></a:graphicData></a:graphic></wp:inline></w:drawing></w:r>"
    )


def text_box(inner: str) -> str:
    return (
        '<w:r><mc:AlternateContent><mc:Choice Requires="wps"><w:drawing><wp:anchor distT="0" distB="0" distL="114300" '
        'distR="114300" simplePos="0" relativeHeight="2" behindDoc="0" locked="0" layoutInCell="1" allowOverlap="1">'
        '<wp:simplePos x="0" y="0"/><wp:positionH relativeFrom="column"><wp:posOffset>3000000</wp:posOffset></wp:positionH>'
        '<wp:positionV relativeFrom="paragraph"><wp:posOffset>100000</wp:posOffset></wp:positionV>'
        '<wp:extent cx="2500000" cy="700000"/><wp:wrapSquare wrapText="bothSides"/><wp:docPr id="77" name="Box"/>'
        '<wp:cNvGraphicFramePr/><a:graphic><a:graphicData uri="http://schemas.microsoft.com/office/word/2010/wordprocessingShape">'
        '<wps:wsp><wps:cNvSpPr txBox="1"/><wps:spPr><a:xfrm><a:off x="0" y="0"/><a:ext cx="2500000" cy="700000"/></a:xfrm>'
        '<a:prstGeom prst="rect"><a:avLst/></a:prstGeom></wps:spPr><wps:txbx><w:txbxContent>'
        f"{inner}</w:txbxContent></wps:txbx><wps:bodyPr/></wps:wsp></a:graphicData></a:graphic></wp:anchor></w:drawing></mc:Choice>"
        f'<mc:Fallback><w:pict><v:shape style="width:197pt;height:55pt"><v:textbox><w:txbxContent>{inner}</w:txbxContent>'
        "</v:textbox></v:shape></w:pict></mc:Fallback></mc:AlternateContent></w:r>"
    )


_STYLES = f"""<w:styles xmlns:w="{W}"><w:docDefaults><w:rPrDefault><w:rPr>
<w:rFonts w:ascii="Arial" w:hAnsi="Arial"/><w:sz w:val="20"/><w:lang w:val="de-DE"/></w:rPr></w:rPrDefault></w:docDefaults>
<w:style w:type="paragraph" w:default="1" w:styleId="Standard"><w:name w:val="Normal"/></w:style>
<w:style w:type="paragraph" w:styleId="berschrift1"><w:name w:val="heading 1"/><w:basedOn w:val="Standard"/><w:pPr><w:keepNext/>
<w:numPr><w:numId w:val="1"/></w:numPr><w:outlineLvl w:val="0"/></w:pPr></w:style>
<w:style w:type="paragraph" w:styleId="berschrift2"><w:name w:val="heading 2"/><w:basedOn w:val="berschrift1"/><w:pPr>
<w:numPr><w:ilvl w:val="1"/><w:numId w:val="1"/></w:numPr><w:outlineLvl w:val="1"/></w:pPr></w:style>
<w:style w:type="paragraph" w:styleId="Verzeichnis1"><w:name w:val="toc 1"/><w:basedOn w:val="Standard"/></w:style>
<w:style w:type="paragraph" w:styleId="Beschriftung"><w:name w:val="caption"/><w:basedOn w:val="Standard"/></w:style></w:styles>"""
_NUMBERS = (
    f'<w:numbering xmlns:w="{W}"><w:abstractNum w:abstractNumId="0"><w:multiLevelType w:val="multilevel"/>'
    + "".join(
        f'<w:lvl w:ilvl="{i}"><w:start w:val="1"/><w:numFmt w:val="decimal"/><w:pStyle w:val="berschrift{i + 1}"/>'
        f'<w:lvlText w:val="{text}"/></w:lvl>'
        for i, text in enumerate(("%1", "%1.%2"))
    )
    + '</w:abstractNum><w:num w:numId="1"><w:abstractNumId w:val="0"/></w:num></w:numbering>'
)


def section(*, landscape: bool = False, references: str = "", title: bool = False) -> str:
    wide, tall = (16838, 11906) if landscape else (11906, 16838)
    turned = ' w:orient="landscape"' if landscape else ""
    return (
        f'<w:sectPr>{references}<w:type w:val="nextPage"/><w:pgSz w:w="{wide}" w:h="{tall}"{turned}/>'
        '<w:pgMar w:top="1417" w:right="1134" w:bottom="1134" w:left="1417" w:header="708" w:footer="708" w:gutter="0"/>'
        f"{'<w:titlePg/>' if title else ''}</w:sectPr>"
    )


_HEADS = "".join(
    f'<w:{kind}Reference w:type="{which}" r:id="{rel}"/>'
    for kind, which, rel in (
        ("header", "default", "rIdH1"), ("header", "first", "rIdH2"), ("header", "even", "rIdH3"), ("footer", "default", "rIdF1"),
    )
)  # fmt: skip


def body() -> str:
    """Return the letter: contents, lists, nested tables, a text box, three sections, numbered headings."""
    contents = (
        '<w:sdt><w:sdtPr><w:docPartObj><w:docPartGallery w:val="Table of Contents"/><w:docPartUnique/></w:docPartObj></w:sdtPr><w:sdtContent>'
        + p("Inhalt")
        + '<w:p><w:pPr><w:pStyle w:val="Verzeichnis1"/></w:pPr><w:r><w:fldChar w:fldCharType="begin"/></w:r>'
        '<w:r><w:instrText xml:space="preserve"> TOC \\o "1-3" \\h \\z \\u </w:instrText></w:r>'
        f'<w:r><w:fldChar w:fldCharType="separate"/></w:r>{t("Alte Zeile")}</w:p>'
        '<w:p><w:r><w:fldChar w:fldCharType="end"/></w:r></w:p></w:sdtContent></w:sdt>'
    )
    showing = SHOWING + BOUND + '<w:lock w:val="sdtContentLocked"/>'
    inner = table(
        2,
        row(cell(p("Größe")), cell(p("{{", "tk:ti", "re.si", "ze}", t("}", "<w:b/>")))),
        row(cell(p("DOT")), cell(p(sdt("tk:tire.DOT", t("klicken"), showing)))),
    )
    date = sdt(
        "tk:test.date",
        t("Datum"),
        SHOWING
        + '<w:date w:fullDate="2001-01-01T00:00:00Z"><w:dateFormat w:val="dd.MM.yyyy"/><w:lid w:val="de-DE"/></w:date>',
    )
    figure = p(sdt("tk:figure.conicity", picture("rIdP1", 3600000, 2000000, 5), "<w:picture/>"))
    number = field("SEQ Figure \\* ARABIC", "9")
    values = table(
        4,
        row(cell(p("Winkel"), span=2), cell(p("Kraft"), span=2), head=True),
        row(cell(p("SA")), cell(p("FZ")), cell(p("FY")), cell(p("MZ")), head=True),
        row(
            cell(p("{{tk:row", ".SA|+.2f}}")),
            cell(p(sdt("tk:row.FZ", t("z"), SHOWING))),
            sdt("tk:row.FY|.3e", cell(p("y"))),
            cell(p("{{tk:row.MZ}} N·m")),
        ),
        row(cell(p("Ende der Tabelle"), span=4)),
    )
    return "".join(
        [
            p("Prüfbericht ", "{{tk:rep", t("ort.", "<w:i/>"), "id", "}}", text_box(p("Box: {{tk:tire", ".company}} ", date))),
            contents,
            p(field('TOC \\h \\z \\c "Figure"', "nothing")),
            table(2, row(cell(p("Reifen")), cell(p("x") + inner + p(""), width=4500)), width=4500),
            p("Reifen {{tk:tire.size}}", style="berschrift1"),
            p("Bestellt von {{tk:test.requestor}}. ", '<w:r><w:footnoteReference w:id="2"/></w:r>'),
            sdt(
                "tk:if.pull",
                p("Zug", style="berschrift2")
                + figure
                + p("Figure ", number, ": {{tk:caption.conicity}}", style="Beschriftung"),
            ),
            sdt(
                "tk:if.simulated",
                p("Simulation", '<w:r><w:footnoteReference w:id="3"/></w:r>', style="berschrift2"),
            ),
            p("", more=section(references=_HEADS, title=True)),
            p("Werte", style="berschrift1"),
            sdt("tk:table.results", values),
            p("{{tk:figure.gough}}"),
            p("Figure ", number, ": {{tk:caption.gough}}", style="Beschriftung"),
            p("{{tk:table.files}}"),
            table(3, row(*(cell(p(x)) for x in ("Datei", "R.", "Hash"))), row(*(cell(p(x)) for x in "abc"))),
            p("", more=section(landscape=True)),
            p("Kalibrierung", style="berschrift1"),
            p("{{tk:calibration.hash}} {{tk:calibration.FY.D51|.5g}}"),
            p("Ende", style="berschrift2"),
            section(),
        ]
    )  # fmt: skip


def build(
    path: Path,
    *,
    story: str | None = None,
    main: str = "document",
    edit: Callable[[dict[str, bytes]], None] | None = None,
) -> Path:
    """Write the template; ``main`` is ``template`` for a .dotx; ``edit`` may change its members."""
    kinds = {"document": main, "styles": "styles", "numbering": "numbering", "footnotes": "footnotes"}
    kinds |= {f"header{i}": "header" for i in (1, 2, 3)} | {"footer1": "footer"}
    overrides = "".join(
        f'<Override PartName="/word/{name}.xml" ContentType="{_WORD}{kind}{".main" if name == "document" else ""}+xml"/>'
        for name, kind in kinds.items()
    )
    links = {"rIdS": "styles", "rIdN": "numbering", "rIdFn": "footnotes", "rIdF1": "footer1"}
    links |= {f"rIdH{i}": f"header{i}" for i in (1, 2, 3)}
    members = {
        "[Content_Types].xml": f'<Types xmlns="{_PACKAGE}/content-types"><Default Extension="rels" '
        'ContentType="application/vnd.openxmlformats-package.relationships+xml"/><Default Extension="xml" '
        f'ContentType="application/xml"/><Default Extension="png" ContentType="image/png"/>{overrides}</Types>',
        "_rels/.rels": _rels(("rId1", "officeDocument", "word/document.xml")),
        "word/document.xml": f"<w:document {_SPACES}><w:body>{story or body()}</w:body></w:document>",
        "word/_rels/document.xml.rels": _rels(
            *((one, name.rstrip("123"), f"{name}.xml") for one, name in links.items()),
            ("rIdP1", "image", "media/logo.png"),
        ),
        "word/styles.xml": _STYLES,
        "word/numbering.xml": _NUMBERS,
        "word/footnotes.xml": f'<w:footnotes {_SPACES}><w:footnote w:type="separator" w:id="0"><w:p><w:r><w:separator/></w:r></w:p>'
        f'</w:footnote><w:footnote w:id="2">{p("<w:r><w:footnoteRef/></w:r>", " Prüfer {{tk:test.oper", "ator}}")}</w:footnote>'
        f'<w:footnote w:id="3">{p("{{tk:test.rated_load}}")}</w:footnote></w:footnotes>',
        "word/header1.xml": f"<w:hdr {_SPACES}>{p(picture('rIdL', 900000, 300000, 91), ' {{tk:report.id}}')}</w:hdr>",
        "word/_rels/header1.xml.rels": _rels(("rIdL", "image", "media/logo.png")),
        "word/header2.xml": f"<w:hdr {_SPACES}>{p('Erste: ', sdt('tk:laboratory.name', t('Labor'), SHOWING))}</w:hdr>",
        "word/header3.xml": f"<w:hdr {_SPACES}>{p('Gerade: {{tk:test.name}}')}</w:hdr>",
        "word/footer1.xml": f"<w:ftr {_SPACES}>"
        + table(2, row(cell(p("{{tk:calibration.id}}")), cell(p("Seite ", field("PAGE"), " von ", field("NUMPAGES")))))
        + p("")
        + "</w:ftr>",
    }  # fmt: skip
    data = {name: text.encode() for name, text in members.items()}
    data["word/media/logo.png"] = grey_png(90, 30)
    if edit is not None:
        edit(data)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in data.items():
            archive.writestr(name, content)
    return path


def _rels(*links: tuple[str, str, str]) -> str:
    inner = "".join(
        f'<Relationship Id="{one}" Type="{_R}/{kind}" Target="{target}"/>' for one, kind, target in links
    )
    return f'<Relationships xmlns="{_PACKAGE}/relationships">{inner}</Relationships>'
