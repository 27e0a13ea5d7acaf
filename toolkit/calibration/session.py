"""SESSION.toml and its CSV files -> `Session`: everything that a fit needs, checked, or an error."""

from __future__ import annotations

import datetime as dt
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from toolkit.calibration.record import Zero, canonical
from toolkit.calibration.table import Table, read_table
from toolkit.calibration.terms import INTERCEPT, MODELS, NAME, model_terms
from toolkit.errors import ConfigError, SessionError
from toolkit.files import check_keys, read_toml, sha256_bytes
from toolkit.machine.definition import quantity
from toolkit.units import si_scale, unit

METHODS = ("ols", "wls", "gls", "odr")
_KEYS = (
    "schema instrument date operator temperature indications loads data check reference cells zero creep "
    "phase model degree method drop certificate"
).split()
_REFERENCE = "standard certificate uncertainty due shared_group".split()
_CELL = "serial resolution scale excitation shunt_expected u".split()
_CHECK = "file data tolerance".split()
_FORCE, _MOMENT = re.compile(r"F[XYZ]?\Z"), re.compile(r"M[XYZ]\Z")
_INSTRUMENT = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*\Z")
DEFAULT_TOLERANCE = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class LoadSetting:
    """One load of a session: its unit in the data, and the check loads' tolerance in that unit."""

    name: str
    unit: str
    tolerance: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CellSetting:
    """One indication: its unit in the data, serial number, and resolution in that unit (None: not stated)."""

    name: str
    unit: str
    serial: str | None
    resolution: float | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Session:
    """A calibration session as read. ``settings`` is the canonical JSON of what decides about the fit."""

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

    @property
    def indications(self) -> tuple[str, ...]:
        """Names of the indications."""
        return tuple(cell.name for cell in self.cells)

    @property
    def inputs_sha256(self) -> str:
        """Hash of data and settings: a session that is already recorded has the same."""
        files = [sha256_bytes(self.data_bytes), self.check_bytes and sha256_bytes(self.check_bytes)]
        return sha256_bytes(canonical([self.settings, *files]).encode())


def read_session(path: Path) -> Session:
    """Read a session and its data files.

    Raises
    ------
    ConfigError
        SESSION.toml: unknown key, missing or wrong value
    SessionError
        a data file: columns, cells, or no such file
    UnitError
        a unit that is unknown or of another dimension
    """
    raw = read_toml(path)
    check_keys(raw, _KEYS, where=path)
    if raw.get("schema", 1) != 1:
        raise _wrong(path, "schema", raw["schema"], "1")
    instrument = _text(raw, "instrument", path)
    if not _INSTRUMENT.match(instrument):
        raise _wrong(path, "instrument", instrument, "letters, digits, '-', '_' and '.'")
    indications, loads = _names(raw, "indications", path), _names(raw, "loads", path)
    if set(indications) & set(loads):
        raise _wrong(path, "loads", ", ".join(loads), "names that are no indications")
    model, method = (
        _choice(raw, "model", MODELS, "linear", path),
        _choice(raw, "method", METHODS, "ols", path),
    )
    degree = _degree(raw, model, path)
    drop = raw.get("drop", [])
    if not isinstance(drop, list) or not all(isinstance(name, str) for name in drop):
        raise _wrong(path, "drop", drop, "a list of term names")
    if method in ("gls", "odr"):
        raise SessionError(
            f"method {method!r} is not available yet",
            where=path, got=method, expected="ols, or wls with u_<LOAD> columns",
            next_step='set method = "ols" or "wls"', rule="method",
        )  # fmt: skip
    data_bytes = _file(path, raw.get("data"), "data")
    uncertainties = [f"u_{load}" for load in loads]
    table = read_table(
        data_bytes,
        where=path.parent / str(raw["data"]),
        required=[*indications, *loads, *(uncertainties if method == "wls" else ())],
        optional=uncertainties,
    )
    _check_dimensions(table, loads, path)
    _check_uncertainties(table, loads, path)
    check_name, tolerances = _check_entry(raw, path)
    check_bytes = None if check_name is None else _file(path, check_name, "check")
    check = (
        None
        if check_bytes is None
        else _check_table(check_bytes, path, str(check_name), table, indications, loads)
    )
    _check_other(raw, indications, loads, path)
    cells = raw.get("cells", {})
    reference = raw.get("reference", {})
    settings = {key: value for key, value in raw.items() if key not in ("data", "check")}
    settings["tolerance"] = tolerances
    return Session(
        path=path,
        instrument=instrument,
        date=_date(raw.get("date"), "date", path),
        operator=_text(raw, "operator", path),
        cells=tuple(_cell(name, cells.get(name, {}), table, path) for name in indications),
        loads=tuple(_load(name, tolerances, table, path) for name in loads),
        terms=model_terms(model, indications, degree=degree, drop=drop),
        model=model,
        degree=degree,
        method=method,
        zero=cast("Zero", _choice(raw, "zero", ("included", "tared"), "included", path)),
        phase=None if "phase" not in raw else _choice(raw, "phase", ("as_found", "as_left"), "", path),
        reference_due=None if "due" not in reference else _date(reference["due"], "reference.due", path),
        settings=canonical(_plain(settings, path)),
        table=table,
        check=check,
        session_bytes=path.read_bytes(),
        data_bytes=data_bytes,
        check_bytes=check_bytes,
    )


