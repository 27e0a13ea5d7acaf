"""SESSION.toml and its CSV files -> `Session`: everything that a fit needs, checked, or an error."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from toolkit.calibration.records.record import Zero
from toolkit.calibration.session.cells import FILES
from toolkit.calibration.session.indications import (
    Bridge,
    bridges_of,
    converted,
    fit_units,
    without_read_zeros,
    without_run_zeros,
)
from toolkit.calibration.session.known_errors import group_column, row_columns
from toolkit.calibration.session.session_file import CellEntries, SessionFile, session_faults
from toolkit.calibration.session.settings import Settings, dcc_name, inputs_hash, parse_session, settings_of
from toolkit.calibration.session.statement_checks import check_columns, check_statements, check_weights
from toolkit.calibration.session.table import Table, read_table
from toolkit.declared import Source, refuse
from toolkit.errors import SessionError
from toolkit.files import real_path, sha256_bytes
from toolkit.inputs import DATA_FILE, SETTINGS_FILE, TooLargeError, read_input, read_regular, unreadable
from toolkit.printable import check_entries
from toolkit.publication import settle

if TYPE_CHECKING:
    from toolkit.calibration.dcc.standard import Standards


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadSetting:
    """One load of a session: its unit in the data, and the check loads' tolerance in that unit."""

    name: str
    unit: str
    tolerance: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CellSetting:
    """One indication: the unit of the fit, serial number, and resolution in that unit (None: not stated).

    ``column_unit`` is the unit in the file where it was converted (`bridge`), None where it is ``unit``;
    ``step`` what the fit finds in the readings where none is stated (`fit.rounding`).
    """

    name: str
    unit: str
    serial: str | None
    resolution: float | None
    column_unit: str | None = None
    step: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Session:
    """A calibration session as read. ``settings`` is the canonical JSON of what decides about the fit.

    ``table`` and ``check`` are in the units of the fit; ``data_bytes``, ``check_bytes`` and
    ``dcc_bytes`` as recorded.
    """

    path: Path
    instrument: str
    date: dt.date
    operator: str
    cells: tuple[CellSetting, ...]
    loads: tuple[LoadSetting, ...]
    terms: tuple[str, ...]
    model: str
    degree: int
    method: str
    zero: Zero
    phase: str | None
    reference_due: dt.date | None
    settings: str
    table: Table
    check: Table | None
    session_bytes: bytes
    data_bytes: bytes
    check_bytes: bytes | None
    dcc_bytes: bytes | None = None

    @property
    def indications(self) -> tuple[str, ...]:
        """Names of the indications."""
        return tuple(cell.name for cell in self.cells)

    @property
    def inputs_sha256(self) -> str:
        """Hash of data and settings: a session that is already recorded has the same."""
        return inputs_hash(
            self.settings,
            sha256_bytes(self.data_bytes),
            None if self.check_bytes is None else sha256_bytes(self.check_bytes),
        )


def read_session(path: Path, *, entered: bool = False, standards: Standards | None = None) -> Session:
    """Read a session and its data files.

    ``entered``: it lies beside a record. Sessions of older records may have keys that nobody read.
    ``standards``: whose digital certificates count, in a session that is entered; default: nobody's.

    Raises
    ------
    ConfigError
        SESSION.toml: unknown keys, missing or wrong values, all of them told at once
    SessionError
        a data file: columns, cells, no such file, or one outside the session's folder
    UnitError
        a unit that is unknown or of another dimension
    """
    settle(path.parent)
    session_bytes = read_input(path, SETTINGS_FILE)
    raw = parse_session(session_bytes, where=path, entered=entered)
    if not entered:
        refuse(session_faults(raw), Source(where=path, text=session_bytes.decode("utf-8-sig")))
    dcc_bytes = None
    if (certificate := dcc_name(raw)) is not None:
        # Few sessions have one: the others do not wait for cryptography.
        from toolkit.calibration.dcc.standard import Standards, check_covered, with_standard

        settings_of(raw, where=path)  # its faults first, in the session's own words
        dcc_bytes = _file(path, certificate, "reference.dcc")
        raw = with_standard(
            raw, dcc_bytes, where=path, standards=None if entered else standards or Standards()
        )
    settings = settings_of(raw, where=path)
    entries = settings.entries
    loads, indications = entries.loads, entries.indications
    data_bytes = _file(path, entries.data, "data")
    uncertainties = row_columns(loads)
    labels = group_column(raw.get("reference", {}))
    recorded = read_table(
        data_bytes,
        where=path.parent / entries.data,
        required=[*indications, *loads],
        optional=uncertainties,
        labels=labels,
    )
    if not entered:
        for name, texts in recorded.labels:
            check_entries(texts, where=f"{path.parent / entries.data}, column {name}")
    if entries.method == "wls":
        check_weights(recorded, loads, path)
    check_columns(recorded, loads, path)
    check_statements(entries, recorded, path)
    bridges = bridges_of(entries, indications, where=path)
    table = converted(recorded, bridges, fit_units(recorded, bridges), where=path)
    if entries.fit_zero == "run":
        table = without_run_zeros(table, indications, loads)
    check_name = _check_name(entries, path)
    check_bytes = None if check_name is None else _file(path, check_name, "check")
    check = None
    if check_bytes is not None:
        check = _check_table(check_bytes, path.parent / str(check_name), table, bridges, entries, labels)
    if dcc_bytes is not None:
        check_covered(raw["reference"], (table, check), path)
    due = None if entries.reference is None else entries.reference.due
    return Session(
        path=path,
        instrument=entries.instrument,
        date=settings.date,
        operator=entries.operator,
        cells=tuple(_cell(bridges[name], entries.cell(name), recorded.unit(name)) for name in indications),
        loads=tuple(_load(name, settings, table, path) for name in loads),
        terms=settings.terms,
        model=entries.model,
        degree=settings.degree,
        method=entries.method,
        zero=entries.fit_zero,
        phase=entries.phase,
        reference_due=None if due is None else dt.date.fromisoformat(due),
        settings=settings.text,
        table=table,
        check=check,
        session_bytes=session_bytes,
        data_bytes=data_bytes,
        check_bytes=check_bytes,
        dcc_bytes=dcc_bytes,
    )


