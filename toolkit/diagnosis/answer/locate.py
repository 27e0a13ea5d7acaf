"""Where a mismatch is: the range of a channel, of time, or the condition that holds most of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.answer.answer import MismatchPlace
from toolkit.diagnosis.policy import LOCATION
from toolkit.units import unit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.arrays import Array
    from toolkit.diagnosis.case.case import Case
    from toolkit.diagnosis.fit.problem import Problem


def places(
    problem: Problem,
    name: str,
    signal: Array,
    simulated: Array,
    depends_on: Sequence[str] = (),
) -> tuple[MismatchPlace, ...]:
    """Return the ranges that hold most of a mismatch: of what it depends on first, then the narrowest.

    Parameters
    ----------
    name : the output
    signal : the part of its residual that is no noise, over all rows
    simulated : the output itself as simulated, a variable like the others
    depends_on : variables on which the mismatch was found to depend
    """
    energy = np.where(problem.kept[name], np.nan_to_num(signal) ** 2, 0.0)
    energy_sum = float(energy.sum())
    if energy_sum <= 0:
        return ()
    rows = problem.kept[name]
    ranges: list[tuple[float, MismatchPlace]] = []
    unit_of = {output.name: output.unit for output in problem.model.outputs}
    for variable, measure, x in [*_variables(problem), (name, unit_of[name], simulated)]:
        span = _range(x, energy, rows)
        if span is not None:
            share, low, high = span
            inside = (x >= low) & (x <= high)
            ranges.append(
                (
                    share,
                    MismatchPlace(
                        variable=variable,
                        start=low,
                        end=high,
                        unit=measure,
                        runs=_runs(problem, energy * inside),
                        whole=share > LOCATION.whole,
                    ),
                )
            )
    ranges += _conditions(problem, energy, rows)
    ranges.sort(key=lambda pair: (pair[1].variable not in depends_on, pair[0]))
    chosen = [place for share, place in ranges if share <= LOCATION.narrow][: LOCATION.ranges]
    return tuple(chosen) if chosen else tuple(place for _, place in ranges[:1])


def _variables(problem: Problem) -> list[tuple[str, str, Array]]:
    variables = []
    for channel in problem.case.drivers:
        if all(channel.name in run.columns for run in problem.runs):
            x = np.concatenate([run.columns[channel.name] for run in problem.runs])
            if np.ptp(x) > 0:
                variables.append((channel.name, channel.unit, x))
    if problem.case.has_time:
        text, seconds = time_unit(problem.case)
        variables.append(("time", text, np.concatenate([run.t for run in problem.runs]) / seconds))
    return variables


def time_unit(case: Case) -> tuple[str, float]:
    """Return the unit in which a case's people count its time, and its seconds."""
    text = next((channel.unit for channel in case.channels if channel.role == "time"), "s")
    return text, unit(text).factor


def _range(x: Array, energy: Array, rows: NDArray[np.bool_]) -> tuple[float, float, float] | None:
    """Return the share of rows, and the ends, of the narrowest range of bins that holds most energy."""
    values = x[rows]
    edges = np.unique(np.quantile(values, np.linspace(0, 1, LOCATION.bins + 1)))
    if len(edges) < 3:
        return None
    at = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, len(edges) - 2)
    per_bin = np.bincount(at, weights=energy, minlength=len(edges) - 1)
    count = np.bincount(at, weights=rows.astype(float), minlength=len(edges) - 1)
    energy_sum, n = per_bin.sum(), count.sum()
    best: tuple[float, float, float] | None = None
    for i in range(len(per_bin)):
        for j in range(i, len(per_bin)):
            if per_bin[i : j + 1].sum() >= LOCATION.held * energy_sum:
                share = float(count[i : j + 1].sum() / n)
                if best is None or share < best[0]:
                    best = (share, float(edges[i]), float(edges[j + 1]))
                break
    return best


def _conditions(
    problem: Problem, energy: Array, rows: NDArray[np.bool_]
) -> list[tuple[float, MismatchPlace]]:
    ranges = []
    energy_sum, n = float(energy.sum()), float(rows.sum())
    keys = dict.fromkeys(key for run in problem.runs for key in run.conditions)
    for key in keys:
        levels: dict[str, list[int]] = {}
        for i, run in enumerate(problem.runs):
            if key in run.conditions:
                levels.setdefault(run.conditions[key], []).append(i)
        if len(levels) < 2 or len(levels) == len(problem.runs):
            continue
        for level, which in levels.items():
            energy_there = sum(float(energy[problem.slices[i]].sum()) for i in which)
            if energy_there >= LOCATION.held * energy_sum:
                share = sum(float(rows[problem.slices[i]].sum()) for i in which) / n
                runs = tuple(problem.runs[i].name for i in which)
                ranges.append(
                    (share, MismatchPlace(variable=key, start=level, end=level, unit="", runs=runs))
                )
    return ranges


def _runs(problem: Problem, energy: Array) -> tuple[str, ...]:
    sums = np.array([float(energy[rows].sum()) for rows in problem.slices])
    if sums.sum() <= 0:
        return ()
    return tuple(
        run.name
        for run, energy_of_run in zip(problem.runs, sums, strict=True)
        if energy_of_run > LOCATION.run * sums.sum() / len(sums)
    )
