"""What a fit says about itself: influence, collinearity, load levels and lack of fit, direction of loading.

Indications never repeat exactly, so replicates are found on the side that does: the reference loads. Rows
belong to one level where *every* load agrees; values of one load are the same where no gap between
neighbours of the sorted values is over 0.02 % of full scale, and a chain of such values is no level where it
is wider than five times that (a continuous sweep has no replicates).

Formulas: Cook and Weisberg, Residuals and Influence in Regression (1982); ASTM E74 annex A1 for the lack
of fit against a model of higher degree.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.calibration.fit.basis import inner
from toolkit.calibration.fit.regression import TermFit

OUTLIER_RISK = 0.01
GAP = 2e-4
WIDEST = 5 * GAP


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Diagnostics:
    """Row by row: studentised residuals (internal, external) and Cook's distance, each (rows,).

    ``apart`` (rows,) is the external one free of what runs differ by, which ``outliers`` are judged by.
    ``press`` is the root of the mean squared leave-one-out residual, ``reversibility`` the mean residual
    going up minus that going down, both in the load's unit. ``lack_of_fit`` is (F, probability) from
    replicated rows, ``heteroscedasticity`` the Breusch-Pagan probability; None where not determined.
    ``outliers`` are rows from 1.
    """

    internal: Array
    external: Array
    apart: Array
    cook: Array
    press: float
    outliers: tuple[int, ...]
    reversibility: float | None
    lack_of_fit: tuple[float, float] | None
    heteroscedasticity: float | None


def diagnose(
    fit: TermFit,
    *,
    cells: Array,
    load: Array,
    up: NDArray[np.bool_] | None,
    replicates: NDArray[np.intp] | None = None,
    loads: int = 1,
) -> Diagnostics:
    """Return the diagnostics of a solved load.

    ``cells`` (rows, indications), ``load`` (rows,), ``up`` (rows,) where the direction is known;
    ``replicates`` as of `replicate_groups`, where they are known already; ``loads`` that the session has.
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
        apart=external,
        cook=internal**2 * (h / (p * complement)),
        press=float(np.sqrt(inner(deleted, deleted) / n)),
        outliers=() if quiet or dof < 2 else _outliers(external, dof - 1, loads),
        reversibility=_reversibility(fit.residuals, up),
        lack_of_fit=None if quiet else _lack_of_fit(fit, cells, load, replicates),
        heteroscedasticity=None if quiet or n < 10 else _breusch_pagan(e, load),
    )


def replicate_groups(rows: Array) -> NDArray[np.intp]:
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


def _outliers(external: Array, dof: int, loads: int) -> tuple[int, ...]:
    # Bonferroni: the risk that any row of a clean session is named in any of its loads is OUTLIER_RISK.
    from scipy.special import stdtrit

    limit = stdtrit(dof, 1 - OUTLIER_RISK / (2 * loads * len(external)))
    return tuple(int(i) + 1 for i in np.flatnonzero(np.abs(external) > limit))


def _reversibility(residuals: Array, up: NDArray[np.bool_] | None) -> float | None:
    ups = 0 if up is None else int(np.count_nonzero(up))
    if up is None or ups in (0, len(up)):
        return None
    rising = inner(residuals, up)
    return rising / ups - (float(residuals.sum()) - rising) / (len(up) - ups)


