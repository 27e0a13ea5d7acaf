"""`toolkit calibration certificate`: Word, verified PDF and the digital certificate of one record."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from toolkit.cli.console import (
    Calibrations,
    Home,
    Json,
    KnownAt,
    Quiet,
    answer,
    day,
    exit_code,
    finding_lines,
    progress,
)
from toolkit.cli.delivery import delivered_payload, file_name, home_template
from toolkit.cli.home import calibrations_folder

if TYPE_CHECKING:
    from toolkit.report.certificate.model import Certificate
    from toolkit.report.deliver import Delivered

NAME = "certificate"


def command(
    record_id: Annotated[str, typer.Argument(metavar="ID", help="Record id, such as m15-r2.")],
    template: Annotated[
        Path | None,
        typer.Option("--template", help="Word template; default: report_templates/certificate.docx."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="Output folder; default: certificate-<ID> here.")
    ] = None,
    dcc: Annotated[bool, typer.Option("--dcc", help="Also write the DCC 3.3.0 file (XML).")] = False,
    replaces: Annotated[
        str | None, typer.Option("--replaces", help="Id of the certificate that this one replaces.")
    ] = None,
    amendment_reason: Annotated[
        str | None, typer.Option("--amendment-reason", help="Why it is replaced; printed.")
    ] = None,
    draft: Annotated[
        bool, typer.Option("--draft", help="Allow a record that is not approved: every page says DRAFT.")
    ] = False,
    known_at: KnownAt = None,
    keep: Annotated[
        bool, typer.Option("--keep", help="Keep what was not verified in rejected/ of the folder.")
    ] = False,
    calibrations: Calibrations = None,
    home: Home = None,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Make the calibration certificate of a record: Word, verified PDF, and with --dcc the XML.

    A legacy import, a candidate and a withdrawn record have none. What nobody stated is a visible gap
    (exit 1). --known-at is the day of issue, and of what was known.

    Example: toolkit calibration certificate m15-r3 --out certificates --dcc
    """
    from toolkit.calibration.registry.registry import Registry
    from toolkit.report.certificate.collect import collect
    from toolkit.report.certificate.content import build_content
    from toolkit.report.certificate.dcc import build_dcc
    from toolkit.report.deliver import deliver
    from toolkit.report.style import read_style, style_file
    from toolkit.report.word.package import read_template

    started = time.perf_counter()
    opened = read_template(template or home_template("certificate.docx", home))
    style = read_style(style_file(opened.path))
    with progress(None, "certificate", show=not (json or quiet)) as step:
        step("record")
        made = collect(
            Registry(calibrations_folder(calibrations, home)),
            record_id,
            style,
            issued=day(known_at),
            draft=draft,
            replaces=replaces,
            amendment=amendment_reason,
        )
        delivered = deliver(
            opened,
            build_content(made, style),
            out or Path.cwd() / f"certificate-{record_id}",
            name=file_name(made.id, otherwise="certificate"),
            companions={".xml": build_dcc(made)} if dcc else None,
            keep=keep,
            step=step,
        )
    payload = _payload(made, delivered) | {"timing": {"seconds": time.perf_counter() - started}}
    answer(payload, _text(made, delivered), as_json=json, quiet=quiet)
    return 1 if delivered.warnings else exit_code(made.findings)


def _payload(made: Certificate, done: Delivered) -> dict[str, Any]:
    return {
        "certificate": made.id,
        "record": {"id": made.record, "sha256": made.record_sha256, "status": made.status},
        "head": made.ledger_head,
        "issued": made.issued.isoformat(),
        "draft": made.draft,
        "draft_reasons": list(made.draft_reasons),
        "withdrawn": made.withdrawn,
        "replaces": made.replaces,
        **delivered_payload(done),
        "dcc": done.companions[0] if done.companions else None,
        "decision_rule": made.rule,
        "loads": {one.load: _load(one) for one in made.loads},
        "unverifiable": [f"{load}: {term}" for load, term in made.unverifiable],
        "not_stated": list(made.gaps),
        "manifest": [entry.as_dict() for entry in done.filled.manifest],
        "findings": [finding.as_dict() for finding in made.findings],
    }


def _load(one: Any) -> dict[str, Any]:
    full = one.full_scale
    return {
        "unit": one.unit,
        "full_scale": full.at,
        "U": full.U,
        "k": full.k,
        "probability": full.probability,
        "dof": full.dof,
        "tolerance": one.tolerance,
        "verdict": one.verdict,
    }


def _text(made: Certificate, done: Delivered) -> str:
    marks = "  DRAFT" if made.draft else "  WITHDRAWN" if made.withdrawn else ""
    lines = [
        f"certificate {made.id} of {made.record}{marks}",
        *(f"{path}" for path in (done.pdf, done.docx, *done.companions)),
        f"{done.pages} pages, {len(done.filled.manifest)} values verified",
        *(f"  warning {one}" for one in done.warnings),
        *finding_lines(made.findings),
    ]
    return "\n".join(lines)
