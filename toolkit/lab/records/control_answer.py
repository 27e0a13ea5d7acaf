"""What the control of calibrations says: charts of check loads, due dates, evaluations by a standard."""

from __future__ import annotations

import datetime as dt
from pathlib import Path
from typing import Annotated, TypedDict

from toolkit.calibration.control.chart import ChartPoint, ControlLimits, Series
from toolkit.calibration.control.recall import DueInstrument
from toolkit.calibration.registry.registry import Registry
from toolkit.calibration.registry.stored import stored_loads
from toolkit.calibration.session.statements import statements_of
from toolkit.calibration.standards.cell_rows import CellSource
from toolkit.calibration.standards.e74 import E74Result
from toolkit.calibration.standards.evaluation import COMBINED, Evaluation, Standard, evaluate_source
from toolkit.calibration.standards.iso376 import Iso376Result
from toolkit.declared.answers import entry_of
from toolkit.errors import ConfigError, SessionError, ToolkitError
from toolkit.findings import Finding, FindingEntry
from toolkit.lab.answers import finding_lines
from toolkit.listing import or_dash, table

StandardEvaluation = TypedDict(
    "StandardEvaluation",
    {
        "standard": Annotated[str, "e74 or iso376"],
        "load": str,
        "load_unit": str,
        "indication": str | None,
        "indication_unit": str | None,
        "sense": Annotated[str | None, "of the force"],
        "direction": Annotated[str | None, "E74: whether the force increases or decreases, up or down"],
        "reasons": Annotated[list[str], "against a class, or a better one"],
        "left_out": Annotated[int, "rows that do not belong to it"],
        "class": str | None,
        "result": Annotated[E74Result | Iso376Result | None, "null where the rows cannot be evaluated"],
    },
)
StandardEvaluation.__doc__ = "One indication under one load, by one standard."


class StandardAnswer(TypedDict):
    """A record, evaluated by a standard."""

    id: str
    standard: Annotated[str, "e74 or iso376"]
    evaluations: list[StandardEvaluation]


class CheckLoad(TypedDict):
    """A load of a check point."""

    load: str
    value: float
    unit: str


class BrokenRule(TypedDict):
    """A rule of the chart that a session breaks."""

    rule: int
    text: str
    session: str


class ChartSeries(TypedDict):
    """The errors of one load at one check point, over the sessions."""

    load: str
    unit: str
    check_load: list[CheckLoad]
    tolerance: float | None
    limits: Annotated[ControlLimits | None, "null of too few points"]
    points: list[ChartPoint]
    moving_ranges: list[float]
    breaks: list[BrokenRule]


class LeftOutSession(TypedDict):
    """A session that no chart can have."""

    id: str
    reason: str


class ChartAnswer(TypedDict):
    """The control charts of an instrument."""

    instrument: str
    series: list[ChartSeries]
    left_out: list[LeftOutSession]
    findings: list[FindingEntry]
    picture: Path | None


class DueAnswer(TypedDict):
    """When each instrument is due."""

    on: Annotated[str, "day that is judged"]
    instruments: list[DueInstrument]
    findings: list[FindingEntry]


