"""What a report says beyond the measurement: ``[report]`` of ``test.toml``, by ISO/IEC 17025 7.8."""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from toolkit.errors import ConfigError
from toolkit.files import check_keys


@dataclass(frozen=True, slots=True, kw_only=True)
class Opinion:
    """A statement that is not a result: an opinion or interpretation, and what it rests on (7.8.7)."""

    statement: str
    basis: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportDetails:
    """Facts of one report; None where nothing is said.

    Attributes
    ----------
    customer, customer_contact : for whom the test was made (7.8.2.1 e)
    item, condition, received : what was tested, in which state, and the day it came, ISO 8601 (g, h)
    location : where the activity was performed (c)
    method, deviations, sampling : the method, what was added or left out, the sampling plan (f, n, k)
    conformity : a statement of conformity with a requirement (7.8.3.1 b)
    external : results that come from another laboratory (p)
    authorised_by, function : who authorises the report (o)
    amends, amendment : the report that this one replaces, and why (7.8.8)
    opinions : opinions and interpretations
    """

    customer: str | None = None
    customer_contact: str | None = None
    item: str | None = None
    condition: str | None = None
    received: str | None = None
    location: str | None = None
    method: str | None = None
    deviations: str | None = None
    sampling: str | None = None
    conformity: str | None = None
    external: str | None = None
    authorised_by: str | None = None
    function: str | None = None
    amends: str | None = None
    amendment: str | None = None
    opinions: tuple[Opinion, ...] = ()


KEYS = tuple(field.name for field in fields(ReportDetails))


def read_details(table: Any, *, where: object) -> ReportDetails:
    """Return the details of a ``[report]`` table.

    Raises
    ------
    ConfigError
        no table, an unknown key, a value of the wrong type, an amendment without its report or its reason
    """
    if not isinstance(table, dict):
        raise wrong_value(where, "report", table, "a table [report]")
    check_keys(table, KEYS, where=f"{where}, [report]")
    texts = {
        key: _text(value, key, where) for key, value in table.items() if key not in ("received", "opinions")
    }
    if ("amends" in texts) != ("amendment" in texts):
        raise wrong_value(where, "report.amends", texts.get("amends"), "amends and amendment, both or none")
    return ReportDetails(
        **texts,
        received=iso_day(table["received"], "report.received", where) if "received" in table else None,
        opinions=tuple(_opinion(one, where) for one in _list(table.get("opinions", []), where)),
    )


def _opinion(entry: Any, where: object) -> Opinion:
    if isinstance(entry, Mapping):
        check_keys(entry, ("statement", "basis"), where=f"{where}, [[report.opinions]]")
        basis = _text(entry["basis"], "opinions.basis", where) if "basis" in entry else None
        return Opinion(statement=_text(entry.get("statement"), "opinions.statement", where), basis=basis)
    return Opinion(statement=_text(entry, "opinions", where))


def _list(value: Any, where: object) -> list[Any]:
    if not isinstance(value, list):
        raise wrong_value(where, "report.opinions", value, "a list of statements")
    return value


def iso_day(value: Any, key: str, where: object) -> str:
    """Return a date of a settings file, a TOML date or text, as YYYY-MM-DD.

    Raises
    ------
    ConfigError
        ``wrong-value``
    """
    if isinstance(value, dt.datetime):
        return value.date().isoformat()
    if isinstance(value, dt.date):
        return value.isoformat()
    try:
        return dt.date.fromisoformat(value).isoformat()
    except (TypeError, ValueError) as error:
        raise wrong_value(where, key, value, "a date such as 2026-03-31") from error


def _text(value: Any, key: str, where: object) -> str:
    if not isinstance(value, str) or not value.strip():
        raise wrong_value(where, f"report.{key}", value, "a text")
    return value.strip()


def wrong_value(where: object, key: str, got: object, expected: str) -> ConfigError:
    """Return the error of a key whose value does not fit."""
    return ConfigError(
        f"{key!r} has a value that does not fit",
        where=where,
        got=got,
        expected=expected,
        next_step="correct the line",
        rule="wrong-value",
    )
