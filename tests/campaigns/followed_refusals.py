"""Refusals of `plan next` that are followed: is the true member named after the recordings they ask for?

    python -m tests.campaigns.followed_refusals [--cases 30] [--seed 29]

Cases are those of `next_runs`, a force that is late or lags under a slow sine, on a machine that goes at a
small part of the recorded rate, drawn too, so that no run of a recording's time parts both members. The
refusal says how often the nearest run would have to be made until it parts them, and until the true one is
named nearly always. The true plant answers it once, as often as the one, and as often as the other; both
members are fitted to all recordings, and named is the one that is ahead by what a diagnosis asks for.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import tempfile
from pathlib import Path

import numpy as np

from tests.campaigns.next_runs import AHEAD, drawn, fitted, lead, written
from tests.campaigns.sealed_classes import fitted_again, named
from tests.coverage.rows import exact_interval
from tests.planning.class_factory import problem
from toolkit.diagnosis.policy import VERDICT
from toolkit.planning.drives import fastest
from toolkit.planning.next_run import RunSearch
from toolkit.planning.run_changes import RunLimits

MOST = 60  # recordings of one run that are carried out
WAYS = ("once", "until it parts", "until it is sure")


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Followed:
    """What was named by as many recordings as each way has, and the power that was promised of it.

    ``least`` is the number of recordings below which the refusal says that no course parts the members.
    """

    true: str
    least: float
    times: dict[str, int]
    power: dict[str, float]
    named: dict[str, str | None]


def followed(number: int, seed: int, folder: Path) -> Followed | str:
    """Return what followed from a refusal, or why the case does not count."""
    rng = np.random.default_rng([seed, number])
    plant, inputs = drawn(rng)
    slow = float(np.exp(rng.uniform(np.log(0.02), np.log(0.3))))
    case = written(folder / "before", plant, inputs, rng, None)
    posed = problem(case)
    members = fitted(posed)
    if lead(members) > AHEAD:
        return "the recordings name one"
    rate = slow * max(fastest(run.t, run.columns["u"]) for run in posed.runs)
    search = RunSearch(problem=posed, members=members, limits=RunLimits(rates={"u": rate}))
    chosen = search.judge(search.best())
    if chosen is None or chosen.parts:
        return "a run is proposed"
    parting, sure = search.repeated(chosen), search.repeated(chosen, power=VERDICT.interval)
    if parting is None or sure is None:
        return "no number of recordings is enough"
    if sure.times > MOST:
        return "too many recordings to be carried out"
    names = {}
    for way, made in zip(WAYS, (chosen, parting, sure), strict=True):
        columns = [*inputs, *[chosen.run.columns["u"]] * made.times]
        more = problem(written(folder / way, plant, columns, rng, case.parent))
        names[way] = named(more, fitted_again(more, members), members)
    return Followed(
        true="filter_lag" if plant.lags else "channel_delay",
        least=VERDICT.close / (search.farthest * chosen.seconds),
        times=dict(zip(WAYS, (1, parting.times, sure.times), strict=True)),
        power=dict(zip(WAYS, (chosen.power, parting.power, sure.power), strict=True)), named=names,
    )  # fmt: skip


def table(rows: list[Followed]) -> str:
    """Return what was named in each way, beside the power that was promised."""
    lines = ["| recordings of the run | classes | power, mean | right, 95 % | wrong | open |"]
    lines.append("|---|---|---|---|---|---|")
    for way in WAYS:
        right = sum(row.named[way] == row.true for row in rows)
        none = sum(row.named[way] is None for row in rows)
        low, high = exact_interval(right, len(rows)) if rows else (0.0, 1.0)
        times = [row.times[way] for row in rows] or [0]
        power = np.mean([row.power[way] for row in rows]) if rows else 0.0
        lines.append(
            f"| {way}: {min(times)} to {max(times)} | {len(rows)} | {100 * power:.0f} % "
            f"| {right}, {100 * right / max(len(rows), 1):.0f} % ({100 * low:.0f} to {100 * high:.0f}) "
            f"| {len(rows) - right - none} | {none} |"
        )
    return "\n".join(lines)


def main() -> None:
    """Print every refusal as it is followed, with the table of all until then."""
    parser = argparse.ArgumentParser(prog="python -m tests.campaigns.followed_refusals", description=__doc__)
    parser.add_argument("--cases", type=int, default=30)
    parser.add_argument("--seed", type=int, default=29)
    given = parser.parse_args()
    rows: list[Followed] = []
    others: list[str] = []
    while len(rows) < given.cases:
        with tempfile.TemporaryDirectory() as folder:
            outcome = followed(len(rows) + len(others), given.seed, Path(folder))
        if isinstance(outcome, str):
            others.append(outcome)
            continue
        rows.append(outcome)
        sys.stdout.write(f"{dataclasses.asdict(outcome)}\n")
        sys.stdout.flush()
    counted = {reason: others.count(reason) for reason in sorted({*others})}
    bounded = [row.times["until it parts"] / row.least for row in rows]
    sys.stdout.write(f"{table(rows)}\nnot counted: {counted}\n")
    sys.stdout.write(f"asked for over the bound: {min(bounded):.3g} to {max(bounded):.3g}\n")


if __name__ == "__main__":
    main()
