"""`toolkit calibration report ID`: the whole report of a stored record's fit."""

from __future__ import annotations

from typing import Annotated

import typer

from toolkit.cli.console import Calibrations, Home, Json, Quiet, answer, exit_code, finding_lines
from toolkit.cli.fit_report import Figures, check_folder, tell
from toolkit.cli.home import calibrations_folder


def command(
    record_id: Annotated[str, typer.Argument(help="Record id, such as m15-r2.")],
    figures: Figures = None,
    calibrations: Calibrations = None,
    home: Home = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Fit a record's stored data again and print the whole report; exit code 1 where it has findings.

    Example: toolkit calibration report m15-r2 --figures fit
    """
    from toolkit.calibration.fit.findings import session_findings
    from toolkit.calibration.fit.session_fit import fit_session
    from toolkit.calibration.registry.registry import Registry
    from toolkit.calibration.registry.stored import stored_session

    registry = Registry(calibrations_folder(calibrations, home))
    record = registry.load(record_id)
    fit = fit_session(stored_session(registry.folder, record))
    check_folder(figures)
    findings = session_findings(fit)
    told = tell(fit, title=record.id, full=True, figures=figures)
    lines = [f"{record.id}  {record.instrument}, session of {record.date}", f"sha256 {record.sha256}"]
    text = "\n".join(lines) + told.text
    if findings:
        text += "\n\nfindings:\n" + "\n".join(finding_lines(findings))
    payload = {
        "record": {"id": record.id, "sha256": record.sha256},
        "loads": told.loads,
        "findings": [one.as_dict() for one in findings],
        **told.payload,
    }
    answer(payload, text, as_json=as_json, quiet=quiet)
    return exit_code(findings)
