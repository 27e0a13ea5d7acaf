"""A template that nobody adapted: through the check, the filling and the PDF."""

from __future__ import annotations

import dataclasses
import datetime as dt
import io
import re
import shutil
import zipfile
from pathlib import Path

import pytest
from lxml import etree

from tests.report.alien_factory import build, p, section
from tests.report.report_factory import make_record, make_result
from toolkit.report.deliver import Delivered, deliver
from toolkit.report.kinds import check as check_template
from toolkit.report.style import Style
from toolkit.report.test.content import build_content
from toolkit.report.word.fill import fill
from toolkit.report.word.package import read_template
from toolkit.report.word.toc_pages import pdf_outline, pdf_text, printed_pages
from toolkit.report.word.verify import contents_problems, text_checks
from toolkit.report.word.xml import NS

STYLE = Style(laboratory="Prüflabor Ärmel & Söhne", decimal_comma=True, dates="%d.%m.%Y")
DAY = dt.date(2026, 11, 21)
office_needed = pytest.mark.skipif(
    not (shutil.which("soffice") and shutil.which("pdftohtml")),
    reason="LibreOffice or poppler is not installed",
)


def content(**changes: object):
    return build_content(make_result(**changes), make_record(), style=STYLE, issued=DAY)


@pytest.fixture(scope="module")
def delivered(tmp_path_factory) -> Delivered:
    folder = tmp_path_factory.mktemp("alien")
    path = build(folder / "Brief.dotx", main="template")
    made = content(operator='Jürgen <Prüfer> & "Söhne"', rated_load_N=None)
    return deliver(read_template(path), made, folder / "out")


def test_it_is_clean(tmp_path: Path) -> None:
    findings = check_template(read_template(build(tmp_path / "t.docx")), STYLE)
    # One table repeats no header: it is advised of it, and nothing else is said.
    assert {(finding.rule, finding.level) for finding in findings} == {("header-row", "note")}


@office_needed
def test_every_value_reaches_the_pdf(delivered: Delivered) -> None:
    assert delivered.warnings == ()
    page = pdf_text(delivered.pdf)
    for words in (
        "Erste: Prüflabor Ärmel & Söhne",  # the first page's header
        "Box: Continental 04.06.2019",  # the text box, with a date control of its own format
        "265/35 ZR 18",  # a literal over five runs in a nested table
        '1 Prüfer Jürgen <Prüfer> & "Söhne"',  # a footnote
        f"Seite 2 von {delivered.pages}",
        "Ende der Tabelle",
        "1,0123",
    ):
        assert words in page, words
    assert "Simulation" not in page
    assert "klicken" not in page
    # The footnote of the block that went away is gone with it, and needs no value.
    assert "tk:test.rated_load" not in {one.tag for one in delivered.filled.manifest}


@office_needed
def test_contents_equal_the_headings_and_their_pages(delivered: Delivered) -> None:
    outline = pdf_outline(delivered.pdf)
    # Word numbers these headings by itself: 1, 1.1 and so on are nowhere in the file.
    titles = ["1 Reifen 265/35 ZR 18", "1.1 Zug", "2 Werte", "3 Kalibrierung", "3.1 Ende"]
    assert [title for title, _ in outline] == titles
    lines = [line for line in pdf_text(delivered.pdf).split("\f")[0].splitlines() if "....." in line]
    found = [re.fullmatch(r"\s*(.*?)\.{5,}\s*(\d+)", line) for line in lines]
    shown = [(" ".join(one[1].split()), int(one[2])) for one in found if one]
    assert shown[:5] == outline
    assert shown[5][0].startswith("Figure 1: Conicity against load")
    assert len(shown) == 7
    with zipfile.ZipFile(delivered.docx) as archive:
        root = etree.fromstring(archive.read("word/document.xml"))
    word = "".join(root.itertext())
    # In Word the same lines stand in the field, which Word can still update.
    assert "Alte Zeile" not in word
    assert ' TOC \\o "1-3" \\h \\z \\u ' in word
    assert root.find(f".//{{{NS['w']}}}docPartObj") is not None
    codes = [one for one in root.iter(f"{{{NS['w']}}}instrText") if "PAGEREF" in one.text]
    ends = [int(one.xpath("string(following::w:t[1])", namespaces=NS)) for one in codes]
    assert ends == [page for _, page in shown]


@office_needed
def test_a_wrong_page_in_the_contents_is_found(delivered: Delivered) -> None:
    text = pdf_text(delivered.pdf)
    assert contents_problems(delivered.pdf, text, delivered.filled) == []
    wrong = re.sub(r"(Werte\.{5,}\s*)\d+", r"\g<1>9", text)
    assert wrong != text
    assert "'Werte' is on page 2, the contents say 9" in contents_problems(
        delivered.pdf, wrong, delivered.filled
    )


