"""One form of a day, in every option and every file."""

from __future__ import annotations

import datetime as dt

import pytest

from toolkit.cli.main import run
from toolkit.days import parse_day


def test_a_day_is_read_in_the_form_that_is_printed() -> None:
    assert parse_day("2026-04-03") == dt.date(2026, 4, 3)
    assert parse_day(dt.date.min.isoformat()) == dt.date.min


# Friday of week 14 of 2026 is 3 April: ISO 8601 writes that day in each of the first three ways.
@pytest.mark.parametrize(
    "text",
    ["20260403", "2026-W14-5", "2026W145", "2026-4-3", "2026-04-31", "26-04-03", " 2026-04-03", ""],
)
def test_no_other_form_is_a_day(text: str) -> None:
    with pytest.raises(ValueError, match=r".+"):
        parse_day(text)


@pytest.mark.parametrize(
    "words",
    [
        ("calibration", "approve", "m15-r2", "--checked-by", "B", "--in-force-from"),
        ("calibration", "withdraw", "m15-r2", "--by", "B", "--reason", "x", "--on"),
        ("calibration", "list", "--known-at"),
        ("calibration", "due", "--on"),
        ("process", "nowhere", "--known-at"),
        ("plan", "session", "--on"),
    ],
    ids=lambda words: " ".join(words[:2]),
)
@pytest.mark.parametrize("text", ["20260403", "2026-W14-5"])
def test_every_option_of_a_day_refuses_other_forms(
    words: tuple[str, ...], text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        run([*words, text])
    assert ended.value.code == 2
    told = capsys.readouterr().err
    assert text in told
    assert "YYYY-MM-DD" in told
