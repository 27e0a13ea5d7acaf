# ruff: noqa: E501  lines of WordprocessingML read best whole
from __future__ import annotations

import dataclasses
import datetime as dt
import io
import re
import zipfile
from pathlib import Path

import docx
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lxml import etree

from tests.report.report_factory import SHA, make_record, make_result
from tests.report.template_factory import W, grey_png, make, opened, p, run, sdt, tbl, texts
from toolkit.errors import TemplateError
from toolkit.report.content import Table, Value
from toolkit.report.figures import Picture
from toolkit.report.style import Style
from toolkit.report.test.content import build_content
from toolkit.report.word.fill import Filled, fill
from toolkit.report.word.package import read_template
from toolkit.report.word.verify import text_checks, verify_docx
from toolkit.report.word.xml import NS

DAY = dt.date(2026, 11, 21)
PICTURE = Picture(png=grey_png(63, 37), width_px=63, height_px=37)


def content(**changes: object):
    return build_content(make_result(**changes), make_record(), issued=DAY)


def filled(folder: Path, body: str, made=None, *, allow_missing: bool = False, **more: object) -> Filled:
    made = made or content()
    pictures = dict.fromkeys(made.plots, PICTURE)
    result = fill(opened(folder, body, **more), made, pictures, allow_missing=allow_missing)
    assert all(check.ok for check in verify_docx(result))
    return result


def root(result: Filled, part: str = "word/document.xml"):
    with zipfile.ZipFile(io.BytesIO(result.docx)) as archive:
        return etree.fromstring(archive.read(part))


def test_a_literal_split_over_runs_keeps_the_first_runs_look(tmp_path: Path) -> None:
    bold = "<w:r><w:rPr><w:b/></w:rPr><w:t>: {{t</w:t></w:r>"
    result = filled(tmp_path, p("Size", bold, "k:tire", '<w:proofErr w:type="x"/>', ".size}", "} and more"))
    assert "Size: 265/35 ZR 18 and more" in texts(result.docx)
    holder = next(t for t in root(result).iter(f"{{{W}}}t") if "265" in (t.text or ""))
    assert holder.getparent().find(f"{{{W}}}rPr/{{{W}}}b") is not None


def _bookmarked(result: Filled) -> str:
    """Return the text between the beginning and the end of the bookmark b."""
    inside, text = False, ""
    for element in root(result).iter(f"{{{W}}}bookmarkStart", f"{{{W}}}bookmarkEnd", f"{{{W}}}t"):
        if element.tag.endswith("}t"):
            text += (element.text or "") if inside else ""
        else:
            inside = element.tag.endswith("Start")
    return text


START, STOP = '<w:bookmarkStart w:id="7" w:name="b"/>', '<w:bookmarkEnd w:id="7"/>'


@pytest.mark.parametrize(
    "runs",
    [
        ("before {{tk:tire.", START, "size}}", STOP),
        ("before ", "{{tk:", START, "tire.", STOP, "size}}", " after"),
        ("before {{", "tk:tire", START, ".size}}", STOP),
        (START, "{{tk:tire", STOP, ".size}}"),
        ("before ", START, "{{tk:tire.size", STOP, "}}"),
        ("{{tk:tire.rim}} {{tk:tire.", START, "size}}", STOP),
    ],
)
def test_a_bookmark_of_a_part_of_a_tag_holds_the_whole_value(tmp_path: Path, runs: tuple[str, ...]) -> None:
    result = filled(tmp_path, p(*runs))
    size = next(entry.text for entry in result.manifest if entry.tag == "tk:tire.size")
    assert _bookmarked(result) == size


def test_what_a_bookmark_holds_beside_a_part_of_a_tag_stays_in_it(tmp_path: Path) -> None:
    result = filled(tmp_path, p("x {{tk:", START, "tire.size}} and more", STOP))
    size = next(entry.text for entry in result.manifest if entry.tag == "tk:tire.size")
    assert _bookmarked(result) == f"{size} and more"


