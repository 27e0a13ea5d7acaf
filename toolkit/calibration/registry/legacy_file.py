"""The file of a legacy import: read into a record without a number, and checked for what cannot be.

Reading and checking are apart: a stored record is read again on every load and compared with its file, and
a stricter check of a later version must not refuse what an earlier one entered.
"""

from __future__ import annotations

import datetime as dt
from typing import Any, cast

from toolkit.calibration.records.record import CalibrationRecord, Golden, Indication, LoadFit, Zero, canonical
from toolkit.calibration.registry.refit import polarity
from toolkit.calibration.session.settings import INSTRUMENT, wrong
from toolkit.calibration.session.statement_checks import check_load_unit
from toolkit.calibration.terms import INTERCEPT, NAME, parse_term
from toolkit.errors import ConfigError, ToolkitError, UnitError
from toolkit.files import check_keys, is_number, parse_toml, sha256_bytes
from toolkit.units import si_scale, unit

_KEYS = "schema instrument date entered_by zero indications source loads".split()


def read_legacy(data: bytes, *, where: object) -> CalibrationRecord:
    """Read a legacy file into a record that has no id yet.

    Raises
    ------
    ConfigError, SessionError, UnitError
        the file: not TOML, unknown key, missing value, unknown unit, a term that cannot be read
    """
    table = parse_toml(data, where=where)
    check_keys(table, _KEYS, where=where)
    for key in _KEYS:
        if key not in table and key != "schema":
            raise _wrong(where, key, None, "an entry")
    if table.get("schema", 1) != 1:
        raise _wrong(where, "schema", table["schema"], "1")
    instrument, by = table["instrument"], table["entered_by"]
    if not isinstance(instrument, str) or not INSTRUMENT.match(instrument):
        raise _wrong(where, "instrument", instrument, "letters, digits, '-', '_' and '.'")
    if not isinstance(by, str) or not by.strip():
        raise _wrong(where, "entered_by", by, "a name")
    if table["zero"] not in ("included", "tared"):
        raise _wrong(where, "zero", table["zero"], "included | tared")
    origin = table["source"]
    if not isinstance(origin, dict):
        raise _wrong(where, "source", origin, "a table with title, place and text")
    check_keys(origin, ("title", "place", "text"), where=f"{where}: source")
    for key in ("title", "text"):
        if not isinstance(origin.get(key), str) or not origin[key].strip():
            raise _wrong(where, f"source.{key}", origin.get(key), "where the coefficients come from")
    cells = tuple(_cell(entry, where) for entry in _list(table, "indications", where))
    settings = {"source": {key: str(value) for key, value in origin.items()}}
    return CalibrationRecord(
        id="",
        instrument=instrument,
        kind="legacy",
        date=_date(table["date"], where),
        entered_by=by.strip(),
        zero=cast("Zero", table["zero"]),
        cells=cells,
        loads=tuple(_load(entry, cells, where) for entry in _list(table, "loads", where)),
        golden=Golden(),
        data=(),
        settings=canonical(settings),
        inputs_sha256=sha256_bytes(data),
    )


