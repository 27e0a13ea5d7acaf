"""The name that somebody meant by a misspelt one: every "did you mean" of the toolkit comes from here."""

from __future__ import annotations

import difflib
import re
from collections.abc import Container, Iterable

LIKE = 0.6
"""Likeness from which a name is suggested: what is less alike is another word."""

LONGEST = 200
"""Characters of a name that can be a misspelt one: comparing takes the square of them."""


def nearest(name: str, candidates: Iterable[str], present: Container[str] = ()) -> str | None:
    """Return the known name that was meant, None where none is alike.

    Case does not count: ``dot`` is DOT. A name with another number is another thing, not a misspelt one. Of
    two that are as near, that which is not there yet was meant.

    >>> nearest("dat", ["date", "data"], present=["date"])
    'data'
    >>> nearest("FM_run_6.xlsx", ["FM_run_3.xlsx"]), nearest("FM_rnu_3.xlsx", ["FM_run_3.xlsx"])
    (None, 'FM_run_3.xlsx')
    """

    if len(name) > LONGEST:
        return None

    def likeness(candidate: str) -> tuple[float, bool, str]:
        ratio = difflib.SequenceMatcher(None, name.lower(), candidate.lower()).ratio()
        return ratio, candidate not in present, candidate

    near = max((word for word in candidates if not _renumbered(name, word)), key=likeness, default=None)
    return None if near is None or likeness(near)[0] < LIKE else near


def _renumbered(name: str, candidate: str) -> bool:
    """Tell whether both names have numbers, and others."""
    ours, theirs = re.findall(r"\d+", name), re.findall(r"\d+", candidate)
    return bool(ours and theirs) and ours != theirs
