"""`toolkit report`: the filled Word report and its verified PDF."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from toolkit.cli.console import (
    CalibrationId,
    Calibrations,
    Draft,
    Home,
    Json,
    KnownAt,
    ProtocolFile,
    Quiet,
    Reader,
    answer,
    day,
    exit_code,
    finding_lines,
    progress,
)
from toolkit.cli.console import reader as choose_reader
from toolkit.cli.delivery import delivered_payload, draft_keys, file_name, home_template, mark_words

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from toolkit.cli.resolve import Resolved
    from toolkit.errors import ToolkitError
    from toolkit.report.deliver import Delivered, Job
    from toolkit.report.diagnosis.answer import Told
    from toolkit.report.drawer import Drawer
    from toolkit.report.style import Style
    from toolkit.report.word.office import Office
    from toolkit.report.word.package import Template
    from toolkit.tires.comparison import Comparison

NAME = "report"


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """What every report of a command has in common.

    ``None`` in ``details``: those of each ``test.toml``; in ``units``: those of the style file.
    ``diagnosis`` is the answer that the report tells, with its file.
    """

    template: Template
    resolve: Callable[[Path], Resolved]
    details: Path | None = None
    xlsx: bool = False
    tydex: bool = False
    tir: bool = False
    models: tuple[str, ...] = ()
    units: Style | None = None
    diagnosis: tuple[Told, Path] | None = None
    allow_missing: bool = False
    keep: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Made:
    """One report of a command: the test and its report, or the error that stands in its place."""

    test: Path
    resolved: Resolved | None
    outcome: Delivered | ToolkitError


def command(
    tests: Annotated[
        list[Path],
        typer.Argument(metavar="TEST...", help="Folders with test.toml and recordings, or reduced tests."),
    ],
    template: Annotated[
        Path | None,
        typer.Option("--template", help="Word template; default: report_templates/org.docx of the home."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            help="Output folder; of several tests, each has its own in it. Default: report-<test name> here.",
        ),
    ] = None,
    details: Annotated[
        Path | None,
        typer.Option("--details", help="TOML file with customer, method, opinions ... in place of [report]."),
    ] = None,
    xlsx: Annotated[
        bool, typer.Option("--xlsx", help="Hand over test.xlsx: the whole test in one file.")
    ] = False,
    tydex: Annotated[bool, typer.Option("--tydex", help="Hand over test.tdx (TYDEX 1.3).")] = False,
    tir: Annotated[
        bool, typer.Option("--tir", help="Hand over tire.tir: MF 6.1 over all loads, forward run.")
    ] = False,
    hand_over: Annotated[
        bool, typer.Option("--hand-over", help="All of the three: test.xlsx, test.tdx, tire.tir.")
    ] = False,
    models: Annotated[
        list[str] | None,
        typer.Option(
            "--models",
            help="Compare tire models in the report (tk:table.models): a name, may be repeated; 'all' is "
            "every one. Fits take seconds.",
        ),
    ] = None,
    units: Annotated[
        str | None,
        typer.Option(
            "--units",
            help="SI or lbf: N and N*m, or lbf and lbf*ft, in tables, figures and text of the report. "
            "Default: the style file's. What is handed over beside it stays in SI, a diagnosis in the units "
            "of its case.",
        ),
    ] = None,
    diagnosis: Annotated[
        Path | None,
        typer.Option(
            "--diagnosis",
            metavar="DIR_OR_JSON",
            help="Tell the answer of 'toolkit diagnose' in a chapter of the report (tk:diagnosis.*).",
        ),
    ] = None,
    by: Annotated[
        str | None,
        typer.Option("--by", help="Who releases the diagnosis' opinion on the cause; else a draft."),
    ] = None,
    calibration: CalibrationId = None,
    known_at: KnownAt = None,
    draft: Draft = False,
    protocol: ProtocolFile = None,
    reader: Reader = "calamine",
    allow_missing: Annotated[
        bool, typer.Option("--allow-missing", help="Print n/a for a value that the test has not.")
    ] = False,
    keep: Annotated[
        bool, typer.Option("--keep", help="Keep a report that was not verified in rejected/ of the folder.")
    ] = False,
    calibrations: Calibrations = None,
    home: Home = None,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Fill the Word template and make the verified PDF.

    Delivers report.docx, report.pdf and manifest.json, or nothing where the PDF does not show every value
    and figure. Several tests are converted in one call of LibreOffice; one that is refused does not stop
    the others.

    Example: toolkit report tests/2019-06-04 --template report_templates/org.docx --out reports/89
    """
    from functools import partial

    from toolkit.report.drawer import Drawer
    from toolkit.report.word.office import Office

    chosen = choose_reader(reader)
    started = time.perf_counter()
    # LibreOffice and matplotlib take a second to start: beside all that is imported and read here.
    with Office() as office, Drawer() as drawer, progress(None, "report", show=not (json or quiet)) as step:
        from toolkit.cli.fit import model_choice
        from toolkit.cli.handover import diagnosis_of
        from toolkit.cli.resolve import resolve_test
        from toolkit.cli.units import unit_choice
        from toolkit.report.word.package import read_template

        compared = model_choice(models) if models else ()
        shown = None if units is None else unit_choice(units)
        told = diagnosis_of(diagnosis, by, tests)
        # The template is judged before anything is read: its error must not wait for a long reduction.
        opened = read_template(template or home_template("org.docx", home))
        options = Options(
            template=opened,
            resolve=partial(
                resolve_test,
                calibration=calibration,
                calibrations=calibrations,
                home=home,
                known_at=day(known_at),
                draft=draft,
                reader=chosen,
                protocol=protocol,
                step=step,
            ),
            details=details,
            xlsx=xlsx or hand_over,
            tydex=tydex or hand_over,
            tir=tir or hand_over,
            models=compared,
            units=shown,
            diagnosis=told,
            allow_missing=allow_missing,
            keep=keep,
        )
        made = make_reports(tests, options, out, office=office, drawer=drawer, step=step)
    timing = {"timing": {"seconds": time.perf_counter() - started}}
    if len(made) == 1:
        payload = report_payload(made[0]) | timing
    else:
        payload = {"reports": [_entry(one) for one in made]} | timing
    answer(payload, "\n\n".join(_text(one) for one in made), as_json=json, quiet=quiet)
    return max(report_code(one) for one in made)


