"""What a SESSION.toml decides about a record, derived from its text alone.

A session is read with it, and a stored record is held against it on every load: each entry of the hashed
content that is no number of the fit must follow from the session file that lies beside the record.
"""

from __future__ import annotations

import datetime as dt
import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

from toolkit.calibration.records.record import ZEROS, Zero, canonical
from toolkit.calibration.terms import INTERCEPT, MODELS, NAME, model_terms
from toolkit.days import parse_day
from toolkit.errors import ConfigError, ToolkitError
from toolkit.files import is_number, number_expected, parse_toml, sha256_bytes
from toolkit.units import si_scale, unit

_ENCODER = json.JSONEncoder(
    sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False, default=str
)
METHODS = ("ols", "wls", "gls", "odr")
DEFAULT_TOLERANCE = 1e-3
_MOST_PRELOADS = 99
# It is a folder's name and the beginning of files' names, which file systems limit to 255 bytes.
INSTRUMENT = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,199}\Z")
INSTRUMENT_FORM = "letters, digits, '-', '_' and '.', 200 at most"
_CHECK_VALUE, _CHECK_TABLE = re.compile(r"(?m)^\s*check\s*="), re.compile(r"(?m)^\s*\[\s*check\s*\]")


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """The settings of a session.

    ``serials`` stand in the order of ``indications``. ``check`` is the check file's name as written;
    ``check_table`` tells that a table ``[check]`` is there, which without a name means check.csv where that
    exists. ``tolerances`` are the entries of ``[check] tolerance`` as written. ``text`` is the canonical
    JSON of everything that decides about the fit.
    """

    instrument: str
    date: dt.date
    operator: str
    indications: tuple[str, ...]
    loads: tuple[str, ...]
    serials: tuple[str | None, ...]
    model: str
    degree: int
    method: str
    terms: tuple[str, ...]
    zero: Zero
    phase: str | None
    check: str | None
    check_table: bool
    tolerances: tuple[tuple[str, Any], ...]
    text: str

    def tolerance(self, load: str, load_unit: str, largest: float, where: object) -> float:
        """Return the check loads' tolerance in the load's unit: as stated, else 0.1 % of the largest load.

        Raises
        ------
        ConfigError, UnitError
            the stated one is not positive, or its unit is not one of the load
        """
        stated = dict(self.tolerances)
        if load not in stated:
            return DEFAULT_TOLERANCE * largest
        place = f"{where}: check.tolerance.{load}"
        found = unit(load_unit)
        tolerance = quantity(stated[load], found.dimension, place) / found.factor
        if not (math.isfinite(tolerance) and tolerance > 0):
            raise wrong(where, f"check.tolerance.{load}", tolerance, "a positive number")
        return tolerance


def parse_session(data: bytes, *, where: object, entered: bool = False) -> dict[str, Any]:
    """Parse the text of a SESSION.toml; ``entered``: it lies beside a record.

    Raises
    ------
    ConfigError
        ``unprintable``; ``not-toml``, with a hint where ``check`` stands as a value and as a table
    """
    try:
        return parse_toml(data, where=where, entered=entered)
    except ToolkitError as error:
        text = data.decode("utf-8", "replace")
        if not (_CHECK_VALUE.search(text) and _CHECK_TABLE.search(text)):
            raise
        raise ConfigError(
            "check stands twice: as a value and as a table [check]",
            where=where,
            got=error.got,
            expected='one table: [check] with file = "check.csv" and tolerance = { FY = { value, unit } }',
            next_step='remove the line check = "...", and write file = "..." inside [check]; '
            "nothing was written",
            rule="not-toml",
        ) from error


