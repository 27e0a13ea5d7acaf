"""The templates that come with the toolkit are Word files: each is clean, and each is taken to its PDF."""

from __future__ import annotations

import datetime as dt
import re
import shutil
import subprocess
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from lxml import etree
from pyhanko.pdf_utils.reader import PdfFileReader

from tests.conftest import EXAMPLES
from tests.diagnosis.cases import HEAD, TWO, carriage, write_case
from tests.report.certificate.test_certificate import DAY as CALIBRATED
from tests.report.certificate.test_certificate import STYLE, registry_of
from tests.report.comparison.test_comparison_document import content as compared
from tests.report.comparison.test_comparison_document import pair
from tests.report.diagnosis.test_answer import ANSWER
from tests.report.laboratories.laboratories_factory import compared as compared_laboratories
from tests.report.plan.plan_factory import sheet
from tests.report.report_factory import make_record, make_result
from tests.report.template_factory import FOLDER
from toolkit.audit.archive import audit_archive
from toolkit.calibration.registry.registry import Registry
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import Result
from toolkit.errors import ConfigError
from toolkit.lab.rules import rules_catalogue
from toolkit.recording.folder import read_details
from toolkit.report.audit.content import build_audit_content
from toolkit.report.audit.page import AuditView
from toolkit.report.certificate.collect import collect
from toolkit.report.certificate.content import build_content as certified
from toolkit.report.content import ReportContent
from toolkit.report.deliver import Delivered, Job, deliver_all
from toolkit.report.diagnosis.content import build_diagnosis_content
from toolkit.report.kinds import check as check_template
from toolkit.report.laboratories.content import build_laboratories_content
from toolkit.report.plan.content import build_plan_content
from toolkit.report.style import Style, read_style, replace_terms, style_file
from toolkit.report.test.content import build_content, report_id
from toolkit.report.word.package import read_template
from toolkit.report.word.toc_pages import pdf_outline, pdf_text
from toolkit.report.word.xml import q

DAY = dt.date(2026, 11, 21)
DETAILS = {
    "customer": "Example Tyres",
    "method": "angelehnt an SAE J1987",
    "customer_contact": "1 Rubber Road",
    "received": dt.date(2019, 5, 28),
    "condition": "new",
    "conformity": "nicht beurteilt",
    "authorised_by": "A. Authoriser",
    "function": "head of laboratory",
    "opinions": ["The belt may be off centre.", {"statement": "Carcass buckling.", "basis": "Table 2"}],
}
office_needed = pytest.mark.skipif(
    not (shutil.which("soffice") and shutil.which("pdftohtml")),
    reason="LibreOffice or poppler is not installed",
)


def of_a_test(name: str, **changes: object) -> ReportContent:
    return build_content(
        make_result(**changes),
        make_record(),
        style=read_style(style_file(FOLDER / f"{name}.docx")),
        issued=DAY,
        details=read_details(DETAILS, where="test.toml"),
    )


@pytest.fixture(scope="session")
def contents(tmp_path_factory: pytest.TempPathFactory) -> dict[str, ReportContent]:
    """Return a content for every packaged template."""
    work = tmp_path_factory.mktemp("contents")
    registry = Registry(FOLDER.parent / "calibrations")
    audited = audit_archive(EXAMPLES / "fig4_4", registry, known_at=DAY)
    recordings = {f"r{i}__csv": carriage(seed=i, coulomb=0.0, drag=800.0) for i in range(2)}
    return {
        "org": of_a_test("org"),
        "summary": of_a_test("summary", simulated=True, unverified=True),
        "pruefbericht": of_a_test("pruefbericht"),
        "audit": build_audit_content(
            AuditView(made=audited, rules=rules_catalogue(), timelines=(), traces=())
        ),
        "certificate": certified(collect(registry_of(work), "pair-r1", STYLE, issued=CALIBRATED), STYLE),
        "comparison": compared(pair()),
        "laboratories": build_laboratories_content(compared_laboratories(), Style()),
        "plan": build_plan_content(sheet(), Style()),
        "diagnosis": build_diagnosis_content(
            read_case(write_case(tmp_path_factory.mktemp("case"), HEAD + TWO, **recordings)),
            Result(diagnosis=ANSWER, search=None),
            Style(),
            issued=DAY,
        ),
    }


