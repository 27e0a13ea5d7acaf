"""`toolkit audit ARCHIVE`: which calibration computed each file of an archive, and what it changes."""

from __future__ import annotations

import shutil
import time
from pathlib import Path
from typing import Annotated

import typer

from toolkit.cli.console import answers, progress, say, stream
from toolkit.cli.options import Draft, KnownAt, Output, RegistryOptions, day, into_file, into_folder

NAME = "audit"


@answers("toolkit.lab.archives.audit_answer:AuditAnswer")
def command(
    archive: Annotated[Path, typer.Argument(help="A folder of recordings, in any depth.")],
    workers: Annotated[
        int | None, typer.Option("--workers", help="Processes that read files; default 1.")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler",
            help="A dask cluster instead: tcp://host:8786, or tls:// with the certificates that dask's own "
            "configuration names (distributed.comm.tls).",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            callback=into_folder,
            help="Folder for the results; an interrupted audit resumes from it.",
        ),
    ] = None,
    reports: Annotated[
        Path | None,
        typer.Option("--reports", help="Reports of past years: a folder, or CSV with report, test, sha256."),
    ] = None,
    since_good: Annotated[
        str | None,
        typer.Option(
            "--since-good",
            help="Record id of the last good check: tests that a failed as-found check puts in doubt.",
        ),
    ] = None,
    repair: Annotated[
        Path | None,
        typer.Option(
            "--repair",
            callback=into_folder,
            help="Folder for corrected copies; the originals are never touched.",
        ),
    ] = None,
    template: Annotated[
        Path | None,
        typer.Option("--template", help="Word template of a summary, audit.docx and audit.pdf in --out."),
    ] = None,
    parquet: Annotated[
        Path | None,
        typer.Option(
            "--parquet",
            callback=into_file,
            help="Also the results of all files as a Parquet table (.parquet).",
        ),
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

    if workers is not None and scheduler is not None:
        raise typer.BadParameter("either workers here or those of a cluster", param_hint="--scheduler")
    if template is not None and out is None:
        raise typer.BadParameter("a summary needs --out, where it is written", param_hint="--template")
    order = AuditOrder(
        archive=archive, known_at=day(known_at), workers=1 if workers is None else workers,
        scheduler=scheduler, out=out, reports=reports, since_good=since_good, repair=repair,
        template=template, parquet=parquet, draft=draft, calibrations=place.calibrations, home=place.home,
    )  # fmt: skip
    began = time.perf_counter()
    result, written = audit(order, stage=partial(progress, show=not output.silent))
    if output.json:
        seconds = time.perf_counter() - began
        rate = len(result.made.files) / seconds if seconds else None
        timing = {"seconds": seconds, "files_per_second": rate, "reused": result.made.reused}
        stream({**payload_of(result), "written": [str(path) for path in written], "timing": timing})
    elif not output.quiet:
        width = shutil.get_terminal_size().columns
        say("\n".join([text_of(result, width=width), *(str(path) for path in written)]))
    return 0 if result.made.clean else 1
