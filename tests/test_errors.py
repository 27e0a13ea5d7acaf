"""An error is made for people to read, whatever stood in the file."""

from __future__ import annotations

from toolkit.errors import LONGEST, SessionError


def test_a_cell_of_megabytes_is_told_by_its_beginning_and_its_size() -> None:
    error = SessionError("row 3 holds no number", where="loads.csv", got="1" * 3_000_000, expected="a number")
    assert max(map(len, str(error).splitlines())) < LONGEST + 50
    assert "3000000 characters" in str(error)
    assert error.as_dict()["got"] == error.got


def test_lines_stay_whole_however_many() -> None:
    text = "\n".join(f"cell {number}" for number in range(1000))
    assert SessionError("many", got=text).got == text
