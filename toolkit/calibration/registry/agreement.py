"""Load-time gate: a record's settings must follow from the session file that lies beside it.

The refit holds the numbers against the data. What is no number of the fit (zero, method, terms, dates, names,
serials, tolerances) has its origin in the session's text: it is derived again by the function that read the
session, and compared entry by entry. Units are compared with the data's header by the refit.
"""

from __future__ import annotations

import json
from collections.abc import Iterator

import numpy as np

from toolkit.calibration.records.record import CalibrationRecord
from toolkit.calibration.registry.legacy import read_legacy
from toolkit.calibration.session.settings import Settings, dcc_name, inputs_hash, parse_session, settings_of
from toolkit.calibration.session.table import Table
from toolkit.errors import RecordError, ToolkitError

_RESTORE = "restore the record from a backup; a correction is a new record, made by a new session"


def check_agrees(record: CalibrationRecord, session: bytes, table: Table, dcc: bytes | None = None) -> None:
    """Refuse a record whose settings are not those of its stored session.

    Parameters
    ----------
    record : the record as read
    session : the stored session file
    table : the stored reference loads
    dcc : the stored digital certificate of the standard, where the session names one

    Raises
    ------
    RecordError
        ``data``, naming the entry that differs and the session file
    """
    stored = record.data_file("session")
    file = "the session" if stored is None else stored.file
    try:
        raw = parse_session(session, where=file, entered=True)
        if dcc is not None and dcc_name(raw) is not None:
            # Few sessions have one: the others do not wait for cryptography.
            from toolkit.calibration.dcc.standard import with_standard

            raw = with_standard(raw, dcc, where=file)
        settings = settings_of(raw, where=file)
        roles = {"loads", "session"} | ({"dcc"} if "dcc" in raw.get("reference", {}) else set())
        for name, got, expected in _entries(record, settings, table, file, roles):
            if got != expected:
                raise _differs(record, file, name, got, expected)
    except RecordError:
        raise
    except ToolkitError as error:
        raise _differs(record, file, "its text", error.what, f"a session: {error.expected}") from error


def check_transcribed(record: CalibrationRecord, source: bytes) -> None:
    """Refuse a legacy record that is not what its stored source says: it cannot be refitted.

    It carries no golden vectors. They would be computed from the digits of the very file that every
    coefficient is compared with here, double for double: whoever changes both would compute them anew. And
    the records entered without them are hashed so. What a rewritten source, record and ledger cannot meet
    is a head that was printed earlier (`verify --head`).

    Raises
    ------
    RecordError
        ``refit``: a load's equation differs; ``data``: any other entry, or a source that cannot be read
    """
    stored = record.data_file("source")
    file = "the source" if stored is None else stored.file
    try:
        legacy = read_legacy(source, where=file)
    except ToolkitError as error:
        raise _differs(record, file, "its text", error.what, f"a legacy file: {error.expected}") from error
    if record.loads != legacy.loads:
        raise RecordError(
            f"record {record.id} does not reproduce from its own data: its coefficients",
            where=f"{record.id}, loads",
            got="not those of its source file",
            expected=f"those of {file}",
            next_step=_RESTORE,
            rule="refit",
        )
    for name in ("instrument", "date", "entered_by", "zero", "cells", "golden", "settings", "inputs_sha256"):
        if getattr(record, name) != getattr(legacy, name):
            raise _differs(record, file, name, getattr(record, name), getattr(legacy, name))


def check_inputs(record: CalibrationRecord) -> None:
    """Refuse a record whose hash of its inputs is not that of its settings and data files.

    It comes after the refit: of data that were exchanged, the refit says what they do to the coefficients.

    Raises
    ------
    RecordError
        ``data``
    """
    hashes = {part.role: part.sha256 for part in record.data}
    expected = inputs_hash(record.settings, hashes["loads"], hashes.get("check"))
    if record.inputs_sha256 != expected:
        raise _differs(record, "with its data files", "inputs_sha256", record.inputs_sha256, expected)


def _entries(
    record: CalibrationRecord, settings: Settings, table: Table, file: str, roles: set[str]
) -> Iterator[tuple[str, object, object]]:
    entries = settings.entries
    yield "instrument", record.instrument, entries.instrument
    yield "date", record.date, entries.date
    yield "entered_by", record.entered_by, entries.operator
    yield "zero", record.zero, entries.fit_zero
    yield "indications", record.indications, entries.indications
    yield "serial", tuple(cell.serial for cell in record.cells), settings.serials
    yield "loads", tuple(load.load for load in record.loads), entries.loads
    for load in record.loads:
        yield f"{load.load}, terms", load.terms, settings.terms
        yield f"{load.load}, method", load.method, entries.method
        largest = float(np.abs(table.column(load.load)).max())
        tolerance = settings.tolerance(load.load, table.unit(load.load), largest, file)
        yield f"{load.load}, tolerance", load.tolerance, tolerance
    if record.settings != settings.text:
        yield _first_difference(record.settings, settings.text)
    hashes = {file_entry.role: file_entry.sha256 for file_entry in record.data}
    if entries.check_file is not None or (entries.check is not None and "check" in hashes):
        roles = {*roles, "check"}
    yield "files", (*sorted(hashes), len(record.data)), (*sorted(roles), len(roles))


def _first_difference(actual: str, expected: str) -> tuple[str, object, object]:
    stored, refitted = json.loads(actual), json.loads(expected)
    if isinstance(stored, dict):
        for key in sorted({*stored, *refitted}):
            if stored.get(key) != refitted.get(key):
                return f"settings, {key}", stored.get(key), refitted.get(key)
    return "settings", actual, expected


def _differs(
    record: CalibrationRecord, file: str, name: str, actual: object, expected: object
) -> RecordError:
    return RecordError(
        f"record {record.id} differs from its stored session {file}: {name}",
        where=f"{record.id}, {name}",
        got="nothing" if actual is None else actual,
        expected="nothing" if expected is None else f"{expected} by {file}",
        next_step=_RESTORE,
        rule="data",
    )