@office_needed
def test_a_heading_that_the_pdf_has_not_is_found(delivered: Delivered) -> None:
    contents = dataclasses.replace(
        delivered.filled.contents, headings=(*delivered.filled.contents.headings, ("", "Nachtrag"))
    )
    more = dataclasses.replace(delivered.filled, contents=contents)
    assert contents_problems(delivered.pdf, pdf_text(delivered.pdf), more) == [
        "heading 'Nachtrag' is not in the PDF"
    ]


def test_a_header_that_no_page_shows_is_not_looked_for(tmp_path: Path) -> None:
    result = fill(read_template(build(tmp_path / "t.docx")), content(), _pictures())
    # Even pages have a header of their own only where the settings ask for it; these do not.
    assert result.never_shown == ("word/header3.xml",)
    # The first page has the header of first pages: it is there whatever the number of pages.
    assert [name for name, _ in result.perhaps_shown] == ["word/footer1.xml", "word/header1.xml"]

    heads = tuple(one for one in result.manifest if "/header" in one.part)

    def lost(page: str, **more: object) -> str:
        alone = dataclasses.replace(result, manifest=heads, cells=(), **more)
        return next(one.message for one in text_checks(page, alone) if one.name == "values")

    assert "tk:test.name" not in lost("")
    assert "tk:laboratory.name" in lost("")
    # Of a header that may be hidden its own words are there: then its value must be, too.
    perhaps = (("word/header2.xml", ("Erste: ",)),)
    assert "tk:laboratory.name" not in lost("", perhaps_shown=perhaps)
    assert "tk:laboratory.name" in lost("Erste: nobody", perhaps_shown=perhaps)


def test_even_headers_count_where_the_settings_ask_for_them(tmp_path: Path) -> None:
    kind = "application/vnd.openxmlformats-officedocument.wordprocessingml.settings+xml"

    def edit(members: dict[str, bytes]) -> None:
        settings = f'<w:settings xmlns:w="{NS["w"]}"><w:evenAndOddHeaders/></w:settings>'
        members["word/settings.xml"] = settings.encode()
        for name, end, more in (
            ("word/_rels/document.xml.rels", "</Relationships>",
             f'<Relationship Id="rIdX" Type="{NS["r"]}/settings" Target="settings.xml"/>'),
            ("[Content_Types].xml", "</Types>",
             f'<Override PartName="/word/settings.xml" ContentType="{kind}"/>'),
        ):  # fmt: skip
            members[name] = members[name].replace(end.encode(), (more + end).encode())

    result = fill(read_template(build(tmp_path / "t.docx", edit=edit)), content(), _pictures())
    assert result.never_shown == ()
    assert "word/header3.xml" in dict(result.perhaps_shown)


def test_a_hash_that_a_page_end_cuts_is_found_and_a_number_is_not(tmp_path: Path) -> None:
    body = p("{{tk:calibration.hash}} {{tk:calibration.FY.D51|.5g}}") + section()
    result = fill(read_template(build(tmp_path / "t.docx", story=body)), content(), {})
    whole = "c0ffee" + "0" * 58
    cut = f"{whole[:30]} foot\fhead {whole[30:]} 1,0123 Signature: unsigned"
    assert all(one.ok for one in text_checks(cut, result))
    assert not all(one.ok for one in text_checks(f"{whole} 1,0\f123"[::-1], result))


def test_pages_are_read_with_leaders_and_roman_numbers() -> None:
    from toolkit.report.word.toc import ContentsEntry

    def entry(name: str, text: str) -> ContentsEntry:
        return ContentsEntry(bookmark=name, text=text, level=1, heading=True, numbered=False, paged=True)

    text = "1 One ........ iv\n2 Two words\nover lines . . . 12\n2 Two words over lines\n"
    assert printed_pages(text, [entry("a", "1 One"), entry("b", "2 Two words over lines")]) == {
        "a": "iv",
        "b": "12",
    }


def _pictures() -> dict:
    from tests.report.template_factory import grey_png
    from toolkit.report.figures import Picture

    return dict.fromkeys(content().plots, Picture(png=grey_png(63, 37), width_px=63, height_px=37))


def test_a_bound_control_around_a_literal_loses_its_binding(tmp_path: Path) -> None:
    from tests.report.alien_factory import BOUND, SHOWING, sdt, t

    body = (
        p(sdt("Company", t("{{tk:tire.company}}"), SHOWING + BOUND))
        + p("{{tk:calibration.hash}}")
        + section()
    )
    result = fill(read_template(build(tmp_path / "t.docx", story=body)), content(), {})
    with zipfile.ZipFile(io.BytesIO(result.docx)) as archive:
        xml = archive.read("word/document.xml").decode()
    assert "Continental" in xml
    assert "dataBinding" not in xml
    assert "showingPlcHdr" not in xml
    assert '<w:tag w:val="Company"/>' in xml
