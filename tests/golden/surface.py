"""What the golden files call: the command line, the packaged data, and the generators beside the tests.

The one place to mend when something of the toolkit or of its tests moves.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
CALIBRATIONS = ROOT / "calibrations"
TEMPLATES = ROOT / "report_templates"
PLANS = ROOT / "toolkit" / "examples" / "virtual"
FIGURE_4_4 = ROOT / "toolkit" / "examples" / "fig4_4" / "M15_fig4_4.xlsx"
PROOFS = ROOT / "proof"


def run_command(arguments: list[str]) -> int:
    """Run ``toolkit`` in this process and return its exit code."""
    from toolkit.cli.main import run

    try:
        run(arguments)
    except SystemExit as end:
        return int(end.code or 0)


def package_folder() -> Path:
    """Return the folder of the package that answers."""
    import toolkit

    return Path(toolkit.__file__).parent


def make_archive(folder: Path, *, files: int, rows: int, seed: int) -> tuple[Path, Path]:
    """Write an archive whose grades are known by its making, and its registry; return both folders."""
    from tests.benchmarks.archive_factory import make_archive as make

    archive = make(folder, files=files, rows=rows, seed=seed)
    return archive.folder, archive.calibrations


def read_proof(name: str) -> tuple[int, dict[str, Any], dict[str, Any]]:
    """Return an opened batch: its seed, the sealed truth and the tool's answer of each case."""
    from proof import proof_file

    proof = proof_file.read(PROOFS / f"proof-{name}.jsonl.gz")
    return proof.seed, proof.sealed, {case: row.answer for case, row in proof.cases.items()}


def write_proof_case(folder: Path, *, seed: int, index: int, bucket: str) -> dict[str, Any]:
    """Draw one case of a batch again and write it; return what is true of it."""
    from proof.draw import draw_case
    from proof.files import write_case

    drawn = draw_case(seed, index, bucket)
    write_case(drawn.scenario, drawn.measured, folder)
    return dict(drawn.answer)


def enter_proof_sessions(case: Path, calibrations: Path) -> bool:
    """Enter the sessions of a proof case into a new registry, where it has any; return whether it has."""
    from proof.files import SESSIONS, enter

    if not (case / SESSIONS).is_dir():
        return False
    enter(sorted((case / SESSIONS).iterdir()), calibrations, [str(Path(sys.executable).with_name("toolkit"))])
    return True