@pytest.fixture(scope="session")
def printed(
    contents: dict[str, ReportContent], tmp_path_factory: pytest.TempPathFactory
) -> dict[str, Delivered]:
    """Return a document of every packaged template, all of them converted in one call of LibreOffice."""
    work = tmp_path_factory.mktemp("printed")
    jobs = [
        Job(template=read_template(FOLDER / f"{name}.docx"), content=content, out=work / "out", name=name)
        for name, content in contents.items()
    ]
    answers = deliver_all(jobs)
    assert all(isinstance(answer, Delivered) for answer in answers), answers
    return dict(zip(contents, answers, strict=True))


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.docx")), ids=lambda path: path.stem)
def test_each_is_clean(path: Path) -> None:
    assert check_template(read_template(path), read_style(style_file(path))) == ()


def test_a_figure_is_a_chart_where_its_axes_have_numbers(contents: dict[str, ReportContent]) -> None:
    for content in contents.values():
        for name, plot in content.plots.items():
            numeric = not plot.names and all(curve.style != "bars" for curve in plot.curves)
            assert (name in content.vocabulary.charts) is numeric, name


@office_needed
@pytest.mark.parametrize("name", sorted(path.stem for path in FOLDER.glob("*.docx")))
def test_each_prints_all_that_it_asks_for(printed: dict[str, Delivered], name: str) -> None:
    report = printed[name]
    assert report.pdf.read_bytes().startswith(b"%PDF")
    assert [check.message for check in report.checks if not check.ok] == []
    assert report.warnings == ()
    text = re.sub(r"\s", "", pdf_text(report.pdf))
    assert "{{" not in text
    assert report.filled.manifest
    assert name in ("audit", "diagnosis") or report.filled.figures


@dataclass(frozen=True)
class Element:
    """An element of a PDF's structure tree: its type, whether it has alternative text, what is below it."""

    type: str
    alt: bool
    below: tuple[str, ...]


def structure(node: Any) -> Iterator[Element]:
    """Yield the elements of a structure tree, each after those below it."""
    node = node.get_object()
    if isinstance(node, list):
        for one in node:
            yield from structure(one)
    elif hasattr(node, "get"):
        below = list(structure(node["/K"])) if "/K" in node else []
        yield from below
        if "/S" in node:
            types = tuple(element.type for element in below)
            yield Element(type=str(node["/S"])[1:], alt=bool(str(node.get("/Alt", "")).strip()), below=types)


@office_needed
@pytest.mark.parametrize("name", sorted(path.stem for path in FOLDER.glob("*.docx")))
def test_each_can_be_heard(printed: dict[str, Delivered], name: str) -> None:
    """ISO 14289-1 (PDF/UA-1): 5 identification, 7.1 title, 7.2 language, 7.3 figures, 7.5 tables."""
    with printed[name].pdf.open("rb") as stream:
        root = PdfFileReader(stream).root
        metadata = root["/Metadata"].data.decode()
        assert re.search(r"<pdfuaid:part>1</pdfuaid:part>", metadata)
        assert re.search(r"<pdfaid:part>2</pdfaid:part>", metadata)
        assert str(root["/Lang"]) == ("de-DE" if name == "pruefbericht" else "en-US")
        assert root["/MarkInfo"]["/Marked"]
        assert root["/ViewerPreferences"]["/DisplayDocTitle"]
        elements = list(structure(root["/StructTreeRoot"]["/K"]))
        roles = {str(key)[1:] for key in root["/StructTreeRoot"].get("/RoleMap", {})}
    figures = [element for element in elements if element.type == "Figure"]
    assert len(figures) >= len(printed[name].filled.figures)
    assert all(figure.alt for figure in figures)
    tables = [element for element in elements if element.type == "Table"]
    assert tables
    # What only sets figures side by side has nothing to head.
    assert all("TH" in table.below or "Figure" in table.below for table in tables)
    # A standard type keeps its meaning: 7.1, last paragraph.
    assert roles & {"Figure", "Table", "TH", "TD", "TR", "Link", "TOC"} == set()


@pytest.mark.parametrize(("like", "style"), [("summary", "org"), ("pruefbericht", "pruefbericht")])
def test_a_new_template_is_a_copy_with_the_style_file_that_serves_it(
    like: str, style: str, tmp_path: Path
) -> None:
    from toolkit.cli.template import new

    assert new(tmp_path / "ours.docx", like=like, quiet=True) == 0
    assert (tmp_path / "ours.docx").read_bytes() == (FOLDER / f"{like}.docx").read_bytes()
    assert (tmp_path / "ours.toml").read_bytes() == (FOLDER / f"{style}.toml").read_bytes()


