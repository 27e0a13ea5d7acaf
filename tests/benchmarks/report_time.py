"""`toolkit report` as a whole process; the peer is the bare soffice conversion of the same document."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

from tests.benchmarks.timing import pairs, row
from tests.benchmarks.virtual import virtual_test
from toolkit.lab.home import packaged_home


def run(folder: Path, count: int) -> list[dict[str, object]]:
    """Time the report of the packaged virtual test and LibreOffice alone on the report it made."""
    test = virtual_test(folder)
    home = packaged_home()
    out, bare = folder / "report", folder / "bare"
    ours = [str(Path(sys.executable).with_name("toolkit")), "report", str(test), "--home", str(home), "--out",
            str(out), "--quiet"]  # fmt: skip

    def report() -> None:
        # Findings are expected: the virtual acquisition program takes E5 with the wrong sign.
        if subprocess.run(ours, capture_output=True, check=False).returncode not in (0, 1):
            raise RuntimeError("toolkit report failed")

    def convert() -> None:
        # A profile of its own each time, as every job needs one: the same profile fails when shared.
        profile = folder / "profile"
        shutil.rmtree(profile, ignore_errors=True)
        subprocess.run(
            ["soffice", f"-env:UserInstallation=file://{profile}", "--headless", "--convert-to", "pdf",
             "--outdir", str(bare), str(out / "report.docx")],
            check=True, capture_output=True,
        )  # fmt: skip

    times = pairs(report, convert, count)
    return [row("toolkit report (whole process)", times[0], "soffice converts its docx", times[1], "2")]