def test_every_level_of_control_is_filled_and_loses_its_placeholder_state(tmp_path: Path) -> None:
    showing = '<w:lock w:val="sdtContentLocked"/><w:showingPlcHdr/><w:dataBinding w:xpath="/a" w:storeItemID="x"/><w:text/>'
    prompt = '<w:r><w:rPr><w:rStyle w:val="PlaceholderText"/><w:i/></w:rPr><w:t>click</w:t></w:r>'
    cell = f'<w:tc><w:tcPr><w:shd w:val="clear" w:fill="FF0000"/></w:tcPr>{p(prompt)}{p("second")}</w:tc>'
    table = f"<w:tbl><w:tblPr/><w:tblGrid><w:gridCol/></w:tblGrid><w:tr>{sdt('tk:tire.series', cell, showing)}</w:tr></w:tbl>"
    result = filled(
        tmp_path,
        p("a ", sdt("tk:tire.size", prompt, showing))
        + sdt("tk:tire.company", p(prompt) + p("x"), showing)
        + table,
    )
    text = texts(result.docx)
    assert "a 265/35 ZR 18" in text
    assert "Continental" in text
    assert "Altimax" in text
    assert "click" not in text
    assert "second" not in text
    tree = root(result)
    tags = {e.get(f"{{{W}}}val") for e in tree.iter(f"{{{W}}}tag")}
    assert {"tk:tire.size", "tk:tire.company", "tk:tire.series"} <= tags
    assert len(list(tree.iter(f"{{{W}}}lock"))) == 3
    assert not list(tree.iter(f"{{{W}}}showingPlcHdr", f"{{{W}}}dataBinding"))
    assert "PlaceholderText" not in etree.tostring(tree).decode()
    assert tree.find(f".//{{{W}}}tc/{{{W}}}tcPr/{{{W}}}shd") is not None


BOX = (
    '<w:r xmlns:mc="{mc}" xmlns:wps="http://schemas.microsoft.com/office/word/2010/wordprocessingShape" xmlns:v="{v}">'
    '<mc:AlternateContent><mc:Choice Requires="wps"><w:drawing><wp:inline><wp:extent cx="3600000" cy="900000"/>'
    '<wp:docPr id="7" name="box"/><a:graphic><a:graphicData uri="x"><wps:wsp><wps:txbx><w:txbxContent>{inner}'
    "</w:txbxContent></wps:txbx></wps:wsp></a:graphicData></a:graphic></wp:inline></w:drawing></mc:Choice>"
    "<mc:Fallback><w:pict><v:shape><v:textbox><w:txbxContent>{inner}</w:txbxContent></v:textbox></v:shape></w:pict>"
    "</mc:Fallback></mc:AlternateContent></w:r>"
)


def test_an_empty_control_between_paragraphs_is_filled_with_one(tmp_path: Path) -> None:
    result = filled(tmp_path, sdt("tk:tire.size", "") + p("see ", sdt("tk:tire.size", "")))
    block, line = root(result).iter(f"{{{NS['w']}}}sdtContent")
    assert [one.tag.rpartition("}")[2] for one in block] == ["p"]
    assert [one.tag.rpartition("}")[2] for one in line] == ["r"]


def test_headers_footnotes_and_text_boxes(tmp_path: Path) -> None:
    box = BOX.format(inner=p("{{tk:tire.DOT}} ", sdt("tk:test.operator", run("x"))), mc=NS["mc"], v=NS["v"])
    mark = '<w:r><w:footnoteReference w:id="2"/></w:r>'
    result = filled(
        tmp_path, p("body {{tk:tire.size}} ", box, mark), header=p("head ", sdt("tk:tire.series", run("x"))),
        footnote=p("foot {{tk:calibration.id}}"),
    )  # fmt: skip
    document = texts(result.docx)
    assert document.count("4MY8-009X-0713") >= 2  # the choice and the fallback
    assert "body 265/35 ZR 18 " in document
    assert "foot m15-r2" in texts(result.docx, "word/footnotes.xml")
    with zipfile.ZipFile(io.BytesIO(result.docx)) as archive:
        header = next(name for name in archive.namelist() if name.startswith("word/header"))
    assert "head Altimax" in texts(result.docx, header)
    # The manifest counts a text box once and names the part of each value.
    assert [(e.tag, e.part) for e in result.manifest if e.tag == "tk:tire.DOT"] == [
        ("tk:tire.DOT", "word/document.xml")
    ]
    assert ("tk:calibration.id", "word/footnotes.xml") in [(e.tag, e.part) for e in result.manifest]


def test_numbers_take_the_tags_format(tmp_path: Path) -> None:
    result = filled(
        tmp_path, p("{{tk:calibration.Fy.D51|.5g}} {{tk:calibration.FY.D51}} {{tk:test.files|03d}}")
    )
    assert "1.0123 1.01235 026" in texts(result.docx)


