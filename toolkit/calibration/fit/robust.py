"""A robust fit that only points: rows that a resistant regression gives little weight.

Two outliers can hide each other: each inflates the scatter by which the other is judged, and no studentised
residual stands out. Huber's estimate from there Tukey's biweight, with a scale from the median, is not moved
by them. The calibration itself is never fitted so.

References: Huber and Ronchetti, Robust Statistics (2009), ch. 7; Beaton and Tukey, Technometrics 16 (1974);
Hadi and Simonoff, Journal of the American Statistical Association 88 (1993), for the test of a set of rows.
"""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.calibration.fit.basis import build_basis

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from toolkit.calibration.fit.regression import TermFit

SMALL_WEIGHT = 0.05
RISK = 0.002
_TUNING = 4.685  # 95 % efficiency on normal data
_STEPS = 50


def robust_weights(
    fit: TermFit, *, columns: Mapping[str, NDArray[np.float64]], load: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Return the biweight of each row (rows,), 1 in the middle and 0 for a row that is cast out.

    None where the scatter is rounding, or too few rows are left to judge by (fewer than 3 a term). The
    residuals are scaled by 1.4826 median |r| sqrt(n / dof), since p fitted terms shrink them, and by
    sqrt(1 - leverage). A row of high leverage can still draw the fit to itself: Cook's distance tells that.
    """
    n, p = len(load), len(fit.terms)
    if n < 3 * p:
        return None
    from statsmodels.robust.norms import HuberT, TukeyBiweight
    from statsmodels.robust.robust_linear_model import RLM

    w = np.ones(n) if fit.weights is None else np.sqrt(fit.weights)
    design, y = build_basis(fit.terms, columns).design * w[:, None], load * w
    floor = 1e-12 * float(np.abs(y).max())
    if float(np.sqrt(np.mean((fit.residuals * w) ** 2))) <= floor:
        return None
    biweight = TukeyBiweight(c=_TUNING)
    start: Any = None
    with warnings.catch_warnings():
        # A scale of zero (over half of the rows fitted exactly) is judged below.
        warnings.simplefilter("ignore")
        for norm in (HuberT(), biweight):
            solved = RLM(y, design, M=norm).fit(maxiter=_STEPS, start_params=start, cov="H2")
            start = np.asarray(solved.params)
    if not np.isfinite(start).all():
        return None
    residuals = y - design @ start
    scale = 1.4826 * float(np.median(np.abs(residuals))) * np.sqrt(n / fit.dof)
    if scale <= floor:
        return None
    standard = residuals / (scale * np.sqrt(1 - np.minimum(fit.leverage, 1 - 1e-9)))
    return np.asarray(biweight.weights(standard), dtype=np.float64)


def hidden_outliers(
    fit: TermFit,
    weights: NDArray[np.float64] | None,
    *,
    columns: Mapping[str, NDArray[np.float64]],
) -> tuple[int, ...]:
    """Return the rows (from 1) of small robust weight that the fit without all of them contradicts.

    The median's scale is rough in short sessions, and casts out sound rows. So each row under SMALL_WEIGHT is
    held against the least-squares fit of the others, the whole set left out at once: its deviation over its
    own standard deviation exceeds Student's quantile at RISK over all rows (Bonferroni).
    """
    if weights is None:
        return ()
    out = np.flatnonzero(weights < SMALL_WEIGHT)
    dof = fit.dof - len(out)
    if not len(out) or dof < 2:
        return ()
    from scipy.special import stdtrit

    w = np.ones(len(weights)) if fit.weights is None else np.sqrt(fit.weights)
    q, _ = np.linalg.qr(build_basis(fit.terms, columns).design * w[:, None])
    e = fit.residuals * w
    # Rows left out together: e_out = (1 - H)^-1 e, and so much less is left of the sum of squares.
    spread = np.linalg.pinv(np.eye(len(out)) - q[out] @ q[out].T)
    deviation = spread @ e[out]
    rest = float(e @ e - e[out] @ deviation)
    if rest <= 0:
        return ()
    ratio = np.abs(deviation) / np.sqrt(rest / dof * np.diag(spread))
    limit = float(stdtrit(dof, 1 - RISK / (2 * len(weights))))
    return tuple(int(row) + 1 for row in out[ratio > limit])
