"""One row of the table of coverage, with its exact binomial interval."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import beta


@dataclass(frozen=True, slots=True, kw_only=True)
class CoverageRow:
    """How often an interval held the truth.

    ``name`` is what was estimated and ``condition`` how it was drawn; of ``n`` intervals ``covered`` held
    the truth, a share that lies in ``low`` to ``high`` (95 %, Clopper and Pearson, Biometrika 26 (1934)
    404). ``rms_ratio`` is the root mean square of error over standard uncertainty, 1 where the uncertainty
    is right. ``median_width_ratio`` is the median half width over the half width that covers 95 % of the
    same errors, None where it was not asked.
    """

    name: str
    condition: str
    n: int
    covered: int
    low: float
    high: float
    rms_ratio: float
    median_width_ratio: float | None = None

    def without_widths(self) -> CoverageRow:
        """Return the row with the share alone: of intervals that have no standard uncertainty."""
        return replace(self, rms_ratio=math.nan, median_width_ratio=None)

    @property
    def share(self) -> float:
        """The share of the intervals that held the truth, not a number where there was none."""
        return self.covered / self.n if self.n else float("nan")


def exact_interval(covered: int, n: int, probability: float = 0.95) -> tuple[float, float]:
    """Return the Clopper-Pearson interval of a share.

    >>> [round(one, 4) for one in exact_interval(10, 10)]
    [0.6915, 1.0]
    """
    tail = (1.0 - probability) / 2
    low = float(beta.ppf(tail, covered, n - covered + 1)) if covered else 0.0
    high = float(beta.ppf(1 - tail, covered + 1, n - covered)) if covered < n else 1.0
    return low, high


def row_of(
    name: str, condition: str, *, errors: Sequence[float], u: Sequence[float], U: Sequence[float]
) -> CoverageRow:
    """Return the row of estimates with their errors, standard uncertainties and half widths (n,) each."""
    if not len(errors):
        return CoverageRow(
            name=name, condition=condition, n=0, covered=0, low=0.0, high=1.0, rms_ratio=math.nan
        )
    e, s, half = (np.asarray(one, dtype=float) for one in (errors, u, U))
    covered = int(np.sum(np.abs(e) <= half))
    low, high = exact_interval(covered, len(e))
    needed = float(np.quantile(np.abs(e), 0.95))
    return CoverageRow(
        name=name,
        condition=condition,
        n=len(e),
        covered=covered,
        low=low,
        high=high,
        rms_ratio=float(np.sqrt(np.mean((e / s) ** 2))),
        median_width_ratio=float(np.median(half)) / needed if needed > 0 else None,
    )


def as_table(rows: Sequence[CoverageRow]) -> str:
    """Return the rows as a Markdown table."""
    head = ("what", "drawn", "n", "covers %", "95 % of it", "rms error / u", "median U / needed")
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for one in rows:
        share = limits = ratio = width = ""
        if one.n:
            share = f"{100 * one.share:.1f}"
            limits = f"{100 * one.low:.1f} to {100 * one.high:.1f}"
        if not math.isnan(one.rms_ratio):
            ratio = f"{one.rms_ratio:.2f}"
        if one.median_width_ratio is not None:
            width = f"{one.median_width_ratio:.2f}"
        cells = (one.name, one.condition, str(one.n), share, limits, ratio, width)
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)