@pytest.mark.parametrize(
    "text",
    ["a < b & c = d > e", "{{tk:test.date}}", "סמית — اختبار", "tire 🛞", "=1+1", "x\ny\tz", "\x00\x0b!"],
)
def test_hostile_metadata_stays_text(tmp_path: Path, text: str) -> None:
    made = content(special=text)
    literal = p("<w:r><w:t>{{tk:test.special}}|{{tk:test.date}}</w:t></w:r>")
    result = filled(tmp_path, p("A", sdt("tk:test.special", run("x"))) + literal, made)
    plain = text.replace("\n", "").replace("\t", "").replace("\x00", "\\x00").replace("\x0b", "\\x0b")
    assert f"A{plain}" in texts(result.docx)
    assert f"{plain}|2019-06-04" in texts(result.docx)


@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.text(min_size=1, max_size=60).filter(str.strip))
def test_any_text_fills_and_verifies(tmp_path: Path, text: str) -> None:
    filled(tmp_path, p("{{tk:test.special}}", sdt("tk:test.special", run("x"))), content(special=text))


def test_a_prototype_row_is_cloned_and_header_and_footer_rows_stay(tmp_path: Path) -> None:
    cells = [f"<w:p>{sdt('tk:row.FY|.0f', run('x'))}</w:p>", "{{tk:row.file}} of {{tk:test.name}}"]
    result = filled(tmp_path, sdt("tk:table.results", tbl(["FY", "file"], cells, ["end", "."])))
    rows = list(root(result).iter(f"{{{W}}}tr"))
    assert len(rows) == 130 + 2
    assert "".join(rows[-1].itertext()) == "end."
    assert "f+0 of altimax-89" in "".join(rows[1].itertext())
    assert len(result.cells) == 130
    assert result.cells[0][0] == f"{make_result().reduced.conditions[0].FY:.0f}"
    identities = [e.get(f"{{{W}}}val") for e in root(result).iter(f"{{{W}}}id")]
    assert len(identities) == len(set(identities))


def test_an_untagged_prototype_takes_the_columns_in_order(tmp_path: Path) -> None:
    result = filled(tmp_path, p("{{tk:table.files}}") + tbl(["file", "dir", "hash"], ["1", "2", "3"]))
    assert result.cells[0][:2] == ("f+0", "forward")
    assert "tk:table" not in texts(result.docx)
    assert len(result.cells) == 26


def test_what_is_absent_in_a_table_is_visible(tmp_path: Path) -> None:
    result = filled(tmp_path, p("{{tk:table.fits}}") + tbl(["h"], ["{{tk:row.B|.1f}} {{tk:row.floor}}"]))
    assert result.cells[0] == ("11.3 n/a",)  # B = 12 - 1112/1500; the factory has no scatter floor


def test_conditions(tmp_path: Path) -> None:
    rows = f"<w:tr><w:tc>{p('always')}</w:tc></w:tr>" + sdt(
        "tk:if.conicity", f"<w:tr><w:tc>{p('row')}</w:tc></w:tr>"
    )
    body = (
        sdt("tk:if.pull", p("pull {{tk:summary.conicity}}") + sdt("tk:if.simulated", p("never")))
        + p("inline ", sdt("tk:if.reverse", run("both")))
        + f"<w:tbl><w:tblPr/><w:tblGrid><w:gridCol/></w:tblGrid>{rows}</w:tbl>"
    )
    full = filled(tmp_path, body)
    assert "pull 69" in texts(full.docx)
    assert "inline both" in texts(full.docx)
    assert "never" not in texts(full.docx)
    assert "row" in texts(full.docx)
    assert "tk:if" not in etree.tostring(root(full)).decode()
    forward = texts(filled(tmp_path, body, content(both=False)).docx)  # needs no value inside what goes
    assert "pull" not in forward
    assert "row" not in forward
    assert "always" in forward