def chart_answer(
    registry: Registry, instrument: str, *, load: str | None, baseline: int | None, out: Path | None
) -> tuple[ChartAnswer, str, list[Finding]]:
    """Return the control charts of an instrument as JSON, as text, and their findings; draw them to ``out``.

    Raises
    ------
    ConfigError
        the picture's name or the sessions do not serve
    RegistryError
        ``missing``: there is no such instrument
    """
    from toolkit.calibration.control.chart import chart_findings, control_chart

    kind = None if out is None else out.suffix.lower().lstrip(".")
    if kind not in (None, "png", "svg"):
        raise ConfigError(
            "the picture's name has another ending", where="--out", got=out, expected=".png or .svg",
            next_step="choose one of them; nothing was written", rule="output-name",
        )  # fmt: skip
    if instrument not in registry.instruments():
        raise registry.no_instrument(instrument)
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
        from toolkit.publication import write_result
        from toolkit.report.calibration.chart_figures import draw_chart

        write_result(out, draw_chart(chart, kind or "png"))
    text = [table(
        ["load", "check load", "points", "centre", "lower", "upper", "newest", "unit", "rules broken"],
        [_row(series) for series in chart.series], align="<<>>>>><<",
    )]  # fmt: skip
    text += [f"left out: {record_id}: {why}" for record_id, why in chart.left_out]
    if any(series.limits is None for series in chart.series):
        text.append("no limits: at least 4 sessions before the newest, which do not all agree, are needed")
    elif any(series.limits is not None and series.limits.provisional for series in chart.series):
        text.append("limits of fewer than 20 sessions are provisional")
    text += ["findings:", *finding_lines(findings)] if findings else []
    text += [f"picture: {out}"] if out else []
    payload: ChartAnswer = {
        "instrument": instrument,
        "series": [_series(series) for series in chart.series],
        "left_out": [{"id": record_id, "reason": why} for record_id, why in chart.left_out],
        "findings": [finding.as_dict() for finding in findings],
        "picture": out,
    }
    return payload, "\n".join(text), list(findings)


def due_answer(
    registry: Registry, instrument: str | None, date: dt.date
) -> tuple[DueAnswer, str, list[Finding]]:
    """Return when each instrument is due, as JSON, as text, and the findings.

    Raises
    ------
    ToolkitError
        the one instrument that was named cannot be judged
    """
    from toolkit.calibration.control.recall import due_findings, due_of

    rows: list[DueInstrument] = []
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
        rows.append(due)
    lines = [
        table(
            ["instrument", "in force", "session", "recall", "due", "days left", "recommended"],
            [[r.instrument, r.record, str(r.session_date), r.recall or "-", str(r.due or "-"),
              "-" if r.days_left is None else str(r.days_left),
              "-" if r.recommended.days is None else f"{r.recommended.days} days"] for r in rows],
            align="<<<<<><",
        ) or "no instrument has a record in force"
    ]  # fmt: skip
    lines += [f"{r.instrument}: {r.recommended.reason}" for r in rows]
    lines += ["findings:", *finding_lines(findings)] if findings else []
    payload: DueAnswer = {
        "on": date.isoformat(),
        "instruments": rows,
        "findings": [f.as_dict() for f in findings],
    }
    return payload, "\n".join(lines), findings


def _row(series: Series) -> list[str]:
    limits = [f"{v:+.4g}" for v in (series.limits.centre, series.limits.lower, series.limits.upper)] if (
        series.limits
    ) else ["-"] * 3  # fmt: skip
    broken = ", ".join(f"{b.rule.number} ({series.points[b.index].date.isoformat()})" for b in series.breaks)
    newest = f"{series.points[-1].error:+.4g}"
    return [
        series.load, str(series.check_load), str(len(series.points)), *limits, newest, series.unit, broken
    ]  # fmt: skip


def _series(series: Series) -> ChartSeries:
    return entry_of(
        ChartSeries, series,
        check_load=[{"load": n, "value": v, "unit": u} for n, v, u in series.check_load.loads],
        moving_ranges=series.ranges,
        breaks=[
            {"rule": b.rule.number, "text": b.rule.text, "session": series.points[b.index].session_record}
            for b in series.breaks
        ],
    )  # fmt: skip


def evaluation_text(evaluation: Evaluation) -> str:
    """Return an evaluation by a standard for people."""
    title = "ASTM E74" if evaluation.standard == "e74" else "ISO 376"
    sense = {"up": ", increasing", "down": ", decreasing"}.get(evaluation.direction or "", "")
    lines = [
        f"{title}: {evaluation.indication} [{evaluation.indication_unit}] under "
        f"{evaluation.load} [{evaluation.load_unit}], {evaluation.sense} force{sense}",
        f"class {evaluation.class_name}" if evaluation.class_name else "no class",
    ]
    if isinstance(evaluation.result, E74Result):
        lines += _e74(evaluation.result, evaluation.load_unit, evaluation.indication_unit or "")
    elif evaluation.result is not None:
        lines += _iso376(evaluation.result, evaluation.load_unit, evaluation.indication_unit or "")
    if evaluation.all_reasons:
        lines += ["not better because", *(f"  {reason}" for reason in evaluation.all_reasons)]
    if evaluation.left_out:
        lines.append(f"{evaluation.left_out} rows are left out: another load acts")
    return "\n".join(lines)


