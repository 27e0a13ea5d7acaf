"""Entries of a case file: texts, numbers, tables and units as TOML has them, or an error that says what."""

from __future__ import annotations

import difflib
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.errors import ConfigError, UnitError
from toolkit.files import is_number
from toolkit.units import unit

if TYPE_CHECKING:
    from collections.abc import Sequence


def table_of(entry: object, where: str) -> dict[str, Any]:
    """Return a TOML table."""
    if not isinstance(entry, dict):
        raise wrong("a table is missing", where, entry, "a TOML table")
    return entry


def text_of(entry: object, where: str) -> str:
    """Return a text."""
    if not isinstance(entry, str):
        raise wrong("an entry is no text", where, entry, "text in quotes")
    return entry


def number_of(entry: object, where: str) -> float:
    """Return a finite number."""
    if not is_number(entry):
        raise wrong("an entry is no number", where, entry, "a finite number")
    return float(np.float64(entry))


def known_unit(text: str, where: str) -> None:
    """Refuse a unit that nobody knows, and name its place in the case."""
    try:
        unit(text)
    except UnitError as error:
        raise wrong("a unit is unknown", where, text, str(error.expected)) from error


def none_of(what: str, where: str, got: object, known: Sequence[str]) -> ConfigError:
    """Return the error of a word that is none of those known, with the nearest one."""
    lowered = {one.lower(): one for one in known}
    near = difflib.get_close_matches(str(got).lower(), list(lowered), n=1, cutoff=0.5)
    made = wrong(what, where, got, ", ".join(known))
    if near:
        made.next_step = f"did you mean {lowered[near[0]]!r}?"
    return made


def wrong(what: str, where: str, got: object, expected: str) -> ConfigError:
    """Return the error of an entry that is missing, unknown or of the wrong kind."""
    return ConfigError(
        what,
        where=where,
        got="nothing" if got is None else got,
        expected=expected,
        next_step="correct the case file; `toolkit explain case` shows a whole one",
        rule="case",
    )