def test_strict_filling_names_everything_that_is_missing(tmp_path: Path) -> None:
    body = (
        p("{{tk:test.operator}} {{tk:figure.conicity}} {{tk:summary.PRAT}}")
        + p("{{tk:table.pull}}")
        + tbl(["a"], ["{{tk:row.load}}"])
    )
    made = content(both=False, operator=None)
    with pytest.raises(TemplateError) as caught:
        filled(tmp_path, body, made)
    assert caught.value.rule == "missing-value"
    for tag in ("tk:test.operator", "tk:figure.conicity", "tk:summary.PRAT", "tk:table.pull"):
        assert tag in caught.value.what
    shown = filled(tmp_path, body, made, allow_missing=True)
    assert texts(shown.docx).count("n/a") == 4
    assert set(shown.missing) == {
        "tk:test.operator",
        "tk:figure.conicity",
        "tk:summary.PRAT",
        "tk:table.pull",
    }


@pytest.mark.parametrize("value", [None, float("nan"), float("inf")])
def test_values_that_are_no_numbers_are_missing(tmp_path: Path, value: float | None) -> None:
    made = content()
    made.values["summary.load"] = Value(kind="number", value=value)
    with pytest.raises(TemplateError, match=r"tk:summary\.load"):
        filled(tmp_path, p("{{tk:summary.load}}"), made)


def test_an_infinite_table_cell_is_refused(tmp_path: Path) -> None:
    made = content()
    old = made.tables["acquisition"]
    made.tables["acquisition"] = Table(name=old.name, columns=old.columns, rows=(("a", float("inf"), 1.0),))
    with pytest.raises(TemplateError, match="FY_difference"):
        filled(tmp_path, p("{{tk:table.acquisition}}") + tbl(["a"], ["{{tk:row.file}}"]), made)


def test_an_error_of_the_lint_stops_the_filling(tmp_path: Path) -> None:
    with pytest.raises(TemplateError) as caught:
        filled(tmp_path, p("{{tk:tire.sise}}"))
    assert caught.value.rule == "unknown-tag"
    assert "tk:tire.size" in str(caught.value)


def extents(result: Filled, part: str = "word/document.xml") -> list[int]:
    return [round(int(e.get("cx")) / 36000, 1) for e in root(result, part).iter(f"{{{NS['wp']}}}extent")]


def test_pictures_take_the_width_asked_or_of_their_place(tmp_path: Path) -> None:
    cell = (
        f'<w:tc><w:tcPr><w:tcW w:w="{2 * 1440 + 216}" w:type="dxa"/></w:tcPr>{p("{{tk:figure.prat}}")}</w:tc>'
    )
    table = f"<w:tbl><w:tblPr/><w:tblGrid><w:gridCol/></w:tblGrid><w:tr>{cell}</w:tr></w:tbl>"
    body = p("see {{tk:figure.gough|width=120mm}} here") + p(sdt("tk:figure.crat", run("x"))) + table
    result = filled(tmp_path, body)
    assert extents(result)[0] == 120.0
    assert extents(result)[2] == 50.8  # two inches of the cell
    section = docx.Document(io.BytesIO(result.docx)).sections[0]
    column = section.page_width - section.left_margin - section.right_margin
    assert extents(result)[1] == pytest.approx(column / 36000, abs=0.1)
    assert "see  here" in texts(result.docx)
    # No wider than the page, whatever is asked.
    assert extents(filled(tmp_path, p("{{tk:figure.gough|width=400mm}}"))) == [
        pytest.approx(column / 36000, abs=0.1)
    ]
    # A cell of no stated width has its share of the page, and within a cell of the cell.
    shared = filled(
        tmp_path, tbl(["a", p("{{tk:figure.gough}}")], ["b", tbl(["c", p("{{tk:figure.prat}}")])])
    )
    half = column / 36000 / 2 - 2 * 1.905
    assert extents(shared) == [pytest.approx(half, abs=0.1), pytest.approx(half / 2 - 2 * 1.905, abs=0.1)]
    alts = [e.get("descr") for e in root(result).iter(f"{{{NS['wp']}}}docPr")]
    assert alts == [content().plots[name].alt for name in ("gough", "crat", "prat")]
    assert {tag for tag, _ in result.figures} == {"tk:figure.gough", "tk:figure.crat", "tk:figure.prat"}