def _e74(result: E74Result, force: str, reading: str) -> list[str]:
    rows = [
        [str(c.degree) + (" *" if c.degree == result.degree else ""),
         f"{c.s_m:.6g}", f"{c.llf:.6g}", str(c.dof),
         "-" if c.lack_of_fit is None else f"{c.lack_of_fit.F:.4g}",
         "-" if c.lack_of_fit is None else f"{c.lack_of_fit.p:.3g}"]
        for c in result.curves
    ]  # fmt: skip
    origin = "as asked for" if result.requested else "by the annex"
    return [
        f"{result.points} points at {result.levels} forces in {result.runs} runs; "
        f"degree {result.degree} {origin}",
        table(["degree", f"s_m [{reading}]", f"LLF [{force}]", "dof", "lack of fit F", "p"], rows),
        f"lower limit factor {result.llf:.6g} {force}",
        *(
            f"class {c.name}: {c.lower_limit:.6g} to {c.upper_limit:.6g} {force}"
            + ("" if c.granted else "  (not granted)")
            for c in result.classes
        ),
    ]


def _iso376(result: Iso376Result, force: str, reading: str) -> list[str]:
    rows = [
        [f"{r.force:g}", f"{r.deflection:.6g}", *(or_dash(e, ".4f") for e in (r.b, r.b_same, r.fc, r.v)),
         (r.class_name or "none") if not result.procedure else "-"]
        for r in result.forces
    ]  # fmt: skip
    return [
        table([f"force [{force}]", f"deflection [{reading}]", "b %", "b' %", "fc %", "v %", "class"], rows,
              align=">>>>>>>"),
        f"zero f0 {or_dash(result.f0, '.4f')} %, creep c {or_dash(result.c, '.4f')} %",
        *(f"class {r.class_name}: {r.lower:g} to {r.upper:g} {force}" for r in result.ranges),
    ]  # fmt: skip


def evaluate_record(
    registry: Registry,
    record_id: str,
    *,
    standard: Standard,
    load: str | None = None,
    indication: str | None = None,
    preloads: int | None = None,
    degree: int | None = None,
) -> tuple[Evaluation, ...]:
    """Evaluate one indication under one load of a record; both may be left out where there is only one.

    Raises
    ------
    SessionError
        ``standard``: several loads or indications and none was named, or one that the record does not have
    RegistryError, RecordError
        the record may not be used
    """
    record = registry.load(record_id)
    table = stored_loads(registry.folder, record)
    if table is None:
        raise _refused(
            record_id,
            "the record has no reference-load data",
            "a legacy import",
            "a fitted record",
            "calibrate the instrument from a session",
        )
    loads = tuple(load.load for load in record.loads)
    if (load is None and len(loads) > 1) or (indication is None and len(record.indications) > 1):
        raise _refused(
            record_id,
            f"the load and the indication are not stated: {COMBINED}",
            f"loads {', '.join(loads)}; indications {', '.join(record.indications)}",
            "--load and --indication",
        )
    return evaluate_source(
        CellSource(
            table=table,
            statements=statements_of(record),
            zero=record.zero,
            loads=loads,
            indications=record.indications,
            where=record_id,
        ),
        standard=standard,
        load=load or loads[0],
        indication=indication or record.indications[0],
        preloads=preloads,
        degree=degree,
    )


def _refused(
    where: str,
    problem: str,
    actual: object,
    expected: object,
    next_step: str = "name one of each with --load and --indication",
) -> SessionError:
    return SessionError(
        problem, where=where, got=actual, expected=expected, next_step=next_step, rule="standard"
    )
