"""`toolkit calibrate SESSION.toml`: fit a session's reference-load data."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from toolkit.cli.command import ARGUMENT, answers
from toolkit.cli.console import exit_code
from toolkit.cli.options import INTO_FOLDER, INTO_REGISTRY, EntryOptions, Machine, Output
from toolkit.errors import ConfigError

NAME = "calibrate"
Full = Annotated[bool, "Print the whole report of the fit; the JSON then has its rows."]
Figures = Annotated[Path | None, "Folder for the fit's figures, PNG and SVG of each.", INTO_FOLDER]


@answers("toolkit.lab.records.session_answer:CalibrateAnswer")
def command(
    session: Annotated[Path, "SESSION.toml, with its CSV or .xlsx files beside it.", ARGUMENT],
    out: Annotated[Path | None, "Another name for --calibrations.", INTO_REGISTRY] = None,
    machine: Machine = None,
    dry_run: Annotated[bool, "Compute and judge everything; write nothing."] = False,
    again: Annotated[bool, "Enter a session anew whose record was discarded."] = False,
    full: Full = False,
    figures: Figures = None,
    *,
    entering: EntryOptions,
    output: Output,
) -> int:
    """Fit a session: a candidate record and its diagnostics.

    A class of ISO 376 is granted to a session of one indication and one load that states its preloads to
    the largest load, "[standard] preloads = 3", and has runs at rotated mountings; rows are in time order.

    Example: toolkit calibrate sessions/2026-03.toml --figures fit
    """
    from toolkit.calibration.control.calibrate import calibrate, rehearse
    from toolkit.calibration.records.use import UNSIGNED
    from toolkit.lab.records.session_answer import (
        NOT_ENTERED,
        candidate_payload,
        candidate_text,
        fit_report,
        next_step,
    )
    from toolkit.lab.signatures.sealing import standards_of

    calibrations = entering.calibrations
    if calibrations is not None and out is not None and calibrations != out:
        raise ConfigError(
            "the registry is named twice",
            where="--calibrations, --out",
            got=f"{calibrations} and {out}",
            expected="one folder: --out is another name for --calibrations",
            next_step="leave one of them out; nothing was written",
            rule="usage",
        )
    registry = replace(entering, calibrations=calibrations or out).registry()
    if dry_run and figures is not None:
        raise ConfigError(
            "a dry run makes no files",
            where="--dry-run, --figures",
            got=f"--figures {figures}",
            expected="one of the two",
            next_step="leave out --figures, or enter the session; nothing was written",
            rule="usage",
        )
    candidate = (rehearse if dry_run else calibrate)(
        session, registry, machine=machine, again=again, standards=standards_of(registry.folder.parent)
    )
    status = NOT_ENTERED if dry_run and not candidate.existing else registry.status(candidate.record.id).state
    signature = UNSIGNED if status == NOT_ENTERED else registry.signature(candidate.record.id)
    fitted = candidate_payload(candidate, status, signature)
    text = candidate_text(candidate, status, signature)
    if status == "candidate":
        text += f"\n\nnext: {next_step(registry, candidate.record, machine)}"
    payload: dict[str, Any] = {**fitted, "dry_run": dry_run}
    if full or output.json or figures is not None:
        from toolkit.calibration.standards.evaluation import evaluations

        payload["standards"] = [row.as_dict() for row in evaluations(candidate.fit)]
        report = fit_report(candidate.fit, candidate.record, full=full, figures=figures)
        for name, load in report.loads.items():
            payload["loads"][name]["report"] = load
        payload |= report.payload
        text += report.text
    output.answer(payload, text)
    return 0 if candidate.existing else exit_code(candidate.findings)