@pytest.mark.parametrize("stated", ["", '<w:trPr><w:cantSplit w:val="0"/><w:jc w:val="center"/></w:trPr>'])
def test_no_page_ends_within_a_row_of_a_table(tmp_path: Path, stated: str) -> None:
    # A file's name that was wrapped at the end of a page was on neither page: the report was refused.
    table = tbl(["file", "hash"], ["{{tk:row.file}}", "{{tk:row.sha256}}"]).replace(
        '<w:tr><w:tc><w:p><w:r><w:t xml:space="preserve">{{', f"<w:tr>{stated}<w:tc><w:p><w:r><w:t>{{{{"
    )
    assert stated in table
    rows = list(root(filled(tmp_path, p("{{tk:table.files}}") + table)).iter(f"{{{W}}}tr"))[1:]
    assert len(rows) == len(content().tables["files"].rows)
    for row in rows:
        assert next(e.tag for e in row) == f"{{{W}}}trPr"
        (whole,) = row.findall(f"{{{W}}}trPr/{{{W}}}cantSplit")
        assert not whole.attrib


@pytest.mark.parametrize("figure", ["{{tk:figure.gough}}", "{{tk:figure.gough|width=400mm}}"])
def test_a_picture_takes_no_more_than_the_line_of_its_paragraph_has(tmp_path: Path, figure: str) -> None:
    # 60 mm of indentation on the left and 10 on the right: the page would cut it off.
    indented = '<w:pPr><w:ind w:left="3402" w:right="567" w:hanging="0"/></w:pPr>'
    result = filled(tmp_path, p(indented, figure) + p(sdt("tk:figure.crat", run("x"))))
    narrow, whole = extents(result)
    assert narrow == pytest.approx(whole - 70.0, abs=0.1)


def test_a_picture_fits_into_the_narrowest_of_unequal_columns(tmp_path: Path) -> None:
    def edit(members: dict[str, bytes]) -> None:
        text = members["word/document.xml"]
        columns = b'<w:cols w:num="2" w:equalWidth="0"><w:col w:w="2268" w:space="300"/><w:col w:w="6000"/></w:cols>'
        members["word/document.xml"] = re.sub(rb"<w:cols[^>]*/>", columns, text)

    assert extents(filled(tmp_path, p("{{tk:figure.gough}}"), edit=edit)) == [40.0]


def test_a_figure_in_a_header_and_none_in_a_footnote(tmp_path: Path) -> None:
    result = filled(tmp_path, p("{{tk:figure.prat}}"), header=p("{{tk:figure.gough|width=20mm}}"))
    with zipfile.ZipFile(io.BytesIO(result.docx)) as archive:
        (header,) = [name for name in archive.namelist() if re.fullmatch(r"word/header\d*\.xml", name)]
    assert extents(result, header) == [20.0]
    assert len(result.figures) == 2
    assert result.in_margins == {"tk:figure.gough"}
    with pytest.raises(TemplateError, match="in a note would be missing") as caught:
        filled(tmp_path, p("x"), footnote=p("{{tk:figure.prat|width=2cm}}"))
    assert caught.value.rule == "wrong-place"


def test_captions_are_numbered_over_removed_blocks(tmp_path: Path) -> None:
    seq = '<w:r><w:fldChar w:fldCharType="begin"/></w:r><w:r><w:instrText> SEQ Figure </w:instrText></w:r>'
    seq += (
        '<w:r><w:fldChar w:fldCharType="separate"/></w:r>'
        + run("9")
        + '<w:r><w:fldChar w:fldCharType="end"/></w:r>'
    )
    mark = f'<w:bookmarkStart w:id="5" w:name="fig_b"/>{seq}<w:bookmarkEnd w:id="5"/>'
    ref = '<w:fldSimple w:instr=" REF fig_b \\h ">' + run("?") + "</w:fldSimple>"
    body = (
        p("F ", seq)
        + sdt("tk:if.simulated", p("F ", seq))
        + p("F ", mark)
        + p("see ", ref)
        + p("T ", seq.replace("Figure", "Table"))
    )
    assert texts(filled(tmp_path, body).docx).splitlines()[:4] == ["F 1", "F 2", "see 2", "T 1"]


def test_marks_stand_in_a_template_that_forgot_them(tmp_path: Path) -> None:
    made = content(simulated=True, unverified=True)
    result = filled(tmp_path, p("x"), made)
    assert texts(result.docx).startswith("SIMULATED DATA")
    assert "UNVERIFIED CALIBRATION" in texts(result.docx)
    assert set(result.marks_added) == {"simulated", "unverified"}
    assert filled(tmp_path, p("{{tk:simulated}} {{tk:calibration.status}}"), made).marks_added == ()


