"""Text tables as programs of every country save them: one reading, or a refusal."""

from __future__ import annotations

import math
import tracemalloc

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from tests.recording.format_checks import whole
from tests.recording.workbook_factory import DATA, HEADERS
from toolkit.errors import CellError, ColumnError, ToolkitError, UnreadableError
from toolkit.machine import load_machine
from toolkit.recording import csvfile, read_recording
from toolkit.recording.read import LARGEST

M15 = load_machine("m15")
DIALECTS = [(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ",")]
ENCODINGS = ["utf-8", "utf-8-sig", "utf-16", "utf-16-le with a mark", "utf-16-be with a mark"]


def text(rows=DATA, headers=HEADERS, *, separator=",", decimal=".", end="\n", form=repr) -> str:
    lines = [list(headers), *([form(v).replace(".", decimal) for v in row] for row in rows)]
    return end.join(separator.join(line) for line in lines) + end


def encoded(words: str, encoding: str) -> bytes:
    plain, _, marked = encoding.partition(" ")
    return ("\ufeff" + words if marked else words).encode(plain)


@pytest.fixture
def read(tmp_path):
    def made(words: str | bytes):
        path = tmp_path / "recording"
        path.write_bytes(words if isinstance(words, bytes) else words.encode())
        return read_recording(path, M15)

    return made


def refused(read, words, rule, kind: type[ToolkitError] = UnreadableError) -> ToolkitError:
    with pytest.raises(kind) as caught:
        read(words)
    return whole(caught.value, rule)


def same(recording, rows=DATA) -> None:
    assert recording.format == "csv"
    for i, header in enumerate(HEADERS):
        one = next(s for s in recording.series if s.header == header)
        np.testing.assert_array_equal(one.values, [row[i] for row in rows])


@pytest.mark.parametrize(("separator", "decimal"), DIALECTS)
@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_every_dialect_gives_the_same_numbers(read, separator, decimal, encoding, end):
    same(read(encoded(text(separator=separator, decimal=decimal, end=end), encoding)))


@pytest.mark.parametrize(("separator", "decimal"), DIALECTS)
def test_whole_numbers_exponents_quotes_and_blank_columns(read, separator, decimal):
    rows = [(250, 86, 98, -182, 1.5e-7, -3.5e8, 0), (251, 87, 99, -183, -0.30197, 371, -1)]
    words = text(rows, separator=separator, decimal=decimal)
    same(read(words), rows)
    quoted = "\n".join(separator.join(f'"{c}"' for c in line.split(separator)) for line in words.splitlines())
    same(read(quoted), rows)
    same(read("\n\n" + words.replace("\n", separator + "\n")), rows)  # a separator behind every last cell


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_whole_numbers_alone_have_one_reading_in_every_dialect(read, separator):
    rows = [(250, 86, 98, -182, 1, 371, 0)]
    same(read(text(rows, separator=separator)), rows)


@pytest.mark.parametrize("separator", [";", "\t"])
def test_commas_that_may_stand_between_thousands_are_refused(read, separator):
    rows = [(248.814, 86.06, 98.592, -182.415, 301.975, 371.355, 353.935)]
    words = text(rows, separator=separator, decimal=",", form="{:.3f}".format)
    error = refused(read, words, "ambiguous-text")
    assert "248,814" in error.got
    # One number that cannot be in thousands decides, wherever it stands.
    for other in ("0,302", "-0,302", "301,97", "3019,750", "007,125", "301,975e0"):
        found = read(words.replace("301,975", other))
        assert found["FZ"].values[0] == 248.814
        assert found["SA"].values[0] == float(other.replace(",", "."))


@pytest.mark.parametrize(
    ("cell", "rule"),
    [
        ("1.234,5", "text-cell"),
        ("1 234,5", "text-cell"),
        ("1,234,567", "text-cell"),
        ("1,5.0", "text-cell"),
        ("86.06072", "text-cell"),
        (",", "text-cell"),
        ("1,5e2,5", "text-cell"),
        ("86,06072 lbf", "text-cell"),
        ("1'234,5", "text-cell"),
        ("٣,5", "text-cell"),
        ("", "empty-cell"),
        ("NaN", "nan-cell"),
        ("1,5E999", "nan-cell"),
        ("#DIV/0!", "error-cell"),
    ],
)
def test_a_cell_of_another_dialect_is_told(read, cell, rule):
    words = text(separator=";", decimal=",")
    assert "86,06072" in words
    error = refused(read, words.replace("86,06072", cell, 1), rule, CellError)
    if rule != "text-cell" or cell != "86.06072":
        assert "row 2" in error.where
        assert "D52" in error.where


