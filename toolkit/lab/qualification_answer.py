"""What `qualify` says of this installation: the record as JSON, and as text for the auditor."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from toolkit.lab.answers import table

if TYPE_CHECKING:
    from toolkit.qualification.model import Check, QualificationRecord


def qualification_payload(record: QualificationRecord) -> dict[str, Any]:
    """Return a qualification as the JSON answer."""
    return {
        "passed": record.passed,
        "software": record.software,
        "python": record.python,
        "packages": dict(record.packages),
        "platform": record.platform,
        "date": record.date.isoformat(),
        "numbers_sha256": record.numbers_sha256,
        "checks": [dataclasses.asdict(check) for check in record.checks],
        "not_covered": [dataclasses.asdict(one) for one in record.not_covered],
    }


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
        [_verdict(one), one.group, one.name, one.quantity, one.measure, _required(one), _digits(one.reached)]
        for one in record.checks
        if one.measure != "rules"
    ]
    head = ["", "group", "name", "quantity", "measure", "required", "reached"]
    lines += [table(head, rows, align="<<<<<>>"), ""]
    rows = [
        [_verdict(one), one.name, one.quantity, _required(one), _digits(one.reached)]
        for one in record.checks
        if one.measure == "rules"
    ]
    lines.append(
        table(["", "refusal shown", "at", "must be refused by", "was refused by"], rows, align="<" * 5)
    )
    for title, told in (
        ("failed", [_reason(one) for one in record.failed]),
        ("asked for less than public QR solvers reach",
         [f"{one.name}, {one.quantity}: {one.note}" for one in record.checks
          if one.measure == "correct digits" and "more than" in one.note]),
        ("not covered", [f"{one.name}: {one.reason}" for one in record.not_covered]),
    ):  # fmt: skip
        if told:
            lines += ["", f"{title}:", *(f"  {line}" for line in told)]
    verdict = f"{failed} FAILED" if failed else "all passed"
    lines += ["", f"{len(record.checks)} checks, {verdict}"]
    return "\n".join(lines)


def _verdict(one: Check) -> str:
    return "pass" if one.passed else "FAIL"


def _reason(one: Check) -> str:
    what = ", ".join(part for part in (one.group, one.name, one.quantity) if part)
    numbers = f"required {_required(one)}, reached {_digits(one.reached)}"
    return f"{what}: {numbers}" + (f"; {one.note}" if one.note else "")


def _required(one: Check) -> str:
    sign = {"correct digits": ">= ", "text": "", "rules": ""}.get(one.measure, "<= ")
    return sign + _digits(one.required)


def _digits(value: float | str | None) -> str:
    if value is None:
        return "-"
    return value if isinstance(value, str) else f"{value:.3g}"
