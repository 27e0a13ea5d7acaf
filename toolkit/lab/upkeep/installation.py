"""What this installation lacks, with the command that mends it, and what it computes: its qualification."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from typing import Annotated, TypedDict

from toolkit.errors import RenderError
from toolkit.listing import table
from toolkit.qualification.model import Check, QualificationRecord
from toolkit.report.word.office import SOFFICE, find_soffice
from toolkit.system import is_administrator

PACKAGES = (
    "libreoffice-writer-nogui fonts-crosextra-carlito fonts-crosextra-caladea fonts-liberation2 poppler-utils"
)
_FONTS = ("Carlito", "Caladea", "Liberation Sans")


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineNeed:
    """What this computer has, and what it is needed for."""

    name: str
    ok: bool
    found: str
    needed_for: str


class DoctorAnswer(TypedDict):
    """What this computer lacks."""

    checks: list[MachineNeed]
    mend: Annotated[str | None, "command that mends it; null where nothing is missing"]


def doctor_answer() -> tuple[DoctorAnswer, str]:
    """Return what is looked for, Python, programs and fonts, and the command that mends it; as text too."""
    needs = [_python(), *_programs(), *_fonts()]
    missing = [need for need in needs if not need.ok]
    mend = _mending_command() if missing else None
    if [need.name for need in missing] == ["soffice"] and os.environ.get(SOFFICE):
        mend = f"unset {SOFFICE}"
    rows = [["ok" if need.ok else "MISSING", need.name, need.found, need.needed_for] for need in needs]
    text = table(["", "what", "found", "needed for"], rows, align="<<<<")
    text += f"\n\nmend it with:\n  {mend}" if mend else "\n\nnothing is missing"
    return {"checks": needs, "mend": mend}, text


def _mending_command() -> str:
    sudo = "" if is_administrator() else "sudo "
    return f"{sudo}sh -c 'apt-get update && apt-get install -y --no-install-recommends {PACKAGES}'"


def _python() -> MachineNeed:
    version = ".".join(map(str, sys.version_info[:3]))
    return MachineNeed(
        name="Python 3.11+", ok=sys.version_info >= (3, 11), found=version, needed_for="everything"
    )


def _programs() -> list[MachineNeed]:
    programs = [_soffice()]
    for program in ("pdftotext", "pdffonts", "pdfinfo"):
        path = shutil.which(program)
        programs.append(
            MachineNeed(
                name=program, ok=path is not None, found=path or "not found", needed_for="verifying PDFs"
            )
        )
    return programs


def _soffice() -> MachineNeed:
    try:
        found, ok = find_soffice(), True
    except RenderError as error:
        found, ok = f"{SOFFICE}={error.got}" if os.environ.get(SOFFICE) else "not found", False
    return MachineNeed(name="soffice", ok=ok, found=found, needed_for="reports as PDF")


def _fonts() -> list[MachineNeed]:
    listed = ""
    if shutil.which("fc-list"):
        listed = subprocess.run(
            ["fc-list", ":", "family"], capture_output=True, text=True, check=False, timeout=30
        ).stdout
    return [
        MachineNeed(
            name=f"font {font}",
            ok=font in listed,
            found="installed" if font in listed else "not found",
            needed_for="templates keep their line breaks",
        )
        for font in _FONTS
    ]


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
