"""Lines in the spectrum of a residual: a disturbance that repeats in time, of a period that nobody named.

An autoregression takes a line for a resonance of the noise, so that no test on its innovations sees it. A
line is told by the periodogram itself: its peak over the level of the frequencies around it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.policy import STRUCTURE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.diagnosis.fit.problem import Problem


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """A line: its frequency [1/s], its p-value among all of them, its share of the residual's variance."""

    frequency: float
    p_value: float
    share: float


def strongest_line(problem: Problem, name: str, residual: NDArray[np.float64]) -> Line | None:
    """Return the strongest line of an output's residual, None where no run is long and even enough."""
    if not problem.case.has_time:
        return None
    runs = []
    for run, place in zip(problem.runs, problem.slices, strict=True):
        steps = np.diff(run.t)
        if run.rows < STRUCTURE.line_rows or np.ptp(steps) > STRUCTURE.line_jitter * np.median(steps):
            continue
        good = problem.kept[name][place]
        if good.mean() < STRUCTURE.line_kept:
            continue
        values = residual[place]
        even = np.linspace(run.t[0], run.t[-1], run.rows)
        runs.append((float(even[1] - even[0]), np.interp(even, run.t[good], values[good])))
    if not runs:
        return None
    n = min(len(values) for _, values in runs)
    step = runs[0][0]
    if any(abs(run_step - step) > STRUCTURE.line_even * step for run_step, _ in runs):
        return None
    window = np.hanning(n + 2)[1:-1]
    power = np.zeros(n // 2 + 1)
    for _, values in runs:
        x = values[:n] - values[:n].mean()
        power += np.abs(np.fft.rfft(x * window)) ** 2
    level = np.array([_level(power, k) for k in range(len(power))])
    ratio = np.where(level > 0, power / np.maximum(level, 1e-300), 0.0)
    ratio[: STRUCTURE.line_cycles] = 0.0
    k = int(np.argmax(ratio))
    # A sum of R independent periodograms is chi-squared with 2R degrees, its median the level.
    p = min(1.0, len(power) * _tail(ratio[k], len(runs)))
    line_power = power[max(k - 1, 1) : k + 2].sum() - 3 * level[k]
    share = max(0.0, float(line_power / max(power[1:].sum(), 1e-300)))
    return Line(frequency=k / (n * step), p_value=p, share=share)


def _level(power: NDArray[np.float64], k: int) -> float:
    low, high = max(1, k - STRUCTURE.line_around), min(len(power), k + STRUCTURE.line_around + 1)
    around = np.concatenate([power[low : max(low, k - 2)], power[min(high, k + 3) : high]])
    return float(np.median(around)) if len(around) else 0.0


def _tail(ratio: float, runs: int) -> float:
    from scipy.stats import chi2

    median = float(chi2.median(2 * runs))
    # The level is itself a median of some twenty values: its own scatter is allowed for.
    return float(chi2.sf(ratio * median / (1 + 2 / math.sqrt(2 * STRUCTURE.line_around)), 2 * runs))
