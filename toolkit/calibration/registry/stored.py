"""The reference loads and check loads that lie beside a record, as the tables they were fitted from.

The stored files are those of the session, byte for byte. Where the record says that a column was converted
(bridge output in mV, counts), the same conversion is made again, from the settings that the record holds.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path

from toolkit.calibration.records.record import CalibrationRecord
from toolkit.calibration.session.indications import (
    Bridge,
    bridges_of,
    converted,
    without_read_zeros,
    without_run_zeros,
)
from toolkit.calibration.session.known_errors import group_column, row_columns
from toolkit.calibration.session.read import Session, read_session
from toolkit.calibration.session.session_file import session_entries
from toolkit.calibration.session.settings import dcc_name, parse_session
from toolkit.calibration.session.statements import entries_of
from toolkit.calibration.session.table import Table, read_table
from toolkit.errors import RecordError, RegistryError, ToolkitError
from toolkit.files import real_path
from toolkit.inputs import RECORD_FILE, read_input
from toolkit.units import unit


def stored_loads(registry: Path, record: CalibrationRecord) -> Table | None:
    """Return a record's reference loads, in its own units; None for a legacy record, which has none.

    ``registry`` is the registry's folder; the record has been checked (`Registry.load`).
    """
    entry = record.data_file("loads")
    if entry is None:
        return None
    folder = registry / record.instrument
    return parse_loads(record, read_input(folder / entry.file, RECORD_FILE), folder)


def stored_check(registry: Path, record: CalibrationRecord) -> Table | None:
    """Return a record's check loads, in its own units; None where its session had none."""
    entry = record.data_file("check")
    if entry is None:
        return None
    path = registry / record.instrument / entry.file
    loads = [load.load for load in record.loads]
    table = read_table(
        read_input(path, RECORD_FILE),
        where=path,
        required=[*record.indications, *loads],
        passed=row_columns(loads, _labels(record)),
        runs=False,
    )
    units = record.units
    mismatched = [n for n, text in units.items() if unit(table.unit(n)).dimension != unit(text).dimension]
    table = converted(table, _bridges(record, mismatched), units, where=path)
    table = table.in_units(units | {load.load: load.unit for load in record.loads})
    return without_read_zeros(table, record.indications, loads, path) if record.zero == "run" else table


def parse_loads(record: CalibrationRecord, data: bytes, folder: Path) -> Table:
    """Parse the bytes of a record's reference loads.

    Raises
    ------
    RecordError
        ``data``: they cannot be read
    """
    needed = [*record.indications, *(load.load for load in record.loads)]
    uncertainties = row_columns([load.load for load in record.loads])
    file = record.data_file("loads")
    where = folder / ("loads" if file is None else file.file)
    try:
        table = read_table(data, where=where, required=needed, optional=uncertainties, labels=_labels(record))
        table = _as_fitted(record, table, where)
        loads = [load.load for load in record.loads]
        return without_run_zeros(table, record.indications, loads) if record.zero == "run" else table
    except RegistryError:
        raise
    except ToolkitError as error:
        fault = f"{where.name}: {reason_of(error)}"
        raise bad_record(record.id, where, fault, "reference-load data that can be read", "data") from error


def _labels(record: CalibrationRecord) -> tuple[str, ...]:
    # Few sessions name a group: the settings of the others are not parsed.
    has_group = '"shared_group"' in record.settings
    return group_column(json.loads(record.settings).get("reference", {})) if has_group else ()


def _as_fitted(record: CalibrationRecord, table: Table, where: Path) -> Table:
    # A column that the record does not call converted is left alone: the refit compares its unit.
    changed = {cell.name: cell for cell in record.cells if cell.column_unit is not None}
    if not changed:
        return table
    for cell in changed.values():
        if table.unit(cell.name) != cell.column_unit:
            raise bad_record(
                record.id, f"{where}, column {cell.name}", table.unit(cell.name), cell.column_unit, "data"
            )
    units = {name: cell.unit for name, cell in changed.items()}
    return converted(table, _bridges(record, list(changed)), units, where=where)


def _bridges(record: CalibrationRecord, names: list[str]) -> dict[str, Bridge]:
    if not names:
        return {}
    return bridges_of(entries_of(record), names, where=record.id)


def bad_record(record_id: str, where: object, actual: object, expected: object, rule: str) -> RecordError:
    """Return the error of a record that may not be used."""
    return RecordError(
        f"record {record_id} may not be used",
        where=where,
        got=actual,
        expected=expected,
        next_step="restore the registry from a backup; 'toolkit calibration verify' lists every bad file",
        rule=rule,
    )


def reason_of(error: ToolkitError) -> str:
    """Return an error in one line."""
    return f"{error.what}: got {error.got}, expected {error.expected}" if error.got else error.what


# A record's session, read again from the files that lie beside it.


def stored_session(registry: Path, record: CalibrationRecord) -> Session:
    """Return the session that a record was fitted from, by the reader that read it then.

    ``registry`` is the registry's folder; the record has been checked (`Registry.load`), and with it the
    hashes of its files.

    Raises
    ------
    RecordError
        ``data``: a legacy import, which has no session
    """
    folder = registry / record.instrument
    files = {part.role: read_input(folder / part.file, RECORD_FILE) for part in record.data}
    if "session" not in files or "loads" not in files:
        raise RecordError(
            f"record {record.id} has no reference loads to report on",
            where=folder,
            got="a legacy import",
            expected="a record that was fitted from a session",
            next_step="see 'toolkit calibration show' for its coefficients and their source",
            rule="data",
        )
    raw = parse_session(files["session"], where=folder / f"{record.id}.session.toml", entered=True)
    entries = session_entries(raw, where=folder / f"{record.id}.session.toml")
    check = entries.check_file or "check.csv"
    with tempfile.TemporaryDirectory() as place:
        # The session names its files as they were called when it was recorded.
        for name, role in ((entries.data, "loads"), (check, "check"), (dcc_name(raw), "dcc")):
            if role in files:
                target = real_path(Path(place, str(name)))
                if not target.is_relative_to(real_path(Path(place))):
                    continue  # the reader refuses such a name, and says so
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(files[role])
        path = Path(place) / "SESSION.toml"
        path.write_bytes(files["session"])
        return read_session(path, entered=True)