def make_reports(
    tests: Sequence[Path],
    options: Options,
    out: Path | None,
    *,
    folders: Sequence[Path] | None = None,
    office: Office | None = None,
    drawer: Drawer | None = None,
    step: Callable[[str], None] = lambda _text: None,
) -> list[Made]:
    """Return the report of every test, converted in one call; with one test its error is raised.

    ``folders`` are the output folders of the tests; default: ``out``, or one for each test in it.

    Raises
    ------
    ToolkitError
        the only test cannot be read, or its report is not delivered
    """
    from toolkit.cli.handover import diagnosis_findings
    from toolkit.errors import ToolkitError
    from toolkit.report.deliver import deliver_all

    resolved: list[Resolved | ToolkitError] = []
    jobs: list[Job] = []
    taken: set[Path] = set()
    for index, test in enumerate(tests):
        try:
            one = options.resolve(test)
            alone = len(tests) == 1
            folder = folders[index] if folders else _folder(one, out, alone=alone, taken=taken)
            if options.models:
                step(f"{test.name}: tire models")
            one, comparison = _compared(test, one, options.models)
            if options.diagnosis:
                more = diagnosis_findings(options.diagnosis[0].answer, one, test)
                one = replace(one, findings=(*one.findings, *more))
            jobs.append(_job(test, one, folder, options, comparison))
            resolved.append(one)
        except ToolkitError as error:
            if len(tests) == 1:
                raise
            resolved.append(error)
    done = iter(
        deliver_all(
            jobs,
            office=office,
            drawer=drawer,
            allow_missing=options.allow_missing,
            keep=options.keep,
            step=step,
        )
    )
    made = [
        Made(test=test, resolved=None, outcome=one)
        if isinstance(one, ToolkitError)
        else Made(test=test, resolved=one, outcome=next(done))
        for test, one in zip(tests, resolved, strict=True)
    ]
    if len(made) == 1 and isinstance(made[0].outcome, ToolkitError):
        raise made[0].outcome
    return made


