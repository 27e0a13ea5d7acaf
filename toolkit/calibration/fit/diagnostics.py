"""What a fit says about itself: influence, collinearity, lack of fit, direction of loading.

Formulas: Cook and Weisberg, Residuals and Influence in Regression (1982); ASTM E74 annex A1 for the lack
of fit against a model of higher degree.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

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
    direction: tuple[str, ...] | None,
    replicates: NDArray[np.intp] | None = None,
) -> Diagnostics:
    """Return the diagnostics of a solved load.

    ``cells`` (rows, indications), ``load`` (rows,); ``replicates`` as of `replicate_groups`, where they are
    known already.
    """
    n, p = len(load), len(fit.terms)
    w = np.ones(n) if fit.weights is None else np.sqrt(fit.weights)
    e, h = fit.scaled, np.minimum(fit.leverage, 1 - 1e-12)
    sse, dof = float(e @ e) if fit.chi2 is None else fit.chi2, fit.dof
    variance = sse / dof
    # Residuals at the level of rounding say nothing about the data.
    floor = (1e-12 * float(np.abs(load * w).max())) ** 2
    tiny = max(floor, np.finfo(float).tiny)
    internal = e / np.sqrt(max(variance, tiny) * (1 - h))
    if dof > 1:
        left = np.maximum((sse - e**2 / (1 - h)) / (dof - 1), tiny)
        external = e / np.sqrt(left * (1 - h))
    else:
        external = internal
    quiet = variance <= floor
    return Diagnostics(
        internal=internal,
        external=external,
        cook=internal**2 * h / (1 - h) / p,
        press=float(np.sqrt(np.mean((e / w / (1 - h)) ** 2))),
        outliers=() if quiet or dof < 2 else _outliers(external, dof - 1),
        reversibility=_reversibility(fit.residuals, direction),
        lack_of_fit=None if quiet else _lack_of_fit(fit, cells, load, replicates),
        heteroscedasticity=None if quiet or n < 10 else _breusch_pagan(e, load),
    )


def variance_inflation(cells: NDArray[np.float64]) -> tuple[float, ...]:
    """Return the variance inflation factor of each indication (1 where it is alone)."""
    centred = cells - cells.mean(axis=0)
    scaled = centred / np.sqrt(np.einsum("ij,ij->j", centred, centred))
    return tuple(np.diag(np.linalg.inv(scaled.T @ scaled)).tolist())


def replicate_groups(rows: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the number of each row's group of equal rows (rows,), groups counted from 0."""
    # Sorting rows is slow, sorting one mixed key a row is not. Equal rows have equal keys, so that rows
    # with a key of their own are alone; only the others are compared in full.
    bits = np.ascontiguousarray(rows + 0.0).view(np.uint64)
    key = np.zeros(len(rows), dtype=np.uint64)
    for column in bits.T:
        key = (key ^ (column ^ (column >> np.uint64(29)))) * np.uint64(0x9E3779B97F4A7C15)
        key ^= key >> np.uint64(32)
    order = np.sort(key)
    again = np.unique(order[1:][order[1:] == order[:-1]])
    groups = np.arange(len(rows), dtype=np.intp)
    if not again.size:
        return groups
    several = np.isin(key, again)
    _, inverse = np.unique(rows[several], axis=0, return_inverse=True)
    alone = int((~several).sum())
    groups[~several] = np.arange(alone)
    groups[several] = alone + inverse.ravel()
    return groups


def repeated_share(rows: NDArray[np.float64]) -> float:
    """Return the share of rows that repeat another one, cell by cell."""
    return 1.0 - (int(replicate_groups(rows).max()) + 1) / len(rows)


def _outliers(external: NDArray[np.float64], dof: int) -> tuple[int, ...]:
    # Bonferroni: the risk that any row of a clean session is named is OUTLIER_RISK.
    from scipy.special import stdtrit

    limit = stdtrit(dof, 1 - OUTLIER_RISK / (2 * len(external)))
    return tuple(int(i) + 1 for i in np.flatnonzero(np.abs(external) > limit))


def _reversibility(residuals: NDArray[np.float64], direction: tuple[str, ...] | None) -> float | None:
    up = np.array(direction or (), dtype=np.str_) == "up"
    if not up.any() or up.all():
        return None
    return float(residuals[up].mean() - residuals[~up].mean())


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

    ratio = (float(fit.residuals @ fit.residuals) - pure) / lack_dof / (pure / pure_dof)
    return ratio, float(fdtrc(lack_dof, pure_dof, max(ratio, 0.0)))


def _breusch_pagan(e: NDArray[np.float64], load: NDArray[np.float64]) -> float:
    from scipy.special import chdtrc

    g = e**2 / np.mean(e**2) - 1
    x = np.abs(load) - np.abs(load).mean()
    spread = float(x @ x)
    return float(chdtrc(1, 0.5 * float(x @ g) ** 2 / spread)) if spread > 0 else 1.0
