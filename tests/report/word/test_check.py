# ruff: noqa: E501  lines of WordprocessingML read best whole
from __future__ import annotations

import zipfile
from pathlib import Path

import docx
import pytest
from docx.enum.style import WD_STYLE_TYPE
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.report.template_factory import FOLDER, make, opened, p, run, sdt, tbl
from toolkit.errors import TemplateError, ToolkitError
from toolkit.report.kinds import check as check_template
from toolkit.report.style import Style
from toolkit.report.word.check import RULES
from toolkit.report.word.package import read_template

CHECKOUT = Path(__file__).resolve().parents[3]


def rules(folder: Path, body: str, style: Style | None = None, **more: object) -> list[str]:
    found = check_template(opened(folder, body, **more), style or Style(), fonts=False)
    return [one.rule for one in found if one.level != "note"]


FIELD = (
    '<w:r><w:fldChar w:fldCharType="begin"/></w:r><w:r><w:instrText>{}</w:instrText></w:r>'
    '<w:r><w:fldChar w:fldCharType="separate"/></w:r>'
    + run("x")
    + '<w:r><w:fldChar w:fldCharType="end"/></w:r>'
)


PICTURE = '<w:r><w:drawing><wp:inline><wp:extent cx="{0}" cy="{0}"/></wp:inline></w:drawing></w:r>'
NARROW = (
    '<w:tbl><w:tblPr/><w:tblGrid><w:gridCol w:w="500"/><w:gridCol w:w="8000"/></w:tblGrid><w:tr><w:tc>'
    + p("{{tk:figure.gough}}")
    + "</w:tc><w:tc>"
    + p("beside")
    + "</w:tc></w:tr></w:tbl>"
)


@pytest.mark.parametrize(("width", "level"), [("0.5mm", "error"), ("1cm", "error"), ("40mm", "warning")])
def test_a_spot_in_place_of_a_figure_is_refused(tmp_path: Path, width: str, level: str) -> None:
    found = check_template(
        opened(tmp_path, p(f"{{{{tk:figure.gough|width={width}}}}}")), Style(), fonts=False
    )
    assert [(one.rule, one.level) for one in found] == [("figure-small", level)]


def test_a_style_that_is_based_on_a_headings_makes_a_heading_as_the_contents_have_it(tmp_path: Path) -> None:
    document = docx.Document()
    own = document.styles.add_style("Chapter", WD_STYLE_TYPE.PARAGRAPH)
    own.base_style = document.styles["Heading 1"]
    document.add_paragraph("{{tk:figure.gough}}", style="Chapter")
    document.save(tmp_path / "own.docx")
    found = check_template(read_template(tmp_path / "own.docx"), Style(), fonts=False)
    assert [one.message for one in found if one.rule == "wrong-place"] == [
        "tk:figure.gough: a figure cannot stand in a heading"
    ]


@pytest.mark.parametrize("width", ["60mm", "6cm", "2.5in", "180pt"])
def test_a_figure_that_can_be_read_may_be_small(tmp_path: Path, width: str) -> None:
    assert rules(tmp_path, p(f"{{{{tk:figure.gough|width={width}}}}}")) == []