def settings_of(raw: Mapping[str, Any], *, where: object) -> Settings:
    """Derive the settings of a parsed session.

    Raises
    ------
    ConfigError
        an entry is missing, or has a value that cannot be
    SessionError
        a term to drop is not in the model
    """
    if raw.get("schema", 1) != 1:
        raise wrong(where, "schema", raw["schema"], "1")
    instrument = _text(raw, "instrument", where)
    if not INSTRUMENT.match(instrument):
        raise wrong(where, "instrument", instrument, INSTRUMENT_FORM)
    indications, loads = _names(raw, "indications", where), _names(raw, "loads", where)
    if set(indications) & set(loads):
        raise wrong(where, "loads", ", ".join(loads), "names that are no indications")
    model = _choice(raw, "model", MODELS, "linear", where)
    degree = _degree(raw, model, where)
    drop = raw.get("drop", [])
    if not isinstance(drop, list) or not all(isinstance(name, str) for name in drop):
        raise wrong(where, "drop", drop, "a list of term names")
    check, tolerances = _check_entry(raw, where)
    preloads_of(raw, where)
    settings = {key: value for key, value in raw.items() if key not in ("data", "check")}
    settings["tolerance"] = tolerances
    return Settings(
        instrument=instrument,
        date=date_of(raw.get("date"), "date", where),
        operator=_text(raw, "operator", where),
        indications=tuple(indications),
        loads=tuple(loads),
        serials=tuple(_serial(raw, name, where) for name in indications),
        model=model,
        degree=degree,
        method=_choice(raw, "method", METHODS, "ols", where),
        terms=model_terms(model, indications, degree=degree, drop=drop),
        zero=cast("Zero", _choice(raw, "zero", ZEROS, "included", where)),
        phase=None if "phase" not in raw else _choice(raw, "phase", ("as_found", "as_left"), "", where),
        check=check,
        check_table=isinstance(raw.get("check"), dict),
        tolerances=tuple(tolerances.items()),
        text=_text_of(settings, where),
    )


def dcc_name(raw: Mapping[str, Any]) -> str | None:
    """Return the name of the standard's digital certificate, ``[reference] dcc``; None without one."""
    reference = raw.get("reference", {})
    name = reference.get("dcc") if isinstance(reference, Mapping) else None
    return name if isinstance(name, str) else None


def preloads_of(raw: Mapping[str, Any], where: object) -> int | None:
    """Return ``[standard] preloads``: how often the largest load was applied before the first run.

    A class of ISO 376 needs it; None where it is not stated.

    Raises
    ------
    ConfigError
        it is no whole number from 0 to 99
    """
    entry = raw.get("standard", {})
    if not isinstance(entry, dict):
        raise wrong(where, "standard", entry, "a table [standard] with preloads = 3")
    preloads = entry.get("preloads")
    if preloads is None:
        return None
    if isinstance(preloads, bool) or not isinstance(preloads, int) or not 0 <= preloads <= _MOST_PRELOADS:
        raise wrong(where, "standard.preloads", preloads, f"a whole number from 0 to {_MOST_PRELOADS}")
    return preloads


def zero_readings(raw: Mapping[str, Any]) -> Any:
    """Return the entries of [[zero]], or of [[zero.readings]] below a table ``[zero]`` with ``fit``.

    >>> zero_readings({"zero": {"fit": "tared", "readings": [{"when": "before"}]}})
    [{'when': 'before'}]
    """
    entry = raw.get("zero", [])
    if isinstance(entry, dict):
        return entry.get("readings", [])
    return [] if isinstance(entry, str) else entry


def inputs_hash(settings: str, loads: str, check: str | None) -> str:
    """Return the hash of a session's settings (canonical JSON) and of its data files' hashes."""
    return sha256_bytes(canonical([settings, loads, check]).encode())


def date_of(value: object, key: str, where: object) -> dt.date:
    """Return an entry that is a date.

    Raises
    ------
    ConfigError
        it is none
    """
    if type(value) is dt.date:
        return value
    try:
        return parse_day(cast("str", value))
    except (TypeError, ValueError) as error:
        raise wrong(where, key, value, "a date such as 2026-03-31") from error


def wrong(where: object, key: str, actual: object, expected: str, rule: str = "session") -> ConfigError:
    """Return the error of an entry that is missing (``actual`` is None) or cannot be used."""
    return ConfigError(
        f"{key} is missing" if actual is None else f"{key} has a value that cannot be used",
        where=f"{where}: {key}",
        got="nothing" if actual is None else actual,
        expected=number_expected(actual, expected),
        next_step=f"correct {key}; nothing was written",
        rule=rule,
    )


def _check_entry(raw: Mapping[str, Any], where: object) -> tuple[str | None, dict[str, Any]]:
    # TOML cannot hold check = "check.csv" and a table [check] at once: the table may name the file itself.
    entry = raw.get("check")
    if entry is None or isinstance(entry, str):
        return entry, {}
    if not isinstance(entry, dict):
        raise wrong(where, "check", entry, 'check = "check.csv", or a table [check] with file and tolerance')
    tolerance = entry.get("tolerance", {})
    if not isinstance(tolerance, dict):
        raise wrong(where, "check.tolerance", tolerance, "{ FY = { value, unit } }")
    return entry.get("file", entry.get("data")), tolerance