def _of_pages(kind: str):
    """Make the header of a template one of the first or of the even pages, which it does not tell apart."""

    def edit(members: dict[str, bytes]) -> None:
        text = members["word/document.xml"]
        members["word/document.xml"] = text.replace(b'w:type="default"', f'w:type="{kind}"'.encode())

    return edit


def test_a_condition_within_a_line_is_a_place_of_a_mark(tmp_path: Path) -> None:
    line = p("x ", sdt("tk:if.simulated", run("simulated")) + sdt("tk:if.unverified", run("unverified")))
    made = content(simulated=True, unverified=True)
    assert filled(tmp_path, line, made).marks_added == ()
    assert filled(tmp_path, p("x"), made, header=line).marks_added == ()
    empty = p("x ", sdt("tk:if.simulated", run(" ")) + sdt("tk:if.unverified", run("unverified")))
    assert filled(tmp_path, empty, made).marks_added == ("simulated",)


MARKS = p("{{tk:simulated}} {{tk:calibration.status}} {{tk:signature}}")


@pytest.mark.parametrize(
    ("body", "more"),
    [
        (sdt("tk:if.relaxation_length", MARKS), {}),
        (sdt("tk:if.simulated", p()) + sdt("tk:if.unverified", p(" ")), {}),
        (p("x"), {"header": MARKS, "edit": _of_pages("first")}),
        (p("x"), {"header": MARKS, "edit": _of_pages("even")}),
    ],
    ids=[
        "a condition that does not hold",
        "conditions without words",
        "first page's header",
        "even pages' header",
    ],
)
def test_marks_stand_in_a_template_that_does_not_print_their_places(tmp_path, body, more) -> None:
    # Neither titlePg nor evenAndOddHeaders is set (ISO/IEC 29500-1, 17.10.1 and 17.10.6).
    result = filled(tmp_path, body, content(simulated=True, unverified=True), **more)
    assert set(result.marks_added) == {"simulated", "unverified"}
    assert texts(result.docx).startswith("SIMULATED DATA")
    assert "Signature: " in texts(result.docx)


def test_a_mark_in_the_header_of_even_pages_stands_in_the_body_too(tmp_path: Path) -> None:
    # A report of one page has none.
    def edit(members: dict[str, bytes]) -> None:
        _of_pages("even")(members)
        settings = members["word/settings.xml"]
        at = settings.index(b">", settings.index(b"<w:settings")) + 1
        members["word/settings.xml"] = settings[:at] + b"<w:evenAndOddHeaders/>" + settings[at:]

    result = filled(tmp_path, p("x"), content(simulated=True), header=MARKS, edit=edit)
    assert result.marks_added == ("simulated",)


def test_a_mark_in_the_header_of_the_first_page_is_enough(tmp_path: Path) -> None:
    def edit(members: dict[str, bytes]) -> None:
        _of_pages("first")(members)
        text = members["word/document.xml"]
        members["word/document.xml"] = text.replace(b"</w:sectPr>", b"<w:titlePg/></w:sectPr>")

    result = filled(tmp_path, p("x"), content(simulated=True), header=MARKS, edit=edit)
    assert result.marks_added == ()
    assert result.perhaps_shown == ()


def test_document_properties(tmp_path: Path) -> None:
    core = docx.Document(io.BytesIO(filled(tmp_path, p("x")).docx)).core_properties
    assert core.created == core.modified == dt.datetime(2026, 11, 21, tzinfo=dt.UTC)
    assert core.title == "Tire force and moment test 265/35 ZR 18"
    assert core.author == "A. Operator"
    assert "python-docx" not in (core.author + core.comments + core.last_modified_by)


def test_a_dotx_becomes_a_document(tmp_path: Path) -> None:
    def edit(members: dict[str, bytes]) -> None:
        members["[Content_Types].xml"] = members["[Content_Types].xml"].replace(
            b"document.main+xml", b"template.main+xml"
        )

    path = make(tmp_path, p("{{tk:tire.size}}"), name="t.dotx", edit=edit)
    result = fill(read_template(path), content(), {})
    with zipfile.ZipFile(io.BytesIO(result.docx)) as archive:
        types = archive.read("[Content_Types].xml")
    assert b"document.main+xml" in types
    assert b"template.main+xml" not in types