@pytest.mark.parametrize(
    ("body", "rule"),
    [
        (p("{{tk:tire.sise}}"), "unknown-tag"),
        (p("{{tk:figure.fy}}"), "unknown-tag"),
        (sdt("tk:if.rain", p("x")), "unknown-tag"),
        (p("{{tk:tire.size|.2f}}"), "bad-format"),
        (p("{{tk:test.date|%d}}"), "bad-format"),
        (p("{{tk:summary.load|.2q}}"), "bad-format"),
        (p("{{tk:tire.size"), "malformed-tag"),
        (p("{{tk:}}"), "malformed-tag"),
        (p("{{Tk:tire.size}}"), "malformed-tag"),
        (p("{{", " TK", " : tire.size}}"), "malformed-tag"),
        (p("{{tk :tire.size}}"), "malformed-tag"),
        (p(sdt("TK:tire.size", run("x"))), "malformed-tag"),
        (p("{{tk:figure.gough}}") + p("{{tk:figure.gough}}"), "doubled-tag"),
        (sdt("tk:figure.gough", p("")) + p("{{tk:figure.gough}}"), "doubled-tag"),
        (p("{{tk:chart.gough}}") + p("{{tk:chart.gough}}"), "doubled-tag"),
        (p("{{tk:chart.rain}}"), "unknown-tag"),
        (p("{tk:tire.size}"), "malformed-tag"),
        (p("[[tk:", "tire.size]]"), "malformed-tag"),
        (p("｛｛tk:tire.size｝｝"), "malformed-tag"),
        (p(FIELD.format(' HYPERLINK "http://x.org/{{tk:report.id}}" ')), "wrong-place"),
        (p('<w:r><w:drawing><wp:inline><wp:docPr id="1" name="x" descr="of {{tk:tire.size}}"/></wp:inline></w:drawing></w:r>'), "wrong-place"),
        (p('<w:r><w:pict><v:shape xmlns:v="urn:schemas-microsoft-com:vml"><v:textpath string="No {{tk:report.id}}"/></v:shape></w:pict></w:r>'), "wrong-place"),
        (p("{{tk:chart.models_fy}}"), "not-as-chart"),
        (p("{{tk:chart.gough|.2f}}"), "bad-format"),
        (p("{{tk:figure.gough|width=0.5mm}}"), "figure-small"),
        (p("{{tk:chart.gough|width=2cm}}"), "figure-small"),
        (p(sdt("tk:figure.gough", PICTURE.format(12700))), "figure-small"),
        (NARROW, "figure-small"),
        (p("{{tk:row.SA}}"), "wrong-place"),
        (p("{{tk:if.pull}}"), "wrong-place"),
        ('<w:p><w:pPr><w:pStyle w:val="Heading1"/></w:pPr>' + sdt("tk:figure.gough", run("x")) + "</w:p>", "wrong-place"),
        (p(sdt("tk:tire.size", sdt("tk:tire.company", run("x")))), "overlapping-tags"),
        (p("{{tk:table.results}}") + p("no table"), "no-table"),
        (p("{{tk:table.files}}") + tbl(["a", "b", "c"]), "prototype"),
        (p("{{tk:table.files}}") + tbl(["a", "b"], ["x", "y"]), "column-count"),
        (p("{{tk:table.files}}") + tbl(["a"], ["{{tk:row.FY}}"]), "unknown-column"),
        (p("{{tk:table.files}}") + tbl(["{{tk:row.file}}"], ["{{tk:row.sha256}}"]), "prototype"),
        (p("{{tk:table.files}}") + tbl(["a"], ["{{tk:row.file|.1f}}"]), "bad-format"),
        (p(FIELD.format("DATE")), "date-field"),
        (p(FIELD.format("IF 1 = 1 yes no")), "if-field"),
        (p(FIELD.format(" FILENAME ")), "stale-field"),
        (p(FIELD.format("SECTIONPAGES")), "stale-field"),
        (p(FIELD.format('STYLEREF "Heading 1"')), "stale-field"),
        (p(FIELD.format("= 2+2")), "stale-field"),
        (p(FIELD.format("REF _Ref1 \\h")), "broken-reference"),
        (p(FIELD.format("PAGEREF")), "broken-reference"),
        (p('<w:ins w:id="1" w:author="x">' + run("new") + "</w:ins>"), "tracked-changes"),
    ],
)  # fmt: skip
def test_each_rule(tmp_path: Path, body: str, rule: str) -> None:
    assert rules(tmp_path, body) == [rule]
    assert rule in RULES


@pytest.mark.parametrize(
    "code", ["PAGE", "NUMPAGES", 'DOCPROPERTY "Company"', "TITLE", 'HYPERLINK "http://x.org"', "REF _ref1 \\h", "SEQ Figure", ""]
)  # fmt: skip
def test_fields_that_print_what_they_mean_are_left_alone(tmp_path: Path, code: str) -> None:
    bookmark = '<w:bookmarkStart w:id="9" w:name="_Ref1"/><w:bookmarkEnd w:id="9"/>'
    assert rules(tmp_path, p(bookmark, "x") + p(FIELD.format(code))) == []


