"""Is the true member of a class named in the end, by a proposed run or by what a refusal asks for?

    python -m tests.campaigns.followed_classes --drawn SEED [--family NAME ...] [--effect NAME ...]
        [--cases 100] [--minutes 30]

Classes are drawn as `sealed_classes` draws them. A run is planned within that campaign's limits, but with
rows at most four times as dense and no longer than the recordings, as where nobody says more. Where the
command proposes one, the truth answers it, and a run of the same time that is changed at random. Where it
refuses, it is asked again with the minutes that it names: the truth answers what it then proposes, a longer
run or one that is made again and again, and beside it the refused run, once. The members are fitted to all
recordings, and the one that is ahead by what a diagnosis asks for is named.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

from proof.catalogue import FAMILIES
from tests.campaigns.sealed_classes import (
    Posed,
    SealedClass,
    drawn_classes,
    fitted_again,
    laboratory_limits,
    named,
    posed_class,
    random_change,
    with_run,
)
from tests.coverage.rows import exact_interval
from toolkit.diagnosis.case.case import Run
from toolkit.diagnosis.policy import VERDICT
from toolkit.errors import ToolkitError
from toolkit.planning.members import row_step
from toolkit.planning.next_run import NextRun, RunSearch
from toolkit.planning.run_changes import RunLimits, changed

DENSE = 4
SEARCH_S = 6.0  # of the processor, each search
MOST_ROWS = 150_000  # of what is carried out: fits of more take too long
PROPOSED, RANDOM, REFUSED, FOLLOWED = WAYS = (
    "proposed at once", "random change in its place", "refused run, once", "refused, followed",
)  # fmt: skip


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """A class and what was named; times in those of the recording.

    ``asked`` is what the refusal asks for, ``least`` the time below which it says that no course parts the
    class; ``lasts`` and ``times`` of the run that is proposed in the end, with its ``power``; 0 of none.
    """

    case: str
    true: str
    asked: float
    least: float
    lasts: float
    times: int
    power: float
    named: dict[str, str | None]


def outcome_of(left: SealedClass, folder: Path, rng: np.random.Generator) -> Outcome | str:
    """Return what is named in the end, or why the class does not count."""
    class_ = posed_class(left, folder)
    if isinstance(class_, str):
        return class_
    step_s = min(row_step(run) for run in class_.problem.runs) / DENSE
    limits = dataclasses.replace(laboratory_limits(class_.problem), step_s=step_s, longest_s=0.0)
    search, chosen = _searched(class_, limits)
    if chosen is None:
        return "no run can be simulated"
    seconds, asked, least, names = float(np.ptp(chosen.run.t)), 0.0, 0.0, {}
    proposed: NextRun | None = chosen
    if chosen.parts:
        names[PROPOSED] = _named(class_, chosen.run, chosen.change.run, 1, folder / "proposed", rng)
        change = random_change(search, rng)
        run = changed(class_.problem, change, limits)
        assert run is not None
        names[RANDOM] = _named(class_, run, change.run, 1, folder / "random", rng)
    else:
        names[REFUSED] = _named(class_, chosen.run, chosen.change.run, 1, folder / "once", rng)
        least = VERDICT.close / search.farthest / seconds if search.farthest > 0 else np.inf
        needed = search.repeated(chosen, power=VERDICT.interval) or search.repeated(chosen)
        proposed = None
        if needed is not None:
            asked = needed.times
            again, longer = _searched(class_, dataclasses.replace(limits, longest_s=1.01 * needed.seconds))
            if longer is not None:
                proposed = longer if longer.parts else again.made_again(longer)
        names[FOLLOWED] = None
        if proposed is not None and proposed.times * proposed.run.rows <= MOST_ROWS:
            name, times = proposed.change.run, proposed.times
            names[FOLLOWED] = _named(class_, proposed.run, name, times, folder / "followed", rng)
        elif proposed is not None:
            names[FOLLOWED] = "not carried out"
    return Outcome(
        case=f"{left.batch} {left.name} {left.sealed['family']}", true=class_.true, asked=asked, least=least,
        lasts=0.0 if proposed is None else proposed.seconds / seconds,
        times=0 if proposed is None else proposed.times, power=0.0 if proposed is None else proposed.power,
        named=names,
    )  # fmt: skip


def _searched(class_: Posed, limits: RunLimits) -> tuple[RunSearch, NextRun | None]:
    ends = time.process_time() + SEARCH_S
    search = RunSearch(
        problem=class_.problem, members=class_.members, limits=limits,
        until=lambda: time.process_time() < ends,
    )  # fmt: skip
    return search, search.judge(search.best())


def _named(
    class_: Posed, run: Run, name: str, times: int, folder: Path, rng: np.random.Generator
) -> str | None:
    more = with_run(class_.drawn, run, name, folder, rng, times)
    try:
        return named(more, fitted_again(more, class_.members), class_.members)
    except ToolkitError:
        return None


def table(rows: list[Outcome]) -> str:
    """Return how many are right, wrong and open in each way."""
    lines = ["| what was done | classes | right, 95 % | wrong | open |", "|---|---|---|---|---|"]
    for way in WAYS:
        mine = [row for row in rows if row.named.get(way, "not carried out") != "not carried out"]
        right = sum(row.named[way] == row.true for row in mine)
        none = sum(row.named[way] is None for row in mine)
        low, high = exact_interval(right, len(mine)) if mine else (0.0, 1.0)
        share = f"{right}, {100 * right / max(len(mine), 1):.0f} % ({100 * low:.0f} to {100 * high:.0f})"
        lines.append(f"| {way} | {len(mine)} | {share} | {len(mine) - right - none} | {none} |")
    return "\n".join(lines)


def main() -> None:
    """Print every outcome as it comes, then the table of all and of each family."""
    parser = argparse.ArgumentParser(prog="python -m tests.campaigns.followed_classes", description=__doc__)
    parser.add_argument("--drawn", type=int, required=True, help="seed of the classes")
    parser.add_argument("--family", action="append", default=[], choices=FAMILIES, help="of these alone")
    parser.add_argument("--effect", action="append", default=[], help="of these alone, with --family")
    parser.add_argument("--minutes", type=float, default=30.0, help="of the processor")
    parser.add_argument("--cases", type=int, default=100)
    given = parser.parse_args()
    ends = time.process_time() + 60 * given.minutes
    rows: list[Outcome] = []
    uncounted: Counter[str] = Counter()
    listed = drawn_classes(given.drawn, families=given.family, effects=given.effect)
    for place, left in enumerate(itertools.islice(listed, given.cases)):
        with tempfile.TemporaryDirectory() as folder:
            outcome = outcome_of(left, Path(folder), np.random.default_rng([given.drawn, place, 2]))
        if isinstance(outcome, str):
            uncounted[outcome] += 1
            sys.stdout.write(f"  {left.name} {left.sealed['family']}: {outcome}\n")
        else:
            rows.append(outcome)
            sys.stdout.write(f"  {dataclasses.asdict(outcome)}\n")
        sys.stdout.flush()
        if time.process_time() > ends:
            break
    sys.stdout.write(f"{len(rows)} classes; not counted: {dict(uncounted)}\n{table(rows)}\n")
    for family in sorted({row.case.split()[-1] for row in rows}):
        sys.stdout.write(f"{family}\n{table([row for row in rows if row.case.endswith(family)])}\n")
    refused = [row for row in rows if REFUSED in row.named]
    bound = sum(row.least > 1 for row in refused)
    sooner = sum(0 < row.lasts < row.least for row in refused)
    sys.stdout.write(f"refused: {len(refused)}; a bound above one recording: {bound}; sooner: {sooner}\n")


if __name__ == "__main__":
    main()
