"""Structure that no effect of the catalogue explains: smooth dependences of a residual, tested, never named.

Each group is a set of columns for one output: splines over a channel, over time, over the output itself,
products of two, offsets of runs, harmonics of a shaft's angle. They are tested like effects, against their
own null; what is found is `unknown`, with the variables that it depends on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.policy import STRUCTURE
from toolkit.diagnosis.simulators.setting import is_speed
from toolkit.effects.law import way

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.problem import Problem

RUNS = ("run",)  # the variables of offsets of runs
_ANGLES = ("TIRE_ANGLE", "DRUM_ANGLE")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SmoothDependence:
    """Columns of a smooth dependence: the output it is in, the variables it depends on."""

    output: str
    variables: tuple[str, ...]
    columns: Array

    def directions(self, problem: Problem) -> dict[str, Array]:
        """Return the columns as responses of every output: nothing in the others."""
        none = np.zeros_like(self.columns)
        return {name: self.columns if name == self.output else none for name in problem.names}


def groups(problem: Problem, base: Fit) -> list[SmoothDependence]:
    """Return the groups of a case."""
    variables = _variables(problem)
    dependences: list[SmoothDependence] = []
    for output in problem.names:
        n = int(problem.kept[output].sum())
        listed: list[tuple[tuple[str, ...], Array]] = []
        most = int(n / STRUCTURE.rows_per_column)
        for name, x in [*variables, (output, filled(base.simulated[output]))]:
            columns = _spline(x, most)
            if columns is not None:
                listed.append(((name,), columns))
            if name in _ANGLES or name.lower() in ("tire_angle", "drum_angle"):
                listed.append(((name,), _harmonics(x)))
        for i, (a, x) in enumerate(variables):
            for b, y in variables[i + 1 :]:
                product = _product(x, y)
                if product is not None and "time" not in (a, b):
                    listed.append(((a, b), product))
        if len(problem.runs) > 1:
            listed.append((RUNS, _run_offsets(problem)))
        for names, columns in listed:
            if columns.shape[1] * STRUCTURE.rows_per_column <= n:
                dependences.append(SmoothDependence(output=output, variables=names, columns=columns))
    return dependences


def filled(simulated: Array) -> Array:
    """Return a simulated output with a value in every row, the mean where it has none.

    What acts on recorded readings leaves a simulation open where these were not recorded: rows that no
    output has either.
    """
    known = np.isfinite(simulated)
    return simulated if known.all() else np.where(known, simulated, np.mean(simulated[known]))


def _variables(problem: Problem) -> list[tuple[str, Array]]:
    variables = [
        (channel.name, np.concatenate([run.columns[channel.name] for run in problem.runs]))
        for channel in problem.case.drivers
        if all(channel.name in run.columns for run in problem.runs)
    ]
    rates, ways = [], []
    if problem.case.has_time:
        # Where something is shows over the way, which a recording of the speed alone has too.
        ways = [
            (f"way of {channel.name}", _way(problem, channel.name))
            for channel in problem.case.drivers
            if is_speed(channel.unit) and all(channel.name in run.columns for run in problem.runs)
        ]
        elapsed = np.concatenate([run.t - run.t[0] for run in problem.runs])
        for name, x in variables:
            steps = []
            for run, place in zip(problem.runs, problem.slices, strict=True):
                column = x[place]
                steps.append(np.gradient(column, run.t) if run.rows > 2 else np.zeros(run.rows))
            rate = np.concatenate(steps)
            if np.ptp(rate) > 0:
                low, high = np.quantile(rate, (0.005, 0.995))
                rates.append((f"d{name}/dt", np.clip(rate, low, high)))
        variables.append(("time", elapsed))
    return [*variables, *ways, *rates]


def _way(problem: Problem, name: str) -> Array:
    """Return the way of a recorded speed from the first row of each run on."""
    return np.concatenate([way(run.t, run.columns[name]) for run in problem.runs])


def _spline(x: Array, most: int) -> Array | None:
    """Return natural splines over quantiles, centred; powers where few values occur.

    There are at most so many columns: a short recording has fewer knots, and is asked all the same.
    """
    values = np.unique(x[np.isfinite(x)])
    if len(values) < 2 or np.ptp(values) <= 1e-9 * np.abs(values).max():
        return None
    scaled = (x - values[0]) / np.ptp(values)
    most = max(most, 1)
    if len(values) <= STRUCTURE.knots + 1:
        columns = np.stack([scaled**k for k in range(1, min(len(values), 4, most + 1))], axis=1)
    else:
        knots = np.unique(np.quantile(scaled, np.linspace(0, 1, min(STRUCTURE.knots, most + 1))))
        columns = np.stack([scaled, *[np.abs(scaled - knot) ** 3 for knot in knots[1:-1]]], axis=1)
    return np.asarray(columns - columns.mean(axis=0))


def _product(x: Array, y: Array) -> Array | None:
    if np.ptp(x) == 0 or np.ptp(y) == 0:
        return None
    u = (x - x.mean()) / (np.abs(x - x.mean()).max())
    v = (y - y.mean()) / (np.abs(y - y.mean()).max())
    columns = np.stack([u * v, u * u * v, u * v * v, np.abs(u) * v, u * np.abs(v)], axis=1)
    return np.asarray(columns - columns.mean(axis=0))


def _harmonics(angle: Array) -> Array:
    return np.stack([f(k * angle) for k in (1, 2, 3, 4) for f in (np.cos, np.sin)], axis=1)


def _run_offsets(problem: Problem) -> Array:
    columns = np.zeros((problem.rows, len(problem.slices)))
    for i, rows in enumerate(problem.slices):
        columns[rows, i] = 1.0
    return columns[:, 1:] if len(problem.slices) > 1 else columns