def test_a_tag_in_a_tracked_deletion_would_be_printed(tmp_path: Path) -> None:
    gone = "<w:r><w:delText>{{tk:ti</w:delText></w:r><w:r><w:delText>re.DOT}}</w:delText></w:r>"
    deleted = f'<w:del w:id="1" w:author="x">{gone}</w:del>'
    found = check_template(opened(tmp_path, p(deleted)), Style())
    assert {(one.rule, one.level) for one in found} == {
        ("tracked-changes", "error"),
        ("tracked-changes", "warning"),
    }


def test_other_words_and_controls_of_others_are_left_alone(tmp_path: Path) -> None:
    body = p("{{ticket: 7}} tk: as in {tk:x}") + p(sdt("tkt:ticket", run("x")))
    assert rules(tmp_path, body) == []


def test_column_count_names_both(tmp_path: Path) -> None:
    found = check_template(opened(tmp_path, p("{{tk:table.files}}") + tbl(["a", "b"], ["x", "y"])), Style())
    assert "2 cells" in found[0].message
    assert "3 columns" in found[0].message


def test_no_tags_and_missing_required(tmp_path: Path) -> None:
    assert rules(tmp_path, p("text"), hash_=False) == ["no-tags", "missing-required"]
    style = Style(required=("tk:calibration.hash", "tk:report.id"), styles=(("caption", "Legende"),))
    assert rules(tmp_path, p("x"), style) == ["missing-required", "missing-style"]


def test_a_value_may_be_used_any_number_of_times(tmp_path: Path) -> None:
    assert rules(tmp_path, p("{{tk:tire.size}} {{tk:tire.size}}"), header=p("{{tk:tire.size}}")) == []


REL = '<Relationship Id="rId90" Type="http://schemas.openxmlformats.org/officeDocument/2006/relationships/{}" Target="{}" {}/>'
EXTERNAL = 'TargetMode="External"'


def add_rel(kind: str, target: str, mode: str = EXTERNAL, rels: str = "word/_rels/document.xml.rels"):
    def edit(members: dict[str, bytes]) -> None:
        blank = b'<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships"></Relationships>'
        old = members.get(rels, blank)
        members[rels] = old.replace(
            b"</Relationships>", REL.format(kind, target, mode).encode() + b"</Relationships>"
        )

    return edit


def put(name: str, data: bytes):
    return lambda members: members.__setitem__(name, data)


def swap(name: str, old: bytes, new: bytes):
    return lambda members: members.__setitem__(name, members[name].replace(old, new))


MACRO = b"application/vnd.ms-word.document.macroEnabled.main+xml"
PLAIN = b"application/vnd.openxmlformats-officedocument.wordprocessingml.document.main+xml"
DTD = b'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "b">]><x/>'


@pytest.mark.parametrize(
    ("edit", "rule"),
    [
        (add_rel("image", "http://example.org/x.png"), "external-content"),
        (add_rel("image", "file:///etc/passwd"), "external-content"),
        (add_rel("oleObject", "file:///x.xlsx"), "ole-object"),
        (add_rel("oleObject", "embeddings/o.bin", ""), "ole-object"),
        (add_rel("subDocument", "b.docx"), "sub-document"),
        (add_rel("frame", "b.htm"), "frames"),
        (add_rel("aFChunk", "x.html", ""), "alt-chunk"),
        (add_rel("attachedTemplate", "http://example.org/t.dotm", rels="word/_rels/settings.xml.rels"), "attached-template"),
        (add_rel("attachedTemplate", " HTTPS://example.org/t.dotm", rels="word/_rels/settings.xml.rels"), "attached-template"),
        (put("word/vbaProject.bin", b"x"), "macros"),
        (swap("[Content_Types].xml", PLAIN, MACRO), "macros"),
        (put("word/embeddings/a.xlsx", b"x"), "ole-object"),
        (put("word/extra.xml", DTD), "dtd"),
        (put("customXml/item1.xml", DTD.decode().encode("utf-16")), "dtd"),
        (put("word/media/a.svg", b'<svg xmlns="http://www.w3.org/2000/svg"><image href="http://x.org/a"/></svg>'), "external-content"),
        (put("word/bad.xml", b"<a><b>"), "zip-damaged"),
        (put("../escape.xml", b"<a/>"), "not-word"),
        (put("word/bomb.xml", b"<a>" + b" " * 40_000_000 + b"</a>"), "too-large"),
        (lambda m: m.pop("word/document.xml"), "not-word"),
    ],
)  # fmt: skip
def test_unsafe_files_are_refused(tmp_path: Path, edit, rule: str) -> None:
    if rule == "too-large":
        path = make(tmp_path, p("x"))
        with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("word/bomb.xml", b"<a>" + b" " * 40_000_000 + b"</a>")
    else:
        path = make(tmp_path, p("x"), edit=edit)
    with pytest.raises(TemplateError) as caught:
        read_template(path)
    assert caught.value.rule == rule
    assert caught.value.where
    assert caught.value.next_step