def _check_name(entries: SessionFile, path: Path) -> str | None:
    # A table [check] without a name means check.csv, or check.xlsx, beside the session.
    if entries.check_file is None and entries.check is not None:
        return next((name for name in ("check.csv", "check.xlsx") if (path.parent / name).is_file()), None)
    return entries.check_file


def _check_table(
    data: bytes,
    where: Path,
    table: Table,
    bridges: Mapping[str, Bridge],
    entries: SessionFile,
    labels: tuple[str, ...],
) -> Table:
    check = read_table(
        data,
        where=where,
        required=[*entries.indications, *entries.loads],
        passed=row_columns(entries.loads, labels),
        runs=False,
    )
    # The check file may be in other units than the data; it is brought to those of the fit.
    units = {name: table.unit(name) for name in check.names}
    check = converted(check, bridges, units, where=where).in_units(units)
    if entries.fit_zero == "run":
        check = without_read_zeros(check, entries.indications, entries.loads, where)
    return check


def _load(name: str, settings: Settings, table: Table, path: Path) -> LoadSetting:
    text, largest = table.unit(name), float(abs(table.column(name)).max())
    return LoadSetting(name=name, unit=text, tolerance=settings.tolerance(name, text, largest, path))


def _cell(bridge: Bridge, cell: CellEntries, column: str) -> CellSetting:
    text, key = bridge.unit(column), f"cells.{bridge.name}.resolution"
    stated = cell.resolution
    resolution = None if stated is None else bridge.stated(stated, key, column=column, target=text)
    return CellSetting(
        name=bridge.name,
        unit=text,
        serial=cell.serial,
        resolution=resolution,
        column_unit=None if column == text else column,
    )


def demand_inside(path: Path, name: str, key: str) -> None:
    """Refuse a data file that does not lie beside a session or below; ``path`` is the session's.

    Links count as what they lead to: what an error quotes must never be another file than the session's own.

    Raises
    ------
    SessionError
        ``outside``
    """
    target = path.parent / name
    if not real_path(target).is_relative_to(real_path(path.parent)) or Path(name).is_absolute():
        raise SessionError(
            "a data file lies outside the session's folder",
            where=f"{path}: {key}", got=name, expected="a relative path to a file beside the session",
            next_step="copy the file beside the session and name it there; nothing was written",
            rule="outside",
        )  # fmt: skip


def _file(path: Path, name: str, key: str) -> bytes:
    target = path.parent / name
    try:
        demand_inside(path, name, key)
        return read_regular(target, DATA_FILE)
    except TooLargeError as error:
        raise unreadable(target, DATA_FILE, error) from error
    except (OSError, ValueError) as error:
        raise SessionError(
            "a data file cannot be read",
            where=target, got=getattr(error, "strerror", None) or error,
            expected=f"{FILES}, beside the session",
            next_step=f"correct '{key}' in {path.name}; nothing was written", rule="no-data",
        ) from error  # fmt: skip
