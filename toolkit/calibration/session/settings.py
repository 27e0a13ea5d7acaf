"""What a SESSION.toml decides about a record, derived from its text alone.

A session is read with it, and a stored record is held against it on every load: each entry of the hashed
content that is no number of the fit must follow from the session file that lies beside the record.
"""

from __future__ import annotations

import datetime as dt
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from toolkit.calibration.records.record import DEFAULT_TOLERANCE, canonical
from toolkit.calibration.session.session_file import CheckTable, SessionFile, session_entries
from toolkit.calibration.terms import model_terms
from toolkit.errors import ConfigError, ToolkitError
from toolkit.files import number_expected, parse_toml, sha256_bytes
from toolkit.units import unit

# `canonical`, but that a date is written as its text.
_ENCODER = json.JSONEncoder(
    sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False, default=str
)
_CHECK_VALUE, _CHECK_TABLE = re.compile(r"(?m)^\s*check\s*="), re.compile(r"(?m)^\s*\[\s*check\s*\]")
_DEGREES = {"linear": 1, "balance": 2}


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """The settings of a session: its entries, and what follows from them.

    ``text`` is the canonical JSON of everything that decides about the fit.
    """

    entries: SessionFile
    degree: int
    terms: tuple[str, ...]
    text: str

    @property
    def date(self) -> dt.date:
        """The day of the session."""
        return dt.date.fromisoformat(self.entries.date)

    @property
    def serials(self) -> tuple[str | None, ...]:
        """Serial numbers in the order of the indications."""
        return tuple(self.entries.cell(name).serial for name in self.entries.indications)

    def tolerance(self, load: str, load_unit: str, largest: float, where: object) -> float:
        """Return the check loads' tolerance in the load's unit: as stated, else 0.1 % of the largest load.

        Raises
        ------
        ConfigError, UnitError
            the stated one is not positive, or its unit is not one of the load
        """
        check = self.entries.check
        stated = dict(check.tolerance).get(load) if isinstance(check, CheckTable) else None
        if stated is None:
            return DEFAULT_TOLERANCE * largest
        load_scale = unit(load_unit)
        tolerance = stated.si(load_scale.dimension, f"{where}: check.tolerance.{load}") / load_scale.factor
        if not tolerance > 0:
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
    """Derive the settings of a parsed session that was accepted.

    Raises
    ------
    ConfigError
        an entry is missing, or has a value that cannot be
    SessionError
        a term to drop is not in the model
    """
    entries = session_entries(raw, where=where)
    check = raw.get("check")
    # The files have hashes of their own.
    settings = {key: value for key, value in raw.items() if key not in ("data", "check")}
    settings["tolerance"] = check.get("tolerance", {}) if isinstance(check, dict) else {}
    degree = entries.degree or _DEGREES[entries.model]
    return Settings(
        entries=entries,
        degree=degree,
        terms=model_terms(entries.model, entries.indications, degree=degree, drop=entries.drop),
        text=_text_of(settings, where),
    )


def dcc_name(raw: Mapping[str, Any]) -> str | None:
    """Return the name of the standard's digital certificate, ``[reference] dcc``; None without one."""
    reference = raw.get("reference", {})
    name = reference.get("dcc") if isinstance(reference, Mapping) else None
    return name if isinstance(name, str) else None


def inputs_hash(settings: str, loads: str, check: str | None) -> str:
    """Return the hash of a session's settings (canonical JSON) and of its data files' hashes."""
    return sha256_bytes(canonical([settings, loads, check]).encode())


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


def _text_of(settings: dict[str, Any], where: object) -> str:
    try:
        return _ENCODER.encode(settings)
    except ValueError as error:  # below a key that is not declared: all others are finite
        raise wrong(where, "a number", error, "a finite number") from error
