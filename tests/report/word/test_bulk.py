"""Rows kept as bytes: the same document as rows filled in the tree, without the tree."""

from __future__ import annotations

import datetime as dt
import io
import zipfile
from pathlib import Path

import pytest
from lxml import etree

from tests.report.report_factory import make_record, make_result
from tests.report.template_factory import HASH, opened, p, run, sdt, tbl
from toolkit.report.content import ReportContent, Table
from toolkit.report.test.content import build_content
from toolkit.report.word import bulk, rows
from toolkit.report.word.bulk import with_rows, without_rows
from toolkit.report.word.fill import Filled, fill
from toolkit.report.word.verify import verify_docx

W = "{http://schemas.openxmlformats.org/wordprocessingml/2006/main}"
ODD = (
    'a&b <c> "d"',
    "two\nlines",
    "a\ttab",
    " spaces ",
    "",
    "שלום 12",
    "Größe 漢字 🙂",
    "{{tk:tire.size}}",
    "bell\x07",
)
CELLS = (
    "{{tk:row.file}}",
    p("is ", sdt("tk:row.FY_difference", run("x"), '<w:id w:val="5"/><w:showingPlcHdr/>'), " N"),
    "{{tk:row.MZ_difference|.4f}} of {{tk:tire.size}}",
)


def content(count: int) -> ReportContent:
    made = build_content(make_result(), make_record(), issued=dt.date(2026, 11, 21))
    table = made.tables["acquisition"]
    data = tuple((ODD[i % len(ODD)], i / 7, i / 9) for i in range(count))
    made.tables["acquisition"] = Table(name=table.name, columns=table.columns, rows=data)
    return made


def both(
    folder: Path, body: str, monkeypatch: pytest.MonkeyPatch, count: int = 30, **more: object
) -> tuple[Filled, Filled]:
    """Fill a template with its rows in the tree, and with its rows as bytes."""
    template, made = opened(folder, body, **more), content(count)
    monkeypatch.setattr(rows, "MANY", 10**9)
    tree = fill(template, made, {}, allow_missing=True)
    monkeypatch.setattr(rows, "MANY", 3)
    return tree, fill(template, made, {}, allow_missing=True)


def part(result: Filled, name: str = "word/document.xml") -> bytes:
    with zipfile.ZipFile(io.BytesIO(result.docx)) as archive:
        assert archive.testzip() is None
        return archive.read(name)


def canonical(xml: bytes) -> bytes:
    canon: bytes = etree.tostring(etree.fromstring(xml), method="c14n", exclusive=True)
    return canon


