"""How large an effect is: what a refit of the nominal parameters leaves of it, against the noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from proof.model import Array, Effects, Params, Run, Scenario
from proof.noise import whitened

Signals = list[dict[str, Array]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Size:
    """An effect's size after the nominal projection."""

    over_noise: float
    """RMS over the noise's standard deviation, in the output that shows it most."""
    distance: float
    """Length over the whole recording, in noise sd, corrected for the noise's colour."""
    by_output: dict[str, float]


def truth_of(scenario: Scenario, runs: tuple[Run, ...], p: Params, e: Effects) -> Signals:
    """Return the true outputs of the runs."""
    return [scenario.truth(run, p, e) for run in runs]


def driven_of(scenario: Scenario, runs: tuple[Run, ...], e: Effects) -> tuple[Run, ...]:
    """Return the runs with their measured drivers as the effects made them."""
    return tuple(scenario.driven(run, e) for run in runs) if scenario.driven else runs


def without_of(scenario: Scenario, runs: tuple[Run, ...], p: Params, e: Effects) -> Signals:
    """Return what the outputs would be without the effects, at the drivers that were measured with them."""
    return truth_of(scenario, driven_of(scenario, runs, e), p, {})


def nominal_of(scenario: Scenario, runs: tuple[Run, ...], p: Params) -> Signals:
    """Return the nominal outputs of the runs."""
    return [scenario.nominal(scenario.inputs(run), run, p) for run in runs]


def difference(a: Signals, b: Signals) -> Signals:
    """Return a - b in the outputs that both have."""
    return [{k: x[k] - y[k] for k in x if k in y} for x, y in zip(a, b, strict=True)]


def change(scenario: Scenario, p: Params, e: Effects, without: Signals) -> Signals:
    """Return what effects change in the recorded runs; `without` serves where no measured driver moves."""
    bare = without_of(scenario, scenario.runs, p, e) if scenario.driven else without
    return difference(truth_of(scenario, scenario.runs, p, e), bare)


def stacked(scenario: Scenario, signals: Signals) -> Array:
    """Return all outputs of all runs as innovations of unit variance, one vector."""
    return np.concatenate([whitened(scenario.noise[k], s[k]) for s in signals for k in scenario.outputs])


def jacobian(scenario: Scenario, runs: tuple[Run, ...]) -> list[Signals]:
    """Return, for each free parameter, the change of the nominal outputs for one prior sd."""
    at = scenario.true_parameters()
    middle = nominal_of(scenario, runs, at)
    out = []
    for p in scenario.free():
        step = 0.05 * float(p.sd or 0.0)
        moved = nominal_of(scenario, runs, at | {p.name: p.true + step})
        out.append([{k: x / 0.05 for k, x in row.items()} for row in difference(moved, middle)])
    return out


def _left(scenario: Scenario, effect: Signals, slopes: list[Signals]) -> Signals:
    if not slopes:
        return effect
    J = np.column_stack([stacked(scenario, s) for s in slopes])
    ridge = np.vstack([J, np.eye(J.shape[1])])
    wanted = np.concatenate([stacked(scenario, effect), np.zeros(J.shape[1])])
    d = lsq_linear(ridge, wanted, bounds=(-3.0, 3.0)).x
    return [
        {k: row[k] - sum(d[j] * slopes[j][i][k] for j in range(d.size)) for k in scenario.outputs}
        for i, row in enumerate(effect)
    ]


def projected(scenario: Scenario, effect: Signals, slopes: list[Signals]) -> Array:
    """Return what the parameters leave of a difference, as innovations of unit variance in one vector."""
    return stacked(scenario, _left(scenario, effect, slopes))


def size_of(scenario: Scenario, effect: Signals, slopes: list[Signals]) -> Size:
    """Return the size of a difference between outputs after the parameters have taken what they can.

    Generalised least squares with the priors as a ridge: min |W(e - J d)|^2 + |d|^2, d in prior sd and at
    most 3 of them: beyond that the refit itself would be the finding.
    """
    effect = _left(scenario, effect, slopes)
    by_output = {
        k: float(np.sqrt(np.mean(np.concatenate([row[k] for row in effect]) ** 2)) / scenario.noise[k].sd)
        for k in scenario.outputs
    }
    distance = float(np.linalg.norm(stacked(scenario, effect)))
    return Size(over_noise=max(by_output.values()), distance=distance, by_output=by_output)


def scaled_to(
    scenario: Scenario, name: str, wanted: float, slopes: list[Signals], without: Signals
) -> tuple[float, Size]:
    """Return the factor on the effect's base, and the size it reaches; as near the wanted one as is
    physical. `without` is what the outputs would be without any effect."""
    spec, p = scenario.effects[name], scenario.true_parameters()

    def size_at(factor: float) -> Size:
        return size_of(scenario, change(scenario, p, {name: spec.at(factor)}, without), slopes)

    factor = 1.0
    found = size_at(factor)
    if not spec.scaled:
        return factor, found
    for _ in range(4):
        if abs(found.over_noise / wanted - 1) < 0.03 or found.over_noise < 1e-9:
            break
        factor = float(np.clip(factor * wanted / found.over_noise, 1e-3, spec.largest))
        found = size_at(factor)
    return factor, found
