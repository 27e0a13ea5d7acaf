"""`toolkit plan`: what to measure next, from what the laboratory's records know and lack.

A plan is of a session, a test, the next run of a diagnosis, or an interval: how few loads and runs are
enough.
"""

from __future__ import annotations

import dataclasses
import math
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Protocol, cast

import typer

from toolkit.cli.command import ARGUMENT, Mark, answers
from toolkit.cli.console import exit_code
from toolkit.cli.options import (
    DAY,
    INTO_FOLDER,
    CalibrationId,
    Draft,
    KnownAt,
    Output,
    RegistryOptions,
    WorkerOptions,
    day,
)
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
    from toolkit.planning.row_exchange import CRITERIA

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


@app.command("test")
@answers("toolkit.lab.plans.protocol_plan:PlanTestAnswer")
def protocol(
    like: Annotated[
        list[Path] | None,
        "Earlier test of such a tire, or a tire file (.tir, model.toml); repeatable: the plan serves each "
        "of them. Default: passenger tires, by the published one on the virtual machine.",
        Mark(metavar="TEST|TIRE"),
    ] = None,
    spread: Annotated[
        list[str] | None,
        "How far tires of the class may be from it, as factors: stiffness=0.7..1.3, friction=0.9..1.1; the "
        "plan serves all of them. Default: as tested; of passenger tires, stiffness=0.41..1.11.",
        Mark(metavar="NAME=LOW..HIGH"),
    ] = None,
    u: Annotated[
        list[str] | None,
        "Largest expanded uncertainty: 'conicity=2 N', 'slope_cornering=2 %', 'FY@8deg=40 N', 'peak=1 %'; a "
        "name alone: that of the machine's protocol. Repeatable; default: slope_cornering, conicity, "
        "plysteer and peak as by the protocol.",
        Mark(metavar="NAME=U"),
    ] = None,
    load: Annotated[
        list[str] | None, "At which load, '833 lbf'; repeatable; default: all.", Mark(metavar="LOAD")
    ] = None,
    minutes: Annotated[float | None, "Time on the machine at most."] = None,
    between_files: Annotated[
        float | None, "From one recording to the next; default 30.", Mark(metavar="SECONDS", min=0.0)
    ] = None,
    sliding: Annotated[
        float | None, "Energy that may slide away: wear of the tread.", Mark(metavar="KJ")
    ] = None,
    rise: Annotated[
        float | None,
        "Largest temperature rise of the tread above the room; pauses keep it below.",
        Mark(metavar="K"),
    ] = None,
    out: Annotated[
        Path | None, "Folder for protocol.toml and the plan.toml of `toolkit simulate`.", INTO_FOLDER
    ] = None,
    template: SheetTemplate = None,
    calibration: CalibrationId = None,
    draft: Draft = False,
    *,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Plan the shortest test that reaches stated uncertainties.

    Slip angles, loads and directions, by the budget that `toolkit process` prints. A demand that no
    test meets ends with 2 and the nearest plan that is feasible.

    Example: toolkit plan test --like tests/2019-06-04 --u "conicity=2 N" --load "833 lbf" --out plan
    """
    from toolkit.lab.home import document_template
    from toolkit.lab.plans.protocol_plan import ProtocolOrder, plan_test

    order = ProtocolOrder(
        like=tuple(like or ()), spread=tuple(spread or ()), demands=tuple(u or ()), loads=tuple(load or ()),
        minutes=_most(minutes), between_files_s=between_files, sliding_kJ=_most(sliding), rise_K=_most(rise),
        basis=place.basis(calibration=calibration, draft=draft),
    )  # fmt: skip
    opened = document_template(template, out)
    with output.progress("planning") as step:
        planned, text = plan_test(order, out, template=opened, tell=step)
    return answered(planned, text, output)


def _most(limit: float | None) -> float:
    return math.inf if limit is None else limit


@app.command("next")
@answers("toolkit.lab.plans.next_run:PlanNextAnswer")
def following(
    source: Annotated[
        Path, "Folder of toolkit diagnose --out, or its diagnosis.json.", ARGUMENT, Mark(metavar="ANSWER")
    ],
    case: Annotated[Path | None, "The case; default: the one that the answer's model names."] = None,
    limit: Annotated[
        list[str] | None,
        "What an input may reach, in its unit; repeatable; default: what was recorded.",
        Mark(metavar="NAME=LOW..HIGH"),
    ] = None,
    rate: Annotated[
        list[str] | None,
        "How fast an input may change, in its unit a second; repeatable; default: four times as recorded.",
        Mark(metavar="NAME=MOST"),
    ] = None,
    sample_rate: Annotated[
        float | None,
        "Rows that can be recorded in a second; default: the case's, the machine's, or as recorded.",
        Mark(metavar="HZ", min=0.0),
    ] = None,
    minutes: Annotated[
        float | None,
        "How long a run may take; default: the case's longest_run, or as recorded.",
        Mark(metavar="MIN", min=0.0),
    ] = None,
    budget: Annotated[
        float, "Seconds until the search ends; a third of them it has in any case.", Mark(min=1.0)
    ] = 45.0,
    out: Annotated[
        Path | None, "Folder for the inputs, what each member predicts, and the steps.", INTO_FOLDER
    ] = None,
    template: SheetTemplate = None,
    *,
    worker: WorkerOptions,
    place: RegistryOptions,
    output: Output,
) -> int:
    """Propose the run that tells the members of a diagnosis' class apart.

    Each member is fitted to the recordings in the others' place. Runs are those that were made, with inputs
    faster or slower, larger or smaller, one alone, on new courses within the limits, with denser rows where
    these can be recorded, longer where one may be, and conditions changed: the one is proposed in which the
    members' predictions are furthest apart beyond noise and what is open of their parameters.

    Example: toolkit plan next answer --out next
    """
    from toolkit.lab.home import document_template
    from toolkit.lab.plans.next_run import plan_next

    opened = document_template(template, out)
    with output.progress("planning") as step:
        planned, text = plan_next(
            source, out, case=case, limits=tuple(limit or ()), rates=tuple(rate or ()),
            sample_rate_Hz=sample_rate, minutes=minutes, budget_s=budget, calibrations=place.calibrations,
            home=place.home, worker=worker.limits(), template=opened, tell=step,
        )  # fmt: skip
    return answered(planned, text, output)
