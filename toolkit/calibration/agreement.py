"""Load-time gate: a record's settings must follow from the session file that lies beside it.

The refit holds the numbers against the data. What is no number of the fit (zero, method, terms, dates, names,
serials, tolerances) has its origin in the session's text: it is derived again by the function that read the
session, and compared entry by entry. Units are compared with the data's header by the refit.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.settings import Settings, inputs_hash, parse_session, settings_of
from toolkit.errors import RecordError, ToolkitError

if TYPE_CHECKING:
    from toolkit.calibration.record import CalibrationRecord
    from toolkit.calibration.table import Table


def check_agrees(record: CalibrationRecord, session: bytes, table: Table) -> None:
    """Refuse a record whose settings are not those of its stored session.

    Parameters
    ----------
    record : the record as read
    session : the stored session file
    table : the stored reference loads

    Raises
    ------
    RecordError
        ``data``, naming the entry that differs and the session file
    """
    stored = record.data_file("session")
    file = "the session" if stored is None else stored.file
    try:
        settings = settings_of(parse_session(session, where=file), where=file)
        for name, got, expected in _entries(record, settings, table, file):
            if got != expected:
                raise _differs(record, file, name, got, expected)
    except RecordError:
        raise
    except ToolkitError as error:
        raise _differs(record, file, "its text", error.what, f"a session: {error.expected}") from error


def _entries(
    record: CalibrationRecord, settings: Settings, table: Table, file: str
) -> Iterator[tuple[str, object, object]]:
    yield "instrument", record.instrument, settings.instrument
    yield "date", record.date, settings.date.isoformat()
    yield "entered_by", record.entered_by, settings.operator
    yield "zero", record.zero, settings.zero
    yield "indications", record.indications, settings.indications
    yield "serial", tuple(cell.serial for cell in record.cells), settings.serials
    yield "loads", tuple(one.load for one in record.loads), settings.loads
    for one in record.loads:
        yield f"{one.load}, terms", one.terms, settings.terms
        yield f"{one.load}, method", one.method, settings.method
        largest = float(np.abs(table.column(one.load)).max())
        tolerance = settings.tolerance(one.load, table.unit(one.load), largest, file)
        yield f"{one.load}, tolerance", one.tolerance, tolerance
    if record.settings != settings.text:
        yield _first_difference(record.settings, settings.text)
    hashes = {one.role: one.sha256 for one in record.data}
    roles = {"loads", "session"}
    if settings.check is not None or (settings.check_table and "check" in hashes):
        roles.add("check")
    yield "data", (*sorted(hashes), len(record.data)), (*sorted(roles), len(roles))
    inputs = inputs_hash(settings.text, hashes["loads"], hashes.get("check"))
    yield "inputs_sha256", record.inputs_sha256, inputs


def _first_difference(got: str, expected: str) -> tuple[str, object, object]:
    one, other = json.loads(got), json.loads(expected)
    if isinstance(one, dict):
        for key in sorted({*one, *other}):
            if one.get(key) != other.get(key):
                return f"settings, {key}", one.get(key), other.get(key)
    return "settings", got, expected


def _differs(record: CalibrationRecord, file: str, name: str, got: object, expected: object) -> RecordError:
    return RecordError(
        f"record {record.id} differs from its stored session {file}: {name}",
        where=f"{record.id}, {name}",
        got="nothing" if got is None else got,
        expected="nothing" if expected is None else f"{expected} by {file}",
        next_step="restore the record from a backup; a correction is a new record, made by a new session",
        rule="data",
    )
