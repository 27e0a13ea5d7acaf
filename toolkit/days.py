"""Days as people write them, in options and in files: the one form that the toolkit reads."""

from __future__ import annotations

from datetime import date

FORM = "YYYY-MM-DD"
_LENGTH = len(FORM)


def parse_day(text: str) -> date:
    """Return the day of a text.

    ISO 8601 has other forms, 20260331 and 2026-W14-2. They look like numbers and slips, and nothing that is
    printed for people has them.

    >>> parse_day("2026-03-31")
    datetime.date(2026, 3, 31)
    >>> parse_day("2026-W14-2")
    Traceback (most recent call last):
    ValueError: no day in the form YYYY-MM-DD: '2026-W14-2'

    Raises
    ------
    ValueError
        it is none, or in another form
    """
    if len(text) != _LENGTH or text[4] != "-" or text[7] != "-":
        raise ValueError(f"no day in the form {FORM}: {text!r}")
    return date.fromisoformat(text)
