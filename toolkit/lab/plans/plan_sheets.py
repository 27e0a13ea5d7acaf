"""The sheets of `toolkit plan`: each plan as rows and sentences for people, and its files in one folder."""

from __future__ import annotations

import datetime as dt
import json
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated

from toolkit.declared import Entry
from toolkit.estimate import round_uncertainty
from toolkit.lab.answers import DeliveredDocument, Timing
from toolkit.lab.home import PLAN
from toolkit.listing import or_dash
from toolkit.planning.demands import PrintedUnits, title_of
from toolkit.planning.sweep_plan import sweep_lines
from toolkit.report.content import Curve, Plot
from toolkit.report.plan.content import Expected, PlanSheet, Step
from toolkit.units import printed

if TYPE_CHECKING:
    from pathlib import Path

    from toolkit.calibration.records.record import CalibrationRecord
    from toolkit.findings import Finding
    from toolkit.planning.interval import IntervalPlan, IntervalRisk
    from toolkit.planning.next_run_plan import NextRunPlan
    from toolkit.planning.protocol_plan import PlannedValue, ProtocolPlan
    from toolkit.planning.session_plan import PlannedLoad, SessionPlan
    from toolkit.report.word.package import Template


SheetKey = Annotated[
    DeliveredDocument | None, Entry("the plan's sheet, where a template was named", sparse=True)
]
TimingKey = Annotated[Timing, Entry("of the command")]


def untimed() -> Timing:
    """Return the time of an answer that is still on its way."""
    return {"seconds": 0.0}


DOCUMENT = "plan"
"""The name of the sheet's two files."""
_WHERE = ("out", "files", "timing")  # of an answer: what was written and how fast, not what was planned


def write_plan(
    files: Mapping[str, str | bytes],
    out: Path,
    sheet: PlanSheet,
    template: Template | None,
    planned: object,
) -> DeliveredDocument | None:
    """Write a plan's files, its answer and, by a template, its sheet, all or none.

    Returns what the answer says of the sheet. ``planned``, a declared answer, is written as ``plan.json``,
    with the kind of plan.
    """
    from toolkit.declared import answer
    from toolkit.lab.answers import delivered_keys
    from toolkit.publication import publication
    from toolkit.report.deliver import deliver
    from toolkit.report.plan.content import build_plan_content
    from toolkit.report.style import read_style, style_file

    stated = {key: value for key, value in answer(planned).items() if key not in _WHERE}
    kept = json.dumps(stated | {"kind": sheet.kind}, ensure_ascii=False, indent=2, allow_nan=False) + "\n"
    with publication(out) as stage:
        for name, data in {**files, PLAN: kept}.items():
            (stage / name).write_bytes(data if isinstance(data, bytes) else data.encode())
        if template is None:
            return None
        content = build_plan_content(sheet, read_style(style_file(template.path)))
        return delivered_keys(deliver(template, content, out, name=DOCUMENT, stage=stage))


def operator_steps(plan: SessionPlan) -> Iterator[tuple[str, str, PlannedLoad | None]]:
    """Yield the operator's steps of a session: run, what to do, and the load that is then on."""
    run, mount = 0, ""
    for row in (*plan.rows, *plan.check):
        name = str(row.run) if row.run <= plan.runs else "check loads"
        if row.run != run:
            yield name, "preload to the largest load and back; rest; read the zeros", None
            run, mount = row.run, ""
        if row.mount and row.mount != mount:
            yield name, f"mount: {row.mount}", None
            mount = row.mount
        way = "from below" if row.direction == "up" else "from above"
        yield name, f"{row.label}, {way}" if row.mount else f"no load, {way}", row
    yield "check loads", "read the zeros", None


