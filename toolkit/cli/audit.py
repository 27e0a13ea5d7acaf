"""`toolkit audit ARCHIVE`: which calibration computed each file of an archive, and what it changes."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from toolkit.cli.console import Calibrations, Home, Json, KnownAt, Quiet, day, progress, stream, table
from toolkit.cli.home import calibrations_folder

if TYPE_CHECKING:
    from toolkit.audit.archive import ArchiveAudit

NAME = "audit"
_SHOWN = 40


def command(
    archive: Annotated[Path, typer.Argument(help="A folder of recordings, in any depth.")],
    workers: Annotated[int, typer.Option("--workers", help="Processes that read files.")] = 1,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Folder that keeps the results: an audit goes on where it was ended."),
    ] = None,
    known_at: KnownAt = None,
    calibrations: Calibrations = None,
    home: Home = None,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Tell for every file of an archive which calibration computed its Fy and Mz.

    Each file has a grade (exact, rounding, stale, sign_variant, column_swap, ambiguous, unknown, undated,
    unreadable) and a repair: the largest change of FY and MZ by the record in force on the test's date.

    Example: toolkit audit archive --workers 2 --json
    """
    from toolkit.audit.archive import audit_archive
    from toolkit.audit.inventory import inventory
    from toolkit.calibration.registry.registry import Registry

    registry = Registry(calibrations_folder(calibrations, home))
    names = inventory(archive)
    began = time.perf_counter()
    with progress(len(names), "audit", show=not quiet and not json) as step:
        made = audit_archive(
            archive, registry, known_at=day(known_at), workers=workers, step=step, names=names, out=out
        )
    seconds = time.perf_counter() - began
    if json:
        payload = _payload(made)
        payload["timing"] = {
            "seconds": seconds,
            "files_per_second": len(names) / seconds if seconds else None,
            "reused": made.reused,
        }
        stream(payload)
    elif not quiet:
        typer.echo(_text(made))
    return 0 if made.clean else 1


def _payload(made: ArchiveAudit) -> dict[str, Any]:
    return {
        "archive": made.archive,
        "known_at": made.known_at.isoformat(),
        "files": made.files.plain(),
        "summary": {"files": len(made.files), "grades": dict(made.grades), "undated": made.undated},
        "tests": iter(made.tests),
        "refused_records": [{"id": r.id, "rule": r.rule, "reason": r.reason} for r in made.refused],
        "heads": dict(made.heads),
        "findings": (finding.as_dict() for finding in made.findings),
    }


def _text(made: ArchiveAudit) -> str:
    rows = list(_rows(made))
    bad = len(made.files) - made.grades["exact"] - made.grades["rounding"]
    header = ["file", "grade", "computed by", "how", "in force", "dFY [N]", "dMZ [N·m]"]
    lines = [table(header, rows, align="<<<<<>>")] if rows else []
    if bad > len(rows):
        lines.append(f"... and {bad - len(rows)} more; --json tells all of them")
    told = ", ".join(f"{count} {grade}" for grade, count in made.grades.items() if count)
    lines += ["", f"{len(made.files)} files: {told or 'none'}; known at {made.known_at.isoformat()}"]
    notes = [one for one in made.findings if one.level == "note"]
    if notes:
        from collections import Counter

        counted = Counter(one.rule for one in notes)
        lines.append("also: " + ", ".join(f"{count} {rule}" for rule, count in sorted(counted.items())))
    lines += [f"refused record {one.id}: {one.reason}" for one in made.refused]
    lines += [f"head of {name}: {head}" for name, head in made.heads]
    return "\n".join(lines)


def _rows(made: ArchiveAudit) -> Iterator[list[str]]:
    shown = 0
    for one in made.files.plain():
        if one["grade"] in ("exact", "rounding"):
            continue
        if shown == _SHOWN:
            return
        shown += 1
        repair = one["repair"] or {"FY_max_abs_N": None, "MZ_max_abs_Nm": None}
        FY, MZ = repair["FY_max_abs_N"], repair["MZ_max_abs_Nm"]
        yield [
            one["path"],
            one["grade"],
            one["record"] or "",
            one["variant"] or one["reason"] or "",
            one["in_force"] or "",
            "" if FY is None else f"{FY:.1f}",
            "" if MZ is None else f"{MZ:.2f}",
        ]
