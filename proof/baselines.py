"""What simpler methods make of the same cases, on the residual of the refitted nominal.

Forward selection by BIC, and least squares with sequential thresholds (the algorithm of SINDy: Brunton,
Proctor, Kutz, PNAS 113, 2016; written here, pysindy is not used),
    over a library of simple terms each of which
stands for one name; a Gaussian process, which can only say that something is there; always the commonest
effect.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from proof.model import Array, Params, Run, Scenario
from proof.oracle import rmse_of
from proof.size import Signals, nominal_of

Library = dict[str, Array]
METHODS = ("bic", "sparse", "gaussian process")


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """A baseline's answer."""

    verdict: str
    names: tuple[str, ...]
    predicted: Signals


def _column(df: pd.DataFrame, name: str) -> Array | None:
    return df[name].to_numpy(float) if name in df else None


def library(df: pd.DataFrame, run: Run, nominal: dict[str, Array], output: str) -> Library:
    """Return the simple terms of one run by `effect:term`."""
    t, y = df["t"].to_numpy(float), nominal[output]
    rate = np.gradient(y, t)
    out: Library = {
        "zero_offset:1": np.ones_like(t), "zero_drift:t": t, "sensitivity_error:y": y,
            "nonlinearity:y2": y**2,
        "nonlinearity:y3": y**3, "channel_delay:dy": rate, "hysteresis:sign": np.sign(rate),
    }  # fmt: skip
    tire = {"SA", "V"} <= set(df)
    load = df.rename(columns={"FZ_CMD": "FZ"}) if "FZ" not in df else df
    for name in ("T", "T_AMBIENT"):
        if (x := _column(df, name)) is not None:
            out[f"thermal_drift:{name}"] = x
    if tire:
        sa, fz, v = (load[k].to_numpy(float) for k in ("SA", "FZ", "V"))
        turn = np.gradient(np.radians(sa), t)
        slope = rate / np.where(np.abs(turn) > 0.01, turn, np.inf)
        pull = "conicity" if output == "FY" else "crosstalk"
        out |= {
            f"{pull}:FZ": fz, "turn_slip:rate": turn / v, "relaxation:rate/V": rate / v,
                "steer_offset:slope": slope,
            "load_friction:yFZ": y * (fz / 4000 - 1),
                "thermal_friction:yT": y * (df["T_TREAD"].to_numpy(float) - 30),
            "speed_friction:yVs": y * v * np.abs(np.sin(np.radians(sa))),
        }  # fmt: skip
        for name, effect in (("TIRE_ANGLE", "nonuniformity"), ("DRUM_ANGLE", "drum_runout")):
            x = np.radians(df[name].to_numpy(float))
            out |= {f"{effect}:cos": np.cos(x), f"{effect}:sin": np.sin(x)}
        if "surface" in run.conditions:
            out["surface_friction:y"] = y * (run.conditions["surface"] == "sandpaper")
        if "MZ" in nominal:
            out["steer_compliance:slopeMZ"] = slope * nominal["MZ"]
    motion = {"pendulum": "TH", "drive": "X"}
    x = nominal.get(motion["pendulum"], nominal.get(motion["drive"]))
    speed = df["v"].to_numpy(float) if "v" in df else (np.gradient(x, t) if x is not None else None)
    if speed is not None:
        out |= {
            "viscous_damping:v": speed, "coulomb_friction:sign": np.sign(speed),
            "quadratic_drag:v|v|": speed * np.abs(speed),
        }  # fmt: skip
    if x is not None:
        out["cubic_stiffness:x3"] = x**3
    return out


def _stack(s: Scenario, runs: tuple[Run, ...], p: Params, output: str) -> tuple[list[str], Array]:
    """Return the terms' names and the matrix over all runs."""
    tables = []
    for run in runs:
        df = s.inputs(run)
        tables.append(library(df, run, s.nominal(df, run, p), output))
    names = list(tables[0])
    return names, np.column_stack([np.concatenate([row[k] for row in tables]) for k in names])


def bic_forward(X: Array, r: Array, *, most: int = 6) -> list[int]:
    """Return the columns that forward selection takes while BIC falls (rows taken as independent)."""
    n, chosen = r.size, []
    best = n * np.log(np.mean(r**2))
    while len(chosen) < most:
        trials = []
        for j in set(range(X.shape[1])) - set(chosen):
            A = X[:, [*chosen, j]]
            left = r - A @ np.linalg.lstsq(A, r, rcond=None)[0]
            trials.append((n * np.log(np.mean(left**2)) + (len(chosen) + 1) * np.log(n), j))
        score, j = min(trials)
        if score >= best:
            break
        best = score
        chosen.append(j)
    return chosen


def thresholded(X: Array, r: Array, *, threshold: float = 0.25) -> list[int]:
    """Return the columns left by sequentially thresholded least squares, coefficients in sd of the
    residual."""
    kept = np.arange(X.shape[1])
    scale = float(r.std())
    for _ in range(10):
        if not kept.size:
            break
        c = np.linalg.lstsq(X[:, kept], r, rcond=1e-6)[0] / scale
        strong = np.abs(c) > threshold
        if strong.all():
            break
        kept = kept[strong]
    return [int(j) for j in kept]


