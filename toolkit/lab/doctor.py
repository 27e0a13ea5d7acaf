"""What this machine lacks, and the command that mends it."""

from __future__ import annotations

import shutil
import subprocess
import sys
from dataclasses import dataclass

from toolkit.system import is_administrator

PACKAGES = (
    "libreoffice-writer-nogui fonts-crosextra-carlito fonts-crosextra-caladea fonts-liberation2 poppler-utils"
)
_FONTS = ("Carlito", "Caladea", "Liberation Sans")


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One thing that the toolkit needs."""

    name: str
    ok: bool
    found: str
    needed_for: str


def checks() -> tuple[Check, ...]:
    """Return everything that is looked for: Python, programs, fonts."""
    return (_python(), *_programs(), *_fonts())


def mending_command() -> str:
    """Return the one command that installs the system's packages."""
    sudo = "" if is_administrator() else "sudo "
    return f"{sudo}sh -c 'apt-get update && apt-get install -y --no-install-recommends {PACKAGES}'"


def _python() -> Check:
    version = ".".join(map(str, sys.version_info[:3]))
    return Check(name="Python 3.11+", ok=sys.version_info >= (3, 11), found=version, needed_for="everything")


def _programs() -> list[Check]:
    programs = []
    for program, needed_for in (
        ("soffice", "reports as PDF"),
        ("pdftotext", "verifying PDFs"),
        ("pdffonts", "verifying PDFs"),
        ("pdfinfo", "verifying PDFs"),
    ):
        path = shutil.which(program)
        programs.append(
            Check(name=program, ok=path is not None, found=path or "not found", needed_for=needed_for)
        )
    return programs


def _fonts() -> list[Check]:
    listed = ""
    if shutil.which("fc-list"):
        listed = subprocess.run(
            ["fc-list", ":", "family"], capture_output=True, text=True, check=False, timeout=30
        ).stdout
    return [
        Check(
            name=f"font {font}",
            ok=font in listed,
            found="installed" if font in listed else "not found",
            needed_for="templates keep their line breaks",
        )
        for font in _FONTS
    ]
