"""Reports: tests to filled templates and verified PDFs, several of them in one call of LibreOffice."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypedDict, cast

from toolkit.calibration.records.use import UsedRecord
from toolkit.declared.answers import entry_of
from toolkit.findings import FindingEntry
from toolkit.lab.answers import (
    DeliveredDocument,
    DraftKeys,
    ErrorEntry,
    PrintedEntry,
    Timed,
    Timing,
    counted,
    delivered_keys,
    draft_keys,
    file_name,
    finding_lines,
    mark_words,
    needs_attention,
)
from toolkit.listing import one_line

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from toolkit.errors import ToolkitError
    from toolkit.lab.signatures.issuing import Issuing
    from toolkit.lab.tire_tests.resolve import Resolved
    from toolkit.lab.tire_tests.tire_files import HandedTire
    from toolkit.report.deliver import Delivered, Job
    from toolkit.report.diagnosis.answer import Told
    from toolkit.report.drawer import Drawer
    from toolkit.report.style import Style
    from toolkit.report.word.office import Office
    from toolkit.report.word.package import Template
    from toolkit.tires.comparison import Comparison


class RefusedReport(TypedDict):
    """A report that was not delivered."""

    verified: bool
    error: ErrorEntry | None


class PrintedUnits(TypedDict):
    """Units as a document prints them."""

    force: str
    moment: str


class DeliveredReport(DeliveredDocument, DraftKeys):
    """The report of a test."""

    calibrations: list[UsedRecord]
    units: PrintedUnits
    manifest: Annotated[list[PrintedEntry], "every value as it was printed"]
    manifest_file: Path | None
    handed_over: Annotated[list[Path], "files beside the report"]
    simulated: bool
    impossible: Annotated[list[FindingEntry], "values that no tire has"]
    findings: list[FindingEntry]


class NamedReport(DeliveredReport):
    """The report of one of several tests."""

    test: Path


class NamedRefusal(RefusedReport):
    """The refusal of one of several tests."""

    test: Path


class ReportAnswer(DeliveredReport, Timed):
    """The report of one test."""


class RefusalAnswer(RefusedReport, Timed):
    """The one report that was asked for was not delivered."""


class ReportsAnswer(Timed):
    """The reports of several tests."""

    reports: Annotated[list[NamedReport | NamedRefusal], "in the order of the command"]


ReportForms = ReportAnswer | RefusalAnswer | ReportsAnswer


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """What all reports of one call have in common.

    ``None`` in ``details``: those of each ``test.toml``; in ``units``: those of the style file.
    ``diagnosis`` is the answer that the report tells, with its file; ``issuing`` issues each report.
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
    issuing: Issuing | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MadeReport:
    """One report: the test and its report, or the error that stands in its place."""

    test: Path
    resolved: Resolved | None
    outcome: Delivered | ToolkitError


def make_reports(
    tests: Sequence[Path],
    options: Options,
    out: Path | None,
    *,
    folders: Sequence[Path] | None = None,
    office: Office | None = None,
    drawer: Drawer | None = None,
    step: Callable[[str], None] = lambda _text: None,
) -> list[MadeReport]:
    """Return the report of every test, converted in one call; with one test its error is raised.

    ``folders`` are the output folders of the tests; default: ``out``, or one for each test in it.

    Raises
    ------
    ToolkitError
        the only test cannot be read, or its report is not delivered
    """
    from toolkit.errors import ConfigError, ToolkitError
    from toolkit.lab.tire_tests.handover import details_of, diagnosis_findings
    from toolkit.report.deliver import deliver_all
    from toolkit.trust.signing import HERE

    if options.issuing is not None and options.issuing.registry.travel != HERE and len(tests) > 1:
        raise ConfigError(
            "a request is of one document", where="--request, --answer", got=f"{len(tests)} tests",
            expected="one test", next_step="request each report by itself; nothing was made", rule="usage",
        )  # fmt: skip
    if options.details is not None:
        details_of(tests[0], options.details)  # one file for all tests: refused before any of them is read
    resolved: list[Resolved | ToolkitError] = []
    jobs: list[Job] = []
    taken: set[Path] = set()
    for index, test in enumerate(tests):
        try:
            result = options.resolve(test)
            alone = len(tests) == 1
            folder = folders[index] if folders else _folder(result, out, alone=alone, taken=taken)
            if options.models:
                step(f"{test.name}: tire models")
            result, comparison = _compared(test, result, options.models)
            result, tire = _with_tire(result, options)
            if options.diagnosis:
                tie_findings = diagnosis_findings(options.diagnosis[0].answer, result, test)
                result = replace(result, findings=(*result.findings, *tie_findings))
            jobs.append(_job(test, result, folder, options, comparison, tire))
            resolved.append(result)
        except ToolkitError as error:
            if len(tests) == 1:
                raise
            resolved.append(error)
    outcomes = iter(
        deliver_all(
            jobs,
            office=office,
            drawer=drawer,
            allow_missing=options.allow_missing,
            keep=options.keep,
            step=step,
        )
    )
    reports = [
        MadeReport(test=test, resolved=None, outcome=result)
        if isinstance(result, ToolkitError)
        else MadeReport(test=test, resolved=result, outcome=next(outcomes))
        for test, result in zip(tests, resolved, strict=True)
    ]
    if len(reports) == 1 and isinstance(reports[0].outcome, ToolkitError):
        raise reports[0].outcome
    return reports


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
    from toolkit.lab.tire_tests.fit_models import FitOrder, fit_resolved

    if not models:
        return resolved, None
    fitted = fit_resolved(resolved, FitOrder(names=models), where=str(test))
    fit_findings = [
        finding for finding in fitted.findings if finding.level != "note" and finding not in resolved.findings
    ]
    return replace(resolved, findings=(*resolved.findings, *fit_findings)), fitted.comparison


