"""`toolkit audit ARCHIVE`: which calibration computed each file of an archive, and what it changes."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from toolkit.cli.console import Calibrations, Home, Json, KnownAt, Quiet, answer, day, progress, table
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
    payload = _payload(made)
    payload["timing"] = {"seconds": seconds, "files_per_second": len(names) / seconds if seconds else None}
    answer(payload, _text(made), as_json=json, quiet=quiet)
    return 0 if made.clean else 1


def _payload(made: ArchiveAudit) -> dict[str, Any]:
    from toolkit.audit.serial import to_plain

    return {
        "archive": made.archive,
        "known_at": made.known_at.isoformat(),
        "files": [to_plain(one) for one in made.files],
        "summary": {"files": len(made.files), "grades": made.grades, "undated": made.undated},
        "refused_records": [{"id": r.id, "rule": r.rule, "reason": r.reason} for r in made.refused],
        "heads": dict(made.heads),
        "findings": [finding.as_dict() for finding in made.findings],
    }


def _text(made: ArchiveAudit) -> str:
    bad = [one for one in made.files if one.grade not in ("exact", "rounding")]
    rows = []
    for one in bad[:_SHOWN]:
        found = one.found
        repair = None if found is None else found.repair
        rows.append([
            one.path,
            one.grade,
            (found and found.record) or "",
            (found and found.variant) or one.reason or "",
            (found and found.in_force) or "",
            "" if repair is None or repair.FY_max_abs_N is None else f"{repair.FY_max_abs_N:.1f}",
            "" if repair is None or repair.MZ_max_abs_Nm is None else f"{repair.MZ_max_abs_Nm:.2f}",
        ])  # fmt: skip
    header = ["file", "grade", "computed by", "how", "in force", "dFY [N]", "dMZ [N·m]"]
    lines = [table(header, rows, align="<<<<<>>")] if rows else []
    if len(bad) > _SHOWN:
        lines.append(f"... and {len(bad) - _SHOWN} more; --json tells all of them")
    told = ", ".join(f"{count} {grade}" for grade, count in made.grades.items() if count)
    lines += ["", f"{len(made.files)} files: {told or 'none'}; known at {made.known_at.isoformat()}"]
    lines += [f"refused record {one.id}: {one.reason}" for one in made.refused]
    lines += [f"head of {name}: {head}" for name, head in made.heads]
    return "\n".join(lines)