def _lack_of_fit(
    fit: TermFit, cells: Array, load: Array, replicates: NDArray[np.intp] | None
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


def _breusch_pagan(e: Array, load: Array) -> float:
    from scipy.special import chdtrc

    g = e**2
    g /= g.mean()
    g -= 1
    x = np.abs(load)
    x -= x.mean()
    spread = inner(x, x)
    return float(chdtrc(1, 0.5 * inner(x, g) ** 2 / spread)) if spread > 0 else 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LackOfFit:
    """F = (between-level scatter of the residuals) / (their scatter within levels), with its probability.

    ``pure_error_sd`` is the scatter within levels, in the load's unit (weighted rows: relative to u).
    """

    F: float
    probability: float
    lack_dof: int
    pure_dof: int
    pure_error_sd: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Reversal:
    """Loading against unloading at one level: ``load`` and ``difference`` in the load's unit.

    ``difference`` is the load indicated going down minus that going up; ``run`` None where the file has none.
    """

    run: int | None
    load: float
    difference: float
    percent_fs: float


def load_levels(loads: Array) -> NDArray[np.int64] | None:
    """Return each row's level (rows,) from loads (rows, loads); None where no level holds two rows."""
    rows = len(loads)
    identity = np.empty(loads.shape, dtype=np.int64)
    for j, column in enumerate(loads.T):
        full = float(np.abs(column).max())
        order = np.argsort(column, kind="stable")
        steps = np.diff(column[order]) > GAP * full
        group = np.concatenate([[0], np.cumsum(steps)])
        low = np.flatnonzero(np.concatenate([[True], steps]))
        high = np.append(low[1:], rows) - 1
        wide = (column[order][high] - column[order][low]) > WIDEST * full
        # Rows of a sweep stand alone: each is its own level.
        alone = wide[group]
        identity[order, j] = np.where(alone, rows + np.arange(rows), group)
    _, level = np.unique(identity, axis=0, return_inverse=True)
    level = np.asarray(level.ravel(), dtype=np.int64)
    return None if int(level.max()) + 1 == rows else level


def loadings(
    level: NDArray[np.int64] | None, run: Array | None, up: NDArray[np.bool_] | None
) -> NDArray[np.int64] | None:
    """Return which loading each row was read at (rows,): rows behind each other of one level, run, direction.

    Readings of a load that stays on are no replicates: they share what that loading made of it.
    """
    if level is None:
        return None
    new = np.diff(level, prepend=-1) != 0
    for label in (run, up):
        if label is not None:
            new[1:] |= label[1:] != label[:-1]
    return np.asarray(np.cumsum(new) - 1, dtype=np.int64)


def lack_of_fit(
    fit: TermFit, level: NDArray[np.int64] | None, loading: NDArray[np.int64] | None = None
) -> LackOfFit | None:
    """Return the lack-of-fit test against the pure error of replicated levels; None where not determined.

    F = [sum n_g mean_g^2 / (G - p)] / [sum (e - mean_g)^2 / (n - G)] over G levels of the residuals e,
    weighted where the fit is. With ``loading`` (rows,) the residuals are the means of n loadings. Hysteresis
    between loading and unloading counts as pure error. Source: Draper and Smith, Applied Regression Analysis
    (1998), 2.1; ASTM E74 annex for calibrations.
    """
    if level is None:
        return None
    residuals, w = fit.residuals, np.ones(len(level)) if fit.weights is None else fit.weights
    if loading is not None:
        total = np.bincount(loading, weights=w)
        residuals = np.bincount(loading, weights=w * residuals) / total
        level, w = level[np.flatnonzero(np.diff(loading, prepend=-1))], np.asarray(total, dtype=np.float64)
    n, groups, p = len(residuals), int(level.max()) + 1, len(fit.terms)
    pure_dof, lack_dof = n - groups, groups - p
    if pure_dof < 1 or lack_dof < 1:
        return None
    mean = np.bincount(level, weights=w * residuals) / np.bincount(level, weights=w)
    pure = float(np.sum(w * (residuals - mean[level]) ** 2))
    if pure <= 0:
        return None
    from scipy.special import fdtrc

    lack = float(np.sum(w * mean[level] ** 2))
    ratio = lack / lack_dof / (pure / pure_dof)
    return LackOfFit(
        F=ratio,
        probability=float(fdtrc(lack_dof, pure_dof, ratio)),
        lack_dof=lack_dof,
        pure_dof=pure_dof,
        pure_error_sd=float(np.sqrt(pure / pure_dof)),
    )


def reversals(
    *,
    residuals: Array,
    load: Array,
    level: NDArray[np.int64] | None,
    up: NDArray[np.bool_] | None,
    run: Array | None,
) -> tuple[Reversal, ...]:
    """Return down minus up of the indicated load at each level that has both, by run.

    ``residuals`` = reference - indicated, so that unequal references of one level cancel. Levels without
    both directions in one run say nothing and are left out.
    """
    if level is None or up is None:
        return ()
    full = float(np.abs(load).max())
    runs = np.zeros(len(load)) if run is None else run
    visited, key = np.unique(np.column_stack([runs, level.astype(np.float64)]), axis=0, return_inverse=True)
    key = key.ravel()
    count = [np.bincount(key[side], minlength=len(visited)) for side in (up, ~up)]
    paired = np.flatnonzero((count[0] > 0) & (count[1] > 0))
    total = [np.bincount(key[s], weights=residuals[s], minlength=len(visited)) for s in (up, ~up)]
    at = np.bincount(key, weights=load) / np.bincount(key)
    # residual = reference - indicated: (indicated down) - (indicated up) = residual up - residual down.
    rows = []
    for i in paired.tolist():
        difference = float(total[0][i] / count[0][i] - total[1][i] / count[1][i])
        rows.append(
            Reversal(
                run=None if run is None else int(visited[i, 0]),
                load=float(at[i]),
                difference=difference,
                percent_fs=100 * difference / full,
            )
        )
    return tuple(sorted(rows, key=lambda row: (row.run or 0, row.load)))
