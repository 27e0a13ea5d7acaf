"""A file's audit as plain JSON values, and back: exactly, for answers, for files and for resuming."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from typing import Any

from toolkit.audit.model import Identification, Repair, Segment, Skipped
from toolkit.audit.one_file import FileAudit


def to_plain(one: FileAudit) -> dict[str, Any]:
    """Return a file's audit under the keys of the answer; what it does not have is None or empty."""
    found = one.found
    repair = None if found is None else found.repair
    return {
        "path": one.path,
        "sha256": one.sha256,
        "size": one.size,
        "instrument": one.instrument,
        "date": None if one.date is None else one.date.isoformat(),
        "rows": one.rows,
        "grade": one.grade,
        "record": None if found is None else found.record,
        "variant": None if found is None else found.variant,
        "issued": None if found is None else found.issued,
        "candidates": [] if found is None else list(found.candidates),
        "segments": [] if found is None else [_segment(segment) for segment in found.segments],
        "in_force": None if found is None else found.in_force,
        "repair": None
        if repair is None
        else {"FY_max_abs_N": repair.FY_max_abs_N, "MZ_max_abs_Nm": repair.MZ_max_abs_Nm},
        "skipped": [] if found is None else [{"id": s.id, "reason": s.reason} for s in found.skipped],
        "reason": one.reason,
        "test_toml": one.context,
    }


def from_plain(plain: Mapping[str, Any]) -> FileAudit:
    """Return the audit that `to_plain` wrote.

    Raises
    ------
    KeyError, TypeError, ValueError
        it is not what this version writes
    """
    date = plain["date"]
    return FileAudit(
        path=plain["path"],
        sha256=plain["sha256"],
        size=plain["size"],
        instrument=plain["instrument"],
        date=None if date is None else dt.date.fromisoformat(date),
        rows=plain["rows"],
        found=None if plain["grade"] == "unreadable" else _found(plain),
        reason=plain["reason"],
        context=plain["test_toml"],
    )


def _segment(one: Segment) -> dict[str, Any]:
    return {
        "first_row": one.first_row,
        "last_row": one.last_row,
        "record": one.record,
        "variant": one.variant,
        "grade": one.grade,
        "candidates": list(one.candidates),
    }


def _found(plain: Mapping[str, Any]) -> Identification:
    repair = plain["repair"]
    return Identification(
        grade=plain["grade"],
        record=plain["record"],
        variant=plain["variant"],
        issued=plain["issued"],
        candidates=tuple(plain["candidates"]),
        segments=tuple(
            Segment(**{**segment, "candidates": tuple(segment["candidates"])})
            for segment in plain["segments"]
        ),
        in_force=plain["in_force"],
        repair=None if repair is None else Repair(**repair),
        skipped=tuple(Skipped(**one) for one in plain["skipped"]),
    )
