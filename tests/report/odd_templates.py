# ruff: noqa: E501  lines of WordprocessingML read best whole
"""Templates as they come: what Word, LibreOffice and people leave around a tag, each on one page or a few."""

from __future__ import annotations

from pathlib import Path

from tests.report.alien_factory import (
    BOUND,
    SHOWING,
    build,
    cell,
    field,
    p,
    picture,
    row,
    sdt,
    section,
    t,
    table,
    text_box,
)

HASH = p("{{tk:calibration.hash}}")
_LOCKED = '<w:lock w:val="sdtContentLocked"/>'
_MARKS = (
    '<w:bookmarkStart w:id="7" w:name="b"/>', '<w:bookmarkEnd w:id="7"/>',
    '<w:proofErr w:type="spellStart"/>', '<w:proofErr w:type="spellEnd"/>',
)  # fmt: skip
LIBREOFFICE_CORE = (
    "http://schemas.openxmlformats.org/officedocument/2006/relationships/metadata/core-properties"
)


def _link(*runs: str) -> str:
    return f'<w:hyperlink w:anchor="b">{"".join(runs)}</w:hyperlink>'


def _smart(inner: str) -> str:
    return f'<w:smartTag w:uri="urn:x" w:element="y">{inner}</w:smartTag>'


def _tracked(kind: str, inner: str) -> str:
    return f'<w:{kind} w:id="50" w:author="a" w:date="2020-01-01T00:00:00Z">{inner}</w:{kind}>'


def split(folder: Path) -> Path:
    """Return literals over runs: bookmarks, spelling marks, links, smart tags, a comment, tracked changes."""
    start, end, wrong, right = _MARKS
    gone = _tracked("del", '<w:r><w:delText xml:space="preserve">old</w:delText></w:r>')
    return build(
        folder / "split.docx",
        story=p("A ", t("{{"), start, t("tk:"), wrong, t("tire"), right, t(".si"), end, t("ze}}"), " end")
        + p("B ", t("{{tk:"), _tracked("ins", t("test.")), t("name}}"), " end")
        + p("C ", t("{{tk:test."), t("operator}}"), " end ", gone)
        + p("D ", _link(t("{{tk:tire")), _link(t(".DOT}}")), " end")
        + p("E ", _smart(t("{{tk:tire.") + _smart(t("rim}}"))), " end")
        + p("F ", '<w:commentRangeStart w:id="3"/>', t("{{tk:test.sur"), '<w:commentRangeEnd w:id="3"/>', t("face}}"), " end")
        + p("G ", '<w:r><w:t>{{tk:test.</w:t><w:softHyphen/><w:t>machine}}</w:t></w:r>', " end")
        + HASH
        + section(),
    )  # fmt: skip


def controls(folder: Path) -> Path:
    """Return controls of every kind and at every level: locked, bound, repeated, chosen from a list."""
    grid = table(
        3,
        row(sdt("tk:tire.company", cell(p("a")), '<w:lock w:val="sdtLocked"/>'),
            cell(sdt("tk:tire.DOT", p("b"), '<w:text w:multiLine="1"/>')), cell(p(sdt("tk:tire.rim", t("c"), SHOWING)))),
        sdt("of others", row(cell(p(sdt("tk:test.operator", t("d")))), cell(p("lit {{tk:test.name}}")), cell(p("e")))),
        sdt("tk:if.reverse", row(*(cell(p(one)) for one in ("reverse", "yes", "z")))),
        sdt("tk:if.unverified", row(*(cell(p("GONE")) for _ in range(3)))),
    )  # fmt: skip
    item = f"<w:sdt><w:sdtPr><w15:repeatingSectionItem/></w:sdtPr><w:sdtContent>{p('item ', sdt('tk:test.surface', t('?'), SHOWING))}</w:sdtContent></w:sdt>"
    choice = '<w:dropDownList><w:listItem w:displayText="one" w:value="1"/></w:dropDownList>'
    box = '<w14:checkbox><w14:checked w14:val="0"/></w14:checkbox>'
    part = '<w:placeholder><w:docPart w:val="DefaultPlaceholder_1081868574"/></w:placeholder>'
    bound = BOUND + '<w15:dataBinding w:xpath="/a" w:storeItemID="{11111111-2222-3333-4444-555555555555}"/>'
    deep = p("deep ", sdt("d", sdt("e", sdt("tk:calibration.id", t("x")))))
    return build(
        folder / "controls.docx",
        story=sdt("of others", p("x ", sdt("tk:tire.size", t("?"), SHOWING)), f"<w:group/>{_LOCKED}")
        + grid
        + sdt("items", item, "<w15:repeatingSection/>")
        + p(sdt("tk:test.machine", t("Choose"), SHOWING + choice))
        + p(sdt("mine", t("\u2610"), box), " left alone ", sdt("tk:test.special", t("\u2610"), box))
        + p(sdt("tk:test.requestor", t("click", '<w:rStyle w:val="PlaceholderText"/>'), part + SHOWING))
        + p(sdt("tk:tire.construction", t("old"), bound))
        + sdt("a", sdt("b", sdt("tk:if.pull", sdt("c", deep))))
        + sdt("tk:report.id", "")
        + HASH
        + section(),
    )


