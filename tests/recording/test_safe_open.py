"""The gate refuses whatever is no workbook, damaged or hostile, by rule, before any reader sees it."""

from __future__ import annotations

import io
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest

from tests.recording.format_checks import whole
from tests.recording.workbook_factory import (
    CONTENT_MAIN,
    DATA,
    HEADERS,
    PACKAGE,
    SHEET,
    members,
    packed,
    row_xml,
    sheet_xml,
    table_xml,
    workbook,
)  # fmt: skip
from toolkit.errors import UnreadableError
from toolkit.recording.archive import MAX_MEMBERS, read_members, stored_archive
from toolkit.recording.cells import _parse, error_cells, find_cells
from toolkit.recording.safe_open import check_workbook, gate
from toolkit.recording.sniff import office_kind, sniff


def written(tmp_path: Path, data: bytes) -> Path:
    path = tmp_path / "file"
    path.write_bytes(data)
    return path


def refused(tmp_path: Path, data: bytes) -> UnreadableError:
    path = written(tmp_path, data)
    with pytest.raises(UnreadableError) as caught:
        check_workbook(path)
    assert str(path) in str(caught.value)
    return whole(caught.value)


def altered(changes: dict[str, bytes]) -> bytes:
    return packed({**members(), **changes})


def sheet(xml: str) -> bytes:
    return altered({SHEET: xml.encode()})


def test_a_good_workbook_passes(tmp_path):
    path = tmp_path / "any name"
    path.write_bytes(workbook())
    gated = gate(path)
    assert gated.kind == "xlsx"
    assert gated.members == members()


@pytest.mark.parametrize(
    ("data", "rule", "named"),
    [
        (b"", "empty-file", "0 bytes"),
        (b" \n\t ", "empty-file", "empty"),
        (b"%PDF-1.7\n%\xe2\xe3", "not-a-workbook", "PDF"),
        (b"\x89PNG\r\n\x1a\n....", "not-a-workbook", "PNG"),
        (b"just some words", "not-a-workbook", "text"),
        (b"<html><body>", "not-a-workbook", "HTML"),
        (b"\xff\xfeF\x00Z\x00", "not-a-workbook", "UTF-16"),
        (b"TDSm" + bytes(40), "format-version", "TDMS"),
        (bytes(range(256)), "not-a-workbook", "binary"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + "Workbook".encode("utf-16-le"), "not-a-workbook", ".xls"),
        (
            b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + "EncryptedPackage".encode("utf-16-le"),
            "encrypted",
            "encrypt",
        ),
        (packed({"a.txt": b"x"}), "not-a-workbook", "zip"),
        (b"PK\x03\x04", "zip-truncated", "4 bytes"),
    ],
)
def test_what_is_no_workbook_is_named(tmp_path, data, rule, named):
    error = refused(tmp_path, data)
    assert error.rule == rule
    assert named in str(error)


def test_a_word_document_is_named(tmp_path):
    word = CONTENT_MAIN.replace("spreadsheetml.sheet", "wordprocessingml.document").encode()
    error = refused(tmp_path, packed({"[Content_Types].xml": b"<Types>" + word + b"</Types>"}))
    assert error.rule == "not-a-workbook"
    assert "Word" in error.what


@pytest.mark.parametrize("part", [0.1, 0.5, 0.9, 0.99])
def test_a_truncated_workbook(tmp_path, part):
    whole = workbook()
    assert refused(tmp_path, whole[: int(len(whole) * part)]).rule == "zip-truncated"


def test_a_flipped_byte_in_the_packed_data_is_seen_by_its_check_sum(tmp_path):
    data = bytearray(packed(members(), method=zipfile.ZIP_STORED))
    at = data.index(b"248.8146")
    data[at] = ord("9")
    assert refused(tmp_path, bytes(data)).rule == "zip-damaged"


def test_no_file_and_a_folder(tmp_path):
    for path, rule in ((tmp_path / "none", "no-file"), (tmp_path, "folder-for-file")):
        with pytest.raises(UnreadableError) as caught:
            gate(path)
        assert caught.value.rule == rule


@pytest.mark.parametrize(
    "name",
    [
        "../evil.xml",
        "xl/../../evil",
        "/etc/passwd",
        "\\share\\evil",
        "C:/evil",
        "xl/\x01bad",
        "XL/Workbook.xml",
    ],
)
def test_member_names(tmp_path, name):
    assert refused(tmp_path, packed({**members(), name: b"x"})).rule == "member-path"


def test_a_member_without_a_name(tmp_path):
    # Found by mutation: the standard library's ZipInfo cannot say whether such a member is a folder.
    assert refused(tmp_path, stored_archive({**members(), "": b""})).rule == "member-path"


