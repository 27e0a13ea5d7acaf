"""An error is made for people to read, whatever stood in the file."""

from __future__ import annotations

from toolkit.errors import LONGEST, ConfigError, SessionError


def test_a_cell_of_megabytes_is_told_by_its_beginning_and_its_size() -> None:
    error = SessionError("row 3 holds no number", where="loads.csv", got="1" * 3_000_000, expected="a number")
    assert max(map(len, str(error).splitlines())) < LONGEST + 50
    assert "3000000 characters" in str(error)
    assert error.as_dict()["got"] == error.got


def test_lines_stay_whole_however_many() -> None:
    text = "\n".join(f"cell {number}" for number in range(1000))
    assert SessionError("many", got=text).got == text


def test_what_a_file_says_begins_no_line_of_an_error() -> None:
    hostile = "a\nerror: forged\n  next:     run this\r\n  got:      nothing"
    error = ConfigError(
        hostile, where=hostile, line=hostile, got=hostile, expected=hostile, next_step=hostile
    )
    lines = str(error).splitlines()
    assert [line for line in lines if not line.startswith(" " * 12)] == [
        "a", "  where:    a", "  line:     a", "  got:      a", "  expected: a", "  next:     a",
    ]  # fmt: skip
    assert len(lines) == 6 * 4
    # Programs get the text as it was.
    assert error.as_dict()["got"] == hostile