OLE = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"


@pytest.mark.parametrize(
    ("data", "got"),
    [
        (b"", "an empty file"), (b"MZ\x90\x00", "a Windows program"), (b"PK\x03\x04cut", "not a zip"),
        (b"{\\rtf1 x}", "an RTF document"),
        (OLE + "EncryptedPackage".encode("utf-16-le"), "an encrypted Office file"),
        (OLE + "WordDocument".encode("utf-16-le"), "an old Word document (.doc)"),
    ],
)  # fmt: skip
def test_what_is_no_word_file_holds_nothing_to_remove(tmp_path: Path, data: bytes, got: str) -> None:
    (tmp_path / "x.docx").write_bytes(data)
    with pytest.raises(TemplateError) as caught:
        read_template(tmp_path / "x.docx")
    assert got in str(caught.value.got)
    assert caught.value.rule in ("not-word", "zip-damaged")
    assert caught.value.next_step.startswith("copy it again")


@pytest.mark.parametrize(
    "code",
    [
        'INCLUDETEXT "/etc/passwd"',
        " includepicture http://x ",
        "DDEAUTO cmd",
        'LINK Excel.Sheet "x"',
        "DDE a b",
    ],
)
def test_fields_that_read_other_files_are_refused(tmp_path: Path, code: str) -> None:
    half = len(code) // 2
    split = FIELD.format(code[:half] + "</w:instrText></w:r><w:r><w:instrText>" + code[half:])
    simple = f"<w:fldSimple w:instr='{code}'>{run('x')}</w:fldSimple>"
    for body in (p(split), p(simple)):
        with pytest.raises(TemplateError) as caught:
            opened(tmp_path, body)
        assert caught.value.rule == "unsafe-field"


@pytest.mark.parametrize("tag", ["altChunk", "subDoc"])
def test_elements_that_import_are_refused(tmp_path: Path, tag: str) -> None:
    with pytest.raises(TemplateError):
        opened(tmp_path, f'<w:{tag} r:id="rId1"/>')


@pytest.mark.parametrize(
    "target", ["http://example.org", "HTTPS://example.org/a", "mailto:a@b.org", "#table", ""]
)
def test_hyperlinks_to_pages_and_to_mail_are_allowed(tmp_path: Path, target: str) -> None:
    template = read_template(make(tmp_path, p("x"), edit=add_rel("hyperlink", target)))
    assert check_template(template, Style(), fonts=False) == ()
    field = p(FIELD.format(f'HYPERLINK "{target}" \\o "a tip"'))
    assert check_template(opened(tmp_path, field), Style(), fonts=False) == ()
    assert (
        check_template(opened(tmp_path, p(FIELD.format('HYPERLINK \\l "mark"'))), Style(), fonts=False) == ()
    )


OUTSIDE = (
    "file:///C:/x.dotx", "FILE:x", "\\\\server\\share\\x.dotx", "//server/x.dotx", "C:\\x.dotx", "x.dotx", "smb://a/b",
    "ftp://a/b", "javascript:alert(1)", "ms-word:ofe|u|http://a", " \\\\?\\UNC\\a\\b", "data:text/html,x",
)  # fmt: skip


@pytest.mark.parametrize("target", OUTSIDE)
@pytest.mark.parametrize("kind", ["attachedTemplate", "hyperlink", "image", "footer", "unheardOf"])
def test_whatever_else_leads_outside_is_refused(tmp_path: Path, kind: str, target: str) -> None:
    rule = "attached-template" if kind == "attachedTemplate" else "external-content"
    # A mode in other letters, and an address that needs none to lead outside.
    modes = [EXTERNAL, 'TargetMode="external"', *([""] if ":" in target or "\\" in target else [])]
    for mode in modes:
        path = make(tmp_path, p("x"), edit=add_rel(kind, target, mode, rels="word/_rels/settings.xml.RELS"))
        with pytest.raises(TemplateError) as caught:
            read_template(path)
        assert caught.value.rule == rule
        assert caught.value.got == target