def _linear(s: Scenario, residual: dict[str, Array], p: Params, nominal: Signals, method: str) -> Verdict:
    """Return a term-selecting baseline's answer."""
    predicted = [dict(row) for row in nominal]
    ranked: list[tuple[float, str]] = []
    for output in s.outputs:
        names, X = _stack(s, s.runs, p, output)
        r = residual[output]
        use = np.isfinite(r)
        centre, spread = X.mean(axis=0), X.std(axis=0)
        centre, spread = np.where(spread > 1e-12, centre, 0.0), np.where(spread > 1e-12, spread, 1.0)
        Z = ((X - centre) / spread)[use]
        chosen = bic_forward(Z, r[use]) if method == "bic" else thresholded(Z, r[use])
        if not chosen:
            continue
        c = np.linalg.lstsq(Z[:, chosen], r[use], rcond=1e-6)[0]
        ranked += [
            (float(-abs(v)) / s.noise[output].sd, names[j].split(":")[0])
            for v, j in zip(c, chosen, strict=True)
        ]
        _, ahead = _stack(s, s.predict, p, output)
        added = ((ahead - centre) / spread)[:, chosen] @ c
        at = 0
        for row in predicted:
            row[output] = row[output] + added[at : at + row[output].size]
            at += row[output].size
    names = tuple(dict.fromkeys(name for _, name in sorted(ranked)))
    return Verdict(verdict="named" if names else "nothing", names=names, predicted=predicted)


def _gaussian_process(s: Scenario, residual: dict[str, Array], nominal: Signals) -> Verdict:
    """Return what a Gaussian process over inputs and covariates sees; its scales by held-out error on the
    last run."""

    # A file to predict may lack a covariate that was recorded before, and the other way round.
    shared = [
        name
        for name in s.inputs(s.runs[0]).columns
        if name != "t" and all(name in s.inputs(run) for run in (*s.runs, *s.predict))
    ]

    def table(runs: tuple[Run, ...]) -> Array:
        wide = [s.inputs(run)[shared].to_numpy(float) for run in runs]
        for i, run in enumerate(runs):
            wide[i] = np.column_stack([wide[i], np.gradient(wide[i][:, 0], run.rows)])
        return np.vstack(wide)

    X, ahead = table(s.runs), table(s.predict)
    centre, spread = X.mean(axis=0), X.std(axis=0) + 1e-12
    X, ahead = (X - centre) / spread, (ahead - centre) / spread
    held = np.zeros(len(X), bool)
    held[-s.runs[-1].rows.size :] = True
    predicted, seen = [dict(row) for row in nominal], False
    for output in s.outputs:
        r = residual[output]
        use = np.isfinite(r)
        pick = np.flatnonzero(use & ~held)
        pick = pick[:: max(1, pick.size // 350)]
        test = np.flatnonzero(use & held)
        best = (float(np.mean(r[test] ** 2)), None)
        for length in (0.7, 1.5, 3.0, 6.0):
            for share in (0.1, 1.0):
                weights = np.linalg.solve(
                    _kernel(X[pick], X[pick], length) + share * np.eye(pick.size), r[pick]
                )
                error = float(np.mean((r[test] - _kernel(X[test], X[pick], length) @ weights) ** 2))
                if error < best[0] * 0.97:
                    best = (error, (length, weights))  # type: ignore[assignment]
        if best[1] is not None:
            seen = True
            length, weights = best[1]
            added, at = _kernel(ahead, X[pick], length) @ weights, 0
            for row in predicted:
                row[output] = row[output] + added[at : at + row[output].size]
                at += row[output].size
    return Verdict(verdict="unknown" if seen else "nothing", names=(), predicted=predicted)


def _kernel(a: Array, b: Array, length: float) -> Array:
    square = (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1)[None, :] - 2 * a @ b.T
    return np.asarray(np.exp(-np.maximum(square, 0.0) / (2 * length**2 * a.shape[1])))


def all_methods(s: Scenario, measured: Signals, p: Params) -> dict[str, Verdict]:
    """Return the baselines' answers; `p`: the nominal parameters as refitted."""
    there = nominal_of(s, s.runs, p)
    residual = {
        k: np.concatenate([y[k] - m[k] for y, m in zip(measured, there, strict=True)]) for k in s.outputs
    }
    ahead = nominal_of(s, s.predict, p)
    return {
        "bic": _linear(s, residual, p, ahead, "bic"),
        "sparse": _linear(s, residual, p, ahead, "sparse"),
        "gaussian process": _gaussian_process(s, residual, ahead),
    }


def errors(s: Scenario, verdicts: dict[str, Verdict], truth: Signals) -> dict[str, dict[str, float]]:
    """Return each baseline's RMSE on the files to predict."""
    return {k: rmse_of(v.predicted, truth, s.outputs) for k, v in verdicts.items()}
