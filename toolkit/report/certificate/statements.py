"""What people stated for a certificate: the session's ``[certificate]`` table, then the style file.

The session's table is part of the record and hashed with it; the laboratory's own name and address may
stand in the style file (``org.toml``) beside the template instead.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from toolkit.calibration.session.certificate import TEXTS, certificate_faults, rule_of
from toolkit.days import parse_day
from toolkit.declared import Fault
from toolkit.errors import ConfigError
from toolkit.findings import Finding
from toolkit.report.style import Style

Verdict = Literal["pass", "conditionalPass", "conditionalFail", "fail"]
VERDICTS: dict[str, str] = {
    "pass": "pass",
    "conditionalPass": "conditional pass",
    "conditionalFail": "conditional fail",
    "fail": "fail",
}


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
    findings = [_told(fault, where) for fault in certificate_faults(table)]
    texts |= {name: " ".join(str(table[name]).split()) for name in TEXTS if name in table}
    return Stated(
        texts=texts,
        received=_date(table, "received"),
        rule=rule_of(texts.get("decision_rule", "")),
        interval=_interval(table, texts, recall, where, findings),
        findings=tuple(findings),
    )


def _interval(
    table: Mapping[str, Any],
    texts: Mapping[str, str],
    recall: str | None,
    where: str,
    findings: list[Finding],
) -> str | None:
    due = _date(table, "due")
    interval = texts.get("interval") or recall
    if not table.get("interval_agreed", False):
        return None
    if due is None and interval is None:
        findings.append(
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


def _told(fault: Fault, where: str) -> Finding:
    """Return the finding of an entry of a record from before sessions were checked for it, or refuse it."""
    if fault.kind == "unknown":
        message = f"{fault.name!r} is not known and is not printed; {fault.hint}"
        return Finding(rule="certificate-key", where=f"{where}: [certificate]", message=message)
    if fault.name == "decision_rule" and _is_text(fault.got):
        message = f"decision rule {fault.got!r} is not known ({fault.expected}): no conformity is stated"
        return Finding(rule="certificate-rule", where=where, message=message)
    if fault.name == "country" and _is_text(fault.got):
        message = f"country {fault.got!r} is not {fault.expected}"
        return Finding(rule="certificate-country", where=where, message=message)
    raise ConfigError(
        f"[certificate] {fault.name} cannot be printed",
        where=f"{where}: [certificate] {fault.name}",
        got=fault.got if str(fault.got).strip() else "an empty text",
        expected=fault.expected,
        next_step="correct the session and calibrate again: the statement belongs to the record",
        rule="certificate-statement",
    )


def _is_text(value: object) -> bool:
    # A whole number may stand without quotes.
    return (isinstance(value, str) and bool(value.strip())) or type(value) is int


def _date(table: Mapping[str, Any], key: str) -> dt.date | None:
    return parse_day(str(table[key])) if key in table else None


# Decision rules of a conformity statement: ILAC-G8:09/2019, clauses 4.2.1 and 4.2.3.


RULES = {
    "simple": (
        "Simple acceptance (ILAC-G8:09/2019, 4.2.1): pass where |deviation| does not exceed the tolerance, "
        "else fail. The uncertainty is not part of the limit: for a deviation at the tolerance the risk of a "
        "false acceptance, or of a false rejection, is up to 50 %."
    ),
    "guard_band": (
        "Guard band w = U (ILAC-G8:09/2019, 4.2.3): pass where |deviation| does not exceed tolerance - U; "
        "conditional pass up to the tolerance; conditional fail up to tolerance + U; fail beyond. The risk "
        "of a false acceptance is at most 2.5 % for pass and 50 % for conditional pass; the risk of a false "
        "rejection is at most 2.5 % for fail and 50 % for conditional fail."
    ),
}


def decide(rule: str, deviation: float, tolerance: float, U: float) -> Verdict:
    """Return the statement of one deviation; all three in one unit.

    >>> [decide("guard_band", e, 1.0, 0.2) for e in (0.8, -0.9, 1.1, 1.3)]
    ['pass', 'conditionalPass', 'conditionalFail', 'fail']
    >>> decide("simple", 1.0, 1.0, 0.2), decide("simple", -1.01, 1.0, 0.2)
    ('pass', 'fail')
    """
    size = abs(deviation)
    if rule == "simple":
        return "pass" if size <= tolerance else "fail"
    if size <= tolerance - U:
        return "pass"
    if size <= tolerance:
        return "conditionalPass"
    return "conditionalFail" if size <= tolerance + U else "fail"
