"""`toolkit calibration chart INSTRUMENT`: the control charts of its check loads."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from toolkit.cli.console import Calibrations, Home, Json, Quiet, answer, exit_code, finding_lines, table
from toolkit.cli.home import calibrations_folder
from toolkit.errors import ConfigError

if TYPE_CHECKING:
    from toolkit.calibration.control.chart import Series


def command(
    instrument: Annotated[str, typer.Argument(help="The instrument.")],
    out: Annotated[Path | None, typer.Option("--out", help="A picture: FILE.png or FILE.svg.")] = None,
    load: Annotated[str | None, typer.Option("--load", help="One load only.")] = None,
    baseline: Annotated[
        int | None,
        typer.Option(
            "--baseline", min=4, help="First sessions that make the limits; default: all but the last."
        ),
    ] = None,
    calibrations: Calibrations = None,
    home: Home = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Chart the error of each check load over the sessions; exit code 1 where the newest breaks a rule.

    Example: toolkit calibration chart m15 --out chart.png
    """
    from toolkit.calibration.control.chart import chart_findings, control_chart
    from toolkit.calibration.registry.registry import Registry

    kind = None if out is None else out.suffix.lower().lstrip(".")
    if kind not in (None, "png", "svg"):
        raise ConfigError(
            "the picture's name has another ending", where="--out", got=out, expected=".png or .svg",
            next_step="choose one of them; nothing was written", rule="output-name",
        )  # fmt: skip
    registry = Registry(calibrations_folder(calibrations, home))
    if instrument not in registry.instruments():
        raise ConfigError(
            "the registry has no such instrument", where=registry.folder, got=instrument,
            expected=", ".join(registry.instruments()) or "an instrument",
            next_step="see 'toolkit calibration list'", rule="missing",
        )  # fmt: skip
    chart = control_chart(registry, instrument, baseline=baseline, load=load)
    if not chart.series:
        raise ConfigError(
            "there is nothing to chart", where=instrument,
            got="; ".join(f"{i}: {why}" for i, why in chart.left_out) or f"no load {load}",
            expected="sessions with check loads and a record in force before them",
            next_step="calibrate with check loads; the chart begins at the second session", rule="no-chart",
        )  # fmt: skip
    newest = max((s.points[-1] for s in chart.series), key=lambda point: (point.date, point.session_record))
    findings = chart_findings(chart, newest.session_record)
    if out is not None:
        from toolkit.files import write_atomic
        from toolkit.report.calibration.chart_figures import draw_chart

        write_atomic(out, draw_chart(chart, kind or "png"))
    text = [table(
        ["load", "check load", "points", "centre", "lower", "upper", "newest", "unit", "rules broken"],
        [_row(one) for one in chart.series], align="<<>>>>><<",
    )]  # fmt: skip
    text += [f"left out: {record_id}: {why}" for record_id, why in chart.left_out]
    if any(one.limits is None for one in chart.series):
        text.append("no limits: at least 4 sessions before the newest, which do not all agree, are needed")
    elif any(one.limits is not None and one.limits.provisional for one in chart.series):
        text.append("limits of fewer than 20 sessions are provisional")
    text += ["findings:", *finding_lines(findings)] if findings else []
    text += [f"picture: {out}"] if out else []
    payload = {
        "instrument": instrument,
        "series": [_payload(one) for one in chart.series],
        "left_out": [{"id": record_id, "reason": why} for record_id, why in chart.left_out],
        "findings": [finding.as_dict() for finding in findings],
        "picture": out,
    }
    answer(payload, "\n".join(text), as_json=as_json, quiet=quiet)
    return exit_code(findings)


def _row(one: Series) -> list[str]:
    limits = [f"{v:+.4g}" for v in (one.limits.centre, one.limits.lower, one.limits.upper)] if (
        one.limits
    ) else ["-"] * 3  # fmt: skip
    broken = ", ".join(f"{b.rule.number} ({one.points[b.index].date.isoformat()})" for b in one.breaks)
    return [one.load, str(one.check_load), str(len(one.points)), *limits, f"{one.points[-1].error:+.4g}",
            one.unit, broken]  # fmt: skip


def _payload(one: Series) -> dict[str, Any]:
    limits = one.limits
    return {
        "load": one.load,
        "unit": one.unit,
        "check_load": [{"load": n, "value": v, "unit": u} for n, v, u in one.check_load.loads],
        "tolerance": one.tolerance,
        "limits": None if limits is None else {
            "centre": limits.centre, "sigma": limits.sigma, "lower": limits.lower, "upper": limits.upper,
            "mean_range": limits.mean_range, "upper_range": limits.upper_range, "points": limits.points,
            "provisional": limits.provisional,
        },
        "points": [
            {"session": p.session_record, "date": p.date.isoformat(), "record": p.record, "error": p.error,
             "rows": p.rows}
            for p in one.points
        ],
        "moving_ranges": list(one.ranges),
        "breaks": [
            {"rule": b.rule.number, "text": b.rule.text, "session": one.points[b.index].session_record}
            for b in one.breaks
        ],
    }  # fmt: skip
