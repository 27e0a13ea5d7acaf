"""Two ways through a differential equation: the case's own by Runge-Kutta, the truth by LSODA."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType

import numpy as np
import pandas as pd
from scipy.integrate import solve_ivp

from proof.model import Array, Params

Rates = Callable[[float, Array, dict[str, float]], Array]


def nominal(
    sim: ModuleType, df: pd.DataFrame, p: Params, inputs: tuple[str, ...], substeps: int
) -> dict[str, Array]:
    """Return the outputs of a case's simulator: classical Runge-Kutta, inputs linear between rows."""
    t = df["t"].to_numpy(float)
    u = {k: df[k].to_numpy(float) for k in inputs}
    x = np.asarray(sim.initial(p), float)
    rows = [sim.outputs(x, {k: float(v[0]) for k, v in u.items()}, p)]
    for i in range(t.size - 1):
        h = (t[i + 1] - t[i]) / substeps
        start = {k: float(v[i]) for k, v in u.items()}
        rise = {k: float(v[i + 1] - v[i]) / substeps for k, v in u.items()}
        for j in range(substeps):
            at = t[i] + j * h
            u0 = {k: start[k] + j * rise[k] for k in u}
            u1 = {k: start[k] + (j + 0.5) * rise[k] for k in u}
            u2 = {k: start[k] + (j + 1) * rise[k] for k in u}
            k1 = sim.rhs(at, x, u0, p)
            k2 = sim.rhs(at + h / 2, x + h / 2 * k1, u1, p)
            k3 = sim.rhs(at + h / 2, x + h / 2 * k2, u1, p)
            k4 = sim.rhs(at + h, x + h * k3, u2, p)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        rows.append(sim.outputs(x, {k: float(v[i + 1]) for k, v in u.items()}, p))
    return {k: np.array([row[k] for row in rows]) for k in rows[0]}


def truth(rates: Rates, x0: Array, t: Array, u: dict[str, Array], *, longest: float) -> Array:
    """Return the states (time x states) on the grid; the inputs are linear between its points."""
    # Plain floats: a table of one or two inputs costs more as an array than all that is computed from it.
    inputs = [(name, np.asarray(values, float).tolist()) for name, values in u.items()]
    h, begin, last = float(t[1] - t[0]), float(t[0]), t.size - 1.000001

    def rhs(at: float, x: Array) -> Array:
        z = min(max((at - begin) / h, 0.0), last)
        i = int(z)
        return rates(at, x, {name: y[i] + (z - i) * (y[i + 1] - y[i]) for name, y in inputs})

    found = solve_ivp(
        rhs, (t[0], t[-1]), x0, method="LSODA", t_eval=t, rtol=1e-6, atol=1e-8, max_step=longest
    )
    if not found.success:
        raise RuntimeError(found.message)
    return np.asarray(found.y.T)
