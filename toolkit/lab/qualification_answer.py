"""What `qualify` says of this installation: the record as JSON, and as text for the auditor."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, TypedDict

from toolkit.declared.answers import entry_of
from toolkit.lab.answers import table
from toolkit.qualification.model import Check, NotCovered

if TYPE_CHECKING:
    from toolkit.qualification.model import QualificationRecord


class QualifyAnswer(TypedDict):
    """What this installation computes, held against certified values."""

    passed: bool
    software: str
    python: str
    packages: Annotated[Mapping[str, str], "versions that change numbers"]
    platform: str
    date: str
    numbers_sha256: str
    checks: list[Check]
    not_covered: list[NotCovered]


def qualification_payload(record: QualificationRecord) -> QualifyAnswer:
    """Return a qualification as the JSON answer."""
    return entry_of(QualifyAnswer, record)


def qualification_text(record: QualificationRecord) -> str:
    """Return a qualification for people."""
    packages = ", ".join(f"{name} {number}" for name, number in record.packages)
    failed = len(record.failed)
    lines = [
        "Qualification record (ISO/IEC 17025:2017, 7.11)",
        f"software   toolkit {record.software}, Python {record.python}, {record.platform}",
        f"libraries  {packages}",
        f"date       {record.date.isoformat()}",
        f"numbers    sha256 {record.numbers_sha256}",
        "",
    ]
    rows = [
        [
            _verdict(check),
            check.group,
            check.name,
            check.quantity,
            check.measure,
            _required(check),
            _digits(check.reached),
        ]
        for check in record.checks
        if check.measure != "rules"
    ]
    head = ["", "group", "name", "quantity", "measure", "required", "reached"]
    lines += [table(head, rows, align="<<<<<>>"), ""]
    rows = [
        [_verdict(check), check.name, check.quantity, _required(check), _digits(check.reached)]
        for check in record.checks
        if check.measure == "rules"
    ]
    lines.append(
        table(["", "refusal shown", "at", "must be refused by", "was refused by"], rows, align="<" * 5)
    )
    for title, notes in (
        ("failed", [_reason(check) for check in record.failed]),
        ("asked for less than public QR solvers reach",
         [f"{check.name}, {check.quantity}: {check.note}" for check in record.checks
          if check.measure == "correct digits" and "more than" in check.note]),
        ("not covered", [f"{gap.name}: {gap.reason}" for gap in record.not_covered]),
    ):  # fmt: skip
        if notes:
            lines += ["", f"{title}:", *(f"  {line}" for line in notes)]
    verdict = f"{failed} FAILED" if failed else "all passed"
    lines += ["", f"{len(record.checks)} checks, {verdict}"]
    return "\n".join(lines)


def _verdict(check: Check) -> str:
    return "pass" if check.passed else "FAIL"


def _reason(check: Check) -> str:
    place = ", ".join(part for part in (check.group, check.name, check.quantity) if part)
    numbers = f"required {_required(check)}, reached {_digits(check.reached)}"
    return f"{place}: {numbers}" + (f"; {check.note}" if check.note else "")


def _required(check: Check) -> str:
    sign = {"correct digits": ">= ", "text": "", "rules": ""}.get(check.measure, "<= ")
    return sign + _digits(check.required)


def _digits(value: float | str | None) -> str:
    if value is None:
        return "-"
    return value if isinstance(value, str) else f"{value:.3g}"
