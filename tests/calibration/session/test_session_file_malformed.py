"""Malformed sessions, entry by entry: what is said of a new one, and of one that lies beside a record.

`malformed.txt` has three lines of each: the entries; rule, key and what was expected where the file is new;
and the same where it was entered by some version before ("=" where nothing else is said).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.calibration.calibration_factory import CELLS
from toolkit.calibration.session.read import read_session
from toolkit.errors import ToolkitError

Make = Callable[..., Path]
LINES = (Path(__file__).parent / "malformed.txt").read_text(encoding="utf-8").splitlines()
CASES = [tuple(LINES[at : at + 3]) for at in range(0, len(LINES), 3)]
READINGS = ", ".join(f'{name} = {{ value = 1, unit = "mV/V" }}' for name in CELLS)


def told(path: Path, *, entered: bool) -> str:
    """Return rule, key and what was expected; what is said of each entry where there are several."""
    try:
        read_session(path, entered=entered)
    except ToolkitError as error:
        if error.exit_code != 2 or not all(error.as_dict().values()):
            return "an error without one of its parts"
        key = str(error.where).removeprefix(str(path)).removeprefix(": ") or str(error.got)
        return " ".join(f"{error.rule} | {key} | {error.expected}".split())
    return "taken"


@pytest.mark.parametrize(("entries", "new", "entered"), CASES, ids=[case[0][:60] for case in CASES])
def test_a_malformed_session(make_session: Make, entries: str, new: str, entered: str) -> None:
    text = entries.replace("READINGS", READINGS)
    path = make_session(**dict(entry.split(" = ", 1) for entry in text.split("; ")))
    assert told(path, entered=False) == new.strip()
    assert told(path, entered=True) == (new if entered.strip() == "=" else entered).strip()
