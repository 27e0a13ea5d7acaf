"""Files that contradict the day of their test: saved before it, or recorded in a test of another day too.

The record in force is that of the test's day; of a file that was moved into another test's folder it is the
wrong one, and by it a right file looks wrong. A recording was made on one day: where it stands, number for
number, in tests of two days, one of them is not its own. By its own properties a file tells less: a program
may write every file from one old workbook.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

CONTRADICTED = "date-contradicted"
_EARLY_DAYS = 1  # properties are in UTC, and a test may last past midnight


def saved_before(line: Mapping[str, Any]) -> str | None:
    """Return what is said of a file that was last saved before its test, None of others."""
    if line["date"] is None or line["modified"] is None:
        return None
    early = (dt.date.fromisoformat(line["date"]) - dt.date.fromisoformat(line["modified"])).days
    if early <= _EARLY_DAYS:
        return None
    return (
        f"by its own properties the file was last saved on {line['modified']}, {early} days before the test "
        f"of {line['date']}: it may have been moved here from another test"
    )


@dataclass(slots=True, eq=False)
class TwoDays:
    """Takes files one by one; ``told`` are those whose numbers stand in a test of another day too.

    Another record is in force on that day. Path to message, in which the other file is named.
    """

    told: dict[str, str] = field(default_factory=dict)
    _first: dict[bytes, tuple[str, str, str | None]] = field(default_factory=dict)

    def add(self, line: Mapping[str, Any]) -> None:
        """Take a file's plain answer."""
        if line["values_sha256"] is None or line["date"] is None:
            return
        key = bytes.fromhex(line["values_sha256"][:32])
        path, date, record = self._first.setdefault(key, (line["path"], line["date"], line["in_force"]))
        if record != line["in_force"]:
            self.told.setdefault(path, _told(line["path"], line["date"]))
            self.told[line["path"]] = _told(path, date)


def of_two_days(files: Iterable[Mapping[str, Any]]) -> dict[str, str]:
    """Return `TwoDays.told` of all files."""
    days = TwoDays()
    for line in files:
        days.add(line)
    return days.told


def _told(path: str, date: str) -> str:
    return (
        f"the same numbers are those of {path} in a test of {date}: one of the two days is not that of the "
        "recording"
    )