def test_a_point_among_commas_and_a_comma_among_points_are_told_at_a_comma(read):
    words = text(separator=";", decimal=",").replace("86,06072", "86.06072", 1)
    mixed = ", with a comma where numbers are read with points"
    assert f"'248,8146'{mixed}" in refused(read, words, "text-cell", CellError).got
    words = text(separator=";").replace("86.06072", "86,06072", 1)
    assert f"'86,06072'{mixed}" in refused(read, words, "text-cell", CellError).got


def test_a_comma_that_separates_is_never_a_decimal_sign(read):
    refused(read, text(separator=",", decimal=","), "unknown-column", ColumnError)
    refused(read, text().replace("86.06072", '"86,06072"', 1), "text-cell", CellError)


@pytest.mark.parametrize(("inside", "outside"), [(",", ";"), (";", "\t"), ("\t", ",")])
def test_a_row_of_another_dialect_is_told(read, inside, outside):
    words = text(separator=outside).splitlines()
    words[2] = words[2].replace(outside, inside)
    assert "row 3" in refused(read, "\n".join(words), "text-cell", CellError).where


def test_a_header_that_two_separators_split_alike_is_refused(read):
    names = ",".join(HEADERS[:3]) + ";" + ";".join(HEADERS[3:])
    rows = text().partition("\n")[2]
    assert (
        "commas or semicolons"
        in refused(read, ",".join(HEADERS[:2]) + ";" + HEADERS[2], "ambiguous-text").got
    )
    refused(read, names + "\n" + rows, "unknown-unit", ColumnError)  # the one that finds more headers


def test_wide_text_that_is_none(read):
    words = encoded(text(), "utf-16-le with a mark")
    refused(read, words[:-1], "encoding")
    refused(read, words[:40] + b"\x00\xd8A\x00" + words[40:], "encoding")  # half a pair of surrogates
    refused(read, text().encode("utf-16-le"), "not-a-workbook")  # without its mark: binary data
    refused(read, b"\xff\xfe", "not-a-workbook")
    refused(read, b"\xff\xfe\x00\x00" + text().encode("utf-32-le"), "not-a-workbook")
    refused(read, "dear reader".encode("utf-16"), "not-a-workbook")
    refused(read, text().replace("86.06072", "86.0\x006072").encode("utf-16"), "text-cell", CellError)


def test_text_in_latin_1_is_read_with_its_signs(read):
    words = text(headers=[*HEADERS, "T [°C]"], rows=[(*row, 20.5) for row in DATA])
    found = read(words.encode("latin-1"))
    assert found["T"].unit == read(words)["T"].unit
    np.testing.assert_array_equal(found["T"].values, [20.5] * len(DATA))


@pytest.mark.parametrize("hint", ["sep=;\n", '"sep=;"\r\n', "SEP=;\n"])
def test_a_spreadsheets_hint_of_its_separator_is_no_row(read, hint):
    same(read(hint + text(separator=";", decimal=",")))


@pytest.mark.parametrize("begin", [b"", b"\xef\xbb\xbf"])
def test_bytes_that_are_no_text_are_named(read, begin):
    byte = b"\xfc" if begin else b"\x81"  # a mark of UTF-8 leaves no other encoding; 0x81 is no letter
    data = begin + text(headers=[*HEADERS, "M? [N]"], rows=[(*row, 1.0) for row in DATA]).encode()
    error = refused(read, data.replace(b"?", byte), "encoding")
    assert "UTF-16 with its byte order mark" in error.expected


numbers = st.floats(-1e9, 1e9) | st.integers(-(10**6), 10**6)


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(rows=st.lists(st.lists(numbers, min_size=7, max_size=7), min_size=1, max_size=6))
def test_a_table_has_the_same_numbers_in_every_dialect_that_is_read(read, rows):
    for separator, decimal in DIALECTS:
        try:
            same(read(text(rows, separator=separator, decimal=decimal)), rows)
        except UnreadableError:  # of its commas, where none can be told from one between thousands
            assert decimal == ","
            told = [f"{v!r}" for row in rows for v in row if "." in repr(v)]
            assert all(len(t.partition(".")[2]) == 3 for t in told)


