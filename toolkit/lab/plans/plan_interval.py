"""`toolkit plan interval`: when an instrument is to be calibrated again, by its check loads."""

from __future__ import annotations

import dataclasses
import datetime as dt
import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

from toolkit.declared import Entry
from toolkit.declared.answers import extended
from toolkit.errors import ConfigError
from toolkit.findings import Finding, FindingEntry
from toolkit.lab.answers import document_text, findings_text
from toolkit.lab.plans.plan_sheets import SheetKey, TimingKey, untimed
from toolkit.listing import or_dash, table
from toolkit.planning.interval import IntervalPlan

if TYPE_CHECKING:
    from pathlib import Path

    from toolkit.calibration.registry.registry import Registry
    from toolkit.report.word.package import Template


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanIntervalAnswer(IntervalPlan):
    """The interval of an instrument, and what stands beside it."""

    instrument: Annotated[str, Entry("its name")]
    record: Annotated[str, Entry("id of the one in force")]
    in_use: Annotated[str | None, Entry("interval, as its approval states it")]
    next: Annotated[str, Entry("day of the next session")]
    method_2_days: Annotated[int | None, Entry("what drift alone recommends")]
    assumptions: Annotated[tuple[str, ...], Entry("what it rests on")]
    findings: Annotated[tuple[FindingEntry, ...], Entry("on the interval")]
    document: SheetKey = None
    timing: TimingKey = field(default_factory=untimed)


LEAST = 0.5
"""Reliability below which an interval is none."""
MOST_TESTS = round(365.25 * 86400)
"""Tests in a year: no machine makes more than one a second."""


def interval_plan_answer(
    registry: Registry,
    instrument: str,
    *,
    reliability: float,
    tests_a_year: float | None,
    load: str | None,
    out: Path | None = None,
    template: Template | None = None,
) -> tuple[PlanIntervalAnswer, str, list[Finding]]:
    """Return the interval of an instrument as an answer and text, with its findings; its sheet into ``out``.

    Raises
    ------
    ToolkitError
        no such instrument, a reliability or a number that cannot be used, too short a history;
        ``plan-infeasible``: no interval keeps the reliability
    """
    from toolkit.calibration.control.chart import control_chart
    from toolkit.calibration.control.recall import due_of
    from toolkit.lab.plans.plan_sheets import interval_sheet, write_plan
    from toolkit.planning.interval import ASSUMPTIONS, paths_of, plan_interval

    if not LEAST <= reliability < 1:
        raise _wrong("--reliability", reliability, f"a share from {LEAST:g} to below 1, such as 0.95")
    if tests_a_year is not None and not 0 <= tests_a_year <= MOST_TESTS:
        raise _wrong("--tests", tests_a_year, f"tests a year, 0 to {MOST_TESTS}, which is one a second")
    due = due_of(registry, instrument, registry.today())
    if load is not None:
        registry.load(due.record).load(load)  # refuses a load that the record does not have
    chart = control_chart(registry, instrument, load=load)
    records = {point.record for series in chart.series for point in series.points}
    dates = {record: dt.date.fromisoformat(registry.load(record).date) for record in sorted(records)}
    plan = plan_interval(paths_of(chart, dates), reliability=reliability, tests_a_year=tests_a_year)
    if not plan.days:
        raise _infeasible(plan)
    day = due.session_date + dt.timedelta(days=plan.days)
    findings = _findings(plan, instrument, day, registry.today())
    answer = extended(
        PlanIntervalAnswer, plan, instrument=instrument, record=due.record, in_use=due.recall,
        next=day.isoformat(),
        method_2_days=due.recommended.days, assumptions=ASSUMPTIONS,
        findings=tuple(finding.as_dict() for finding in findings),
    )  # fmt: skip
    if out is not None:
        sheet = interval_sheet(plan, instrument, due.record, findings, registry.today())
        answer = dataclasses.replace(answer, document=write_plan({}, out, sheet, template, answer))
    return answer, _text(answer, findings) + document_text(answer.document), findings


def _infeasible(plan: IntervalPlan) -> ConfigError:
    """Return the error of a reliability that not even the shortest interval keeps, with the nearest."""
    reached = math.floor(1e4 * (1 - plan.chosen.beyond)) / 1e4
    step = f"ask with --reliability {reached:g}, or look for" if reached >= LEAST else "look for"
    return ConfigError(
        "no interval keeps the reliability", where="--reliability", got=plan.reliability,
        expected=f"nearest: {plan.chosen.days} days, which keep {reached:g}; {plan.limiting} limits them",
        next_step=f"{step} what drifts or scatters; nothing was written", rule="plan-infeasible",
    )  # fmt: skip


def _findings(plan: IntervalPlan, instrument: str, day: dt.date, today: dt.date) -> list[Finding]:
    from toolkit.planning.interval import STEP

    findings = []
    if day < today:
        message = f"by this interval {instrument} was due on {day.isoformat()}, {(today - day).days} days ago"
        findings.append(Finding(rule="overdue", where=instrument, message=message))
    if plan.capped:
        message = (
            f"kept at {STEP:g} times the longest gap of {plan.seen_days} days: beyond it nothing was seen"
        )
        findings.append(Finding(rule="plan-interval", where=instrument, message=message, level="note"))
    return findings


def _text(plan: PlanIntervalAnswer, findings: list[Finding]) -> str:
    from toolkit.planning.interval import ASSUMPTIONS

    lines = [
        f"{plan.instrument}: {plan.days} days, next by {plan.next}",
        f"at its end inside the tolerance with {100 * (1 - plan.chosen.beyond):.1f} %; asked for: "
        f"{100 * plan.reliability:g} %; in use: {plan.in_use or 'none'}; ILAC-G24 method 2: "
        f"{'none' if plan.method_2_days is None else f'{plan.method_2_days} days'}",
        f"{plan.limiting} drifts most, by {plan.readings} readings ({plan.paths} check loads and loads): "
        f"{plan.trend_per_year:+.2g} tolerances a year, random walk {plan.walk_per_root_year:.2g} in a year",
        "",
        table(
            ["days", "beyond the tolerance", "sessions a year", "tests recalled a year"],
            [
                [str(risk.days), f"{100 * risk.beyond:.1f} %", f"{risk.sessions_a_year:.2g}",
                 or_dash(risk.recalled_a_year, ".3g")]
                for risk in sorted({*plan.risks, plan.chosen}, key=lambda risk: risk.days)
            ],
            align=">>>>",
        ),
        "",
        "it assumes:", *(f"  {text}" for text in ASSUMPTIONS),
    ]  # fmt: skip
    found = findings_text(findings)
    return "\n".join([*lines, *([found] if found else [])])


def _wrong(where: str, actual: object, expected: str) -> ConfigError:
    return ConfigError(
        "a number cannot be used", where=where, got=actual, expected=expected, next_step="correct it",
        rule="plan-demand",
    )  # fmt: skip