def session_sheet(plan: SessionPlan, record: CalibrationRecord, issued: dt.date) -> PlanSheet:
    """Return the sheet of a session."""

    def applied(row: PlannedLoad | None) -> str:
        loads = zip(record.loads, () if row is None else row.loads, strict=False)
        return ", ".join(f"{fit.load} {value:.5g} {printed(fit.unit)}" for fit, value in loads if value)

    minutes = "" if plan.minutes is None else f", {plan.minutes:.0f} minutes"
    largest = max(plan.outlook, key=lambda load: load.U / load.U_today)
    return PlanSheet(
        kind="session",
        subject=plan.instrument,
        basis=f"{plan.record}, {plan.source}",
        size=f"{len(plan.rows)} loads in {plan.runs} runs, {len(plan.check)} check loads{minutes}",
        summary=f"{len(plan.rows)} loads in place of {plan.rows_today}. U becomes "
        f"{largest.U / largest.U_today:.2f} times that of today at most ({largest.load}).",
        issued=issued,
        uncertainties=tuple(
            Expected(
                quantity=load.load, at=f"{load.at:.5g}", unit=printed(load.unit),
                reference=round_uncertainty(load.U_today),
                asked=or_dash(load.U_asked, ".3g"),
                expected=round_uncertainty(load.U_expected),
                span=f"< {round_uncertainty(load.U_in_nine_of_ten)} in 9 of 10",
            )
            for load in plan.outlook
        ),
        steps=tuple(
            Step(run=run, action=action, applied=applied(row)) for run, action, row in operator_steps(plan)
        ),
        assumptions=plan.assumptions,
        gives_up=plan.gives_up,
        findings=plan.findings,
    )  # fmt: skip


def protocol_sheet(plan: ProtocolPlan, issued: dt.date, units: PrintedUnits) -> PlanSheet:
    """Return the sheet of a test: a step is a recording, which runs through all loads."""
    design, own = plan.plan, plan.protocol
    force = printed(units.force)
    sizes = (units.shown(load, "N")[0] for load in design.loads_N)
    loads = f"{', '.join(f'{size:.0f}' for size in sizes)} {force}"
    record = "" if plan.calibration is None else f", {plan.calibration}"

    recordings = 0 if plan.sweeps is None else len(plan.sweeps.recordings)
    swept = f" and {recordings} sweeps" if recordings else ""
    minutes = design.minutes + (0.0 if plan.sweeps is None else plan.sweeps.minutes)

    def wait(pause: float) -> str:
        return f"pause of {pause:.0f} s, " if pause > max(own.pauses_s) else ""

    return PlanSheet(
        kind="test",
        subject=plan.machine,
        basis=f"{plan.like}{record}",
        size=f"{design.rows} rows{swept} in {minutes:.1f} minutes",
        summary=f"{design.rows} rows{swept} in place of {own.rows} of the machine's protocol, {minutes:.1f} "
        f"minutes in place of {own.minutes:.1f}.",
        issued=issued,
        uncertainties=tuple(
            _expected(value, units) for value in plan.values
        ),
        steps=tuple(
            Step(run=rotation, action=f"{wait(pause)}slip angle {angle:g} deg", applied=loads)
            for rotation in design.rotations
            for angle, pause in zip(design.slip_angles_deg, design.pauses_s, strict=True)
        )
        + _sweep_steps(plan, units),
        assumptions=plan.assumptions,
        gives_up=plan.gives_up,
    )  # fmt: skip


def _sweep_steps(plan: ProtocolPlan, units: PrintedUnits) -> tuple[Step, ...]:
    """Return a step for each recording in time."""
    if plan.sweeps is None:
        return ()
    return tuple(
        Step(
            run=sweep.rotation, action=f"sweep in time: {line}",
            applied=", ".join(f"{units.shown(load, 'N')[0]:.0f}" for load in sweep.loads_N) + " "
            + printed(units.force),
        )
        for sweep, line in zip(plan.sweeps.recordings, sweep_lines(plan.sweeps), strict=True)
    )  # fmt: skip


