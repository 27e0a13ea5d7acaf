"""`toolkit report`: the filled Word report and its verified PDF."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from toolkit.cli.console import (
    CalibrationId,
    Calibrations,
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
from toolkit.cli.delivery import file_name, home_template

if TYPE_CHECKING:
    from toolkit.cli.resolve import Resolved
    from toolkit.report.deliver import Delivered
    from toolkit.report.drawer import Drawer
    from toolkit.report.pdf import Office

NAME = "report"


def command(
    test: Annotated[
        Path, typer.Argument(metavar="TEST", help="Folder with test.toml and recordings, or a reduced test.")
    ],
    template: Annotated[
        Path | None,
        typer.Option("--template", help="Word template; default: report_templates/org.docx of the home."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Output folder; default: report-<test name> here.")
    ] = None,
    calibration: CalibrationId = None,
    known_at: KnownAt = None,
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

    Delivers report.docx and report.pdf, or nothing where the PDF does not show every value and figure.

    Example: toolkit report tests/2019-06-04 --template report_templates/org.docx --out reports/89
    """
    from toolkit.cli.resolve import resolve_test
    from toolkit.report.drawer import Drawer
    from toolkit.report.package import read_template
    from toolkit.report.pdf import Office

    chosen = choose_reader(reader)
    started = time.perf_counter()
    # The template is judged before anything is read: its error must not wait for a long reduction.
    opened = read_template(template or home_template("org.docx", home))
    with Office() as office, Drawer() as drawer, progress(None, "report", show=not (json or quiet)) as step:
        resolved = resolve_test(
            test,
            calibration=calibration,
            calibrations=calibrations,
            home=home,
            known_at=day(known_at),
            reader=chosen,
            protocol=protocol,
            step=step,
        )
        target = (
            out or Path.cwd() / f"report-{file_name(resolved.result.reduced.info.name, otherwise='test')}"
        )
        made = make_report(
            resolved,
            opened.path,
            target,
            allow_missing=allow_missing,
            keep=keep,
            office=office,
            drawer=drawer,
            step=step,
        )
    payload = report_payload(made, resolved) | {"timing": {"seconds": time.perf_counter() - started}}
    answer(payload, _text(made, resolved), as_json=json, quiet=quiet)
    return report_code(made, resolved)


def make_report(
    resolved: Resolved,
    template: Path,
    out: Path,
    *,
    allow_missing: bool = False,
    keep: bool = False,
    office: Office | None = None,
    drawer: Drawer | None = None,
    step: Any = lambda _text: None,
) -> Delivered:
    """Return the delivered report of a resolved test."""
    from toolkit.report.build import build_content
    from toolkit.report.deliver import deliver
    from toolkit.report.package import read_template
    from toolkit.report.style import read_style, style_file

    content = build_content(
        resolved.result, resolved.record, findings=resolved.findings, style=read_style(style_file(template))
    )
    return deliver(
        read_template(template),
        content,
        out,
        office=office,
        drawer=drawer,
        allow_missing=allow_missing,
        keep=keep,
        step=step,
    )


def report_code(made: Delivered, resolved: Resolved) -> int:
    """Return 0, or 1 where findings, an unverified record or the template ask for attention."""
    unverified = resolved.result.reduced.calibration.unverified
    return 1 if made.warnings or unverified else exit_code(resolved.findings)


def report_payload(made: Delivered, resolved: Resolved) -> dict[str, Any]:
    """Return a delivered report as the JSON answer."""
    use = resolved.result.reduced.calibration
    return {
        "docx": made.docx,
        "pdf": made.pdf,
        "pages": made.pages,
        "verified": True,
        "checks": [check.as_dict() for check in made.checks],
        "template_sha256": made.template_sha256,
        "calibrations": [{"id": use.id, "sha256": use.sha256, "unverified": use.unverified}],
        "figures": [{"tag": tag, "alt": alt} for tag, alt in made.filled.figures],
        "manifest": [entry.as_dict() for entry in made.filled.manifest],
        "simulated": resolved.result.reduced.info.simulated,
        "warnings": list(made.warnings),
        "findings": [finding.as_dict() for finding in resolved.findings],
    }


def _text(made: Delivered, resolved: Resolved) -> str:
    use = resolved.result.reduced.calibration
    marks = ("  SIMULATED" if resolved.result.reduced.info.simulated else "") + (
        "  UNVERIFIED" if use.unverified else ""
    )
    lines = [
        f"{made.pdf}",
        f"{made.docx}",
        f"{made.pages} pages, {len(made.filled.figures)} figures, "
        f"{len(made.filled.manifest)} values verified{marks}",
        f"calibration {use.id} ({use.sha256[:12]}...)",
        *(f"  warning {one}" for one in made.warnings),
        *finding_lines(resolved.findings),
    ]
    return "\n".join(lines)