@pytest.mark.parametrize("code", ['HYPERLINK "file:///etc/passwd"', "hyperlink \\\\server\\x", "PRINT 27"])
def test_fields_that_lead_outside_are_refused(tmp_path: Path, code: str) -> None:
    with pytest.raises(TemplateError) as caught:
        opened(tmp_path, p(FIELD.format(code)))
    assert caught.value.rule == "unsafe-field"


def test_a_main_part_elsewhere_is_looked_through_as_well(tmp_path: Path) -> None:
    def moved(members: dict[str, bytes]) -> None:
        members["own/main.xml"] = members.pop("word/document.xml")
        for name in ("[Content_Types].xml", "_rels/.rels"):
            members[name] = members[name].replace(b"word/document.xml", b"own/main.xml")

    with pytest.raises(TemplateError) as caught:
        read_template(make(tmp_path, p(FIELD.format('INCLUDETEXT "/etc/passwd"')), edit=moved))
    assert caught.value.rule == "unsafe-field"


SVG = '<svg xmlns="http://www.w3.org/2000/svg" xmlns:k="http://www.w3.org/1999/xlink">{}</svg>'


@pytest.mark.parametrize(
    "inside",
    [
        '<image href="http://x.org/a"/>',
        "<image k:href='//x.org/a'/>",
        '<image href="&#102;ile:///etc/passwd"/>',
        '<use href="other.svg#a"/>',
        '<rect style="fill:url( http://x.org/a )"/>',
        "<style>@import 'http://x.org/a.css';</style>",
        '<?xml-stylesheet href="http://x.org/a.css"?>',
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_a_drawing_fetches_nothing_whatever_its_name_and_encoding(
    tmp_path: Path, inside: str, encoding: str
) -> None:
    data = SVG.format(inside).encode(encoding)
    for name in ("a.svg", "a.png", "A.SVG", "a"):
        with pytest.raises(TemplateError) as caught:
            read_template(make(tmp_path, p("x"), edit=put(f"word/media/{name}", data)))
        assert caught.value.rule == "external-content"
    whole = SVG.format('<use href="#a"/><image href="data:image/png;base64,AA"/><rect fill="url(#a)"/>')
    read_template(make(tmp_path, p("x"), edit=put("word/media/a.svg", whole.encode(encoding))))


@pytest.mark.parametrize("data", [b"", b"not word", b"PK\x03\x04 torn", b"{\\rtf1}"])
def test_what_is_no_word_file(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "t.docx"
    path.write_bytes(data)
    with pytest.raises(TemplateError):
        read_template(path)
    with pytest.raises(TemplateError) as caught:
        read_template(tmp_path / "absent.docx")
    assert caught.value.rule == "no-template"


WHOLE = (FOLDER / "org.docx").read_bytes()


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, len(WHOLE) - 1), st.binary(min_size=1, max_size=40), st.booleans())
def test_mutated_files_give_findings_or_a_clear_error(
    tmp_path: Path, at: int, junk: bytes, cut: bool
) -> None:
    path = tmp_path / "t.docx"
    path.write_bytes(WHOLE[:at] if cut else WHOLE[:at] + junk + WHOLE[at + len(junk) :])
    try:
        check_template(read_template(path), Style(), fonts=False)
    except ToolkitError as error:
        assert error.rule  # noqa: PT017


def test_a_literal_of_another_tag_inside_a_control_is_found_and_its_own_prompt_is_not(tmp_path: Path) -> None:
    assert rules(tmp_path, p(sdt("tk:tire.size", run("{{tk:tire.size}}")))) == []
    assert rules(tmp_path, sdt("tk:tire.size", p("{{tk:ti", "re.size}}"))) == []
    assert rules(tmp_path, p(sdt("tk:tire.size", run("{{tk:tire.company}}")))) == ["overlapping-tags"]
    assert rules(tmp_path, sdt("tk:figure.gough", p("{{tk:tire.company}}"))) == ["overlapping-tags"]


def test_a_tag_where_nothing_is_filled_is_found(tmp_path: Path) -> None:
    math = "http://schemas.openxmlformats.org/officeDocument/2006/math"
    formula = f'<m:oMath xmlns:m="{math}"><m:r><m:t>{{{{tk:tire.size}}}}</m:t></m:r></m:oMath>'
    assert rules(tmp_path, p(formula)) == ["wrong-place"]


def test_a_table_tag_reaches_its_table_through_a_control(tmp_path: Path) -> None:
    table = tbl(["a", "b", "c"], ["1", "2", "3"])
    assert rules(tmp_path, p("{{tk:table.files}}") + sdt("tk:if.files", table)) == []
    assert rules(tmp_path, p("{{tk:table.files}}") + sdt("Company", table)) == []
    assert rules(tmp_path, p("{{tk:table.files}}") + sdt("Company", p("x"))) == ["no-table"]


CONTENTS = FIELD.format('TOC \\o "1-3" \\h')


def test_contents_that_are_written_need_no_finding_and_others_do(tmp_path: Path) -> None:
    assert rules(tmp_path, p(CONTENTS)) == []
    assert rules(tmp_path, p(FIELD.format('TOC \\h \\z \\c "Figure"'))) == []
    assert rules(tmp_path, p(FIELD.format("TOC \\f"))) == ["contents"]
    assert rules(tmp_path, p(FIELD.format("INDEX"))) == ["contents"]
    assert rules(tmp_path, p("x"), header=p(CONTENTS)) == ["contents"]


def test_a_tag_may_ask_for_any_result_as_a_condition(tmp_path: Path) -> None:
    for name in ("figure.gough", "table.pull", "caption.gough", "calibration.FY.E5", "report.opinions"):
        expected = ["unknown-tag"] if name == "report.opinions" else []
        assert rules(tmp_path, sdt(f"tk:if.{name}", p("x"))) == expected, name


@pytest.mark.parametrize(
    ("lost", "rule", "says"),
    [
        ("word/_rels/document.xml.rels", "zip-damaged", "a relation that the template lacks"),
        ("word/document.xml", "not-word", "lacks its main document"),
    ],
)
def test_a_package_with_a_hole_is_refused_for_what_it_lacks(
    tmp_path: Path, lost: str, rule: str, says: str
) -> None:
    def edit(members: dict[str, bytes]) -> None:
        members.pop(lost)

    with pytest.raises(TemplateError, match=says) as caught:
        opened(tmp_path, p("{{tk:tire.size}}"), header=p("x"), edit=edit)
    assert caught.value.rule == rule


@pytest.mark.parametrize("kind", ["styles", "settings", "numbering", "header1"])
@pytest.mark.parametrize("declared", ["lost", "as text"])
def test_a_part_that_is_not_declared_as_its_relation_says_is_refused(
    tmp_path: Path, kind: str, declared: str
) -> None:
    """Such a part is none that can be read: Word repairs the file, and nothing here may stumble over it."""

    def edit(members: dict[str, bytes]) -> None:
        types, part = members["[Content_Types].xml"], f'PartName="/word/{kind}.xml"'.encode()
        assert part in types
        before, _, after = types.partition(part)
        _, _, rest = after.partition(b"/>")
        changed = (
            b'PartName="/99.xml" ContentType="x/x"/>'
            if declared == "lost"
            else part + b' ContentType="text/plain"/>'
        )
        members["[Content_Types].xml"] = before + changed + rest

    with pytest.raises(TemplateError, match="not declared as what it is") as caught:
        check_template(
            opened(tmp_path, p("{{tk:tire.size}}"), header=p("x"), edit=edit), Style(), fonts=False
        )
    assert caught.value.rule == "zip-damaged"


@pytest.mark.parametrize(
    ("tag", "says"),
    [
        ("table.conditions", "did you mean tk:table."),
        ("table.result", "did you mean tk:table.results?"),
        ("figure.result", "see 'toolkit template tags'"),
        ("tabel.results", "did you mean tk:table.results?"),
    ],
)
def test_an_unknown_tag_is_answered_by_a_tag_of_its_kind(tmp_path: Path, tag: str, says: str) -> None:
    (unknown,) = (
        finding
        for finding in check_template(opened(tmp_path, p(f"{{{{tk:{tag}}}}}")), Style(), fonts=False)
        if finding.rule == "unknown-tag"
    )
    assert says in unknown.message