def _with_tire(resolved: Resolved, options: Options) -> tuple[Resolved, HandedTire | None]:
    """Return the tire that is handed over, if one is, and the test with what was found of its fit."""
    from toolkit.lab.tire_tests.tire_files import fit_test_tire

    if not options.tir:
        return resolved, None
    tire = fit_test_tire(resolved.result.reduced)
    return replace(resolved, findings=(*resolved.findings, *tire.findings())), tire


def _job(
    test: Path,
    resolved: Resolved,
    folder: Path,
    options: Options,
    comparison: Comparison | None,
    tire: HandedTire | None = None,
) -> Job:
    from toolkit.calibration.registry.registry import instrument_of
    from toolkit.lab.tire_tests.handover import details_of, provenance, writers
    from toolkit.report.deliver import Job
    from toolkit.report.style import read_style, style_file
    from toolkit.report.test.content import build_content
    from toolkit.trust.signing import HERE

    registry = None if options.issuing is None else options.issuing.registry
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
        issued=None if registry is None or registry.travel == HERE else registry.today(),
        titled=str if registry is None else registry.people().history.titled,
    )
    issue = None
    if options.issuing is not None:
        decided = options.issuing.registry.ledger(instrument_of(content.calibrations[0].id)).decided
        content = options.issuing.content(content)
        issue = options.issuing.issue(
            content, document=f"report {content.identity}", decided=decided,
            tested=resolved.result.reduced.info.date,
        )  # fmt: skip
    return Job(
        issue=issue,
        template=options.template,
        content=content,
        out=folder,
        extras=writers(resolved, test, xlsx=options.xlsx, tydex=options.tydex, tire=tire),
        provenance=provenance(resolved, test, diagnosis=options.diagnosis and options.diagnosis[1]),
    )


def attention(report: MadeReport) -> bool:
    """Tell whether a delivered report asks for a person: its findings, its record or its template."""
    if report.resolved is None or isinstance(report.outcome, Exception):
        return True
    marked = report.resolved.result.reduced.calibration.mark is not None
    return bool(report.outcome.warnings) or marked or needs_attention(report.resolved.findings)


def report_payload(report: MadeReport) -> DeliveredReport | RefusedReport:
    """Return a delivered report as the JSON answer."""
    resolved, delivered = report.resolved, report.outcome
    if resolved is None or isinstance(delivered, Exception):
        error = cast("ErrorEntry", delivered.as_dict()) if isinstance(delivered, Exception) else None
        return {"verified": False, "error": error}
    use = resolved.result.reduced.calibration
    return {
        **delivered_keys(delivered),
        "calibrations": [use.as_dict()],
        **draft_keys(use),
        "units": {"force": delivered.units[0], "moment": delivered.units[1]},
        "manifest": [entry_of(PrintedEntry, entry) for entry in delivered.filled.manifest],
        "manifest_file": delivered.manifest,
        "handed_over": list(delivered.extras),
        "simulated": resolved.result.reduced.info.simulated,
        "impossible": [finding.as_dict() for finding in resolved.result.reduced.impossible],
        "findings": [finding.as_dict() for finding in resolved.findings],
    }


def named_payload(report: MadeReport) -> NamedReport | NamedRefusal:
    """Return the report of one of several tests as the JSON answer."""
    return cast("NamedReport | NamedRefusal", {"test": report.test, **report_payload(report)})


def reports_payload(
    reports: Sequence[MadeReport], timing: Timing
) -> ReportAnswer | RefusalAnswer | ReportsAnswer:
    """Return the JSON answer of a command: the one report, or a list that names the tests."""
    if len(reports) == 1:
        return cast("ReportAnswer | RefusalAnswer", {**report_payload(reports[0]), "timing": timing})
    return {"reports": list(map(named_payload, reports)), "timing": timing}


def report_text(report: MadeReport) -> str:
    """Return a report for people: its files, what was verified, its findings."""
    resolved, delivered = report.resolved, report.outcome
    if resolved is None or isinstance(delivered, Exception):
        return f"{one_line(report.test)}: no report\n{delivered}"
    use = resolved.result.reduced.calibration
    marks = (
        ("  SIMULATED" if resolved.result.reduced.info.simulated else "")
        + mark_words(use)
        + ("  IMPOSSIBLE VALUES" if resolved.result.reduced.impossible else "")
    )
    lines = [
        *(
            one_line(path)
            for path in (delivered.pdf, delivered.docx, delivered.manifest, *delivered.extras)
            if path is not None
        ),
        f"{counted(delivered.pages, 'page')}, {counted(len(delivered.filled.figures), 'figure')}, "
        f"{counted(len(delivered.filled.manifest), 'value')} verified{marks}",
        f"calibration {use.id} ({use.sha256[:12]}...)",
        f"signature: {delivered.signature}",
        f"content {delivered.content_sha256[:12]}...",
        *(f"  warning {warning}" for warning in delivered.warnings),
        *finding_lines(resolved.findings),
    ]
    return "\n".join(lines)
