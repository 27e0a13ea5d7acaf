"""Three peers on the same rows: a polynomial NARX, a sparse regression and a Gaussian process.

A peer is fitted on the training records alone. Where it has a choice (lags, degree, threshold) the choice
is that of the least error in free simulation on the last quarter of each training record; then it is fitted
again on all of them.
"""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from benchmarks.records import Array, Record

_MOST_TERMS = 400  # of a polynomial
_MOST_POINTS = 400  # of a Gaussian process


class Fitted(Protocol):
    """A fitted model that simulates freely."""

    def __call__(self, u: Array, first: Array) -> Array:
        """Return outputs for all inputs, (rows,), with the first outputs given."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Peer:
    """A method: its package, its choices, and how it is fitted with one of them."""

    name: str
    package: str
    choices: tuple[dict[str, Any], ...]
    fit: Callable[..., Fitted]


def simulate(model: Fitted, record: Record, lags: int) -> Array:
    """Return the free simulation of a record: nothing of its output but the first rows is handed over.

    A record with a lead-in is begun at rest there; one without begins with the rows that may start a model,
    and where the lags need more rows than those, the earlier ones repeat the first output.
    """
    pad = max(0, lags - record.warm_up) if not record.lead_in else lags
    u = np.concatenate([np.full(pad, record.u[0]), record.u])
    known = record.y[: record.warm_up] if not record.lead_in else record.y[:0]
    first = np.concatenate([np.full(pad, record.y[0]), known])[:lags]
    with np.errstate(all="ignore"):
        return model(u, first)[pad:]


def evaluate(
    peer: Peer, train: Sequence[Record], test: Sequence[Record]
) -> tuple[list[float], dict[str, Any]]:
    """Return the error on each test record, and the choice that the training part's last quarter made."""
    early = [_rows(r, slice(0, 3 * len(r.t) // 4)) for r in train]
    late = [replace(_rows(r, slice(3 * len(r.t) // 4, None)), warm_up=peer_lags(peer)) for r in train]
    best, chosen = np.inf, peer.choices[0]
    for choice in peer.choices if len(peer.choices) > 1 else ():
        model = _quiet(peer.fit, early, choice)
        errors = [r.error_of(simulate(model, r, choice["lags"])) for r in late] if model else [np.inf]
        if (score := float(np.sqrt(np.mean(np.square(errors))))) < best:
            best, chosen = score, choice
    model = _quiet(peer.fit, train, chosen)
    if model is None:
        return [float("inf")] * len(test), chosen
    return [r.error_of(simulate(model, r, chosen["lags"])) for r in test], chosen


def peer_lags(peer: Peer) -> int:
    """Return the most rows that any of a peer's choices needs to begin."""
    return max(choice["lags"] for choice in peer.choices)


def _rows(record: Record, part: slice) -> Record:
    return replace(record, t=record.t[part], u=record.u[part], y=record.y[part])


def _quiet(fit: Callable[..., Fitted], records: Iterable[Record], choice: dict[str, Any]) -> Fitted | None:
    """Fit without the packages' warnings; a choice that cannot be fitted is none."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            return fit(list(records), **choice)
        except (ValueError, np.linalg.LinAlgError):
            return None


def _lagged(records: Sequence[Record], lags: int) -> tuple[Array, Array]:
    """Return regressors y[k-1..k-lags], u[k..k-lags], (rows, 2 lags + 1), and y[k], (rows,)."""
    rows, outputs = [], []
    for r in records:
        at = np.arange(lags, len(r.t))
        past = [r.y[at - i] for i in range(1, lags + 1)] + [r.u[at - i] for i in range(lags + 1)]
        rows.append(np.column_stack(past))
        outputs.append(r.y[at])
    return np.vstack(rows), np.concatenate(outputs)


def _freely(step: Callable[[Array], float], lags: int, bound: float) -> Fitted:
    """Return the free simulation of a one-step model; beyond the bound the rest is not a number."""

    def run(u: Array, first: Array) -> Array:
        y = np.full(len(u), np.nan)
        y[:lags] = first
        for k in range(lags, len(u)):
            value = step(np.concatenate([y[k - lags : k][::-1], u[k - lags : k + 1][::-1]]))
            if not abs(value) < bound:
                break
            y[k] = value
        return y

    return run


def _bound(records: Sequence[Record]) -> float:
    return 100 * max(float(np.max(np.abs(r.y))) for r in records)


def narx(records: list[Record], *, lags: int, degree: int) -> Fitted:
    """Fit SysIdentPy's FROLS on each record's rows: terms by their error reduction, their number by BIC."""
    from sysidentpy.basis_function import Polynomial
    from sysidentpy.model_structure_selection import FROLS
    from sysidentpy.parameter_estimation import LeastSquares

    x, y = _lagged(records, lags)
    many = math.comb(x.shape[1] + degree, degree)
    if many > _MOST_TERMS:
        raise ValueError("more terms than rows can tell apart")
    # Lags are columns, so that no row spans two records; NFIR takes x[k-1] for y[k], hence the row in front.
    model = FROLS(
        order_selection=True, n_info_values=min(30, many - 1), ylag=1, xlag=[[1]] * x.shape[1],
        info_criteria="bic", estimator=LeastSquares(), basis_function=Polynomial(degree=degree),
        model_type="NFIR",
    )  # fmt: skip
    scale_x, scale_y = np.maximum(np.abs(x).max(axis=0), 1e-12), float(np.abs(y).max())
    model.fit(X=np.vstack([x, x[-1:]]) / scale_x, y=np.concatenate([y[:1], y])[:, None] / scale_y)
    powers, theta = model.final_model, np.ravel(model.theta)

    def step(row: Array) -> float:
        z = row / scale_x
        total = 0.0
        for weight, codes in zip(theta, powers, strict=True):
            term = weight
            for code in codes:
                if code:
                    term *= z[int(code) // 1000 - 2]
            total += term
        return float(total * scale_y)

    return _freely(step, lags, _bound(records))


def sindy(records: list[Record], *, lags: int, degree: int, threshold: float) -> Fitted:
    """Fit pysindy's discrete model of the output and its past rows as states."""
    import pysindy as ps

    x, y = _lagged(records, lags)
    scale = np.maximum(np.abs(x).max(axis=0), 1e-12)
    states, inputs = x[:, :lags] / scale[:lags], x[:, lags:] / scale[lags:]
    after = np.column_stack([y / scale[0], states[:, : lags - 1]])
    library = ps.PolynomialLibrary(degree=degree)
    model = ps.DiscreteSINDy(optimizer=ps.STLSQ(threshold=threshold, alpha=1e-6), feature_library=library)
    model.fit(states, t=1, x_next=after, u=inputs)
    weights = model.coefficients()[0]
    exponents = np.asarray(library.powers_)
    used = np.flatnonzero(weights)

    def step(row: Array) -> float:
        return float(weights[used] @ np.prod((row / scale) ** exponents[used], axis=1) * scale[0])

    return _freely(step, lags, _bound(records))


def gaussian_process(records: list[Record], *, lags: int) -> Fitted:
    """Fit scikit-learn's Gaussian process on what a linear model leaves, and simulate its mean.

    One length for each regressor; rows are drawn evenly.
    """
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    x, y = _lagged(records, lags)
    shift, spread = x.mean(axis=0), x.std(axis=0) + 1e-12
    z = np.column_stack([(x - shift) / spread, np.ones(len(y))])
    linear = np.linalg.lstsq(z, y, rcond=None)[0]
    rest = y - z @ linear
    size = float(rest.std()) or 1.0
    rows = np.linspace(0, len(y) - 1, min(len(y), _MOST_POINTS)).astype(int)
    kernel = ConstantKernel(1.0, (1e-3, 1e4)) * RBF(np.full(x.shape[1], 5.0), (0.3, 1e3)) + WhiteKernel(
        0.1, (1e-6, 2)
    )
    process = GaussianProcessRegressor(kernel=kernel, optimizer=_few_steps)
    process.fit(z[rows, :-1], rest[rows] / size)
    part = process.kernel_.k1
    lengths, height = np.ravel(part.k2.length_scale), part.k1.constant_value
    points, weights = process.X_train_ / lengths, size * height * np.ravel(process.alpha_)

    def step(row: Array) -> float:
        here = (row - shift) / spread
        near = np.exp(-0.5 * np.sum((points - here / lengths) ** 2, axis=1))
        return float(here @ linear[:-1] + linear[-1] + weights @ near)

    return _freely(step, lags, _bound(records))


def _few_steps(objective: Callable[..., Any], start: Array, bounds: Array) -> tuple[Array, float]:
    """Optimise the process's lengths in a bounded number of steps."""
    from scipy.optimize import minimize

    best = minimize(objective, start, jac=True, bounds=bounds, method="L-BFGS-B", options={"maxiter": 30})
    return best.x, float(best.fun)


PEERS: tuple[Peer, ...] = (
    Peer(
        name="NARX", package="sysidentpy", fit=narx,
        choices=tuple(
            {"lags": n, "degree": d} for n, d in ((2, 1), (2, 2), (2, 3), (4, 1), (4, 2), (8, 1), (8, 2))
        ),
    ),
    Peer(
        name="SINDy", package="pysindy", fit=sindy,
        choices=tuple(
            {"lags": n, "degree": d, "threshold": w}
            for (n, d), w in itertools.product(((2, 1), (2, 2), (2, 3), (4, 1), (4, 2)), (1e-4, 1e-2))
        ),
    ),
    Peer(
        name="Gaussian process", package="sklearn", fit=gaussian_process,
        choices=({"lags": 2}, {"lags": 4}, {"lags": 8}),
    ),
)  # fmt: skip