def _folder(resolved: Resolved, out: Path | None, *, alone: bool, taken: set[Path]) -> Path:
    from toolkit.errors import OutputError

    name = file_name(resolved.result.reduced.info.name, otherwise="test")
    folder = out if out is not None and alone else (out or Path.cwd()) / (name if out else f"report-{name}")
    if folder in taken:
        raise OutputError(
            "two tests would have the same output folder",
            where=folder,
            got=f"another test named {resolved.result.reduced.info.name!r}",
            expected="tests with names of their own",
            next_step="make this report by itself, with --out",
            rule="not-empty",
        )
    taken.add(folder)
    return folder


def _compared(test: Path, resolved: Resolved, models: tuple[str, ...]) -> tuple[Resolved, Comparison | None]:
    """Return the models side by side, and the test with what was found of their fits but mere notes."""
    from toolkit.cli.fit_models import fit_resolved

    if not models:
        return resolved, None
    fitted = fit_resolved(resolved, models, where=str(test))
    more = [one for one in fitted.findings if one.level != "note" and one not in resolved.findings]
    return replace(resolved, findings=(*resolved.findings, *more)), fitted.comparison


def _job(
    test: Path, resolved: Resolved, folder: Path, options: Options, comparison: Comparison | None
) -> Job:
    from toolkit.cli.handover import details_of, provenance, writers
    from toolkit.report.deliver import Job
    from toolkit.report.style import read_style, style_file
    from toolkit.report.test.content import build_content

    style = read_style(style_file(options.template.path))
    if options.units is not None:
        style = style.in_units_of(options.units)
    content = build_content(
        resolved.result,
        resolved.record,
        findings=resolved.findings,
        style=style,
        details=details_of(test, options.details),
        comparison=comparison,
        diagnosis=options.diagnosis[0] if options.diagnosis else None,
    )
    return Job(
        template=options.template,
        content=content,
        out=folder,
        extras=writers(resolved, test, xlsx=options.xlsx, tydex=options.tydex, tir=options.tir),
        provenance=provenance(resolved, test, diagnosis=options.diagnosis and options.diagnosis[1]),
    )


def report_code(made: Made) -> int:
    """Return 2 without a report, 1 where findings, the record or the template ask for attention."""
    if made.resolved is None or isinstance(made.outcome, Exception):
        return 2
    marked = made.resolved.result.reduced.calibration.mark is not None
    return 1 if made.outcome.warnings or marked else exit_code(made.resolved.findings)


def report_payload(made: Made) -> dict[str, Any]:
    """Return a delivered report as the JSON answer."""
    resolved, done = made.resolved, made.outcome
    if resolved is None or isinstance(done, Exception):
        return {"verified": False, "error": done.as_dict() if isinstance(done, Exception) else None}
    use = resolved.result.reduced.calibration
    return {
        **delivered_payload(done),
        "calibrations": [use.as_dict()],
        **draft_keys(use),
        "units": dict(zip(("force", "moment"), done.units, strict=True)),
        "manifest": [entry.as_dict() for entry in done.filled.manifest],
        "manifest_file": done.manifest,
        "handed_over": list(done.extras),
        "simulated": resolved.result.reduced.info.simulated,
        "impossible": [finding.as_dict() for finding in resolved.result.reduced.impossible],
        "findings": [finding.as_dict() for finding in resolved.findings],
    }


def _entry(made: Made) -> dict[str, Any]:
    return {"test": made.test, **report_payload(made)}


def _text(made: Made) -> str:
    resolved, done = made.resolved, made.outcome
    if resolved is None or isinstance(done, Exception):
        return f"{made.test}: no report\n{done}"
    use = resolved.result.reduced.calibration
    marks = (
        ("  SIMULATED" if resolved.result.reduced.info.simulated else "")
        + mark_words(use)
        + ("  IMPOSSIBLE VALUES" if resolved.result.reduced.impossible else "")
    )
    lines = [
        *(f"{path}" for path in (done.pdf, done.docx, done.manifest, *done.extras) if path is not None),
        f"{done.pages} pages, {len(done.filled.figures)} figures, "
        f"{len(done.filled.manifest)} values verified{marks}",
        f"calibration {use.id} ({use.sha256[:12]}...)",
        f"content {done.content_sha256[:12]}...",
        *(f"  warning {one}" for one in done.warnings),
        *finding_lines(resolved.findings),
    ]
    return "\n".join(lines)
