"""Reading reference-load data: the fast lane reads what `csv` reads, and a wrong separator is named."""

from __future__ import annotations

import numpy as np
import pytest

from toolkit.calibration.session.table import Table, read_table
from toolkit.errors import SessionError

HEADER = "S [mV/V],F [N],run,direction"
ROWS = ("0.1,10,1,up", "0.2,20,1,up", "0.15,15.5,2,down")


def read(text: str) -> Table:
    return read_table(text.encode(), where="loads.csv", required=["S", "F"])


def refusal(text: str) -> SessionError:
    with pytest.raises(SessionError) as caught:
        read(text)
    return caught.value


@pytest.mark.parametrize(
    "text",
    [
        "\n".join([HEADER, *ROWS]),
        "\n".join([HEADER, *ROWS]) + "\n",
        "\r\n".join([HEADER, *ROWS]) + "\r\n",
        "\ufeff" + "\n".join([HEADER, *ROWS]),
        "\n".join([HEADER, ROWS[0], "", ROWS[1], " , ,,", ROWS[2], "", ""]),
        "\n".join([HEADER, *ROWS]).replace("up", '"up"').replace("20,", '"20",'),
        "\n".join([HEADER, *ROWS]).replace(",", " , ").replace("up", "UP"),
    ],
)
def test_every_way_of_writing_a_table_is_read_alike(text: str) -> None:
    found = read(text)
    np.testing.assert_array_equal(found.values, [[0.1, 10], [0.2, 20], [0.15, 15.5]])
    assert found.run is not None
    assert found.run.tolist() == [1, 1, 2]
    assert found.direction == ("up", "up", "down")
    assert (found.names, found.units, found.rotation) == (("S", "F"), ("mV/V", "N"), None)


@pytest.mark.parametrize(
    ("row", "where"),
    [
        ("nan,1,1,up", "row 4 (line 5), column S"),
        ("1_0,1,1,up", "row 4 (line 5), column S"),
        ("1,x,1,up", "row 4 (line 5), column F"),
        ("1,2,1.5,up", "row 4 (line 5), column run"),
        ("1,2,1,sideways", "row 4 (line 5), column direction"),
        ("1,2,1", "row 4 (line 5)"),
        (",2,1,up", "row 4 (line 5), column S"),
    ],
)
def test_a_bad_cell_is_named_by_both_lanes(row: str, where: str) -> None:
    plain = "\n".join([HEADER, *ROWS, row]) + "\n"
    for text in (plain, plain.replace("0.1,", '"0.1",')):
        assert str(refusal(text).where) == f"loads.csv, {where}"


def test_a_header_alone_has_no_rows() -> None:
    assert refusal(HEADER + "\n").rule == "no-data"


def test_a_semicolon_in_a_name_is_no_separator() -> None:
    assert "unknown column 'a;b'" in refusal(HEADER + ",a;b [N]\n" + ROWS[0] + ",1\n").what


def test_decimal_commas_are_named() -> None:
    quoted = "\n".join([HEADER, '"0,1",10,1,up'])
    assert "decimal comma" in str(refusal(quoted).next_step)
    split = "\n".join([HEADER, "0,1,10,5,1,up"])
    error = refusal(split)
    assert "another number of cells" in error.what
    assert "decimal comma" in str(error.next_step)
    assert "nothing was written" in str(refusal("\n".join([HEADER, "0,1,1"])).next_step)


@pytest.mark.parametrize("number", ["1 000", "1\u202f000", "1\xa0000.5", "-12'500", "1\u2019000\u2019000"])
def test_what_stands_between_thousands_is_named(number: str) -> None:
    found = refusal("\n".join([HEADER, *ROWS, f"0.1,{number},1,up"]))
    assert "nothing may stand between thousands" in str(found.next_step)


def test_a_comment_in_the_first_line_is_no_decimal_comma() -> None:
    step = str(refusal("\n".join(["# measured by hand", HEADER, *ROWS])).next_step)
    assert step.startswith("take comments and titles out")


def test_a_file_of_another_kind_is_not_taken_for_reference_loads() -> None:
    # The cells of a case's recording are read here, too.
    with pytest.raises(SessionError) as caught:
        read_table(b"\x89PNG\r\n\x1a\n\0\0", where="run.csv", required=["S", "F"])
    assert (caught.value.what, caught.value.rule) == ("the file is no table", "not-a-workbook")


def test_every_bad_cell_is_told_at_once_in_the_order_of_the_rows() -> None:
    text = "\n".join([HEADER, "x,1,1,up", "0.1,,1.5,up", "0.2,2,1,sideways", "0.3,3,1,down"]) + "\n"
    first = refusal(text)
    cells = ["row 1 (line 2), column S", "row 2 (line 3), column F", "row 2 (line 3), column run"]
    cells.append("row 3 (line 4), column direction")
    assert [error.where for error in (first, *first.further)] == [f"loads.csv, {cell}" for cell in cells]
    assert {error.rule for error in first.further} == {"cell"}
    assert all(cell in str(first) for cell in cells)


def test_a_file_of_other_things_is_refused_before_all_of_it_is_judged() -> None:
    first = refusal("\n".join([HEADER, *["a,b,1,up"] * 5000]) + "\n")
    assert len(first.further) == 999
    assert "990 more cells" in str(first.got)