def _check_entry(raw: Mapping[str, Any], path: Path) -> tuple[str | None, dict[str, Any]]:
    # TOML cannot hold check = "check.csv" and a table [check] at once: the table may name the file itself,
    # and without a name it means check.csv beside the session.
    entry = raw.get("check")
    if entry is None or isinstance(entry, str):
        return entry, {}
    if not isinstance(entry, dict):
        raise _wrong(path, "check", entry, 'check = "check.csv", or a table [check] with file and tolerance')
    check_keys(entry, _CHECK, where=f"{path}: check")
    name = entry.get("file", entry.get("data"))
    if name is None and (path.parent / "check.csv").is_file():
        name = "check.csv"
    tolerance = entry.get("tolerance", {})
    if not isinstance(tolerance, dict):
        raise _wrong(path, "check.tolerance", tolerance, "{ FY = { value, unit } }")
    return name, tolerance


def _check_table(
    data: bytes, path: Path, name: str, table: Table, indications: list[str], loads: list[str]
) -> Table:
    where = path.parent / name
    check = read_table(data, where=where, required=[*indications, *loads], runs=False)
    # The check file may be in other units of the same dimension; it is brought to those of the fit.
    return check.in_units({name: table.unit(name) for name in check.names})


def _check_other(raw: Mapping[str, Any], indications: list[str], loads: list[str], path: Path) -> None:
    for key, known in (("reference", _REFERENCE), ("cells", indications), ("certificate", None)):
        entry = raw.get(key, {})
        if not isinstance(entry, dict):
            raise _wrong(path, key, entry, f"a table [{key}]")
        if known is not None:
            check_keys(entry, known, where=f"{path}: {key}")
    for name, cell in raw.get("cells", {}).items():
        if not isinstance(cell, dict):
            raise _wrong(path, f"cells.{name}", cell, f"a table [cells.{name}]")
        check_keys(cell, _CELL, where=f"{path}: cells.{name}")
    uncertainty = raw.get("reference", {}).get("uncertainty", {})
    if not isinstance(uncertainty, dict):
        raise _wrong(path, "reference.uncertainty", uncertainty, "{ FY = { U, k, unit } }")
    check_keys(uncertainty, loads, where=f"{path}: reference.uncertainty")
    for name, entry in uncertainty.items():
        check_keys(entry, ("U", "k", "unit"), where=f"{path}: reference.uncertainty.{name}")
    for key, keys in (("zero", ("when", "values")), ("creep", ("load", "seconds", "value"))):
        entries = raw.get(key, [])
        if isinstance(entries, str) and key == "zero":
            continue
        if not isinstance(entries, list) or not all(isinstance(e, dict) for e in entries):
            raise _wrong(path, key, entries, f"tables [[{key}]] with {', '.join(keys)}")
        for entry in entries:
            check_keys(entry, keys, where=f"{path}: {key}")
    if "temperature" in raw:
        quantity(raw["temperature"], "temperature", f"{path}: temperature")


def _check_dimensions(table: Table, loads: list[str], path: Path) -> None:
    for name in loads:
        found = unit(table.unit(name))
        wanted = "force" if _FORCE.match(name) else "moment" if _MOMENT.match(name) else None
        if wanted is not None:
            si_scale(table.unit(name), wanted, where=f"{path}, column {name}")
        elif found.dimension not in ("force", "moment"):
            si_scale(table.unit(name), "force", where=f"{path}, column {name}")


def _check_uncertainties(table: Table, loads: list[str], path: Path) -> None:
    for load in loads:
        name = f"u_{load}"
        if not table.has(name):
            continue
        si_scale(table.unit(name), unit(table.unit(load)).dimension, where=f"{path}, column {name}")
        if not (table.column(name) > 0).all():
            row = int((table.column(name) <= 0).argmax()) + 1
            raise SessionError(
                "a standard uncertainty is not positive",
                where=f"{path}, row {row}, column {name}", got=table.column(name)[row - 1],
                expected="a positive number", next_step="state the uncertainty of every row", rule="cell",
            )  # fmt: skip


