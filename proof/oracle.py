"""Two fits by the generator itself: the declared simulation without new physics, and the true structure.

They bound what any tool could gain on the conditions that no fit has seen.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from proof.model import Array, Effects, Params, Scenario
from proof.noise import whitened
from proof.size import Signals, nominal_of, truth_of

Model = Callable[[Array], Signals]


@dataclass(frozen=True, slots=True, kw_only=True)
class Ceiling:
    """RMSE on the files to predict, against what truly happens there, by output."""

    declared: dict[str, float]
    """The simulation as declared."""
    refitted: dict[str, float]
    """Its parameters refitted within their priors."""
    oracle: dict[str, float]
    """The true structure fitted to the same training data."""


def rmse_of(found: Signals, truth: Signals, outputs: tuple[str, ...]) -> dict[str, float]:
    return {
        k: float(
            np.sqrt(np.mean(np.concatenate([f[k] - t[k] for f, t in zip(found, truth, strict=True)]) ** 2))
        )
        for k in outputs
    }


def _kept(s: Scenario, model: Signals, measured: Signals) -> list[dict[str, Array]]:
    """Return which samples count: those that exist and are no spikes about a first model."""
    out = []
    for m, y in zip(model, measured, strict=True):
        row = {}
        for k in s.outputs:
            r = y[k] - m[k]
            r = r - np.nanmedian(r)
            spread = 1.4826 * float(np.nanmedian(np.abs(r)))
            row[k] = np.isfinite(r) & (np.abs(r) < max(6.0 * spread, 4.5 * s.noise[k].sd))
        out.append(row)
    return out


def _residual(
    s: Scenario, model: Signals, measured: Signals, kept: list[dict[str, Array]], d: Array
) -> Array:
    rows = [
        whitened(s.noise[k], np.where(use[k], np.nan_to_num(y[k]) - m[k], 0.0))
        for m, y, use in zip(model, measured, kept, strict=True)
        for k in s.outputs
    ]
    return np.concatenate([*rows, d])


def fitted(
    s: Scenario, model: Model, measured: Signals, start: Array, prior: Array, *, steps: int = 3
) -> Array:
    """Return Gauss-Newton's answer; parameters are in prior sd, `prior` 1 where one holds and 0 where none
    does."""
    d = start.copy()
    first = model(d)
    kept = _kept(s, first, measured)
    r = _residual(s, first, measured, kept, d * prior)
    for _ in range(steps if d.size else 0):
        columns = []
        for j in range(d.size):
            moved = d.copy()
            moved[j] += 0.05
            columns.append((_residual(s, model(moved), measured, kept, moved * prior) - r) / 0.05)
        step = np.linalg.lstsq(np.column_stack(columns), -r, rcond=1e-8)[0]
        for shrink in (1.0, 0.5, 0.25, 0.1):
            trial = d + shrink * np.clip(step, -2.0, 2.0)
            new = _residual(s, model(trial), measured, kept, trial * prior)
            if new @ new <= r @ r:
                break
        else:
            break
        small = float(r @ r - new @ new) < 0.01
        d, r = trial, new
        if small:
            break
    return d


def _parameters(s: Scenario, d: Array, about: str) -> Params:
    out = s.declared_parameters() if about == "declared" else s.true_parameters()
    for p, x in zip(s.free(), d, strict=True):
        out[p.name] = p.declared + float(x) * float(p.sd or 0.0)
    return out


def refit(s: Scenario, measured: Signals) -> Params:
    """Return the declared simulation's parameters refitted within their priors, and no new physics."""
    n = len(s.free())

    def model(d: Array) -> Signals:
        return nominal_of(s, s.runs, _parameters(s, d, "declared"))

    return _parameters(s, fitted(s, model, measured, np.zeros(n), np.ones(n)), "declared")


def _effects_at(effects: Effects, names: list[tuple[str, str]], d: Array) -> dict[str, dict[str, Any]]:
    out = {k: dict(v) for k, v in effects.items()}
    for (effect, key), x in zip(names, d, strict=True):
        out[effect][key] = out[effect][key] * (1 + 0.2 * float(x))
    return out


def ceiling(s: Scenario, measured: Signals, effects: Effects, truth: Signals) -> Ceiling:
    """Return what the declared, the refitted and the true structure reach on the files to predict."""
    free = s.free()
    keys = [(name, key) for name in effects for key in s.effects[name].scaled]
    n, m = len(free), len(keys)

    def model(d: Array) -> Signals:
        return truth_of(s, s.runs, _parameters(s, d[:n], "true"), _effects_at(effects, keys, d[n:]))

    start = np.concatenate([[(p.true - p.declared) / float(p.sd or 1.0) for p in free], np.zeros(m)])
    d = fitted(s, model, measured, start, np.concatenate([np.ones(n), np.zeros(m)]), steps=2)
    best = truth_of(s, s.predict, _parameters(s, d[:n], "true"), _effects_at(effects, keys, d[n:]))
    return Ceiling(
        declared=rmse_of(nominal_of(s, s.predict, s.declared_parameters()), truth, s.outputs),
        refitted=rmse_of(nominal_of(s, s.predict, refit(s, measured)), truth, s.outputs),
        oracle=rmse_of(best, truth, s.outputs),
    )


def tool_rmse(
    s: Scenario, predictions: list[pd.DataFrame], truth: Signals, which: str
) -> dict[str, float] | None:
    """Return the RMSE of the tool's predictions (`nominal`, `refitted` or `augmented`); None where they
    lack."""
    out = {}
    for k in s.outputs:
        wrong = []
        for df, t in zip(predictions, truth, strict=True):
            if f"{k}_{which}" not in df or len(df) != t[k].size:
                return None
            wrong.append(df[f"{k}_{which}"].to_numpy(float) - t[k])
        out[k] = float(np.sqrt(np.mean(np.concatenate(wrong) ** 2)))
    return out


def gap_closed(found: dict[str, float], reference: dict[str, float], c: Ceiling, s: Scenario) -> float | None:
    """Return (reference - found) / (reference - oracle) over the outputs in noise sd; None where no gap is
    there.

    A gap below 0.1 noise sd is not asked to be closed.
    """

    def total(rmse: dict[str, float]) -> float:
        return float(np.sqrt(np.mean([(rmse[k] / s.noise[k].sd) ** 2 for k in s.outputs])))

    gap = total(reference) - total(c.oracle)
    return (total(reference) - total(found)) / gap if gap > 0.1 else None
