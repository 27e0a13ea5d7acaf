"""`toolkit plan`: what to measure next, from what the laboratory's records know and lack."""

from __future__ import annotations

import dataclasses
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Protocol, cast

import typer

from toolkit.cli.command import ARGUMENT, Mark, answers
from toolkit.cli.console import exit_code
from toolkit.cli.options import DAY, INTO_FOLDER, Draft, KnownAt, Output, RegistryOptions, day
from toolkit.errors import ConfigError

if TYPE_CHECKING:
    from toolkit.lab.answers import DeliveredDocument

app = typer.Typer(help="Plans: what to measure next: sessions, tests, runs, intervals.", no_args_is_help=True)

Out = Annotated[Path | None, "Folder for the plan's files; none of them may exist.", INTO_FOLDER]
SheetTemplate = Annotated[Path | None, "Word template of the plan's sheet, plan.docx and plan.pdf in --out."]


@app.command("session")
@answers("toolkit.lab.plans.plan_session:PlanSessionAnswer")
def session(
    instrument: Annotated[str, "Instrument, such as rig: its record in force is the basis.", ARGUMENT],
    session_file: Annotated[
        Path | None, "SESSION.toml to plan from instead.", Mark(names=("--session",), metavar="FILE")
    ] = None,
    calibration: Annotated[str | None, "Record id to plan from; default: the one in force."] = None,
    draft: Draft = False,
    fixtures: Annotated[
        Path | None,
        "Loading fixtures (.toml): weights, arms, minutes; default: the machine definition's, else the "
        "loads of the last session.",
        Mark(metavar="FILE"),
    ] = None,
    machine: Annotated[
        str | None,
        "Machine definition whose [loading] states the fixtures; default: the packaged one of the "
        "instrument's name.",
    ] = None,
    demands: Annotated[
        list[str] | None,
        'U asked for at the largest load, "FY=20 N", or at another, "FY=20 N at 4 kN"; once for each load.',
        Mark(names=("--u",), metavar="LOAD=U"),
    ] = None,
    minutes: Annotated[float | None, "Time at most, check loads included."] = None,
    loads: Annotated[int | None, "Loads at most, check loads apart."] = None,
    criterion: Annotated[str, "D, I or G: of what the loads are optimal."] = "D",
    two_levels: Annotated[bool, "Allow plans at which no misfit of the equations can be seen."] = False,
    seed: Annotated[int, "Of the search and of the simulated sessions.", Mark(min=0)] = 0,
    on: Annotated[datetime | None, "Day whose record in force is taken; default: today.", DAY] = None,
    out: Out = None,
    template: SheetTemplate = None,
    known_at: KnownAt = None,
    *,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Plan the loads of the next calibration session, in their order.

    The fewest loads that keep a stated U, or the least U in a stated time or number of loads; without any of
    these today's U within a twentieth. U is that of 'toolkit calibration budget', with what the record knows
    of the scatter within runs and between them. Every load has three levels and some rows are repeated, so
    that a misfit of an equation is seen: loads that cannot end with 2, unless --two-levels. Check loads
    verify the sign of every coefficient by five tolerances.

    --out gets SESSION.toml, loads.csv and check.csv, which 'toolkit calibrate' reads once the readings are
    filled in, and the operator's sheet; with --template as Word and PDF too.

    Example: toolkit plan session rig --u "FY=1.2 N" --out next
    """
    from toolkit.lab.home import document_template
    from toolkit.lab.plans.plan_session import PlanOrder, session_plan_answer
    from toolkit.planning.criteria import CRITERIA

    if criterion not in CRITERIA:
        raise ConfigError(
            "an unknown criterion", where="--criterion", got=criterion, expected=", ".join(CRITERIA),
            next_step="name one of those", rule="usage",
        )  # fmt: skip
    order = PlanOrder(
        instrument=instrument, session=session_file, calibration=calibration, draft=draft,
        fixtures=fixtures, machine=machine, demands=tuple(demands or ()),
        minutes=minutes, loads=loads, criterion=criterion, two_levels=two_levels, seed=seed, on=day(on),
        known_at=day(known_at), out=out, template=document_template(template, out),
    )  # fmt: skip
    planned, text, findings = session_plan_answer(place.registry(), order)
    return max(answered(planned, text, output), exit_code(findings))


class Planned(Protocol):
    """An answer of a plan."""

    @property
    def document(self) -> DeliveredDocument | None:
        """Its sheet."""


def answered(planned: Planned, text: str, output: Output) -> int:
    """Print a plan with the time that it took; return 1 where its sheet has warnings."""
    from toolkit.declared import answer

    output.answer(answer(dataclasses.replace(cast("Any", planned), timing=output.timing)), text)
    return int(planned.document is not None and bool(planned.document["warnings"]))


@app.command("interval")
@answers("toolkit.lab.plans.plan_interval:PlanIntervalAnswer")
def interval(
    instrument: Annotated[str, "Instrument, such as rig: by the history of its check loads.", ARGUMENT],
    reliability: Annotated[float, "Chance to be inside the tolerance at the interval's end."] = 0.95,
    tests: Annotated[float | None, "Tests a year, for how many of them are put at risk."] = None,
    load: Annotated[str | None, "By the errors of this load only."] = None,
    out: Annotated[Path | None, "Folder for its sheet, plan.docx and plan.pdf.", INTO_FOLDER] = None,
    template: Annotated[Path | None, "Word template of --out; default: report_templates/plan.docx."] = None,
    *,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Plan when to calibrate again: the longest interval that keeps a reliability at its end.

    Drift between sessions is a state-space model (level, trend, random walk) of each check load's errors, by
    the record before; the path that drifts most decides. ILAC-G24's method 2 stands beside it. Nothing is
    entered: the interval in use is set on approval.

    Example: toolkit plan interval rig --reliability 0.95 --tests 200
    """
    from toolkit.lab.home import document_template
    from toolkit.lab.plans.plan_interval import interval_plan_answer

    planned, text, findings = interval_plan_answer(
        place.registry(), instrument, reliability=reliability, tests_a_year=tests, load=load,
        out=out, template=document_template(template, out, default="plan.docx", home=place.home),
    )  # fmt: skip
    return max(answered(planned, text, output), exit_code(findings))
