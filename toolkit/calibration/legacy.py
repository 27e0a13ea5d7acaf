"""A calibration of before the toolkit: coefficients that a source names, without the data behind them.

    schema = 1
    instrument = "m15"
    date = 2021-12-31            # of the source
    entered_by = "legacy import"
    zero = "included"
    indications = [{ name = "D51", unit = "lbf" }, { name = "E5", unit = "lbf" }]
    [source]
    title = "..."
    place = "section, page, table"
    text = "the equations as printed, or how they were found"
    [[loads]]
    load = "FY"
    unit = "lbf"
    coefficients = { D51 = 0.99719, E5 = 1.0228, intercept = 0.6473 }

The file is kept beside the record and the record is compared with it on every load. It stays *unverified*:
nothing shows that the coefficients follow from any data.
"""

from __future__ import annotations

import datetime as dt
from pathlib import Path
from typing import Any, cast

from toolkit.calibration.candidate import entering, next_id
from toolkit.calibration.ledger import Ledger
from toolkit.calibration.record import (
    CalibrationRecord,
    DataFile,
    Golden,
    Indication,
    LoadFit,
    Zero,
    canonical,
    sealed,
)
from toolkit.calibration.refit import check_transcribed, polarity
from toolkit.calibration.registry import ID, Registry, load_checked
from toolkit.calibration.store import Change, commit
from toolkit.calibration.terms import INTERCEPT, parse_term
from toolkit.errors import ConfigError, ToolkitError
from toolkit.files import check_keys, read_toml, sha256_bytes
from toolkit.units import unit

_KEYS = "schema instrument date entered_by zero indications source loads".split()


def import_legacy(path: Path, registry: Registry) -> tuple[CalibrationRecord, bool]:
    """Enter a legacy record; return it, and whether it was there already.

    Raises
    ------
    ConfigError, SessionError, UnitError
        the file: unknown key, missing value, unknown unit, a term that cannot be read
    RegistryError
        the ledger is damaged
    """
    table = read_toml(path)
    source = path.read_bytes()
    unnumbered = _record(table, path, source)
    folder = registry.folder / unnumbered.instrument
    made: list[CalibrationRecord] = []

    def build(ledger: Ledger) -> Change | None:
        for record_id in ledger.entered():
            try:
                twin = load_checked(folder, record_id, ledger)
            except ToolkitError:
                continue
            if twin.inputs_sha256 == unnumbered.inputs_sha256:
                made.append(twin)
                return None
        record = _numbered(unnumbered, next_id(folder, unnumbered.instrument, ledger), source)
        check_transcribed(record, source)
        made.append(record)
        return entering(record, {record.data[0].file: source}, by=record.entered_by)

    written = commit(folder, build)
    return made[0], not written


def _numbered(record: CalibrationRecord, record_id: str, source: bytes) -> CalibrationRecord:
    import dataclasses

    data = (DataFile(role="source", file=f"{record_id}.source.toml", sha256=sha256_bytes(source)),)
    return sealed(dataclasses.replace(record, id=record_id, data=data))


