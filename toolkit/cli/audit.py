"""`toolkit audit ARCHIVE`: which calibration computed each file of an archive, and what it changes."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from toolkit.cli.console import Calibrations, Draft, Home, Json, KnownAt, Quiet, day, progress, stream
from toolkit.cli.home import calibrations_folder

if TYPE_CHECKING:
    from toolkit.cli.audit_amend import Amended

NAME = "audit"


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
        typer.Option("--out", help="Folder that keeps the results: an audit goes on where it was ended."),
    ] = None,
    reports: Annotated[
        Path | None,
        typer.Option("--reports", help="Reports of past years: a folder, or CSV with report, test, sha256."),
    ] = None,
    since_good: Annotated[
        str | None,
        typer.Option("--since-good", help="Record id: the tests since then that a failed as-found touches."),
    ] = None,
    repair: Annotated[
        Path | None,
        typer.Option("--repair", help="Folder for corrected copies; the originals are never touched."),
    ] = None,
    template: Annotated[
        Path | None,
        typer.Option("--template", help="Word template of a summary, audit.docx and audit.pdf in --out."),
    ] = None,
    parquet: Annotated[
        Path | None,
        typer.Option("--parquet", help="Also the results of all files as a Parquet table (.parquet)."),
    ] = None,
    known_at: KnownAt = None,
    draft: Draft = False,
    calibrations: Calibrations = None,
    home: Home = None,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Tell for every file of an archive which calibration computed its Fy and Mz.

    Each file has a grade (exact, rounding, stale, sign_variant, column_swap, ambiguous, unknown, undated,
    unreadable) and a repair: the largest change of FY and MZ by the record in force on the test's date.
    With --out the folder also gets audit.html, a page that opens without a network, and audit.jsonl.

    Example: toolkit audit archive --workers 2 --out audit-2026 --json
    """
    from toolkit.audit.archive import audit_archive
    from toolkit.audit.corrected import check_target, write_copies
    from toolkit.audit.inventory import inventory
    from toolkit.audit.linked import link, read_reports
    from toolkit.audit.parquet import check_parquet
    from toolkit.audit.since_good import drift_since, drifted_files, drifted_tests
    from toolkit.calibration.registry.registry import Registry
    from toolkit.cli.audit_answer import Answer, payload_of, text_of, write_folder, write_table

    if workers is not None and scheduler is not None:
        raise typer.BadParameter("either workers here or those of a cluster", param_hint="--scheduler")
    count = 1 if workers is None else workers
    registry = Registry(calibrations_folder(calibrations, home))
    names = inventory(archive)
    # What cannot be used is told before hours of work, not after.
    past = None if reports is None else read_reports(reports)
    drift = None if since_good is None else drift_since(registry, since_good)
    if repair is not None:
        check_target(archive, repair)
    if parquet is not None:
        check_parquet(parquet)
    opened = None
    if template is not None:
        from toolkit.report.word.package import read_template

        if out is None:
            raise typer.BadParameter("a summary needs --out, where it is written", param_hint="--template")
        opened = read_template(template)
    began = time.perf_counter()
    show = not quiet and not json
    with progress(len(names), "audit", show=show) as step:
        made = audit_archive(
            archive,
            registry,
            known_at=day(known_at),
            workers=count,
            scheduler=scheduler,
            step=step,
            names=names,
            out=out,
        )
    with progress(None, "since the last good one", show=show and drift is not None) as step:
        drifted = (
            ()
            if drift is None
            else tuple(
                sorted(
                    drifted_files(made, registry, drift, workers=count, scheduler=scheduler, step=step),
                    key=lambda f: f.path,
                )
            )
        )
    with progress(None, "corrected copies", show=show and repair is not None) as step:
        copies = None if repair is None else write_copies(made, registry, repair, draft=draft, step=step)
    linked = None if past is None else link(made, past)
    amended: tuple[Amended, ...] = ()
    if repair is not None and linked is not None:
        from toolkit.cli.audit_amend import amend

        with progress(None, "amended reports", show=show) as step:
            amended = amend(
                linked,
                archive,
                repair,
                calibrations=calibrations,
                home=home,
                known_at=day(known_at),
                draft=draft,
                step=step,
            )
    told = Answer(
        made=made,
        linked=linked,
        drift=drift,
        drifted=drifted,
        drifted_tests=drifted_tests(made, drifted),
        copies=copies,
        amended=amended,
    )
    written = () if out is None else write_folder(out, told, registry, opened)
    if parquet is not None:
        written = (*written, write_table(parquet, told))
    if json:
        seconds = time.perf_counter() - began
        rate = len(names) / seconds if seconds else None
        timing = {"seconds": seconds, "files_per_second": rate, "reused": made.reused}
        stream({**payload_of(told), "written": [str(path) for path in written], "timing": timing})
    elif not quiet:
        typer.echo("\n".join([text_of(told), *(str(path) for path in written)]))
    return 0 if made.clean else 1