@office_needed
def test_the_default_has_what_the_standard_asks_of_a_report(printed: dict[str, Delivered]) -> None:
    done = printed["org"]
    pages = pdf_text(done.pdf).split("\f")[:-1]
    text = " ".join(" ".join(pages).split())
    for words in (
        "Tire Force and Moment Laboratory",  # 7.8.2.1 b
        "Example Tyres", "1 Rubber Road",  # e
        "tire 265/35 ZR 18, Continental, Altimax, DOT 4MY8-009X-0713", "new",  # g
        "2019-05-28",  # h
        "2019-06-04",  # i
        "The results relate only to the item tested, as received",  # l
        "A. Authoriser, head of laboratory",  # o
        "opinions and interpretations (ISO/IEC 17025, 7.8.7). They are not results",
        "The belt may be off centre.",
    ):  # fmt: skip
        assert words in text, words
    identity = report_id(make_result(), read_details(DETAILS, where=""))
    # d: the id and "page x of y" on every page, and where the report ends.
    for number, page in enumerate(pages, start=1):
        assert identity in page
        assert f"page {number} of {done.pages}" in page
    assert f"End of report {identity}" in " ".join(pages[-1].split())
    titles = [title for title, _ in pdf_outline(done.pdf)]
    assert titles[0].endswith("Item, customer and method")
    assert titles[-1] == "Opinions and interpretations"


@office_needed
def test_a_report_without_details_leaves_their_places_out(plain_report: Delivered) -> None:
    text = pdf_text(plain_report.pdf)
    assert plain_report.warnings == ()
    assert "Opinions" not in text
    assert "Authorised by" not in text
    assert "RECEIVED" not in text


@office_needed
def test_the_summary_is_one_page(printed: dict[str, Delivered]) -> None:
    done = printed["summary"]
    assert done.pages == 1
    assert "SIMULATED DATA" in pdf_text(done.pdf)
    assert "page 1 of 1" in pdf_text(done.pdf)


@office_needed
def test_the_german_report_has_its_own_look(printed: dict[str, Delivered]) -> None:
    done = printed["pruefbericht"]
    text = " ".join(pdf_text(done.pdf).split())
    for words in (
        "Reifenprüfstelle",
        "Eingang 28.05.2019",
        "Seite 1 von",
        "Abbildung 1. Seitenkraft",
        "vorwärts",
        "-0,30",  # the first slip angle, with a decimal comma
        "Freigegeben: A. Authoriser, head of laboratory",
        "Konformität nicht beurteilt",
    ):
        assert words in text, words
    sizes = subprocess.run(
        ["pdfinfo", "-f", "1", "-l", str(done.pages), str(done.pdf)], capture_output=True, check=True
    ).stdout.decode()
    shapes = {
        float(wide) > float(tall) for wide, tall in re.findall(r"size:\s+([\d.]+) x ([\d.]+) pts", sizes)
    }
    assert shapes == {True, False}  # upright, and across for the tables
    titles = [title for title, _ in pdf_outline(done.pdf)]
    assert titles == [
        "Prüfbedingungen", "Kennlinien", "Geradeauslauf", "Messwerte", "Feststellungen",
        "Meinungen und Interpretationen",
    ]  # fmt: skip


@pytest.mark.parametrize("name", ["summary", "pruefbericht"])
def test_a_header_of_several_cells_has_one_rule(name: str) -> None:
    """The style rules each paragraph: beside each other these would be broken lines, of unlike heights."""
    book = zipfile.ZipFile(FOLDER / f"{name}.docx")
    parts = [part for part in book.namelist() if part.startswith(("word/header", "word/footer"))]
    seen = set()
    for part in parts:
        root = etree.fromstring(book.read(part))
        for kind, edge in (("header", "bottom"), ("footer", "top")):
            if kind not in part or root.find(f".//{q('w:tbl')}") is None:
                continue
            seen.add(kind)
            (drawn,) = root.iterfind(f".//{q('w:tblBorders')}/{q(f'w:{edge}')}")
            assert drawn.get(q("w:val")) == "single"
            ruled = root.findall(f".//{q('w:tc')}//{q('w:p')}")
            assert ruled
            assert {p.find(f".//{q('w:pBdr')}/{q(f'w:{edge}')}").get(q("w:val")) for p in ruled} == {"nil"}
    assert seen == {"header", "footer"}


def test_an_amended_report_has_an_id_of_its_own() -> None:
    amended = read_details({"amends": "TR-1", "amendment": "the operator was wrong"}, where="")
    assert report_id(make_result(), amended) != report_id(make_result())


