"""Coverage of spreads of repeats from uneven plans, and of E_n and zeta where laboratories' U are true.

Tests of one tire stand in days of unequal numbers; what a day adds is drawn beside what a test adds. Asked
are the interval of the repeatability and that of the spread of all tests, whose truth is the root of both
variances.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from tests.coverage.rows import CoverageRow, row_of
from toolkit.comparison.laboratories import Results, compare_laboratories
from toolkit.comparison.model import Spread
from toolkit.comparison.precision import _within, spread, total_spread


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Tests of each day, and what a day adds, in standard deviations of a test."""

    sizes: tuple[int, ...]
    between: float

    @property
    def name(self) -> str:
        """How the table names it."""
        return f"{' + '.join(map(str, self.sizes))} tests, a day adds {self.between:g}"


PLANS = tuple(
    Plan(sizes=sizes, between=between)
    for sizes in ((4, 4, 4), (2, 3, 7), (1, 1, 8, 2), (2, 1, 1, 1, 6, 1), (3,) * 8)
    for between in (0.0, 1.0, 3.0)
)


def rows_of(plan: Plan, repetitions: int, seed: int) -> list[CoverageRow]:
    """Return the row of the repeatability and that of the spread of all tests."""
    rng = np.random.default_rng([seed, *plan.name.encode()])
    levels = [str(day) for day, size in enumerate(plan.sizes) for _ in range(size)]
    days = np.array([int(level) for level in levels])
    whole = math.hypot(1.0, plan.between)
    hits: dict[str, list[bool]] = {"repeatability": [], "spread of all tests": []}
    for _ in range(repetitions):
        values = (
            100.0 + rng.normal(0.0, plan.between, len(plan.sizes))[days] + rng.normal(0.0, 1.0, len(days))
        )
        variance, dof = _within(values, levels)
        hits["repeatability"].append(_holds(spread(math.sqrt(variance), dof), 1.0))
        hits["spread of all tests"].append(_holds(total_spread(values, [levels]), whole))
    return [_row(name, plan.name, held) for name, held in hits.items()]


def _holds(found: Spread, true: float) -> bool:
    return found.low <= true <= found.high


def _row(name: str, condition: str, held: list[bool]) -> CoverageRow:
    misses = [0.0 if hit else 2.0 for hit in held]
    return row_of(name, condition, errors=misses, u=[1.0] * len(held), U=[1.0] * len(held)).without_widths()


def scores(laboratories: int, repetitions: int, seed: int) -> list[CoverageRow]:
    """Return how often E_n and zeta of a sound laboratory lie within 1 and 1.96, beside a reference and
    without.

    Meant are 95.4 % (k = 2) and 95 %. A consensus is made of the scored value too, and more hold.
    """
    rng = np.random.default_rng([seed, laboratories])
    rows = []
    for reference in ("R", None):
        hits: dict[str, list[bool]] = {"E_n within 1": [], "zeta within 1.96": []}
        for _ in range(repetitions):
            u = rng.uniform(0.3, 2.0, laboratories)
            values = 50.0 + rng.normal(0.0, u)
            listed = [
                Results(laboratory=f"L{place}", values=(float(value),), U=2 * float(own))
                for place, (value, own) in enumerate(zip(values, u, strict=True))
            ]
            if reference is not None:
                listed.append(
                    Results(laboratory=reference, values=(float(50.0 + rng.normal(0.0, 0.4)),), U=0.8)
                )
            found = compare_laboratories({"m": listed}, unit="N", reference=reference, sigma=1.0)
            score = found.measurands[0].scores[0]
            hits["E_n within 1"].append(score.En is not None and abs(score.En) < 1)
            hits["zeta within 1.96"].append(score.zeta is not None and abs(score.zeta) < 1.959964)
        by = "a reference laboratory" if reference else "the consensus"
        rows += [_row(name, f"{laboratories} laboratories, {by}", held) for name, held in hits.items()]
    return rows


def table(repetitions: int, seed: int, workers: int) -> list[CoverageRow]:
    """Return the rows of the table of coverage; a draw is cheap, and ``workers`` is not needed."""
    del workers
    many = 20 * repetitions
    return [
        *(row for plan in PLANS for row in rows_of(plan, many, seed)),
        *(row for count in (3, 6, 15) for row in scores(count, many, seed)),
    ]