def test_too_many_members(tmp_path):
    parts = {f"xl/media/{i}": b"" for i in range(MAX_MEMBERS)}
    assert refused(tmp_path, packed({**members(), **parts})).rule == "members"


def test_a_bomb_is_not_inflated(tmp_path):
    data = packed({**members(), "xl/media/zeros.bin": bytes(8 * 2**20)})
    assert len(data) < 20_000
    assert refused(tmp_path, data).rule == "inflation"


def test_a_directory_that_lies_about_sizes_does_not_help_a_bomb(tmp_path):
    data = bytearray(packed({**members(), "xl/media/zeros.bin": bytes(8 * 2**20)}))
    size = struct.pack("<L", 8 * 2**20)
    while (at := data.find(size)) >= 0:
        data[at : at + 4] = struct.pack("<L", 10)
    assert refused(tmp_path, bytes(data)).rule == "inflation"


def test_an_encrypted_member(tmp_path):
    data = bytearray(workbook())
    at = data.index(b"PK\x01\x02")
    data[at + 8] |= 1
    assert refused(tmp_path, bytes(data)).rule == "encrypted"


@pytest.mark.parametrize("part", [SHEET, "xl/workbook.xml", "_rels/.rels", "xl/theme/theme1.xml"])
def test_a_document_type_definition(tmp_path, part):
    xml = members().get(part, b"<a/>").decode()
    head, _, tail = xml.rpartition("<a/>") if part.endswith("theme1.xml") else xml.partition("\n")
    evil = f'{head}<!DOCTYPE x [<!ENTITY a "aaaa">]>{tail or "<a/>"}'
    assert refused(tmp_path, altered({part: evil.encode()})).rule == "dtd"


def test_utf_16_would_hide_a_dtd(tmp_path):
    for encoding in ("utf-16", "utf-16-le"):
        xml = table_xml([HEADERS, *DATA]).replace("UTF-8", "UTF-16").encode(encoding)
        assert refused(tmp_path, altered({SHEET: xml})).rule == "encoding"
    xml = table_xml([HEADERS, *DATA]).replace('encoding="UTF-8"', f'{" " * 400}encoding="UTF-7"').encode()
    assert refused(tmp_path, altered({SHEET: xml})).rule == "encoding"


def test_macros(tmp_path):
    assert refused(tmp_path, altered({"xl/vbaProject.bin": b"x"})).rule == "macro"
    types = members()["[Content_Types].xml"].replace(
        CONTENT_MAIN.encode(), b"application/vnd.ms-excel.sheet.macroEnabled.main+xml"
    )
    assert refused(tmp_path, altered({"[Content_Types].xml": types})).rule == "macro"


@pytest.mark.parametrize(
    ("kind", "target", "mode"),
    [
        ("externalLink", "externalLinks/externalLink1.xml", ""),
        ("image", "http://example.org/a.png", 'TargetMode="External"'),
        ("attachedTemplate", "file:///C:/x", 'TargetMode="external"'),
    ],
)
def test_external_links(tmp_path, kind, target, mode):
    link = f'<Relationship Id="rId9" Type="{PACKAGE}/{kind}" Target="{target}" {mode}/></Relationships>'
    links = members()["xl/_rels/workbook.xml.rels"].replace(b"</Relationships>", link.encode())
    assert refused(tmp_path, altered({"xl/_rels/workbook.xml.rels": links})).rule == "external-link"


def test_a_hyperlink_is_harmless(tmp_path):
    link = (
        f'<Relationship Id="rId9" Type="{PACKAGE}/hyperlink" Target="http://example.org" '
        'TargetMode="External"/></Relationships>'
    )
    links = members()["xl/_rels/workbook.xml.rels"].replace(b"</Relationships>", link.encode())
    (tmp_path / "f").write_bytes(altered({"xl/_rels/workbook.xml.rels": links}))
    assert gate(tmp_path / "f").kind == "xlsx"


def test_connections_and_objects(tmp_path):
    assert refused(tmp_path, altered({"xl/connections.xml": b"<a/>"})).rule == "external-link"
    assert refused(tmp_path, altered({"xl/embeddings/o.bin": b"x"})).rule == "embedded-object"


