"""Load levels: which rows were taken at the same reference loads, and what their scatter tells.

Indications never repeat exactly, so replicates are found on the side that does: the reference loads. Rows
belong to one level where *every* load agrees; values of one load are the same where no gap between
neighbours of the sorted values is over 0.02 % of full scale, and a chain of such values is no level where it
is wider than five times that (a continuous sweep has no replicates).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.fit.regression import TermFit

GAP = 2e-4
WIDEST = 5 * GAP


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


def load_levels(loads: NDArray[np.float64]) -> NDArray[np.int64] | None:
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


def lack_of_fit(fit: TermFit, level: NDArray[np.int64] | None) -> LackOfFit | None:
    """Return the lack-of-fit test against the pure error of replicated levels; None where not determined.

    F = [sum n_g mean_g^2 / (G - p)] / [sum (e - mean_g)^2 / (n - G)] over G levels of the residuals e,
    weighted where the fit is. Hysteresis between loading and unloading counts as pure error. Source: Draper
    and Smith, Applied Regression Analysis (1998), 2.1; ASTM E74 annex for calibrations.
    """
    if level is None:
        return None
    n, groups, p = len(fit.residuals), int(level.max()) + 1, len(fit.terms)
    pure_dof, lack_dof = n - groups, groups - p
    if pure_dof < 1 or lack_dof < 1:
        return None
    w = np.ones(n) if fit.weights is None else fit.weights
    mean = np.bincount(level, weights=w * fit.residuals) / np.bincount(level, weights=w)
    pure = float(np.sum(w * (fit.residuals - mean[level]) ** 2))
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
    residuals: NDArray[np.float64],
    load: NDArray[np.float64],
    level: NDArray[np.int64] | None,
    up: NDArray[np.bool_] | None,
    run: NDArray[np.float64] | None,
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