def boxes(folder: Path) -> Path:
    """Return a .dotx: text boxes in both branches, old ones, pictures in cells, a wide page of its own."""
    held = sdt("tk:figure.gough", p(picture("rIdP1", 900000, 900000, 8)), "<w:picture/>")
    inline = p(sdt("tk:figure.conicity", picture("rIdP1", 1800000, 1000000, 5), "<w:picture/>"))
    old = f'<w:r><w:pict><v:shape style="width:150pt;height:60pt"><v:textbox><w:txbxContent>{p("old {{tk:test.name}}")}</w:txbxContent></v:textbox></v:shape></w:pict></w:r>'
    inner = p("Box {{tk:ti", "re.size}}") + table(1, row(cell(p(sdt("tk:test.date", t("d")))))) + p("")
    return build(
        folder / "boxes.dotx",
        main="template",
        story=p("Titel ", text_box(inner))
        + p(old)
        + table(2, row(cell(inline), cell(held)))
        + p("", more=section())
        + p("Quer {{tk:figure.mz_vs_slip|width=200mm}}")
        + p("", more=section(landscape=True))
        + HASH
        + section(),
    )


def from_the_right(folder: Path) -> Path:
    """Return paragraphs and tables from the right, with a table inside a table."""

    def right(inner: str) -> str:
        return f"<w:p><w:pPr><w:bidi/></w:pPr>{inner}</w:p>"

    turned = table(
        3, row(*(cell(p(one)) for one in ("Last", "Konizität", "Winkel"))),
        row(*(cell(p(f"{{{{tk:row.{one}}}}}")) for one in ("load", "conicity", "plysteer"))),
    ).replace("<w:tblPr>", "<w:tblPr><w:bidiVisual/>")  # fmt: skip
    return build(
        folder / "right.docx",
        story=right(t("תקופה ") + t("{{tk:tire") + t(".size}}") + t(" בדיקה"))
        + table(1, row(cell(sdt("tk:table.pull", turned) + p(""), width=9000)), width=9000)
        + HASH
        + section(),
    )


def numbered(folder: Path) -> Path:
    """Return contents of one line, of headings that Word numbers, and a note that nothing refers to."""
    gallery = '<w:docPartObj><w:docPartGallery w:val="Table of Contents"/></w:docPartObj>'
    line = p(field('TOC \\o "1-2" \\h', "old"))
    contents = f"<w:sdt><w:sdtPr>{gallery}</w:sdtPr><w:sdtContent>{line}</w:sdtContent></w:sdt>"
    mark = '<w:r><w:footnoteReference w:id="2"/></w:r>'
    return build(
        folder / "numbered.docx",
        story=contents + p("Ein {{tk:tire.size}}", mark, style="berschrift1") + HASH + section(),
    )


def as_libreoffice(folder: Path) -> Path:
    """Return fields in controls around one paragraph, and properties under LibreOffice's own relation."""
    core = b'<cp:coreProperties xmlns:cp="http://schemas.openxmlformats.org/package/2006/metadata/core-properties"/>'

    def edit(members: dict[str, bytes]) -> None:
        members["docProps/core.xml"] = core
        kind = b"application/vnd.openxmlformats-package.core-properties+xml"
        for name, end, more in (
            ("_rels/.rels", b"</Relationships>", b'<Relationship Id="rId9" Type="%b" Target="docProps/core.xml"/>' % LIBREOFFICE_CORE.encode()),
            ("[Content_Types].xml", b"</Types>", b'<Override PartName="/docProps/core.xml" ContentType="%b"/>' % kind),
        ):  # fmt: skip
            members[name] = members[name].replace(end, more + end)
        foot = sdt(
            "foot", p("Blatt ", field("PAGE", "9"), " von ", field("NUMPAGES", "9"), " {{tk:test.name}}")
        )
        members["word/footer1.xml"] = members["word/footer1.xml"].replace(
            b"</w:ftr>", foot.encode() + b"</w:ftr>"
        )

    return build(
        folder / "libreoffice.docx",
        edit=edit,
        story=sdt("x", p("eins ", field("PAGE", "9"), " {{tk:tire.size}}"))
        + table(1, row(sdt("c", cell(p("zwei ", field("PAGE", "9"))))))
        + sdt("y", p("drei ", '<w:hyperlink w:anchor="b"><w:r><w:t>link</w:t></w:r></w:hyperlink>'))
        + HASH
        + section(references='<w:footerReference w:type="default" r:id="rIdF1"/>'),
    )


ALL = (split, controls, boxes, from_the_right, as_libreoffice, numbered)