def _record(table: dict[str, Any], path: Path, source: bytes) -> CalibrationRecord:
    import toolkit

    check_keys(table, _KEYS, where=path)
    for key in _KEYS:
        if key not in table and key != "schema":
            raise _wrong(path, key, "nothing", "an entry")
    if table.get("schema", 1) != 1:
        raise _wrong(path, "schema", table["schema"], "1")
    instrument, by = table["instrument"], table["entered_by"]
    if not isinstance(instrument, str) or not ID.match(f"{instrument}-r1"):
        raise _wrong(path, "instrument", instrument, "letters, digits, '-', '_' and '.'")
    if not isinstance(by, str) or not by.strip():
        raise _wrong(path, "entered_by", by, "a name")
    if table["zero"] not in ("included", "tared"):
        raise _wrong(path, "zero", table["zero"], "included | tared")
    origin = table["source"]
    if not isinstance(origin, dict):
        raise _wrong(path, "source", origin, "a table with title, place and text")
    check_keys(origin, ("title", "place", "text"), where=f"{path}: source")
    for key in ("title", "text"):
        if not isinstance(origin.get(key), str) or not origin[key].strip():
            raise _wrong(path, f"source.{key}", origin.get(key), "where the coefficients come from")
    cells = tuple(_cell(entry, path) for entry in _list(table, "indications", path))
    loads = tuple(_load(entry, cells, path) for entry in _list(table, "loads", path))
    settings = {"source": {key: str(value) for key, value in origin.items()}}
    return CalibrationRecord(
        id="",
        instrument=instrument,
        kind="legacy",
        date=_date(table["date"], path),
        entered_by=by.strip(),
        zero=cast("Zero", table["zero"]),
        cells=cells,
        loads=loads,
        golden=Golden(),
        data=(),
        settings=canonical(settings),
        inputs_sha256=sha256_bytes(source),
        software=(("toolkit", toolkit.__version__),),
    )


def _cell(entry: Any, path: Path) -> Indication:
    if not isinstance(entry, dict):
        raise _wrong(path, "indications", entry, '{ name = "D51", unit = "lbf" }')
    check_keys(entry, ("name", "unit", "serial"), where=f"{path}: indications")
    name, text = entry.get("name"), entry.get("unit")
    if not isinstance(name, str) or not isinstance(text, str):
        raise _wrong(path, "indications", entry, '{ name = "D51", unit = "lbf" }')
    serial = entry.get("serial")
    return Indication(
        name=name, unit=unit(text, where=path).text, serial=None if serial is None else str(serial)
    )


def _load(entry: Any, cells: tuple[Indication, ...], path: Path) -> LoadFit:
    if not isinstance(entry, dict):
        raise _wrong(path, "loads", entry, "tables [[loads]]")
    check_keys(entry, ("load", "unit", "coefficients"), where=f"{path}: loads")
    typed = entry.get("coefficients")
    name, text = entry.get("load"), entry.get("unit")
    if not isinstance(name, str) or not isinstance(text, str) or not isinstance(typed, dict) or not typed:
        raise _wrong(path, "loads", entry, "load, unit and coefficients")
    known = {cell.name for cell in cells}
    for term, value in typed.items():
        parsed = parse_term(term)
        named = {n for n, _ in parsed.powers} | set(parsed.absolutes)
        if not named <= known:
            raise _wrong(path, f"{name}.{term}", term, ", ".join((*sorted(known), INTERCEPT)))
        if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e300:
            raise _wrong(path, f"{name}.{term}", value, "a number")
    terms = tuple(typed)
    if INTERCEPT in terms and terms[-1] != INTERCEPT:
        raise _wrong(path, f"{name}.coefficients", ", ".join(terms), "the intercept last")
    values = tuple(float(value) for value in typed.values())
    return LoadFit(
        load=name,
        unit=unit(text, where=path).text,
        terms=terms,
        coefficients=values,
        issued=values,
        polarity=polarity(values),
        method="legacy",
    )


def _list(table: dict[str, Any], key: str, path: Path) -> list[Any]:
    if not isinstance(table[key], list) or not table[key]:
        raise _wrong(path, key, table[key], "at least one entry")
    return list(table[key])


def _date(value: object, path: Path) -> str:
    try:
        return dt.date.fromisoformat(str(value)).isoformat()
    except ValueError as error:
        raise _wrong(path, "date", value, "a date such as 2026-03-31") from error


def _wrong(path: Path, key: str, got: object, expected: str) -> ConfigError:
    return ConfigError(
        f"{key} has a value that cannot be used",
        where=f"{path}: {key}",
        got=got,
        expected=expected,
        next_step=f"correct {key}; nothing was written",
        rule="legacy",
    )
