"""`toolkit calibration due`: when each instrument is to be calibrated again."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any

import typer

from toolkit.cli.console import (
    Calibrations,
    Home,
    Json,
    Quiet,
    answer,
    day,
    exit_code,
    finding_lines,
    table,
)
from toolkit.cli.home import calibrations_folder
from toolkit.findings import Finding


def command(
    instrument: Annotated[str | None, typer.Argument(help="One instrument; default: all.")] = None,
    on: Annotated[
        datetime | None, typer.Option("--on", formats=["%Y-%m-%d"], help="The day to judge; default: today.")
    ] = None,
    calibrations: Calibrations = None,
    home: Home = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Tell when each instrument is due, as the ledger says; exit code 1 where one is overdue.

    Example: toolkit calibration due --on 2026-12-01
    """
    from toolkit.calibration.control.recall import due_findings, due_of
    from toolkit.calibration.registry.clock import today
    from toolkit.calibration.registry.registry import Registry
    from toolkit.errors import ToolkitError

    registry = Registry(calibrations_folder(calibrations, home))
    date = day(on) or today()
    rows: list[dict[str, Any]] = []
    findings: list[Finding] = []
    for name in [instrument] if instrument else registry.instruments():
        try:
            due = due_of(registry, name, date)
        except ToolkitError as error:
            if instrument:
                raise
            # Of many instruments one that cannot be judged must not hide the others.
            findings.append(
                Finding(rule=error.rule or "ledger", where=name, message=f"{error.what}: {error.got}")
            )
            continue
        findings += due_findings(due)
        more = due.recommendation
        rows.append({
            "instrument": name, "record": due.record, "session_date": due.session_date.isoformat(),
            "recall": due.recall, "due": due.due and due.due.isoformat(), "days_left": due.days_left,
            "overdue": due.overdue,
            "recommended": {
                "days": more.days, "drift_per_year": more.drift_per_year, "results": more.results,
                "reason": more.reason,
            },
        })  # fmt: skip
    lines = [
        table(
            ["instrument", "in force", "session", "recall", "due", "days left", "recommended"],
            [[r["instrument"], r["record"], r["session_date"], r["recall"] or "-", r["due"] or "-",
              "-" if r["days_left"] is None else str(r["days_left"]),
              "-" if r["recommended"]["days"] is None else f"{r['recommended']['days']} days"] for r in rows],
            align="<<<<<><",
        ) or "no instrument has a record in force"
    ]  # fmt: skip
    lines += [f"{r['instrument']}: {r['recommended']['reason']}" for r in rows]
    lines += ["findings:", *finding_lines(findings)] if findings else []
    payload = {"on": date.isoformat(), "instruments": rows, "findings": [f.as_dict() for f in findings]}
    answer(payload, "\n".join(lines), as_json=as_json, quiet=quiet)
    return exit_code(findings)