def test_the_same_inputs_give_the_same_text(tmp_path: Path) -> None:
    one, two = (
        filled(tmp_path, p("{{tk:report.id}}") + p("{{tk:table.files}}") + tbl(["a"], ["{{tk:row.file}}"]))
        for _ in "12"
    )
    assert one.manifest == two.manifest
    assert texts(one.docx) == texts(two.docx)


def test_exact_heights_are_loosened(tmp_path: Path) -> None:
    row = f'<w:tr><w:trPr><w:trHeight w:val="100" w:hRule="exact"/></w:trPr><w:tc>{p("{{tk:test.special}}")}</w:tc></w:tr>'
    result = filled(tmp_path, f"<w:tbl><w:tblPr/><w:tblGrid><w:gridCol/></w:tblGrid>{row}</w:tbl>")
    assert [e.get(f"{{{W}}}hRule") for e in root(result).iter(f"{{{W}}}trHeight")] == ["atLeast"]


def test_content_is_frozen() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        content().title = "x"  # type: ignore[misc]


def test_a_picture_fits_merged_cells_and_the_page_of_its_header(tmp_path: Path) -> None:
    grid = "".join(f'<w:gridCol w:w="{w}"/>' for w in (1000, 2000, 3000))
    merged = f'<w:tc><w:tcPr><w:gridSpan w:val="2"/></w:tcPr>{p("{{tk:figure.prat}}")}</w:tc>'
    body = f"<w:tbl><w:tblPr/><w:tblGrid>{grid}</w:tblGrid><w:tr><w:tc>{p('a')}</w:tc>{merged}</w:tr></w:tbl>"

    def narrow(members: dict[str, bytes]) -> None:
        name = "word/document.xml"
        members[name] = re.sub(
            rb'w:left="\d+"', b'w:left="9000"', members[name].replace(b'w:w="12240"', b'w:w="12000"')
        )

    assert extents(filled(tmp_path, body)) == [pytest.approx((5000 - 216) * 635 / 36000, abs=0.1)]
    result = filled(tmp_path, p("x"), header=p("{{tk:figure.gough}}"), edit=narrow)
    with zipfile.ZipFile(io.BytesIO(result.docx)) as archive:
        header = next(name for name in archive.namelist() if name.startswith("word/header"))
    # 12000 wide, 9000 to the left, python-docx's 1800 to the right: 1200 twips remain.
    assert extents(result, header) == [pytest.approx(1200 * 635 / 36000, abs=0.1)]


def test_a_vml_placeholder_gives_its_width_in_any_unit(tmp_path: Path) -> None:
    for style, mm in (("width:2in", 50.8), ("left:1pt;width:30mm", 30.0), ("width: 96", 25.4)):
        shape = f'<w:r><w:pict xmlns:v="{NS["v"]}"><v:shape style="{style};height:9pt"/></w:pict></w:r>'
        assert extents(filled(tmp_path, p(sdt("tk:figure.gough", shape)))) == [mm]


def test_a_note_goes_with_the_block_that_refers_to_it(tmp_path: Path) -> None:
    mark = '<w:r><w:footnoteReference w:id="2"/></w:r>'
    body = sdt("tk:if.simulated", p("x", mark))
    made = content(operator=None)
    gone = filled(tmp_path, body, made, footnote=p("{{tk:test.operator}}"))  # needs no value
    assert not list(root(gone, "word/footnotes.xml"))
    with pytest.raises(TemplateError, match=r"tk:test\.operator"):
        filled(tmp_path, p("x", mark), made, footnote=p("{{tk:test.operator}}"))
    # One that a deleted sentence left behind is printed by nobody: it needs no value, and none is looked for.
    left = filled(tmp_path, p("x"), made, footnote=p("{{tk:test.operator}} {{tk:tire.size}}"))
    assert "tk:tire.size" not in {one.tag for one in left.manifest}


def test_five_hundred_pages_of_tables_are_filled_and_found_again(tmp_path: Path) -> None:
    made = content()
    old = made.tables["acquisition"]
    rows = tuple((f"file {i}", i / 7, i / 9) for i in range(22_000))
    made.tables["acquisition"] = Table(name=old.name, columns=old.columns, rows=rows)
    result = filled(tmp_path, p("{{tk:table.acquisition}}") + tbl(["f", "F", "M"], ["a", "b", "c"]), made)
    assert len(result.cells) == 22_000
    pages = [" ".join(" ".join(row) for row in result.cells[i : i + 44]) for i in range(0, 22_000, 44)]
    text = "\n\f".join([SHA, *pages, "Signature: unsigned"])
    assert all(one.ok for one in text_checks(text, result))
    wrong = text.replace("file 15000 2142.9", "file 15000 2142.8")  # 15000/7, to a tenth
    assert wrong != text
    assert not all(one.ok for one in text_checks(wrong, result))