def number(cell: str, separator: str, decimal: str) -> float | None:
    """A cell's only reading in a dialect, None where it has none: a mark of another dialect, or no number."""
    if separator in cell or (decimal == "," and "." in cell):
        return None
    try:
        value = float(cell.replace(decimal, "."))
    except ValueError:
        return None
    return value if math.isfinite(value) else None


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    cells=st.lists(
        st.text(st.sampled_from("0123456789.,;-eE \t"), min_size=1, max_size=6), min_size=1, max_size=3
    ),
    dialect=st.sampled_from(DIALECTS),
)
@example(cells=["1E101"], dialect=(",", "."))
def test_whatever_stands_in_the_cells_a_comma_is_one_thing_in_a_whole_file(read, cells, dialect):
    separator, decimal = dialect
    rows = text(separator=separator, decimal=decimal).splitlines()
    for i, cell in enumerate(cells):
        fields = rows[1 + i].split(separator)
        fields[1] = cell
        rows[1 + i] = separator.join(fields)
    wanted = [number(cell, separator, decimal) for cell in cells]
    if None in wanted or max(map(abs, wanted)) > LARGEST:
        with pytest.raises(ToolkitError) as caught:
            read("\n".join(rows))
        whole(caught.value)
        return
    found = read("\n".join(rows))
    assert found["D52"].values[: len(wanted)].tolist() == wanted
    assert found["FZ"].values[0] == DATA[0][0]


CELLS = (
    "1",
    "-2.5",
    "3,5",
    "+.5",
    "1e3",
    "1E-00003",
    "1e00003",
    " 7 ",
    '"8"',
    "1_0",
    "nan",
    "x",
    "",
    "1 2",
    "1,234",
)


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.lists(st.lists(st.sampled_from(CELLS), min_size=7, max_size=8), min_size=1, max_size=5),
    st.sampled_from([",", ";", "\t"]),
    st.sampled_from(["\n", "\r\n", "\r", "\n\n"]),
    st.sampled_from(["", "\n", ",,\n", "sep=;\n", "1\r"]),
    st.sampled_from([1 << 20, 40]),
)
def test_a_table_that_is_read_in_parts_is_what_is_read_cell_by_cell(
    tmp_path, monkeypatch, rows, separator, end, above, part
):
    def answer():
        try:
            recording = read_recording(path, load_machine("m15"))
        except ToolkitError as error:
            return error.as_dict()
        return [(s.header, s.unit, s.values.tolist()) for s in recording.series]

    path = tmp_path / "table.csv"
    lines = [separator.join(HEADERS), *(separator.join(cells) for cells in rows)]
    path.write_bytes((above + end.join(lines) + end).encode())
    with monkeypatch.context() as patch:
        patch.setattr(csvfile, "_PART", part)
        in_parts = answer()
        patch.setattr(csvfile, "_plain_table", lambda *_: None)
        assert in_parts == answer()


OTHER = pytest.mark.campaign("another dialect of plain numbers: that with decimal commas holds in every run")


@pytest.mark.parametrize(
    ("separator", "decimal", "encoding"),
    [
        pytest.param(",", ".", "utf-8", marks=OTHER),
        (";", ",", "utf-8-sig"),
        pytest.param("\t", ".", "utf-16", marks=OTHER),
    ],
)
def test_plain_numbers_take_no_object_for_each_cell(tmp_path, separator, decimal, encoding):
    # 16 bytes for each number: its own and the one that the reader has beside it. A list of floats takes 32,
    # and the text of each cell 50 more.
    def peak(count):
        rows = DATA * (count // len(DATA))
        path = tmp_path / "table.csv"
        path.write_bytes(text(rows, separator=separator, decimal=decimal).encode(encoding))
        data = path.read_bytes()
        tracemalloc.start()
        read_recording(path, load_machine("m15"), data=data)
        high = tracemalloc.get_traced_memory()[1] - (3 * len(data) if encoding == "utf-16" else 0)
        tracemalloc.stop()
        return high

    more = 20_000
    assert peak(20_000 + more) - peak(20_000) < 16 * more * len(HEADERS)


@pytest.mark.parametrize(("titles", "words"), [(1, "1 line stands"), (3, "3 lines stand")])
@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_lines_above_the_header_are_told_as_such(read, titles, words, separator):
    with pytest.raises(UnreadableError, match=f"^{words} above the header row") as caught:
        read("Rig 7\n\n" + "Run of 3 March 2026\n" * (titles - 1) + text(separator=separator))
    assert caught.value.rule == "not-a-workbook"
    assert "remove what stands above the header row" in caught.value.next_step
