"""One record as its files and its entry in the ledger have it, whatever was decided about it since."""

from __future__ import annotations

from typing import TYPE_CHECKING

from toolkit.calibration.records.record import CalibrationRecord, from_bytes
from toolkit.calibration.registry.agreement import check_agrees, check_inputs, check_transcribed
from toolkit.calibration.registry.refit import check_reproduces
from toolkit.calibration.registry.stored import bad_record as _bad
from toolkit.calibration.registry.stored import parse_loads
from toolkit.errors import RecordError
from toolkit.files import sha256_bytes
from toolkit.inputs import read_regular

if TYPE_CHECKING:
    from pathlib import Path

    from toolkit.calibration.registry.ledger import Ledger


def load_reproduced(folder: Path, record_id: str, ledger: Ledger) -> CalibrationRecord:
    """Read one record and hold it against its entry and its data, in the order of `Registry.load`."""
    path = folder / f"{record_id}.json"
    entered = ledger.entered().get(record_id)
    try:
        data = read_regular(path)
    except OSError as error:
        raise RecordError(
            f"record {record_id} is missing" if entered else f"the registry has no record {record_id}",
            where=path,
            got=error.strerror if entered else record_id,
            expected="the record's file" if entered else ", ".join(ledger.entered()) or "a record",
            next_step="restore it from a backup" if entered else "see 'toolkit calibration list'",
            rule="missing",
        ) from error
    record = from_bytes(data, where=path)
    check_entered(record, data, ledger, path)
    contents = {part.role: _data_file(record_id, folder / part.file, part.sha256) for part in record.data}
    try:
        if record.kind == "legacy":
            check_transcribed(record, contents["source"])
            return record
        table = parse_loads(record, contents["loads"], folder)
        check_agrees(record, contents["session"], table, contents.get("dcc"))
    except KeyError as error:
        raise _bad(record_id, path, f"no data file {error}", "its reference-load data", "data") from error
    check_reproduces(record, table)
    check_inputs(record)
    return record


def check_entered(record: CalibrationRecord, data: bytes, ledger: Ledger, path: Path) -> None:
    """Refuse a record whose bytes, read from a path, are not those of its entry.

    Raises
    ------
    RecordError
        ``ledger``, ``hash``
    """
    if ledger.damage is not None:
        raise _bad(path.stem, path, ledger.damage, "a ledger without damage", "ledger")
    entered = ledger.entered().get(path.stem)
    if entered is None or record.id != path.stem or record.instrument != path.parent.name:
        raise _bad(path.stem, path, "no entry of this record in the ledger", "an 'entered' line", "ledger")
    if entered.record != record.sha256:
        raise _bad(path.stem, path, f"sha256 {record.sha256}", f"{entered.record} as entered", "ledger")
    if entered.signatures and (entered.action == "import") != (record.kind == "legacy"):
        raise _bad(
            path.stem, path, f"a {record.kind} record", f"what its entry says: {entered.action}", "ledger"
        )
    if entered.file != sha256_bytes(data):
        raise _bad(path.stem, path, "a file whose bytes were changed", "the file as entered", "hash")


def _data_file(record_id: str, path: Path, expected: str) -> bytes:
    try:
        data = read_regular(path)
    except OSError as error:
        raise _bad(
            record_id, path, f"{path.name}: {error.strerror}", "the data that belong to the record", "data"
        ) from error
    if (digest := sha256_bytes(data)) != expected:
        raise _bad(record_id, path, f"{path.name} with sha256 {digest}", f"{expected} as entered", "data")
    return data