def test_a_value_ends_where_its_uncertainty_does_and_a_tag_s_own_format_rules(tmp_path: Path) -> None:
    # Conicity at 4897 N: 20 + 0.01 x 4897 N with u = 6 N and 12 degrees of freedom: 69 +- 13.
    tag = "summary.conicity"
    body = p(f"{{{{tk:{tag}}}}} | {{{{tk:{tag}|.3f}}}} | {{{{tk:{tag}.with_U}}}}")
    columns = ["{{tk:row.conicity}}", "{{tk:row.U_conicity}}", "{{tk:row.conicity|.2f}}", "{{tk:row.load}}"]
    body += p("{{tk:table.pull}}") + tbl(["a", "b", "c", "d"], columns)

    def made(style: Style) -> tuple[str, tuple[str, ...]]:
        result = filled(tmp_path, body, build_content(make_result(), make_record(), style=style))
        return texts(result.docx).splitlines()[0], result.cells[3]

    first, row = made(Style())
    assert first.split(" | ")[0] == "69"
    assert re.fullmatch(r"6\d\.\d{3}", first.split(" | ")[1])
    assert first.split(" | ")[2] == "69 ± 13"
    assert (row[0], row[1], row[3]) == ("69", "13", "4897")
    assert re.fullmatch(r"6\d\.\d\d", row[2])
    # Decimals of a unit are for numbers without an uncertainty; those of the tag or column itself rule.
    assert made(Style(decimals=(("N", 1),))) == (first, (*row[:3], "4897.0"))
    first, row = made(Style(decimals=(("summary.conicity", 2), ("pull.conicity", 1)), decimal_comma=True))
    assert re.fullmatch(r"6\d,\d\d", first.split(" | ")[0])
    assert re.fullmatch(r"6\d,\d", row[0])
    assert row[1] == "13"


def test_an_uncertainty_that_is_not_known_leaves_the_value_its_format(tmp_path: Path) -> None:
    body = p("{{tk:table.fits}}") + tbl(["a", "b"], ["{{tk:row.B}}", "{{tk:row.u_B}}"])
    made = content()
    table = made.tables["fits"]
    at = {column.name: i for i, column in enumerate(table.columns)}
    rows = tuple(
        tuple(None if i == at["u_B"] else 11.25 if i == at["B"] else cell for i, cell in enumerate(row))
        for row in table.rows
    )
    made = dataclasses.replace(made, tables={**made.tables, "fits": dataclasses.replace(table, rows=rows)})
    assert filled(tmp_path, body, made).cells[0] == ("11.250", "n/a")


@pytest.mark.parametrize(
    ("tag", "plain"), [("tk:tire.size", True), ("tk:figure.gough", False), ("tk:tire.series", False)]
)
@pytest.mark.parametrize("level", ["run", "paragraph"])
def test_a_control_of_plain_text_around_a_literal_holds_plain_text_alone(
    tmp_path: Path, tag: str, plain: bool, level: str
) -> None:
    """Word finds a document damaged in which such a control holds a picture, and drops its line breaks."""
    made = content()
    series = Value(kind="text", value="worn\nand cold")
    made = dataclasses.replace(made, values=made.values | {"tire.series": series})
    literal = f"{{{{{tag}}}}}"
    body = (
        p("a ", sdt("own", run(literal), "<w:text/>"))
        if level == "run"
        else sdt("own", p(literal), "<w:text/>")
    )
    tree = root(filled(tmp_path, body, made))
    assert len(list(tree.iter(f"{{{W}}}text"))) == int(plain)


def test_a_control_of_plain_text_that_is_tagged_as_a_figure_becomes_one_of_rich_text(tmp_path: Path) -> None:
    tree = root(filled(tmp_path, sdt("tk:figure.gough", p("here"), "<w:text/>")))
    assert list(tree.iter(f"{{{W}}}drawing"))
    assert not list(tree.iter(f"{{{W}}}text"))
