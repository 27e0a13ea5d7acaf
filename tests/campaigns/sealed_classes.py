"""The classes that sealed batches left: does one proposed run name the right member?

    python -m tests.campaigns.sealed_classes [--drawn SEED] [--family NAME ...] [--effect NAME ...]
        [--minutes 30] [--cases 100] [--seed 27]

A sealed batch of the proof (`proof/*.jsonl.gz`) keeps what the tool answered to each case, and the seed that
draws the case again. A case counts where the answer has a class that holds a true effect, and where what is
drawn again is what was sealed. `plan next` proposes a run; beside it stand a random change within the same
limits and a repeat. The generator's truth answers each, later than all recordings, with noise of its own;
then the members are fitted to all recordings, each from where it was. Named is the one that is ahead of all
others by what a diagnosis asks for. The newest batch comes first.

`--drawn` takes no batch: cases are drawn anew by the proof's generator, family and effect by its own
weights, with one effect or of a class by construction, as often as a batch has them. One counts where the
generator itself knows the class, or finds others within its noise of the effect (`alike`) that is twice as
far from none, and where the recordings name none.

Runs are planned within limits as a laboratory would know them of its machine.
They were fixed before any outcome by them was seen, with these reasons:

- an input reaches 1.5 times the span that was recorded, about its middle: a test seldom goes to the ends of
  its machine. What was never below zero (a heater's power, a valve's flow, the load of a wheel) stays so;
- it goes at most three times as fast as recorded, and the channel of its rate as far;
- a chamber or a bath (`T`, `TA`) is set within 15 K of the middle of what was recorded, three times as fast;
- rows are recorded up to sixteen times as dense: what is kept of a converter's thousand samples a second is
  a choice of the file;
- a run takes up to eight times as long as a recording: minutes, where recordings are of some ten seconds;
- the drum's speed stays as recorded: the shafts' angles, which are recorded beside it, go with it.

Left out, and counted: classes that no run of such a plan can ask about (`outside`).
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import itertools
import json
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import Akima1DInterpolator

from proof import draw, process_noise, proof_file
from proof import model as generated
from proof.catalogue import FAMILIES
from proof.files import write_case
from tests.coverage.rows import exact_interval
from toolkit.diagnosis.answer.answer import DiagnosedEffect, EffectEstimate, EffectEvidence
from toolkit.diagnosis.case.case import Run
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.fit.fit import fit
from toolkit.diagnosis.fit.problem import Problem, problem_of
from toolkit.diagnosis.policy import EVEN, VERDICT
from toolkit.diagnosis.search.between_rows import differences
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.errors import ConfigError, ToolkitError
from toolkit.planning.drives import fastest
from toolkit.planning.members import Member, members_of, refined, row_step
from toolkit.planning.next_run import RunSearch
from toolkit.planning.run_changes import Change, RunLimits, changed, lengthened, movable, reach

PROOFS = Path(__file__).parents[2] / "proof"
KINDS = ("proposed", "random", "repeat")
SEARCH_S = 30.0  # of the processor
PROMISED = 0.9  # power
SPAN, PACE, CHAMBER_K, DENSE, LONG = 1.5, 3.0, 15.0, 16, 8
BUCKETS = ("single", "confounded")
SHOWN = 2  # times as far from no effect at all as others may be from it: else the recordings show none
CHAMBERS, WITH_SHAFTS = ("T", "TA"), ("V",)


def outside(sealed: Mapping[str, Any]) -> str:
    """Return why no plan of a run can part what a sealed case holds; nothing where one can."""
    effects = {effect["name"] for effect in sealed["effects"]}
    if sealed["kind"] == "columns":
        return "the simulation is a recorded column, which answers no new input"
    if sealed["family"] in ("labview", "tire-cells"):
        return "the cells' recordings and the record are alike in every run, or their writer is not at hand"
    if effects & {"steer_offset", "plysteer"}:
        return "both turn the slip angle by a constant, whatever the machine does"
    if sealed["bucket"] in ("control", "outside"):
        return "no effect of the catalogue is there"
    return ""


@dataclasses.dataclass(frozen=True, kw_only=True)
class SealedClass:
    """A case of a batch whose answer left a class."""

    batch: str
    seed: int
    name: str
    sealed: Mapping[str, Any]
    answer: Mapping[str, Any]
    new: draw.Drawn | None = None

    @functools.cached_property
    def effects(self) -> tuple[DiagnosedEffect, ...]:
        """What the answer names, as far as a plan reads it."""
        return tuple(
            DiagnosedEffect(
                name=effect["name"], channel=effect["channel"], equivalent_to=tuple(effect["equivalent_to"]),
                parameters=tuple(
                    EffectEstimate(**{"unit": "", "ci95": None, **p, "runs": p.get("runs") or None})
                    for p in effect["parameters"]
                ),
                stage="", statement="", equation="", reference="", rejected=(),
                evidence=EffectEvidence(held_out_log_score_gain=np.nan, p_value=np.nan),
            )
            for effect in self.answer["effects"]
        )  # fmt: skip

    def drawn(self) -> draw.Drawn | None:
        """Return the case, drawn again; None where the generator of today gives another one."""
        if self.new is not None:
            return self.new
        again = draw.draw_case(self.seed, self.sealed["index"], self.sealed["bucket"])
        same = json.loads(json.dumps(again.answer | {"index": self.sealed["index"]})) == self.sealed
        return again if same else None


def drawn_classes(
    seed: int, *, families: Sequence[str] = (), effects: Sequence[str] = ()
) -> Iterator[SealedClass]:
    """Yield classes drawn anew, without end: of all kinds, or of effects of families, each as likely."""
    share = np.array([draw.MIX[bucket] for bucket in BUCKETS])
    for index in itertools.count():
        rng = np.random.default_rng([seed, index, 99])
        bucket, picked = str(rng.choice(BUCKETS, p=share / share.sum())), None
        if families:
            family = str(rng.choice(families))
            among = [name for name in FAMILIES[family].inside if not effects or name in effects]
            bucket, picked = "single", (family, (str(rng.choice(among)),))
        try:
            again = draw.draw_case(seed, index, bucket, picked=picked)
        except RuntimeError:  # no draw met its conditions
            continue
        sealed = again.answer
        (effect,) = sealed["effects"]
        others = sorted({*(sealed["class"] or sealed["alike"])} - {effect["name"]})
        clear = sealed["class"] or effect["distance"] > SHOWN * draw.ALIKE
        if (
            others
            and clear
            and not outside(sealed | {"effects": [{"name": n} for n in others], "bucket": ""})
        ):
            effect = {
                "name": effect["name"], "channel": effect["channel"], "parameters": (),
                "equivalent_to": tuple(others),
            }  # fmt: skip
            yield SealedClass(
                batch=f"seed {seed}", seed=seed, name=f"case {index}", sealed=sealed,
                answer={"effects": [effect]}, new=again,
            )  # fmt: skip


def classes() -> tuple[list[SealedClass], Counter[str]]:
    """Return the classes that sealed batches left, the newest batch first, and what is left out."""
    found: list[SealedClass] = []
    absent: Counter[str] = Counter()
    rows = [json.loads(line) for line in (PROOFS / "batches.jsonl").read_text(encoding="utf-8").splitlines()]
    for row in rows[::-1]:
        path = PROOFS / f"proof-{row['answers_sha256'][:16]}.jsonl.gz"
        if not path.exists():
            continue
        batch = proof_file.read(path)
        for name, case in batch.cases.items():
            if case.answer is None or case.answer.get("verdict") != "equivalent":
                continue
            sealed = batch.sealed[name]
            if reason := outside(sealed):
                absent[reason] += 1
                continue
            found.append(
                SealedClass(
                    batch=path.name[6:14], seed=batch.seed, name=name, sealed=sealed, answer=case.answer
                )
            )
    return found, absent


def problem(case: Path) -> Problem:
    """Return the problem of a case, its code run in this process."""
    read = read_case(case)
    return problem_of(read, model_of(read, None))


def carried_out(
    drawn: draw.Drawn, run: Run, name: str, rng: np.random.Generator
) -> tuple[generated.Run, dict[str, np.ndarray]]:
    """Return a planned run and what the truth records of it, after all that was recorded before."""
    s = drawn.scenario
    base = next(known for known in s.runs if known.name == name)
    # As many steps between denser rows as between those of the generator's own runs.
    denser = round(float(base.rows[1] - base.rows[0]) / float(run.t[1] - run.t[0]))
    longer = float(run.t[-1] - run.t[0]) / float(base.rows[-1] - base.rows[0])
    own = Run(
        name=name, t=base.fine["t"], columns=base.fine, conditions={}, declared={}, simulated={}
    )  # fmt: skip
    fine = dict(lengthened(refined(own, denser), longer).columns)
    if "push" in fine:  # what pushes a plant comes no second time
        fine["push"] = np.std(fine["push"]) * process_noise._push(dataclasses.replace(base, fine=fine), rng)
    later = float(run.t[0] - base.rows[0])  # as the plan has it: after all that was recorded
    for channel, declared in s.channels.items():
        if declared.role in ("input", "covariate") and channel in fine and channel in run.columns:
            rows, values = run.t - later, run.columns[channel]
            # Between rows as the generator has its own runs: a tire's actuators move smoothly, all other
            # inputs go straight.
            fine[channel] = (
                Akima1DInterpolator(rows, values)(np.clip(fine["t"], rows[0], rows[-1]))
                if s.family.startswith("tire")
                else np.interp(fine["t"], rows, values)
            )
    if s.family == "drive-force":  # the path is not recorded: it follows the velocity
        fine["x"] = np.cumsum(fine["v"]) * (fine["t"][1] - fine["t"][0])
    fine["t"] = fine["t"] + later
    there = dataclasses.replace(base, name="next.csv", fine=fine, rows=run.t, conditions=run.conditions)
    alone = dataclasses.replace(s, runs=(there,))
    p = s.true_parameters()
    before = draw._before_converter(alone, p, drawn.effects, [s.truth(there, p, drawn.effects)])
    if s.driven:
        there = s.driven(there, drawn.effects)
    return there, draw._recorded(alone, before[0], drawn.effects, 0.0, rng)


def with_run(
    drawn: draw.Drawn, run: Run, name: str, folder: Path, rng: np.random.Generator, times: int = 1
) -> Problem:
    """Return the problem with one more run, made so many times, as the truth answers it."""
    made = []
    recorded = drawn.scenario.runs
    # One after the other where all recordings have one clock.
    pause = max(float(run.t[0] - recorded[-1].rows[-1]), 0.0)
    every = float(run.t[-1] - run.t[0]) + pause if pause else 0.0
    for place in range(times):
        there = dataclasses.replace(run, t=run.t + place * every)
        answered, outputs = carried_out(drawn, there, name, rng)
        made.append((dataclasses.replace(answered, name=f"next{place + 1}.csv"), outputs))
    s = dataclasses.replace(drawn.scenario, runs=(*drawn.scenario.runs, *(answered for answered, _ in made)))
    write_case(s, [*drawn.measured, *(outputs for _, outputs in made)], folder)
    return problem(folder / "CASE.toml")


def random_change(search: RunSearch, rng: np.random.Generator) -> Change:
    """Return a change of a recording in every factor at random, within the limits."""
    while True:
        change = Change(run=search.problem.runs[0].name)
        for place in range(len(search.factors(change))):
            alternatives = search.factors(change)[place]
            change = alternatives[int(rng.integers(len(alternatives)))]
        if changed(search.problem, change, search.limits) is not None:
            return change


def fitted_again(more: Problem, members: tuple[Member, ...]) -> tuple[Member, ...]:
    """Return members fitted to all recordings, each from where it was, the likeliest first."""
    again = [
        Member(label=member.label, fit=fit(more, member.fit.active, start=member.fit.p)) for member in members
    ]
    return tuple(sorted(again, key=lambda member: -member.fit.log_posterior))


def explains(more: Problem, after: Member, before: Member) -> bool:
    """Tell whether a member explains the last run within the noise that it had in all before.

    It may be louder by as much as sensors differ by from run to run, in no output by more.
    """
    last = more.slices[-1]
    return all(
        float(np.mean(residual[last][more.kept[name][last]] ** 2))
        <= EVEN.runs * before.fit.noise[name].marginal_sd ** 2
        for name, residual in after.fit.residual.items()
    )


def named(more: Problem, members: tuple[Member, ...], before: tuple[Member, ...] | None = None) -> str | None:
    """Return the effect of the member that is ahead of all others by what a diagnosis asks for.

    Also whatever is assumed between the rows, where both read a simulation there. And where the member ahead
    does not explain the last run, by its fit to those ``before``, nothing is named: of fits that both end
    in some other minimum one is ahead by chance.
    """
    first, *others = members
    if before is not None:
        known = next(member for member in before if member.label == first.label)
        if not explains(more, first, known):
            return None
    *beside, chosen = first.fit.active
    behind = {
        other.label: other.fit.active[-1]
        for other in others
        if other.fit.active[-1].effect.reads_between_rows
    }
    shown = differences(more, tuple(beside), chosen, behind, first.fit.p)
    ahead = min(
        -max(other.fit.log_posterior - first.fit.log_posterior, shown.get(other.label, -np.inf))
        for other in others
    )
    return chosen.effect.name if ahead > VERDICT.close else None


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """A class, what the plan said of it, and what was named after each kind of run.

    ``length`` of the run, in that of the recording; ``needed`` how often it would have to be made to part a
    pair; ``most`` the log-evidence of the longest run, were every row as far apart as the farthest.
    """

    case: str
    members: tuple[str, ...]
    true: str
    power: float
    together: tuple[tuple[str, str], ...]
    named: dict[str, str | None]
    steps: str
    seconds: float
    length: float
    needed: int | None
    most: float

    @property
    def parts(self) -> bool:
        """Tell whether it parts any pair; of a run that parts none the command ends with exit code 2."""
        return len(self.together) < len(self.members) * (len(self.members) - 1) // 2


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Posed:
    """A class that counts: as drawn, its problem, its members as fitted, and the true effect."""

    drawn: draw.Drawn
    problem: Problem
    members: tuple[Member, ...]
    true: str


def posed_class(left: SealedClass, folder: Path) -> Posed | str:
    """Return a class with its members fitted, or why it does not count; its case in a folder."""
    found = next(effect for effect in left.effects if effect.equivalent_to)
    drawn = left.drawn()
    if drawn is None:
        return "drawn otherwise by the generator of today"
    beside = {(effect.name, effect.channel) for effect in left.effects if effect is not found}
    # What stands beside the class, at its own place, is none of what the class leaves open.
    open_effects = [name for name, at in drawn.effects.items() if (name, at.get("channel")) not in beside]
    true = [name for name in open_effects if name in (found.name, *found.equivalent_to)]
    if len(true) != 1:
        return "no true effect in the class"
    write_case(drawn.scenario, drawn.measured, folder / "before")
    posed = problem(folder / "before" / "CASE.toml")
    try:
        members = members_of(posed, left.effects, found)
    except ConfigError:
        return "fewer than two of the class are candidates of a diagnosis"
    if all(member.fit.active[-1].effect.name != true[0] for member in members):
        return "the true effect is no candidate of a diagnosis"
    if left.new is not None and named(posed, members) is not None:
        return "the recordings name one"
    return Posed(drawn=drawn, problem=posed, members=members, true=true[0])


def after_one_more(left: SealedClass, folder: Path, rng: np.random.Generator) -> Outcome | str:
    """Return what is named after one more run of each kind, or why the case does not count."""
    began = time.process_time()
    class_ = posed_class(left, folder)
    if isinstance(class_, str):
        return class_
    drawn, posed, members = class_.drawn, class_.problem, class_.members
    ends = time.process_time() + SEARCH_S
    limits = laboratory_limits(posed)
    search = RunSearch(
        problem=posed, members=members, limits=limits, until=lambda: time.process_time() < ends
    )
    best = search.best()
    chosen = search.judge(best)
    took = time.process_time() - began
    if chosen is None:
        return "no run can be simulated"
    again = None if chosen.parts else search.repeated(chosen)
    names: dict[str, str | None] = {}
    for label, change in zip(
        KINDS, (best, random_change(search, rng), Change(run=best.run)), strict=True
    ):  # fmt: skip
        run = changed(posed, change, RunLimits() if label == "repeat" else limits)
        assert run is not None
        more = with_run(drawn, run, change.run, folder / label, rng)
        try:
            names[label] = named(more, fitted_again(more, members), members)
        except ToolkitError:
            names[label] = None
    return Outcome(
        case=f"{left.batch} {left.name} {left.sealed['bucket']} {left.sealed['family']}",
        members=tuple(member.fit.active[-1].effect.name for member in members), true=class_.true,
        power=chosen.power, together=chosen.together, named=names, steps="; ".join(best.words()),
        seconds=took, length=best.length, needed=again and again.times,
        most=search.farthest * limits.longest_s,
    )  # fmt: skip


def laboratory_limits(posed: Problem) -> RunLimits:
    """Return what a laboratory would state of its machine, beyond what it recorded."""
    values, rates = {}, {}
    chambers = {*CHAMBERS} & {channel.name for channel in posed.case.drivers}
    settable = RunLimits(values={name: reach(posed, name) for name in chambers})
    for name, source in movable(posed, settable):
        low, high = reach(posed, name)
        if name in WITH_SHAFTS:
            continue
        middle, half = (low + high) / 2, (high - low) / 2
        wide = CHAMBER_K if name in CHAMBERS else half * (SPAN if source is None else PACE)
        floor = 0.0 if low >= 0 and name not in CHAMBERS else -np.inf
        values[name] = max(middle - wide, floor), middle + wide
        if source is None:
            runs = [run for run in posed.case.runs if name in run.columns]
            rates[name] = PACE * max(fastest(run.t, run.columns[name]) for run in runs)
    step_s = min(row_step(run) for run in posed.runs) / DENSE
    longest_s = LONG * max(float(run.t[-1] - run.t[0]) for run in posed.runs)
    return RunLimits(values=values, rates=rates, step_s=step_s, longest_s=longest_s)


def outcomes(listed: Iterable[SealedClass], minutes: float, seed: int) -> Iterator[Outcome | str]:
    """Yield the outcomes of classes, until the processor has had its minutes."""
    ends = time.process_time() + 60 * minutes
    for place, left in enumerate(listed):
        if time.process_time() > ends:
            return
        with tempfile.TemporaryDirectory() as folder:
            yield after_one_more(left, Path(folder), np.random.default_rng([seed, place, 1]))


def table(rows: list[Outcome]) -> str:
    """Return how many are right, wrong and open after each kind of run."""
    lines = ["| run | right | 95 % | wrong | open |", "|---|---|---|---|---|"]
    for label in KINDS:
        right = sum(row.named[label] == row.true for row in rows)
        none = sum(row.named[label] is None for row in rows)
        low, high = exact_interval(right, len(rows))
        lines.append(
            f"| {label} | {right} of {len(rows)} ({100 * right / max(len(rows), 1):.0f} %) "
            f"| {100 * low:.0f} to {100 * high:.0f} | {len(rows) - right - none} | {none} |"
        )
    return "\n".join(lines)


def main() -> None:
    """Print every outcome as it comes, then the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.campaigns.sealed_classes", description=__doc__)
    parser.add_argument("--drawn", type=int, help="seed of classes drawn anew, in place of the batches")
    parser.add_argument("--family", action="append", default=[], choices=FAMILIES, help="of these alone")
    parser.add_argument("--effect", action="append", default=[], help="of these alone, with --family")
    parser.add_argument("--cases", type=int, default=100)
    parser.add_argument("--minutes", type=float, default=30.0)
    parser.add_argument("--seed", type=int, default=27)
    given = parser.parse_args()
    listed: Iterable[SealedClass]
    if given.drawn is None:
        listed, absent = classes()
        sys.stdout.write(f"{len(listed)} classes of sealed batches; left out: {dict(absent)}\n")
    else:
        listed = drawn_classes(given.drawn, families=given.family, effects=given.effect)
    rows: list[Outcome] = []
    uncounted: Counter[str] = Counter()
    for outcome in outcomes(itertools.islice(listed, given.cases), given.minutes, given.seed):
        if isinstance(outcome, str):
            uncounted[outcome] += 1
            sys.stdout.write(f"  not counted: {outcome}\n")
        else:
            rows.append(outcome)
            sys.stdout.write(f"  {dataclasses.asdict(outcome)}\n")
        sys.stdout.flush()
    sure = [row for row in rows if row.power > PROMISED]
    answered = [row for row in rows if row.parts]
    sys.stdout.write(f"{table(rows)}\nwhere the command proposes a run:\n{table(answered)}\n")
    refused = [row for row in rows if not row.parts]
    impossible = sum(row.most <= VERDICT.close for row in refused)
    sys.stdout.write(f"refused: {len(refused)}, of which no run of the longest time parts {impossible}\n")
    sys.stdout.write(f"promised over {PROMISED:g}:\n{table(sure)}\n")
    sys.stdout.write(f"not counted: {dict(uncounted)}\n")


if __name__ == "__main__":
    main()
