"""`toolkit plan next`: from a diagnosis that leaves a class to the run that parts it."""

from __future__ import annotations

import dataclasses
import itertools
import os
import re
import shlex
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from toolkit.declared import Entry
from toolkit.declared.answers import extended
from toolkit.findings import FindingEntry
from toolkit.lab.answers import document_text
from toolkit.lab.plans.plan_sheets import SheetKey, TimingKey, untimed
from toolkit.lab.plans.run_demands import (
    denser_rows,
    infeasible,
    least_step,
    longest_run,
    nothing_parts,
    stated_limits,
    wrong,
)
from toolkit.listing import table
from toolkit.planning.next_run_plan import ASSUMPTIONS, NextRunPlan, PartedPair

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.case.case import Case, Run
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.diagnosis.simulators.simulator import Output
    from toolkit.planning.members import Member
    from toolkit.planning.next_run import NextRun
    from toolkit.report.content import Plot
    from toolkit.report.word.package import Template
    from toolkit.worker.posix import Limits


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanNextAnswer(NextRunPlan):
    """The run that tells a class apart, and what was written of it."""

    out: Annotated[Path | None, Entry("folder of the plan's files; null where none was named")]
    files: Annotated[tuple[str, ...], Entry("in that folder")] = ()
    findings: Annotated[tuple[FindingEntry, ...], Entry("what is to be known of it")] = ()
    document: SheetKey = None
    timing: TimingKey = field(default_factory=untimed)


INPUTS, PREDICTIONS, STEPS = "next.csv", "predictions.csv", "operator.txt"
_AS_RECORDED = 0.01  # of an input's span
_PLAIN, _APART = re.compile(r"[A-Za-z0-9_]{1,40}"), "_apart"


