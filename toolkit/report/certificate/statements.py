"""What people stated for a certificate: the session's ``[certificate]`` table, then the style file.

The session's table is part of the record and hashed with it; the laboratory's own name and address may
stand in the style file (``org.toml``) beside the template instead.
"""

from __future__ import annotations

import datetime as dt
import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from toolkit.errors import ConfigError
from toolkit.findings import Finding
from toolkit.report.certificate.decision import rule_of
from toolkit.report.style import Style

TEXTS = (
    "number laboratory address place country accreditation customer customer_address item method "
    "decision_rule interval opinions"
).split()
KEYS = (*TEXTS, "received", "due", "interval_agreed")


@dataclass(frozen=True, slots=True, kw_only=True)
class Stated:
    """The stated texts by name (absent ones are missing), the dates, and what was wrong with the rest.

    ``rule`` is None where no decision rule, or none that is known, was named. ``interval`` is set only
    where it was agreed with the customer (ISO/IEC 17025:2017, 7.8.4.3).
    """

    texts: Mapping[str, str]
    received: dt.date | None
    rule: str | None
    interval: str | None
    findings: tuple[Finding, ...]

    def get(self, name: str) -> str | None:
        """Return a stated text, None where there is none."""
        return self.texts.get(name)


def read_stated(table: Mapping[str, Any], style: Style, *, recall: str | None, where: str) -> Stated:
    """Return what was stated.

    Parameters
    ----------
    table : the session's ``[certificate]``
    style : the style file, for the laboratory
    recall : the interval that the approval set, used where an agreed one is not written out
    where : the record's id, for messages

    Raises
    ------
    ConfigError
        a value of the wrong kind
    """
    texts = {
        name: value
        for name, value in (
            ("laboratory", style.laboratory),
            ("address", style.address),
            ("place", style.place),
            ("country", style.country),
            ("accreditation", style.accreditation),
        )
        if value
    }
    for name in TEXTS:
        if name in table:
            texts[name] = _text(table, name, where)
    findings = [_unknown(key, where) for key in table if key not in KEYS]
    rule = rule_of(texts["decision_rule"]) if "decision_rule" in texts else None
    if "decision_rule" in texts and rule is None:
        findings.append(
            Finding(
                rule="certificate-rule",
                where=where,
                message=f"decision rule {texts['decision_rule']!r} is not known (simple, guard_band): no "
                "conformity is stated",
            )
        )
    return Stated(
        texts=texts,
        received=_date(table, "received", where),
        rule=rule,
        interval=_interval(table, texts, recall, where, findings),
        findings=tuple(findings),
    )


def _interval(
    table: Mapping[str, Any], texts: Mapping[str, str], recall: str | None, where: str, found: list[Finding]
) -> str | None:
    agreed = table.get("interval_agreed", False)
    if not isinstance(agreed, bool):
        raise _wrong(where, "interval_agreed", agreed, "true or false")
    due = _date(table, "due", where)
    interval = texts.get("interval") or recall
    if not agreed:
        return None
    if due is None and interval is None:
        found.append(
            Finding(
                rule="certificate-interval",
                where=where,
                message="interval_agreed is true, but neither [certificate] interval nor due nor the "
                "approval's recall interval says which",
            )
        )
        return None
    parts = [f"interval {interval}"] if interval else []
    parts += [f"due {due.isoformat()}"] if due else []
    return "As agreed with the customer: " + ", ".join(parts) + "."


def _unknown(key: str, where: str) -> Finding:
    near = difflib.get_close_matches(key, KEYS, n=1, cutoff=0.5)
    hint = f"; did you mean {near[0]!r}?" if near else f"; known are {', '.join(KEYS)}"
    return Finding(
        rule="certificate-key",
        where=f"{where}: [certificate]",
        message=f"{key!r} is not known and is not printed{hint}",
    )


def _text(table: Mapping[str, Any], key: str, where: str) -> str:
    value = table[key]
    if isinstance(value, int) and not isinstance(value, bool):
        value = str(value)  # a certificate's number may be written without quotes
    if isinstance(value, str) and value.strip():
        return " ".join(value.split())
    raise _wrong(where, key, value, "a text")


def _date(table: Mapping[str, Any], key: str, where: str) -> dt.date | None:
    if key not in table:
        return None
    try:
        return dt.date.fromisoformat(str(table[key]))
    except ValueError as error:
        raise _wrong(where, key, table[key], "a date such as 2026-03-31") from error


def _wrong(where: str, key: str, got: object, expected: str) -> ConfigError:
    return ConfigError(
        f"[certificate] {key} cannot be printed",
        where=f"{where}: [certificate] {key}",
        got=got if str(got).strip() else "an empty text",
        expected=expected,
        next_step="correct the session and calibrate again: the statement belongs to the record",
        rule="certificate-statement",
    )