def _serial(raw: Mapping[str, Any], name: str, where: object) -> str | None:
    cells = raw.get("cells", {})
    if not isinstance(cells, dict):
        raise wrong(where, "cells", cells, "a table [cells]")
    cell = cells.get(name, {})
    if not isinstance(cell, dict):
        raise wrong(where, f"cells.{name}", cell, f"a table [cells.{name}]")
    return None if cell.get("serial") is None else str(cell["serial"])


def _names(raw: Mapping[str, Any], key: str, where: object) -> list[str]:
    names = raw.get(key)
    if (
        not isinstance(names, list)
        or not names
        or not all(isinstance(n, str) and NAME.match(n) for n in names)
    ):
        raise wrong(where, key, names, f'a list of names such as {key} = ["FY", "MZ"]')
    if len(set(names)) != len(names) or {"run", "direction", "rotation", INTERCEPT, "abs"} & set(names):
        raise wrong(where, key, ", ".join(names), "different names, none of them run, direction or rotation")
    return names


def _text(raw: Mapping[str, Any], key: str, where: object) -> str:
    value = raw.get(key)
    if not isinstance(value, str) or not value.strip():
        raise wrong(where, key, value, f'a text: {key} = "..."')
    return value.strip()


def _choice(raw: Mapping[str, Any], key: str, known: tuple[str, ...], default: str, where: object) -> str:
    value = raw.get(key, default)
    if key == "zero" and isinstance(value, list | dict):
        # [[zero]] readings and zero = "tared" share the key: readings say nothing about the fit's zero.
        # A table [zero] says both, as [check] does.
        value = value.get("fit", default) if isinstance(value, dict) else default
    if value not in known:
        raise wrong(where, key, value, " | ".join(known))
    return str(value)


def _degree(raw: Mapping[str, Any], model: str, where: object) -> int:
    if model != "polynomial":
        if "degree" in raw:
            raise wrong(where, "degree", raw["degree"], 'no degree, or model = "polynomial"')
        return 1 if model == "linear" else 2
    degree = raw.get("degree")
    if isinstance(degree, bool) or not isinstance(degree, int) or not 1 <= degree <= 9:
        got = repr(degree) if isinstance(degree, str) else degree
        raise wrong(where, "degree", got, "a whole number from 1 to 9")
    return degree


def _text_of(settings: dict[str, Any], where: object) -> str:
    try:
        # A date is written as its text.
        return _ENCODER.encode(settings)
    except ValueError:
        return canonical(_plain(settings, where))


def _plain(value: Any, where: object, key: str = "") -> Any:
    if isinstance(value, dict):
        return {
            str(name): _plain(item, where, f"{key}.{name}" if key else str(name))
            for name, item in value.items()
        }
    if isinstance(value, list):
        return [_plain(item, where, f"{key} {at}") for at, item in enumerate(value, start=1)]
    if isinstance(value, float) and not math.isfinite(value):
        raise wrong(where, key, value, "a finite number")
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


def quantity(entry: dict[str, Any], dimension: str, where: object) -> float:
    """Return ``{ value, unit }`` as a float in SI; the unit must have the dimension that is named."""
    if not isinstance(entry, dict) or "value" not in entry or not isinstance(entry.get("unit"), str):
        raise ConfigError(
            "a quantity has no unit",
            where=where,
            got=entry,
            expected='{ value = NUMBER, unit = "..." }',
            next_step="write value and unit",
            rule="no-unit",
        )
    number = entry["value"]
    # A float that is not finite is refused by the caller, who knows what the number is for.
    if not is_number(number) and (not isinstance(number, float) or math.isfinite(number)):
        raise ConfigError(
            "a quantity's value cannot be used", where=where, got=number,
            expected=number_expected(number, "a number"),
            next_step="write value as a plain number", rule="wrong-value",
        )  # fmt: skip
    stated = unit(entry["unit"], where=where)
    if stated.dimension == dimension:
        return float(number) * stated.factor + stated.offset
    return float(number) * si_scale(entry["unit"], dimension, where=where)
