"""`toolkit audit ARCHIVE`: which calibration computed each file of an archive, and what it changes."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Annotated

import typer

from toolkit.cli.command import ARGUMENT, answers
from toolkit.cli.console import progress, say, stream
from toolkit.cli.options import INTO_FILE, INTO_FOLDER, Draft, KnownAt, Output, RegistryOptions

NAME = "audit"


@answers("toolkit.lab.archives.audit_answer:AuditAnswer")
def command(
    archive: Annotated[Path, "A folder of recordings, in any depth.", ARGUMENT],
    workers: Annotated[int | None, "Processes that read files; default 1."] = None,
    scheduler: Annotated[
        str | None,
        "A dask cluster instead: tcp://host:8786, or tls:// with the certificates that dask's own "
        "configuration names (distributed.comm.tls).",
    ] = None,
    out: Annotated[
        Path | None, "Folder for the results; an interrupted audit resumes from it.", INTO_FOLDER
    ] = None,
    reports: Annotated[
        Path | None, "Reports of past years: a folder, or CSV with report, test, sha256."
    ] = None,
    since_good: Annotated[
        str | None, "Record id of the last good check: tests that a failed as-found check puts in doubt."
    ] = None,
    repair: Annotated[
        Path | None, "Folder for corrected copies; the originals are never touched.", INTO_FOLDER
    ] = None,
    template: Annotated[Path | None, "Word template of a summary, audit.docx and audit.pdf in --out."] = None,
    parquet: Annotated[
        Path | None, "Also the results of all files as a Parquet table (.parquet).", INTO_FILE
    ] = None,
    known_at: KnownAt = None,
    draft: Draft = False,
    *,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Tell for every file of an archive which calibration computed its Fy and Mz.

    Each file has a grade (exact, rounding, stale, sign_variant, column_swap, altered_cells, ambiguous,
    unknown, undated, unreadable, no_recording) and a repair: the largest change of FY and MZ by the record
    in force on the test's date. Where Fy and Mz disagree with the cells, both sides are judged: changed
    cells are altered_cells, what nothing decides is ambiguous, and neither is ever repaired.
    With --out the folder also gets audit.html, a page that opens without a network, and audit.jsonl.

    Example: toolkit audit archive --workers 2 --out audit-2026 --json
    """
    from functools import partial

    from toolkit.lab.archives.audit import AuditOrder, audit
    from toolkit.lab.archives.audit_answer import payload_of, text_of
    from toolkit.lab.progress_note import note_level

    if workers is not None and scheduler is not None:
        raise typer.BadParameter("either workers here or those of a cluster", param_hint="--scheduler")
    if template is not None and out is None:
        raise typer.BadParameter("a summary needs --out, where it is written", param_hint="--template")
    order = AuditOrder(
        archive=archive, basis=place.basis(known_at=known_at, draft=draft),
        workers=1 if workers is None else workers, scheduler=scheduler, out=out, reports=reports,
        since_good=since_good, repair=repair, template=template, parquet=parquet,
    )  # fmt: skip
    result, written = audit(order, stage=partial(progress, show=not output.silent))
    if output.json:
        seconds = output.timing["seconds"]
        rate = len(result.made.files) / seconds if seconds else None
        timing = {"seconds": seconds, "files_per_second": rate, "reused": result.made.reused}
        stream({**payload_of(result), "written": [str(path) for path in written], "timing": timing})
    elif not output.quiet:
        width = shutil.get_terminal_size().columns
        say("\n".join([text_of(result, width=width), *(str(path) for path in written)]))
    note_level(finding.level for finding in result.made.findings)
    return 0 if result.made.clean else 1
