"""Proposed runs against random ones: is the true member of a class alone ahead after one more run?

    python -m tests.campaigns.next_runs [--cases 30] [--seed 25]

Cases are drawn: a force that is late, or that lags, by 10 to 60 ms, recorded under a slow sine of 0.1 to
0.3 Hz with noise of its own; a case counts where the recordings prefer neither by 3. Each gets the run that
is proposed, a random change of a recording within the same limits, and a repeat, all of one length, as the
true plant answers them; then both members are fitted to all recordings. Named is the one that is ahead by 3.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np
import pandas as pd

from tests.coverage.rows import exact_interval
from tests.planning.class_factory import CASE, SIMULATOR, found, problem
from toolkit.diagnosis.fit.problem import Problem
from toolkit.planning.members import Member, members_of
from toolkit.planning.next_run import RunSearch
from toolkit.planning.run_changes import Change, RunLimits, changed

EFFECT = found("channel_delay", "filter_lag")
T = np.arange(500) * 0.02
FINE = 10  # the plant is integrated ten times as finely as it is recorded
AHEAD = 3.0


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Plant:
    """The truth: late by ``seconds``, or lagging by them."""

    lags: bool
    seconds: float
    gain: float
    noise: float

    @property
    def label(self) -> str:
        """The name that is right."""
        return "filter_lag on F" if self.lags else "channel_delay on F"

    def force(self, u: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return what is recorded of the force under an input."""
        if not self.lags:
            moved = np.interp(T - self.seconds, T, u)
        else:
            fine = np.linspace(T[0], T[-1], FINE * (len(T) - 1) + 1)
            drive, state = np.interp(fine, T, u), float(u[0])
            keep = np.exp(-(fine[1] - fine[0]) / self.seconds)
            states = [
                state := keep * state + (1 - keep) * 0.5 * (a + b) for a, b in itertools.pairwise(drive)
            ]
            moved = np.concatenate([[u[0]], states])[::FINE]
        return np.asarray(self.gain * moved + rng.normal(0, self.noise, len(T)))


def written(
    folder: Path, plant: Plant, inputs: list[np.ndarray], rng: np.random.Generator, old: Path | None
) -> Path:
    """Write a case; the first recordings are those of an older one where there is one."""
    folder.mkdir(parents=True)
    text = CASE[: CASE.index("[[recording.run]]")].replace("sd = 1.0", f"sd = {plant.noise}")
    for number, u in enumerate(inputs):
        before = None if old is None else old / f"r{number}.csv"
        if before is not None and before.is_file():
            run = pd.read_csv(before)
        else:
            run = pd.DataFrame({"t": T, "u": u, "F": plant.force(u, rng)})
        run.to_csv(folder / f"r{number}.csv", index=False)
        text += f'[[recording.run]]\nfile = "r{number}.csv"\n'
    (folder / "sim.py").write_text(SIMULATOR, encoding="utf-8")
    (folder / "CASE.toml").write_text(text, encoding="utf-8")
    return folder / "CASE.toml"


def fitted(posed: Problem) -> tuple[Member, ...]:
    """Return both members, fitted to all recordings."""
    return members_of(posed, (EFFECT,), EFFECT)


def lead(members: tuple[Member, ...]) -> float:
    """Return by how much the first member is ahead."""
    return members[0].fit.log_posterior - members[1].fit.log_posterior


def random_change(search: RunSearch, rng: np.random.Generator) -> Change:
    """Return a change of a recording that its limits allow, at random."""
    while True:
        change = Change(
            run=str(rng.choice([run.name for run in search.problem.runs])),
            rate=float(rng.choice([0.25, 0.5, 1.0, 2.0, 4.0])),
            sizes=(("u", float(rng.choice([0.0, 0.5, 1.0, 2.0, 4.0]))),),
        )
        if changed(search.problem, change, search.limits) is not None:
            return change


def drawn(rng: np.random.Generator) -> tuple[Plant, list[np.ndarray]]:
    """Return a plant and the inputs of two runs, slow sines of one frequency."""
    plant = Plant(
        lags=bool(rng.integers(2)), seconds=float(rng.uniform(0.01, 0.06)), gain=float(rng.normal(100, 3)),
        noise=float(rng.uniform(0.5, 2.0)),
    )  # fmt: skip
    frequency = rng.uniform(0.1, 0.3)
    return plant, [
        rng.uniform(1, 2) * np.sin(2 * np.pi * frequency * T) * np.minimum(T, 1.0) for _ in range(2)
    ]


def one(number: int, seed: int, folder: Path) -> dict[str, str] | None:
    """Return right, wrong or open for each kind of run; None where the recordings name one already."""
    rng = np.random.default_rng([seed, number])
    plant, inputs = drawn(rng)
    case = written(folder / "before", plant, inputs, rng, None)
    posed = problem(case)
    members = fitted(posed)
    if lead(members) > AHEAD:
        return None
    search = RunSearch(problem=posed, members=members, limits=RunLimits())
    best = search.best()
    outcome = {}
    for kind, change in (
        ("proposed", best), ("random", random_change(search, rng)), ("repeat", Change(run=best.run)),
    ):  # fmt: skip
        run = changed(posed, change, RunLimits())
        assert run is not None
        more = problem(written(folder / kind, plant, [*inputs, run.columns["u"]], rng, case.parent))
        after = fitted(more)
        named = after[0].label if lead(after) > AHEAD else None
        outcome[kind] = "open" if named is None else "right" if named == plant.label else "wrong"
    return outcome


def main() -> None:
    """Print how many are right, wrong and open after each kind of run."""
    parser = argparse.ArgumentParser(prog="python -m tests.campaigns.next_runs", description=__doc__)
    parser.add_argument("--cases", type=int, default=30)
    parser.add_argument("--seed", type=int, default=25)
    given = parser.parse_args()
    counts: dict[str, Counter[str]] = {}
    drawn = number = 0
    while drawn < given.cases:
        with tempfile.TemporaryDirectory() as folder:
            outcome = one(number, given.seed, Path(folder))
        number += 1
        if outcome is None:
            continue
        drawn += 1
        for kind, word in outcome.items():
            counts.setdefault(kind, Counter())[word] += 1
    head = "| run | right | 95 % | wrong | open |"
    lines = [f"{drawn} classes of {number} cases drawn", head, "|---|---|---|---|---|"]
    for kind, words in counts.items():
        low, high = exact_interval(words["right"], drawn)
        share, interval = f"{100 * words['right'] / drawn:.0f} %", f"{100 * low:.0f} to {100 * high:.0f}"
        lines.append(f"| {kind} | {share} | {interval} | {words['wrong']} | {words['open']} |")
    sys.stdout.write("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
