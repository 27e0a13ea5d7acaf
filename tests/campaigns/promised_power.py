"""The power that a proposed run promises, against how often the true member is then named.

    python -m tests.campaigns.promised_power [--cases 60] [--seed 2600]

Cases are those of `next_runs` with noise from little to much, so that powers of every size occur; runs are
random changes of a recording in place of the best one. The true plant answers each, both members are fitted
to all recordings, and named is the one that is ahead by what a diagnosis asks for. Shares named are held
against the mean power in classes of power.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tests.campaigns.next_runs import AHEAD, Plant, T, fitted, lead, random_change, written
from tests.coverage.rows import exact_interval
from tests.planning.class_factory import problem
from toolkit.planning.next_run import RunSearch
from toolkit.planning.run_changes import RunLimits

BINS = (0.0, 0.2, 0.4, 0.6, 0.8, 0.95, 1.0)
RUNS = 3


def outcomes(number: int, seed: int, folder: Path) -> Iterator[tuple[float, str]]:
    """Yield power and outcome (right, wrong, open) of random runs of a case; nothing where it is not open."""
    rng = np.random.default_rng([seed, number])
    plant = Plant(
        lags=bool(rng.integers(2)), seconds=float(rng.uniform(0.01, 0.06)), gain=float(rng.normal(100, 3)),
        noise=float(np.exp(rng.uniform(np.log(0.5), np.log(40.0)))),
    )  # fmt: skip
    frequency = rng.uniform(0.1, 0.3)
    inputs = [rng.uniform(1, 2) * np.sin(2 * np.pi * frequency * T) * np.minimum(T, 1.0) for _ in range(2)]
    case = written(folder / "before", plant, inputs, rng, None)
    posed = problem(case)
    members = fitted(posed)
    if lead(members) > AHEAD:
        return
    search = RunSearch(problem=posed, members=members, limits=RunLimits())
    for run in range(RUNS):
        judged = search.judge(random_change(search, rng))
        if judged is None:
            continue
        columns = [*inputs, judged.run.columns["u"]]
        after = fitted(problem(written(folder / str(run), plant, columns, rng, case.parent)))
        named = after[0].label if lead(after) > AHEAD else None
        yield judged.power, "open" if named is None else "right" if named == plant.label else "wrong"


def table(every: list[tuple[float, str]]) -> Iterator[str]:
    """Yield the lines of the table."""
    yield "| power promised | runs | mean power, % | named rightly, % | 95 % of it | wrongly |"
    yield "|---|---|---|---|---|---|"
    for low, high in itertools.pairwise(BINS):
        mine = [(p, word) for p, word in every if low <= p < high or p == high == 1.0]
        if not mine:
            continue
        right = sum(word == "right" for _, word in mine)
        least, most = exact_interval(right, len(mine))
        yield (
            f"| {low:g} to {high:g} | {len(mine)} | {100 * np.mean([p for p, _ in mine]):.0f} | "
            f"{100 * right / len(mine):.0f} | {100 * least:.0f} to {100 * most:.0f} | "
            f"{sum(word == 'wrong' for _, word in mine)} |"
        )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.campaigns.promised_power", description=__doc__)
    parser.add_argument("--cases", type=int, default=60)
    parser.add_argument("--seed", type=int, default=2600)
    given = parser.parse_args()
    every: list[tuple[float, str]] = []
    for number in range(given.cases):
        with tempfile.TemporaryDirectory() as folder:
            every += outcomes(number, given.seed, Path(folder))
    sys.stdout.write("\n".join(table(every)) + "\n")


if __name__ == "__main__":
    main()