def plan_next(
    source: Path,
    out: Path | None,
    *,
    case: Path | None = None,
    limits: Sequence[str] = (),
    rates: Sequence[str] = (),
    sample_rate_Hz: float | None = None,
    minutes: float | None = None,
    budget_s: float = 60.0,
    calibrations: Path | None = None,
    home: Path | None = None,
    worker: Limits | None = None,
    template: Template | None = None,
    tell: Callable[[str], None] = lambda _text: None,
) -> tuple[PlanNextAnswer, str]:
    """Return the answer and the text of the run that parts an answer's class; write its files.

    Parameters
    ----------
    source : folder of ``toolkit diagnose --out``, or its diagnosis.json
    case : the case file; by default the one that the answer's model names
    limits, rates : ``NAME=LOW..HIGH`` in the channel's unit, ``NAME=MOST`` in that a second
    sample_rate_Hz, minutes : rows that can be recorded in a second, and how long a run may be
    budget_s : seconds until the search over runs ends, a third of which it has in any case
    worker : limits of the case's own code; None runs it in this process
    template : of the sheet that stands in ``out`` beside the other files; None for none

    Raises
    ------
    ConfigError
        ``plan-next``: no class, a case that is another one, no run that can be made, or rows;
        ``plan-infeasible``: no run stays within the limits, with the nearest limits that one keeps
    """
    from datetime import date

    from toolkit.diagnosis.answer.reader import read_answer
    from toolkit.diagnosis.case.reader import read_case
    from toolkit.diagnosis.fit.problem import problem_of
    from toolkit.diagnosis.simulators.build_simulator import model_of
    from toolkit.diagnosis.simulators.case_code import running
    from toolkit.lab.plans.plan_sheets import next_sheet, write_plan
    from toolkit.lab.studies.diagnosis import machine_registry
    from toolkit.planning.members import class_of, members_of
    from toolkit.planning.next_run import RunSearch
    from toolkit.planning.run_changes import Change, RunLimits, movable

    begun = time.monotonic()
    stated = None if case is None else read_case(case)
    diagnosis, file = read_answer(source)
    effect = class_of(diagnosis, file)
    read = stated or read_case(_case_of(file))
    if read.sha256 != diagnosis.case_sha256:
        raise wrong(
            "the case is not the one of the answer", read.path, read.sha256[:16],
            diagnosis.case_sha256[:16], "diagnose the case again, or name the right one with --case",
        )  # fmt: skip
    registry = machine_registry(read.simulation.kind, calibrations, home)
    with running(read, worker) as code:
        if code is not None:
            code.until = time.monotonic() + 10 * budget_s
        problem = problem_of(read, model_of(read, registry, code))
        reach = dataclasses.replace(
            stated_limits(limits, rates, read),
            step_s=least_step(sample_rate_Hz, problem), longest_s=longest_run(minutes, problem),
        )  # fmt: skip
        tell("the members of the class")
        members = members_of(problem, diagnosis.effects, effect)
        tell("runs")
        ends = search_ends(begun, time.monotonic(), budget_s)
        search = RunSearch(
            problem=problem, members=members, limits=reach, until=lambda: time.monotonic() < ends,
            learn=(lambda _runs: None) if code is None else code.learn,
        )  # fmt: skip
        best = search.best()
        chosen = search.judge(best)
        if chosen is None and reach:
            raise infeasible(problem, reach)
        # A repeat was made once: limits of the next run are none of it.
        recorded = dataclasses.replace(search, limits=RunLimits(), judged={}, runs={}) if reach else search
        repeat = recorded.judge(Change(run=best.run))
        if chosen is not None and not chosen.parts:
            chosen = search.made_again(chosen) or chosen
        stays = chosen is not None and not chosen.parts
        complete = time.monotonic() < ends
        longer = time.monotonic() + budget_s / 3
        denser = denser_rows(search, lambda: time.monotonic() < longer) if stays else None
    if chosen is None or repeat is None:
        raise wrong("no run can be simulated", read.path, best.run, "a run of the case",
                     "look at the case's simulation")  # fmt: skip
    if stays:
        raise nothing_parts(search, chosen, effect, denser, complete=complete)
    driven = [name for name, _ in movable(problem, reach)]
    plan = _plan(problem, diagnosis.effects, members, chosen, repeat, driven, len(search.judged), complete)
    answer = extended(PlanNextAnswer, plan, out=out)
    if out is not None:
        figures = plots(problem, members, chosen)
        files = _files(problem, members, chosen, plan, figures)
        sheet = next_sheet(plan, figures, date.today())  # noqa: DTZ011
        written = write_plan(files, out, sheet, template, answer)
        answer = dataclasses.replace(answer, document=written, files=tuple(files))
    text = plan_text(plan, answer.files, model=file.parent / "model.toml", out=out)
    return answer, text + document_text(answer.document)


def search_ends(begun: float, now: float, budget_s: float) -> float:
    """Return when a search ends that others had to be waited for: a third of its budget it has in any case.

    >>> search_ends(0.0, 20.0, 45.0), search_ends(0.0, 40.0, 45.0)
    (45.0, 55.0)
    """
    return max(begun + budget_s, now + budget_s / 3)


def _case_of(file: Path) -> Path:
    """Return the case that an answer's model names."""
    from toolkit.files import read_toml

    model = file.parent / "model.toml"
    named = read_toml(model).get("answer", {}).get("case") if model.is_file() else None
    if not isinstance(named, str):
        raise wrong(
            "the answer does not say where its case is", model, "no case",
            "the model.toml beside diagnosis.json", "name the case with --case CASE.toml",
        )  # fmt: skip
    return Path(os.path.normpath(file.parent / named))