def stand_ins(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return a list that receives the number of rows of each run that is kept as bytes."""
    seen: list[int] = []
    monkeypatch.setattr(
        bulk.Bulk,
        "add",
        lambda self, at, made, old=bulk.Bulk.add: (seen.append(len(made)), old(self, at, made)),
    )
    return seen


@pytest.mark.parametrize("row", [list(CELLS), ["a", "b", "c"]], ids=["tags", "columns"])
def test_rows_as_bytes_are_the_rows_of_the_tree(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, row: list[str]
) -> None:
    seen = stand_ins(monkeypatch)
    # What looks like a stand-in in the template is none.
    body = (
        p("{{tk:table.acquisition}}", "<?toolkit-rows 0?>")
        + tbl(["f", "F", "M"], row, ["end", "", ""])
        + p("after")
    )
    tree, raw = both(tmp_path, body, monkeypatch)
    assert seen == [30]
    assert canonical(part(tree)) == canonical(part(raw))
    assert tree.cells == raw.cells
    assert tree.manifest == raw.manifest
    assert all(one.ok for one in verify_docx(raw))


def test_a_header_and_a_nested_table_hold_many_rows_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = stand_ins(monkeypatch)
    inner = "<w:p/>" + tbl(["{{tk:row.file}}", "{{tk:row.FY_difference}}", "{{tk:row.MZ_difference}}"])
    nested = p("{{tk:table.acquisition}}") + tbl(["outer", inner + "<w:p/>"])
    head = p("{{tk:table.acquisition}}") + tbl(["f", "F", "M"], list(CELLS))
    for body, more in ((nested, {}), (p(HASH), {"header": head})):
        tree, raw = both(tmp_path, body, monkeypatch, **more)
        assert tree.cells == raw.cells
        with zipfile.ZipFile(io.BytesIO(raw.docx)) as archive:
            names = [one for one in archive.namelist() if one.endswith(".xml")]
        assert all(
            canonical(part(tree, one)) == canonical(part(raw, one)) for one in names if "core" not in one
        )
    assert 30 in seen


@pytest.mark.parametrize(
    "row",
    [
        [
            p("{{tk:row.file}}", '<w:fldSimple w:instr=" SEQ Row "><w:r><w:t>0</w:t></w:r></w:fldSimple>'),
            *CELLS[1:],
        ],
        [
            '<w:p><w:pPr><w:pStyle w:val="Heading1"/></w:pPr><w:r><w:t>{{tk:row.file}}</w:t></w:r></w:p>',
            *CELLS[1:],
        ],
        [
            '<w:p><w:pPr><w:outlineLvl w:val="1"/></w:pPr><w:r><w:t>{{tk:row.file}}</w:t></w:r></w:p>',
            *CELLS[1:],
        ],
    ],
    ids=["numbered", "heading", "level"],
)
def test_rows_that_are_numbered_or_listed_stay_in_the_tree(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, row: list[str]
) -> None:
    seen = stand_ins(monkeypatch)
    tree, raw = both(tmp_path, p("{{tk:table.acquisition}}") + tbl(["f", "F", "M"], row), monkeypatch)
    assert seen == []
    assert part(tree) == part(raw)


def test_rows_inside_a_bookmark_stay_in_the_tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = stand_ins(monkeypatch)
    start, end = '<w:bookmarkStart w:id="1" w:name="all"/>', '<w:bookmarkEnd w:id="1"/>'
    table = p("{{tk:table.acquisition}}") + tbl(["f", "F", "M"], list(CELLS))
    ref = '<w:fldSimple w:instr=" REF all "><w:r><w:t>x</w:t></w:r></w:fldSimple>'
    tree, raw = both(tmp_path, p(start) + table + p(end) + p(ref), monkeypatch)
    assert seen == []
    assert part(tree) == part(raw)
    both(tmp_path, p(start, "x", end) + table, monkeypatch)
    assert seen == [30]


def test_a_part_is_parsed_without_its_long_runs_of_rows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bulk, "_LARGE", 0)
    monkeypatch.setattr(bulk, "MANY", 2)
    within = "<w:tr><w:tc><w:tbl><w:tr><w:tc>i</w:tc></w:tr><w:tr/></w:tbl></w:tc></w:tr>"
    field = '<w:tr><w:tc><w:fldChar w:fldCharType="begin"/></w:tc></w:tr>'
    plain = '<w:tr w:rsidR="1"><w:trPr/><w:tc>{}</w:tc></w:tr>'
    many = "".join(plain.format(i) for i in range(4))
    xml = (
        f'<w:document xmlns:w="{W[1:-1]}"><!-- <w:tr> --><w:tbl>{many}</w:tbl>'
        f"<w:tbl>{many}{field}{plain}</w:tbl>"
        f"<w:tbl>{within * 3}</w:tbl></w:document>"
    ).encode()
    short, runs = without_rows(xml)
    assert [one.count(b"</w:tr>") for one in runs] == [4, 4, 6]
    left = etree.fromstring(short)
    assert len(list(left.iter(f"{W}tr"))) == 2  # the row with a field, and the one behind it
    assert len(list(left.iter(f"{W}fldChar"))) == 1
    assert with_rows(short, runs) == xml
    # A document that says so itself is parsed whole.
    foreign = xml.replace(b"<w:tbl>", b"<?toolkit-rows 0?><w:tbl>", 1)
    assert without_rows(foreign) == (foreign, [])


def test_libreoffice_is_given_the_time_that_a_long_table_takes(tmp_path: Path) -> None:
    """One table of 13 000 rows (501 pages) took it 270 s; 22 000 rows more than 495 s of processor time."""
    from toolkit.report.word.office import time_for

    def document(rows: int) -> Path:
        row = "<w:tr>" + "<w:tc><w:p><w:r><w:t>1</w:t></w:r></w:p></w:tc>" * 3 + "</w:tr>"
        path = tmp_path / f"{rows}.docx"
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            # The rows of a report's own tables are ten times as long.
            archive.writestr("word/document.xml", f"<w:tbl>{row * rows}</w:tbl>" + " " * 2**21)
        return path

    short, long, longer = (document(rows) for rows in (100, 13_000, 22_000))
    assert time_for([short], 180.0) == pytest.approx(180.0, rel=0.02)
    assert time_for([long], 180.0) > 2 * 270
    assert time_for([longer], 180.0) > 2 * 495
    assert time_for([long, longer], 180.0) > time_for([longer], 180.0) + 180
    (tmp_path / "none.docx").write_bytes(b"no archive")
    assert time_for([tmp_path / "none.docx"], 180.0) == 180.0