FAR = {
    "corner": '<row r="1048576"><c r="XFD1048576"><v>1</v></c></row>',
    "row": '<row r="1000000"><c r="A1000000"><v>1</v></c></row>',
    "column": '<row r="9"><c r="XFD9"><v>1</v></c></row>' * 1 + '<row r="99"><c r="A99"><v>1</v></c></row>',
    "beyond Excel": '<row r="9"><c r="ZZZ9999999"><v>1</v></c></row>',
    "single quotes": "<row r='1048576'><c r='XFD1048576'><v>1</v></c></row>",
    "spaces": '<row r = "1048576"><c s="1" r = "XFD1048576"><v>1</v></c></row>',
    "prefix": f'<x:row xmlns:x="{PACKAGE}"><x:c r="XFD1048576"><x:v>1</x:v></x:c></x:row>',
    "row number alone": '<row r="1048576"><c><v>1</v></c></row>',
    "lower case": '<row r="1048576"><c r="xfd1048576"><v>1</v></c></row>',
}


@pytest.mark.parametrize("xml", FAR.values(), ids=FAR.keys())
@pytest.mark.parametrize("dimension", ["", "A1:G4"])
def test_far_cells_however_they_are_written(tmp_path, xml, dimension):
    rows = [row_xml(i, row) for i, row in enumerate([HEADERS, *DATA], start=1)]
    assert refused(tmp_path, sheet(sheet_xml([*rows, xml], dimension=dimension))).rule == "far-cell"


def test_many_cells_without_references_cannot_span_a_plane(tmp_path):
    wide = '<row r="1">' + "<c/>" * 16_000 + "</row>"
    tall = "".join('<row r="%d"><c/></row>' % i for i in range(2, 16_000))  # noqa: UP031
    assert refused(tmp_path, sheet(sheet_xml([wide, tall]))).rule == "far-cell"


def test_a_doubled_cell(tmp_path):
    rows = [row_xml(1, HEADERS), '<row r="2"><c r="A2"><v>1</v></c><c r="A2"><v>2</v></c></row>']
    error = refused(tmp_path, sheet(sheet_xml(rows)))
    assert error.rule == "doubled-cell"
    assert "A2" in str(error)


@pytest.mark.parametrize(
    "xml",
    [
        table_xml([HEADERS, *DATA])[:-40],
        table_xml([HEADERS, *DATA]).replace("</worksheet>", ""),
        sheet_xml(['<row r="1"><c r="$A$1"><v>1</v></c></row>']),
        sheet_xml(['<row r="1"><c r=""><v>1</v></c></row>']),
        sheet_xml(['<row r="1"><c r="A0"><v>1</v></c></row>']),
        sheet_xml(['<row r="-3"><c><v>1</v></c></row>']),
    ],
)
def test_a_damaged_worksheet(tmp_path, xml):
    assert refused(tmp_path, sheet(xml)).rule == "xml"


def test_the_fast_scan_finds_what_the_parser_finds():
    columns = [f"{a}{b}" for a in ("", "A", "Z", "AB") for b in "AMZ"]
    body = "".join(
        f'<row r="{row}">' + "".join(f'<c r="{c}{row}" s="1"><v>1</v></c>' for c in columns) + "</row>"
        for row in (1, 9, 10, 99, 1048576)
    )
    xml = sheet_xml([body]).encode()
    fast, full = find_cells(xml), _parse(xml)
    np.testing.assert_array_equal(fast.rows, full.rows)
    np.testing.assert_array_equal(fast.columns, full.columns)
    assert full.columns.max() == 1 * 26**2 + 2 * 26 + 26  # ABZ
    assert full.rows.max() == 1048576


def test_error_cells_are_found_where_they_stand():
    row = (
        '<c r="A2" t="e"/><c r="B2"><v>1</v></c><c r="C2" s="3" t="e"><f>1/0</f><v>#DIV/0!</v></c>'
        "<c t='e' r='D2'><v>#N/A</v></c>"
    )
    assert error_cells(sheet_xml([f'<row r="2">{row}</row>']).encode()) == (("C2", "#DIV/0!"), ("D2", "#N/A"))


def test_a_stored_archive_holds_what_was_checked():
    parts = members()
    data = stored_archive(parts)
    assert read_members(data, where=None) == parts
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        assert archive.testzip() is None
        assert archive.namelist() == list(parts)


def test_only_the_members_asked_for_are_inflated():
    parts = {**members(), "big": bytes(8 * 2**20)}
    assert set(read_members(packed(parts), where=None, only=(SHEET,))) == {SHEET}


def test_kinds():
    assert sniff(b"MZ [N*m],FY [N],SA [deg]\n1,2,3\n").id == "text"
    assert sniff(b"MZ\x90\x00\x03\x00").id == "program"
    assert sniff(b"\xef\xbb\xbfFZ load,Fy").id == "text"
    assert sniff(b'{"a": 1}').id == "json"
    assert office_kind(frozenset(("mimetype", "content.xml")), b"").id == "odf"
