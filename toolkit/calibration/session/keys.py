"""Every key of a SESSION.toml, declared once: the session's reader and the certificate both go by it.

Values whose meaning depends on the data or on one another (units, models, readings) are judged where they are
read; all of it happens before anything is fitted or written.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from toolkit.calibration.session.declaration import Fault, Table, Value, faults_of, is_date, is_text

TEXTS = (
    "number laboratory address place country accreditation customer customer_address item method "
    "decision_rule interval opinions"
).split()
DATES = ("received", "due")
DECISION_RULES: Mapping[str, str] = {
    "simple": "simple",
    "simple acceptance": "simple",
    "guard band": "guard_band",
    "guard band w=u": "guard_band",
    "guarded acceptance": "guard_band",
    "guarded": "guard_band",
    "w=u": "guard_band",
}


def rule_of(text: str) -> str | None:
    """Return the decision rule that a session names; None for a text that names none.

    >>> rule_of("guard band, w = U"), rule_of("Simple acceptance"), rule_of("by eye")
    ('guard_band', 'simple', None)
    """
    plain = " ".join(text.lower().replace("_", " ").replace("-", " ").replace(",", " ").split())
    return DECISION_RULES.get(plain.replace(" = ", "=").replace("= ", "=").replace(" =", "="))


_TEXT, _DATE, _ANY = Value("a text", is_text), Value("a date such as 2026-03-31", is_date), Value("")
_NAMES = Value('a list of names such as ["FY", "MZ"]', required=True)
_CERTIFICATE = Table(
    {
        **dict.fromkeys(TEXTS, _TEXT),
        **dict.fromkeys(DATES, _DATE),
        # As the digital certificate's schema has it: DCC 3.3.0, stringISO3166Type.
        "country": Value(
            'an ISO 3166-1 code, such as "US"',
            lambda text: isinstance(text, str) and re.fullmatch("[A-Z]{2}", text) is not None,
        ),
        "decision_rule": Value(
            "simple | guard_band", lambda text: isinstance(text, str) and rule_of(text) is not None
        ),
        "interval_agreed": Value("true or false", lambda value: isinstance(value, bool)),
    }
)
_READING = Table(
    {"when": Value('a text: "before", "after", "run 1", "shunt"', required=True),
     "values": Value("{ indication = number }, or a list of numbers", required=True)},
    rows=True,
)  # fmt: skip
_CREEP = Table(
    {"load": Value("a load, a number, or { value, unit }", required=True),
     "seconds": Value("seconds, zero or more", required=True),
     "value": Value("{ indication = number }", required=True)},
    rows=True,
)  # fmt: skip
_UNCERTAINTY = Table(
    {"U": Value("a number, zero or more", required=True),
     "k": Value("a positive number", required=True),
     "unit": Value(
         "a unit of the load such as 'N', or '%' of the applied load",
         lambda value: isinstance(value, str), required=True, rule="no-unit",
     )},
)  # fmt: skip
_BETWEEN = Table(
    {"zero": Value("a standard deviation, zero or more", required=True),
     "gain": Value("a standard deviation at the largest load, zero or more", required=True),
     "unit": Value("a unit of the load such as 'N'", is_text, required=True)},
)  # fmt: skip
_CELL = Table(
    dict.fromkeys(
        "serial resolution scale excitation shunt_expected shunt_measured shunt_tolerance u "
        "temperature_coefficient replacement".split(),
        _ANY,
    )
)
_POLARITY = Table(
    {"load": Value('the name of a load, such as load = "FY"', required=True),
     "value": Value("the load that was applied: { value, unit }", required=True),
     "indications": Value("what it made: { NAME = { value, unit } }", required=True),
     "zero": _ANY, "tolerance": _ANY},
    rows=True,
)  # fmt: skip
SESSION = Table(
    {
        **dict.fromkeys("schema phase model degree method drop".split(), _ANY),
        "temperature": Value('{ value = 20, unit = "degC" }', lambda value: isinstance(value, dict)),
        "instrument": Value('a text: instrument = "..."', required=True),
        "date": Value("a date such as 2026-03-31", is_date, required=True),
        "operator": Value(
            'a text: operator = "..."', lambda text: isinstance(text, str) and is_text(text), required=True
        ),
        "indications": _NAMES,
        "loads": _NAMES,
        "data": Value('the name of a file, such as data = "loads.csv" or "loads.xlsx"', required=True),
        "check": Table(
            {"file": _ANY, "data": _ANY, "tolerance": Table(_ANY, keyed="loads")},
            otherwise=Value(
                'check = "check.csv", or a table [check] with file and tolerance',
                lambda name: isinstance(name, str) and bool(name),
            ),
        ),
        "reference": Table(
            {
                "standard": Value('a text: standard = "..."', is_text),
                "certificate": Value('a text: certificate = "..."', is_text),
                "due": _DATE,
                "shared_group": Table({"column": _ANY, "error": _ANY}, otherwise=_ANY),
                "uncertainty": Table(_UNCERTAINTY, keyed="loads"),
            }
        ),
        "between_runs": Table(_BETWEEN, keyed="loads"),
        "cells": Table(_CELL, keyed="indications"),
        "zero": Table(
            {"fit": _ANY, "readings": _READING}, otherwise=Table(_READING.entries, rows=True, otherwise=_ANY)
        ),
        "creep": _CREEP,
        "polarity": _POLARITY,
        "certificate": _CERTIFICATE,
        "standard": Table({"preloads": _ANY}),
    }
)


def session_faults(raw: Mapping[str, Any]) -> tuple[Fault, ...]:
    """Return every entry of a parsed session that is unknown, missing or of the wrong kind."""
    names = {key: _names(raw.get(key)) for key in ("loads", "indications")}
    return faults_of(raw, SESSION, names)


def certificate_faults(table: Mapping[str, Any]) -> tuple[Fault, ...]:
    """Return the faults of a session's ``[certificate]``: records from before these checks may have some."""
    return faults_of(table, _CERTIFICATE, {})


def _names(entry: object) -> tuple[str, ...]:
    return tuple(name for name in entry if isinstance(name, str)) if isinstance(entry, list) else ()
