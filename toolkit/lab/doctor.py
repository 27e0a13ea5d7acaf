"""What this machine lacks, and the command that mends it."""

from __future__ import annotations

import shutil
import subprocess
import sys
from dataclasses import dataclass
from typing import Annotated, TypedDict

from toolkit.lab.answers import table
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
    mend = None if all(need.ok for need in needs) else _mending_command()
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
    programs = []
    for program, needed_for in (
        ("soffice", "reports as PDF"),
        ("pdftotext", "verifying PDFs"),
        ("pdffonts", "verifying PDFs"),
        ("pdfinfo", "verifying PDFs"),
    ):
        path = shutil.which(program)
        programs.append(
            MachineNeed(name=program, ok=path is not None, found=path or "not found", needed_for=needed_for)
        )
    return programs


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