def _plan(
    problem: Problem,
    effects: Sequence[Any],
    members: Sequence[Member],
    chosen: NextRun,
    repeat: NextRun,
    driven: Sequence[str],
    judged: int,
    complete: bool,
) -> NextRunPlan:
    case = problem.case
    likelihood = {member.label: member.fit.log_posterior for member in members}
    again = {(true, other): gain for true, other, gain in repeat.pairs}
    first, *others = [effect for effect in effects if effect.equivalent_to]
    names = {first.name, *first.equivalent_to}
    fitted = {member.fit.active[-1].effect.name for member in members}
    run = chosen.run
    often = f"made {chosen.times} times, one after the other, each a recording of its own"
    return NextRunPlan(
        case_sha256=case.sha256,
        members=tuple(member.label for member in members),
        lost=tuple(sorted(names - fitted)),
        steps=(*chosen.change.words(), *([often] if chosen.times > 1 else []), *_ranges(case, run, driven)),
        conditions=dict(run.conditions),
        seconds=chosen.seconds,
        times=chosen.times,
        pairs=tuple(
            PartedPair(
                true=true, other=other, recorded=likelihood[true] - likelihood[other],
                repeat=again[true, other], expected=gain,
            )
            for true, other, gain in chosen.pairs
        ),
        power=chosen.power,
        power_of_repeat=repeat.power,
        together=chosen.together,
        judged=judged,
        complete=complete,
        assumptions=(
            *ASSUMPTIONS,
            *_beyond_recorded(problem, run, driven),
            *(f"the class of {other.name} is another one, not planned for here" for other in others),
        ),
    )  # fmt: skip


def _beyond_recorded(problem: Problem, run: Run, driven: Sequence[str]) -> list[str]:
    """Return what members are asked of inputs at which nothing was recorded."""
    from toolkit.planning.run_changes import reach

    units = {channel.name: channel.unit.replace("*", "·") for channel in problem.case.channels}
    told = []
    for name in driven:
        (low, high), column = reach(problem, name), run.columns[name]
        slack = _AS_RECORDED * (high - low)
        if column.min() < low - slack or column.max() > high + slack:
            told.append(
                f"{name} was recorded from {low:.4g} to {high:.4g} {units[name]}: beyond, members are as "
                "their equations have them, which nothing was held against"
            )
    return told


def _ranges(case: Case, run: Run, driven: Sequence[str]) -> list[str]:
    """Return how far and how fast each input of a run goes, for who drives the machine."""
    from toolkit.planning.drives import fastest
    from toolkit.planning.members import row_step

    units = {channel.name: channel.unit.replace("*", "·") for channel in case.channels}
    every = [f"a row every {row_step(run):.4g} s"] if case.has_time else []
    return every + [
        f"{name} from {column.min():.4g} to {column.max():.4g} {units[name]}"
        + (f", at most {rate:.3g} {units[name]} a second" if case.has_time and rate else "")
        for name, column in ((name, run.columns[name]) for name in driven)
        for rate in [fastest(run.t, column)]
    ]


def _files(
    problem: Problem,
    members: Sequence[Member],
    chosen: NextRun,
    plan: NextRunPlan,
    figures: Sequence[Plot],
) -> dict[str, bytes]:
    """Return inputs, predictions, figures and the operator's steps by the names of their files."""
    from toolkit.diagnosis.fit.predict import csv_of
    from toolkit.report.figures import draw

    run, case = chosen.run, problem.case
    given = [c.name for c in case.channels if c.role != "output" and c.name in run.columns]
    columns = {name: run.columns[name] for name in given}
    clock = {channel.name: run.columns[channel.name] for channel in case.channels if channel.role == "time"}
    said = {
        f"{name}_{member.label.replace(' ', '_')}": predicted.outputs[name]
        for name in problem.names
        for member, predicted in zip(members, chosen.predicted, strict=True)
    }
    files = {
        INPUTS: csv_of(columns).encode(),
        PREDICTIONS: csv_of(clock | said).encode(),
        STEPS: ("\n".join(_operator(plan)) + "\n").encode(),
    }
    return files | {f"{plot.name}.png": draw(plot).png for plot in figures}


def _operator(plan: NextRunPlan) -> list[str]:
    from toolkit.lab.plans.plan_sheets import condition_steps

    return [
        f"Next run, {plan.seconds:.0f} s: the inputs over time stand in {INPUTS}.",
        *(f"- {step}" for step in plan.steps),
        *(f"- {step.action}: {step.applied}" for step in condition_steps(plan)),
        f"It parts: {', '.join(plan.members)}.",
    ]


