"""What a fit says about itself: influence, collinearity, lack of fit, direction of loading.

Formulas: Cook and Weisberg, Residuals and Influence in Regression (1982); ASTM E74 annex A1 for the lack
of fit against a model of higher degree.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.fit.inner import inner

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.fit.regression import TermFit

OUTLIER_RISK = 0.01


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Diagnostics:
    """Row by row: studentised residuals (internal, external) and Cook's distance, each (rows,).

    ``press`` is the root of the mean squared leave-one-out residual, ``reversibility`` the mean residual
    going up minus that going down, both in the load's unit. ``lack_of_fit`` is (F, probability) from
    replicated rows, ``heteroscedasticity`` the Breusch-Pagan probability; None where not determined.
    ``outliers`` are rows from 1.
    """

    internal: NDArray[np.float64]
    external: NDArray[np.float64]
    cook: NDArray[np.float64]
    press: float
    outliers: tuple[int, ...]
    reversibility: float | None
    lack_of_fit: tuple[float, float] | None
    heteroscedasticity: float | None


def diagnose(
    fit: TermFit,
    *,
    cells: NDArray[np.float64],
    load: NDArray[np.float64],
    up: NDArray[np.bool_] | None,
    replicates: NDArray[np.intp] | None = None,
) -> Diagnostics:
    """Return the diagnostics of a solved load.

    ``cells`` (rows, indications), ``load`` (rows,), ``up`` (rows,) where the direction is known;
    ``replicates`` as of `replicate_groups`, where they are known already.
    """
    n, p = len(load), len(fit.terms)
    w = None if fit.weights is None else np.sqrt(fit.weights)
    e, h = fit.scaled, np.minimum(fit.leverage, 1 - 1e-12)
    sse, dof = inner(e, e) if fit.chi2 is None else fit.chi2, fit.dof
    variance = sse / dof
    # Residuals at the level of rounding say nothing about the data.
    size = max(-load.min(), load.max()) if w is None else np.abs(load * w).max()
    floor = (1e-12 * float(size)) ** 2
    tiny = max(floor, np.finfo(float).tiny)
    complement = 1 - h
    freed = e / np.sqrt(complement)
    internal = freed / np.sqrt(max(variance, tiny))
    if dof > 1:
        remaining = sse - freed**2
        remaining /= dof - 1
        external = freed / np.sqrt(np.maximum(remaining, tiny, out=remaining))
    else:
        external = internal
    deleted = e / complement
    if w is not None:
        deleted /= w
    quiet = variance <= floor
    return Diagnostics(
        internal=internal,
        external=external,
        cook=internal**2 * (h / (p * complement)),
        press=float(np.sqrt(inner(deleted, deleted) / n)),
        outliers=() if quiet or dof < 2 else _outliers(external, dof - 1),
        reversibility=_reversibility(fit.residuals, up),
        lack_of_fit=None if quiet else _lack_of_fit(fit, cells, load, replicates),
        heteroscedasticity=None if quiet or n < 10 else _breusch_pagan(e, load),
    )


def replicate_groups(rows: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the number of each row's group of equal rows (rows,), groups counted from 0."""
    # Sorting rows is slow, sorting one mixed key a row is not. Equal rows have equal keys, so that rows
    # with a key of their own are alone; only the others are compared in full.
    bits = (np.ascontiguousarray(rows.T) + 0.0).view(np.uint64)  # -0.0 + 0.0 is 0.0
    key = np.zeros(len(rows), dtype=np.uint64)
    for column in bits:
        key = (key ^ (column ^ (column >> np.uint64(29)))) * np.uint64(0x9E3779B97F4A7C15)
        key ^= key >> np.uint64(32)
    # Rows with a key of their own are told by counting keys cut to some bits, and the few that share a count
    # by sorting.
    size = np.uint64(len(rows).bit_length() + 2)
    cut = (key >> (np.uint64(64) - size)).astype(np.intp)
    few = np.flatnonzero(np.bincount(cut)[cut] > 1)
    order = np.sort(key[few])
    repeated = np.unique(order[1:][order[1:] == order[:-1]])
    groups = np.arange(len(rows), dtype=np.intp)
    if not repeated.size:
        return groups
    several = np.isin(key, repeated)
    _, inverse = np.unique(rows[several], axis=0, return_inverse=True)
    alone = int((~several).sum())
    groups[~several] = np.arange(alone)
    groups[several] = alone + inverse.ravel()
    return groups


def _outliers(external: NDArray[np.float64], dof: int) -> tuple[int, ...]:
    # Bonferroni: the risk that any row of a clean session is named is OUTLIER_RISK.
    from scipy.special import stdtrit

    limit = stdtrit(dof, 1 - OUTLIER_RISK / (2 * len(external)))
    return tuple(int(i) + 1 for i in np.flatnonzero(np.abs(external) > limit))


def _reversibility(residuals: NDArray[np.float64], up: NDArray[np.bool_] | None) -> float | None:
    ups = 0 if up is None else int(np.count_nonzero(up))
    if up is None or ups in (0, len(up)):
        return None
    rising = inner(residuals, up)
    return rising / ups - (float(residuals.sum()) - rising) / (len(up) - ups)


def _lack_of_fit(
    fit: TermFit,
    cells: NDArray[np.float64],
    load: NDArray[np.float64],
    replicates: NDArray[np.intp] | None,
) -> tuple[float, float] | None:
    if fit.weights is not None:
        return None
    group = replicate_groups(cells) if replicates is None else replicates
    groups = int(group.max()) + 1
    pure_dof, lack_dof = len(load) - groups, groups - len(fit.terms)
    if pure_dof < 1 or lack_dof < 1:
        return None
    means = np.bincount(group, weights=load) / np.bincount(group)
    pure = float(np.sum((load - means[group]) ** 2))
    if pure <= 0:
        return None
    from scipy.special import fdtrc

    ratio = (inner(fit.residuals, fit.residuals) - pure) / lack_dof / (pure / pure_dof)
    return ratio, float(fdtrc(lack_dof, pure_dof, max(ratio, 0.0)))


def _breusch_pagan(e: NDArray[np.float64], load: NDArray[np.float64]) -> float:
    from scipy.special import chdtrc

    g = e**2
    g /= g.mean()
    g -= 1
    x = np.abs(load)
    x -= x.mean()
    spread = inner(x, x)
    return float(chdtrc(1, 0.5 * inner(x, g) ** 2 / spread)) if spread > 0 else 1.0