def check_possible(record: CalibrationRecord, *, where: object) -> None:
    """Refuse a legacy record that no calibration can have given.

    Raises
    ------
    ConfigError
        ``legacy``: a name that stands twice, an indication that a load does not state; a coefficient of
        zero is stated too
    UnitError
        ``unit-dimension``: a force or moment in another unit, an indication without a dimension
    """
    names = [cell.name for cell in record.cells]
    loads = [load.load for load in record.loads]
    for key, entries in (("indications", names), ("loads", loads)):
        if any(not NAME.match(name) or name in (INTERCEPT, "abs") for name in entries):
            raise _wrong(where, key, ", ".join(entries), "names such as FY, MZ, D51")
    for key, found in (("indications", names), ("loads", loads)):
        twice = [name for name in dict.fromkeys(found) if found.count(name) > 1]
        if twice:
            raise _wrong(where, key, f"{', '.join(twice)} more than once", f"each of the {key} once")
    if shared := set(names) & set(loads):
        raise _wrong(where, "loads", ", ".join(sorted(shared)), "names that are no indications")
    for cell in record.cells:
        place = f"{where}: indications, {cell.name}"
        si_scale(cell.unit, where=place)
        if unit(cell.unit).dimension in ("ratio", "angle"):
            raise UnitError(
                f"the unit of {cell.name} has no dimension",
                where=place, got=cell.unit, expected="what a load cell gives: lbf, N, mV/V, V, counts",
                next_step="state the unit in which the coefficients take it; nothing was written",
                rule="unit-dimension",
            )  # fmt: skip
    for load in record.loads:
        check_load_unit(load.load, load.unit, where=f"{where}: {load.load}.unit")
        missing = [name for name in names if name not in load.terms]
        if missing:
            raise _wrong(
                where, f"{load.load}.coefficients", f"no {', '.join(missing)} among {', '.join(load.terms)}",
                f"a coefficient of every indication ({', '.join(names)}); write 0 where it has none",
            )  # fmt: skip


def _cell(entry: Any, where: object) -> Indication:
    if not isinstance(entry, dict):
        raise _wrong(where, "indications", entry, '{ name = "D51", unit = "lbf" }')
    check_keys(entry, ("name", "unit", "serial"), where=f"{where}: indications")
    name, text = entry.get("name"), entry.get("unit")
    if not isinstance(name, str) or not isinstance(text, str):
        raise _wrong(where, "indications", entry, '{ name = "D51", unit = "lbf" }')
    serial = entry.get("serial")
    return Indication(
        name=name,
        unit=unit(text, where=f"{where}: indications, {name}").text,
        serial=None if serial is None else str(serial),
    )


def _load(entry: Any, cells: tuple[Indication, ...], where: object) -> LoadFit:
    if not isinstance(entry, dict):
        raise _wrong(where, "loads", entry, "tables [[loads]]")
    check_keys(entry, ("load", "unit", "coefficients"), where=f"{where}: loads")
    typed = entry.get("coefficients")
    name, text = entry.get("load"), entry.get("unit")
    if not isinstance(name, str) or not isinstance(text, str) or not isinstance(typed, dict) or not typed:
        raise _wrong(where, "loads", entry, "load, unit and coefficients")
    cell_names = {cell.name for cell in cells}
    for term, value in typed.items():
        try:
            parsed = parse_term(term)
        except ToolkitError as error:
            raise _wrong(where, f"{name}.{term}", term, str(error.expected)) from error
        used_names = {n for n, _ in parsed.powers} | set(parsed.absolutes)
        if not used_names <= cell_names:
            raise _wrong(where, f"{name}.{term}", term, ", ".join((*sorted(cell_names), INTERCEPT)))
        if not is_number(value):
            raise _wrong(where, f"{name}.{term}", value, "a number")
    terms = tuple(typed)
    if INTERCEPT in terms and terms[-1] != INTERCEPT:
        raise _wrong(where, f"{name}.coefficients", ", ".join(terms), "the intercept last")
    values = tuple(float(value) for value in typed.values())
    return LoadFit(
        load=name,
        unit=unit(text, where=f"{where}: {name}.unit").text,
        terms=terms,
        coefficients=values,
        issued=values,
        polarity=polarity(values),
        method="legacy",
    )


def _list(table: dict[str, Any], key: str, where: object) -> list[Any]:
    if not isinstance(table[key], list) or not table[key]:
        raise _wrong(where, key, table[key], "at least one entry")
    return list(table[key])


def _date(value: object, where: object) -> str:
    try:
        return dt.date.fromisoformat(str(value)).isoformat()
    except ValueError as error:
        raise _wrong(where, "date", value, "a date such as 2026-03-31") from error


def _wrong(where: object, key: str, got: object, expected: str) -> ConfigError:
    return wrong(where, key, got, expected, "legacy")