def plots(problem: Problem, members: Sequence[Member], chosen: NextRun) -> tuple[Plot, ...]:
    """Return two figures of each output: what every member predicts, and how far from the first one."""
    from toolkit.report.content import Curve, Plot

    run = chosen.run
    clock = tuple((run.t - run.t[0]).tolist())
    first = members[0].label

    def plot(output: Output, name: str, y: str, caption: str, columns: Sequence[Array]) -> Plot:
        return Plot(
            name=name,
            x_label="t / s" if problem.case.has_time else "row",
            y_label=f"{y} / {output.unit.replace('*', '·')}",
            curves=tuple(
                Curve(label=member.label, x=clock, y=tuple(column.tolist()), style="line", group=place)
                for place, (member, column) in enumerate(zip(members, columns, strict=True))
            ),
            caption=caption,
            alt=f"{y} over time by {', '.join(member.label for member in members)}.",
        )

    figures = []
    for place, output in enumerate(problem.model.outputs, start=1):
        # A file has the output's name where that is one on every disk and in every address.
        plain = _PLAIN.fullmatch(output.name) is not None and not output.name.endswith(_APART)
        picture = f"next_{output.name if plain else f'output-{place}'}"
        columns = [predicted.outputs[output.name] for predicted in chosen.predicted]
        noise = members[0].fit.noise[output.name].marginal_sd
        figures += [
            plot(
                output, picture, output.name,
                f"{output.name} in the run that is proposed, as each member of the class predicts it.",
                columns,
            ),
            plot(
                output, picture + _APART, f"{output.name} less that of {first}",
                f"How far the predictions are from that of {first}; noise of {output.name} has a standard "
                f"deviation of {noise:.3g} {output.unit.replace('*', '·')}.",
                [column - columns[0] for column in columns],
            ),
        ]  # fmt: skip
    return tuple(figures)


def plan_text(plan: NextRunPlan, files: Sequence[str], *, model: Path, out: Path | None) -> str:
    """Return the run for people: what to do, what it parts and with what chance, what it rests on.

    ``model`` is the answer's model file, which simulates the run; ``out`` the folder of the files.
    """

    rows = [
        [pair.true, pair.other, f"{pair.recorded:+.1f}", f"{pair.repeat:.1f}", f"{pair.expected:.1f}"]
        for pair in plan.pairs
    ]
    lines = [
        f"next run, {plan.seconds:.0f} s, to part {', '.join(plan.members)}:",
        *(f"  {step}" for step in plan.steps),
        "",
        table(["if true", "against", "recorded", "by a repeat", "by this run"], rows, align="<<>>>"),
        "  log-evidence: over 3 the data prefer the first. A class may stand against what is recorded, where "
        "its members are alike on every such machine",
        f"the true member is named by this run in {100 * plan.power:.0f} %, by a repeat in "
        f"{100 * plan.power_of_repeat:.0f} %",
    ]
    lines += [f"stay together: {' and '.join(pair)}" for pair in plan.together]
    if plan.lost:
        lines.append(f"could not be fitted: {', '.join(plan.lost)}")
    if not plan.complete:
        lines.append("the search was ended by --budget: a longer one may find a better run")
    lines += ["", "assumed:", *(f"  {text}" for text in plan.assumptions)]
    if files:
        folder = out or Path()
        lines += ["", *(f"written: {folder / name}" for name in files)]
        stated = [("--condition", f"{key}={value}") for key, value in _simulated(plan.conditions).items()]
        pairs = itertools.chain.from_iterable([("--inputs", str(folder / INPUTS)), *stated])
        lines.append(f"  {shlex.join(['toolkit', 'simulate', str(model), *pairs, '--out', 'DIR'])}")
    return "\n".join(lines)


def _simulated(conditions: Mapping[str, str]) -> dict[str, str]:
    return {key: value for key, value in conditions.items() if key != "file"}