@pytest.mark.parametrize(
    ("table", "rule"),
    [
        ({"custumer": "x"}, "unknown-key"),
        ({"customer": 3}, "wrong-value"),
        ({"received": "yesterday"}, "wrong-value"),
        ({"amends": "TR-1"}, "wrong-value"),
        ({"opinions": "one"}, "wrong-value"),
        ({"opinions": [{"statement": "x", "becuase": "y"}]}, "unknown-key"),
        ("text", "wrong-value"),
    ],
)
def test_details_with_a_slip_are_refused(table: object, rule: str) -> None:
    with pytest.raises(ConfigError) as caught:
        read_details(table, where="test.toml")
    assert caught.value.rule == rule


def test_own_words_are_whole_words_of_the_toolkit_and_never_of_people() -> None:
    words = {"load": "Radlast", "forward": "vorwärts", "none": "keine"}
    assert replace_terms("load FZ, reload, payload", words) == "Radlast FZ, reload, payload"
    style = Style(words=tuple(words.items()))
    made = build_content(make_result(special="load forward"), make_record(), style=style, issued=DAY)
    assert made.values["test.special"].value == "load forward"
    assert made.values["report.deviations"].value == "keine"
    assert made.tables["results"].rows[0][0] == "vorwärts"
    assert made.plots["fy_vs_load"].x_label == "Radlast FZ [N]"


# Units, quantities and names that are the same in the languages.
SAME = {
    "de": "deg fy mz sae gough plus plysteer crat prat in minus",
    "fr": "deg fy mz sae gough plus plysteer crat prat angle angles charge constant force moment minus",
}


@pytest.mark.parametrize("language", sorted(SAME))
def test_a_report_speaks_its_language_to_those_who_hear_it(language: str) -> None:
    """Alternative texts: no English word is left, and every number is that of the English text."""
    style = Style(language=language, decimal_comma=True)
    for more in ({}, {"simulated": True}):
        english = build_content(make_result(**more), make_record(), issued=DAY).plots
        spoken = build_content(make_result(**more), make_record(), style=style, issued=DAY).plots
        assert len(spoken) == len(english) >= 11
        for name, plot in spoken.items():
            words = set(re.findall(r"[a-zäöüßéèà]{2,}", plot.alt.lower()))
            left = words & set(re.findall(r"[a-z]{2,}", english[name].alt.lower()))
            assert left <= set(SAME[language].split()), left
            assert re.findall(r"\d+", plot.alt) == re.findall(r"\d+", english[name].alt)
            assert "." not in re.sub(r"\.( |$)", "", plot.alt)  # decimal commas


def test_what_the_toolkit_says_in_a_report_is_in_its_language_and_what_people_wrote_is_not() -> None:
    made = build_content(
        make_result(special="the load of the test", tire_company="forward"), make_record(),
        style=Style(language="de", decimal_comma=True), issued=DAY,
    )  # fmt: skip
    assert made.values["test.special"].value == "the load of the test"
    assert made.values["tire.company"].value == "forward"
    assert made.values["report.title"].value == "Reifenprüfung, Kräfte und Momente, 265/35 ZR 18"
    assert made.values["test.directions"].value == "vorwärts und rückwärts"
    assert made.title == made.values["report.title"].value


def test_any_result_can_be_a_condition(tmp_path: Path) -> None:
    made = build_content(make_result(both=False), make_record(), issued=DAY)
    for name, held in (
        ("figure.gough", True), ("figure.conicity", False), ("table.files", True), ("table.opinions", False),
        ("calibration.FY.D51", True), ("item.received", False), ("caption.gough", True), ("pull", False),
    ):  # fmt: skip
        assert made.holds(name) is held, name
        assert made.vocabulary.knows_condition(name)
    assert not made.vocabulary.knows_condition("figure.rain")


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.docx")), ids=lambda path: path.name)
def test_every_column_of_a_table_has_a_heading(path: Path) -> None:
    w = "{http://schemas.openxmlformats.org/wordprocessingml/2006/main}"
    with zipfile.ZipFile(path) as package:
        document = etree.fromstring(package.read("word/document.xml"))
    for header in document.iter(f"{w}tblHeader"):
        row = header.getparent().getparent()
        cells = ["".join(text.text or "" for text in cell.iter(f"{w}t")) for cell in row.iter(f"{w}tc")]
        assert all(cells[:-1]), cells  # a mark behind the last column needs none