def _load(name: str, tolerances: Mapping[str, Any], table: Table, path: Path) -> LoadSetting:
    text = table.unit(name)
    largest = float(abs(table.column(name)).max())
    check_keys(
        tolerances, [n for n in table.names if not n.startswith("u_")], where=f"{path}: check.tolerance"
    )
    if name not in tolerances:
        return LoadSetting(name=name, unit=text, tolerance=DEFAULT_TOLERANCE * largest)
    where = f"{path}: check.tolerance.{name}"
    tolerance = quantity(tolerances[name], unit(text).dimension, where) / unit(text).factor
    if not (math.isfinite(tolerance) and tolerance > 0):
        raise _wrong(path, f"check.tolerance.{name}", tolerance, "a positive number")
    return LoadSetting(name=name, unit=text, tolerance=tolerance)


def _cell(name: str, entry: Mapping[str, Any], table: Table, path: Path) -> CellSetting:
    text = table.unit(name)
    resolution = entry.get("resolution")
    if isinstance(resolution, dict):
        where = f"{path}: cells.{name}.resolution"
        resolution = quantity(resolution, unit(text).dimension, where) / unit(text).factor
    if resolution is not None and (isinstance(resolution, bool) or not isinstance(resolution, int | float)):
        raise _wrong(path, f"cells.{name}.resolution", resolution, "a number in the indication's unit")
    serial = entry.get("serial")
    return CellSetting(
        name=name,
        unit=text,
        serial=None if serial is None else str(serial),
        resolution=None if resolution is None else float(resolution),
    )


def _file(path: Path, name: object, key: str) -> bytes:
    if not isinstance(name, str) or not name:
        raise _wrong(path, key, name, f'the name of a CSV file, such as {key} = "{key}.csv"')
    target = path.parent / name
    try:
        return target.read_bytes()
    except OSError as error:
        raise SessionError(
            "a data file cannot be read",
            where=target, got=error.strerror, expected="a CSV file beside the session",
            next_step=f"correct '{key}' in {path.name}", rule="no-data",
        ) from error  # fmt: skip


def _names(raw: Mapping[str, Any], key: str, path: Path) -> list[str]:
    names = raw.get(key)
    if (
        not isinstance(names, list)
        or not names
        or not all(isinstance(n, str) and NAME.match(n) for n in names)
    ):
        raise _wrong(path, key, names, f'a list of names such as {key} = ["FY", "MZ"]')
    if len(set(names)) != len(names) or {"run", "direction", "rotation", INTERCEPT, "abs"} & set(names):
        raise _wrong(path, key, ", ".join(names), "different names, none of them run, direction or rotation")
    return names


def _text(raw: Mapping[str, Any], key: str, path: Path) -> str:
    value = raw.get(key)
    if not isinstance(value, str) or not value.strip():
        raise _wrong(path, key, value, f'a text: {key} = "..."')
    return value.strip()


def _choice(raw: Mapping[str, Any], key: str, known: tuple[str, ...], default: str, path: Path) -> str:
    value = raw.get(key, default)
    if key == "zero" and isinstance(value, list):
        # [[zero]] readings and zero = "tared" share the key: readings say nothing about the fit's zero.
        return default
    if value not in known:
        raise _wrong(path, key, value, " | ".join(known))
    return str(value)


def _degree(raw: Mapping[str, Any], model: str, path: Path) -> int:
    if model != "polynomial":
        if "degree" in raw:
            raise _wrong(path, "degree", raw["degree"], 'no degree, or model = "polynomial"')
        return 1 if model == "linear" else 2
    degree = raw.get("degree")
    if isinstance(degree, bool) or not isinstance(degree, int) or not 1 <= degree <= 9:
        raise _wrong(path, "degree", degree, "a whole number from 1 to 9")
    return degree


def _date(value: object, key: str, path: Path) -> dt.date:
    if type(value) is dt.date:
        return value
    try:
        return dt.date.fromisoformat(cast("str", value))
    except (TypeError, ValueError) as error:
        raise _wrong(path, key, value, "a date such as 2026-03-31") from error


def _plain(value: Any, path: Path) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(item, path) for key, item in value.items()}
    if isinstance(value, list):
        return [_plain(item, path) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        raise _wrong(path, "a number", value, "a finite number")
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


def _wrong(path: Path, key: str, got: object, expected: str) -> ConfigError:
    return ConfigError(
        f"{key} is missing" if got is None else f"{key} has a value that cannot be used",
        where=f"{path}: {key}",
        got="nothing" if got is None else got,
        expected=expected,
        next_step=f"correct {key}; nothing was written",
        rule="session",
    )