def _expected(value: PlannedValue, units: PrintedUnits) -> Expected:
    def U(size: float) -> str:
        return round_uncertainty(units.shown(size, value.unit)[0])

    return Expected(
        quantity=title_of(value.name),
        at="{:.0f} {}".format(*units.shown(value.load_N, "N")),
        unit=printed(units.shown(value.planned_U, value.unit)[1]),
        reference="-" if value.protocol_U is None else U(value.protocol_U),
        asked=U(value.demanded_U),
        expected=U(value.planned_U),
        span=f"< {U(value.planned_U_in_nine_of_ten)} in 9 of 10",
    )


def condition_steps(plan: NextRunPlan) -> tuple[Step, ...]:
    """Return the conditions of a run that no step of it states already, for its operator."""
    return tuple(
        Step(run="1", action=f"condition {key}", applied=value)
        for key, value in plan.conditions.items()
        if f"{key}: {value}" not in plan.steps
    )


def next_sheet(plan: NextRunPlan, plots: Sequence[Plot], issued: dt.date) -> PlanSheet:
    """Return the sheet of a run that parts a class, with what every member predicts of it."""
    return PlanSheet(
        kind="next",
        subject=", ".join(plan.members),
        basis=f"case {plan.case_sha256[:16]}",
        size=f"{plan.seconds:.0f} s",
        summary=f"This run names the true member in {100 * plan.power:.0f} %, a repeat in "
        f"{100 * plan.power_of_repeat:.0f} %.",
        issued=issued,
        pairs=tuple(
            (pair.true, pair.other, f"{pair.recorded:+.1f}", f"{pair.repeat:.1f}", f"{pair.expected:.1f}")
            for pair in plan.pairs
        ),
        steps=(*(Step(run="1", action=step, applied="") for step in plan.steps), *condition_steps(plan)),
        plots=tuple(plots),
        assumptions=plan.assumptions,
        gives_up=(
            *(f"stay together: {' and '.join(pair)}" for pair in plan.together),
            *(f"could not be fitted: {name}" for name in plan.lost),
        ),
    )


def interval_sheet(
    plan: IntervalPlan, instrument: str, record: str, findings: Sequence[Finding], issued: dt.date
) -> PlanSheet:
    """Return the sheet of an interval, with its risk over the days."""
    from toolkit.planning.interval import ASSUMPTIONS

    risks = sorted({*plan.risks, plan.chosen}, key=lambda risk: risk.days)
    inside = f"{100 * (1 - plan.chosen.beyond):.1f} %"
    load, _, check_load = plan.limiting.partition(" at ")
    limiting = f"{load} by the check load {check_load}"
    return PlanSheet(
        kind="interval",
        subject=instrument,
        basis=f"{record}: {plan.readings} readings of {limiting}",
        size=f"{plan.days} days",
        summary=f"After {plan.chosen.days} days inside the tolerance with a chance of {inside}; asked for: "
        f"{100 * plan.reliability:g} %. {limiting} drifts most.",
        issued=issued,
        risks=tuple(
            (str(risk.days), f"{100 * risk.beyond:.1f}", f"{risk.sessions_a_year:.2g}",
             or_dash(risk.recalled_a_year, ".3g"))
            for risk in risks
        ),
        plots=(_risk_plot(risks, plan.reliability),),
        assumptions=ASSUMPTIONS,
        findings=tuple(findings),
    )  # fmt: skip


def _risk_plot(risks: Sequence[IntervalRisk], reliability: float) -> Plot:
    days = tuple(float(risk.days) for risk in risks)
    shares = tuple(100 * risk.beyond for risk in risks)
    limit = 100 * (1 - reliability)
    listed = ", ".join(f"{risk.days}: {share:.1f} %" for risk, share in zip(risks, shares, strict=True))
    return Plot(
        name="risk",
        x_label="interval [days]",
        y_label="beyond the tolerance [%]",
        curves=(
            Curve(label="chance at the interval's end", x=days, y=shares, style="both"),
            Curve(label="allowed", x=(days[0], days[-1]), y=(limit, limit), group=1, style="line"),
        ),
        caption="Chance to be beyond the tolerance at the interval's end.",
        alt=f"Chance to be beyond the tolerance by days: {listed}.",
    )
