"""The report of a fit as a value: everything that `metrology` lists, one `FitReport` a load.

Formulas: Cook and Weisberg, Residuals and Influence in Regression (1982), for influence; Allen, Technometrics
16 (1974), for PRESS; Breusch and Pagan, Econometrica 47 (1979); Shapiro and Wilk, Biometrika 52 (1965).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.fit.diagnostics import (
    LackOfFit,
    Reversal,
    lack_of_fit,
    load_levels,
    loadings,
    reversals,
)
from toolkit.calibration.fit.robust import robust_weights
from toolkit.calibration.terms import term_matrix

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from toolkit.calibration.fit.adequacy import Adequacy
    from toolkit.calibration.fit.diagnostics import Diagnostics
    from toolkit.calibration.fit.regression import TermFit
    from toolkit.calibration.fit.session_fit import LoadResult, SessionFit

COVERAGE = 0.95
_SHAPIRO_ROWS = 5000


@dataclass(frozen=True, slots=True, kw_only=True)
class Coefficient:
    """One term. ``value``, ``standard_error`` and ``extent`` in the session's own units.

    ``t`` = value / standard error. ``sign_confidence`` is the probability that the true coefficient has the
    sign of ``value``: Student's distribution function at |t| with the fit's degrees of freedom (normal where
    the covariance follows from stated uncertainties), for a flat prior; 0.5 tells nothing of the sign.
    ``percent_fs`` is 100 |value| max|term| / max|load|: what the term is worth.
    """

    term: str
    value: float
    standard_error: float
    t: float
    sign_confidence: float
    percent_fs: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FitReport:
    """One load's fit, told completely. Rows are those of the data file, in its order.

    Parameters
    ----------
    load, unit, full_scale : name; unit; largest absolute reference load
    fit, tests, adequacy : the regression, what it says row by row, and what the session's rows determine
    coefficients, correlation : by term, in the order of ``coefficients``; (terms, terms)
    n, r_squared : rows; share of the load's variation explained
    vif : variance inflation by indication
    reference : [unit] (rows,)
    robust_weight : biweight (rows,), None where not judged; a small one points at the row
    direction : up, down by row, None where the file has no such column
    predicted_r_squared : 1 - sum of squared leave-one-out residuals / variation of the load
    normality : (statistic W, probability) of Shapiro and Wilk on the internal residuals, None under eight
        or over 5000 rows
    lack_of_fit : see `levels`; None without replicated levels
    levels, replicated_rows : load levels with two rows or more; rows in them
    prediction_half_width : 95 % prediction interval's half width at the row of the largest load [unit]
    check_reference, check_percent_fs : check loads [unit], 100 (fitted - reference) / full scale (checks,)
    tolerance_percent_fs : that of the check loads
    reversals, reversibility_percent_fs : loading against unloading by level; the largest in size
    noise_free : the scatter is rounding, and no test says anything
    """

    load: str
    unit: str
    full_scale: float
    fit: TermFit
    tests: Diagnostics
    adequacy: Adequacy
    coefficients: tuple[Coefficient, ...]
    correlation: Array
    n: int
    r_squared: float
    vif: tuple[tuple[str, float], ...]
    reference: Array
    robust_weight: Array | None
    direction: tuple[str, ...] | None
    predicted_r_squared: float
    normality: tuple[float, float] | None
    lack_of_fit: LackOfFit | None
    levels: int
    replicated_rows: int
    prediction_half_width: float
    check_reference: Array | None
    check_percent_fs: Array | None
    tolerance_percent_fs: float
    reversals: tuple[Reversal, ...]
    reversibility_percent_fs: float | None
    noise_free: bool


def report_session(fit: SessionFit, covariances: Mapping[str, Array] | None = None) -> tuple[FitReport, ...]:
    """Return the report of every load of a fitted session.

    ``covariances`` of the coefficients by load hold, beside the fit's own, what the session states
    (`uncertainty.common_errors`); None: the fit's own.
    """
    loads = [
        load if covariances is None else replace(
            load, fit=replace(load.fit, covariance=covariances[load.setting.name])
        )
        for load in fit.loads
    ]  # fmt: skip
    table = fit.session.table
    level = load_levels(table.matrix([load.name for load in fit.session.loads]))
    loading = loadings(level, table.run, table.up)
    return tuple(_report(fit, load, level, loading) for load in loads)


def prediction_half_width(fit: TermFit, columns: Mapping[str, Array], *, coverage: float = COVERAGE) -> Array:
    """Return the half width of the prediction interval at indications (points,), in the load's unit.

    t(coverage, dof) sqrt(s^2 + x' V x) with V the coefficients' covariance: where one further reading at
    these indications will lie. s is the residual standard deviation; in a weighted fit the root mean square
    of the stated uncertainties, with the normal quantile.
    """
    from scipy.special import ndtri, stdtrit

    x = term_matrix(fit.terms, columns)
    share = (1 + coverage) / 2
    if fit.weights is None:
        scatter, factor = fit.residual_sd**2, float(stdtrit(fit.dof, share))
    else:
        scatter, factor = float(np.mean(1 / fit.weights)), float(ndtri(share))
    variance = np.einsum("ij,jk,ik->i", x, fit.covariance, x)
    half: Array = factor * np.sqrt(scatter + np.maximum(variance, 0.0))
    return half


def coefficient_rows(fit: TermFit, extent: Array, full_scale: float) -> tuple[Coefficient, ...]:
    """Return the coefficients with what is known of each; ``extent`` is max|term| (terms,)."""
    from scipy.special import ndtr, stdtr

    value, error = np.asarray(fit.coefficients), fit.standard_errors
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(error > 0, value / error, np.where(value == 0, 0.0, np.copysign(np.inf, value)))
    sure = ndtr(np.abs(t)) if fit.weights is not None else stdtr(fit.dof, np.abs(t))
    worth = 100 * np.abs(value) * extent / full_scale
    rows = zip(fit.terms, value, error, t, sure, worth, strict=True)
    return tuple(
        Coefficient(
            term=name, value=float(c), standard_error=float(u), t=float(ratio),
            sign_confidence=float(p), percent_fs=float(w),
        )
        for name, c, u, ratio, p, w in rows
    )  # fmt: skip


def _report(
    fit: SessionFit,
    load_result: LoadResult,
    level: NDArray[np.int64] | None,
    loading: NDArray[np.int64] | None,
) -> FitReport:
    session, table, solved, tests = fit.session, fit.session.table, load_result.fit, load_result.diagnostics
    load = table.column(load_result.setting.name)
    columns = table.columns(session.indications)
    full = float(np.abs(load).max())
    extent = np.abs(term_matrix(solved.terms, columns)).max(axis=0)
    noise_free = load_result.exact
    total, within, left_out = _sums(solved, load, weighted=session.method == "wls")
    error = solved.standard_errors
    size = np.where(error > 0, error, 1.0)
    reversal = reversals(residuals=solved.residuals, load=load, level=level, up=table.up, run=table.run)
    sizes = np.array([]) if level is None else np.bincount(level)
    at = int(np.argmax(np.abs(load)))
    check = session.check
    return FitReport(
        load=load_result.setting.name,
        unit=load_result.setting.unit,
        full_scale=full,
        fit=solved,
        tests=tests,
        adequacy=fit.adequacy,
        coefficients=coefficient_rows(solved, extent, full),
        correlation=solved.covariance / np.outer(size, size),
        n=len(load),
        r_squared=1 - within / total,
        vif=tuple(zip(session.indications, fit.adequacy.vif, strict=True)),
        reference=load,
        robust_weight=None if noise_free else robust_weights(solved, columns=columns, load=load),
        direction=table.direction,
        predicted_r_squared=1 - left_out / total,
        normality=None if noise_free else _normality(tests.internal),
        lack_of_fit=None if noise_free else lack_of_fit(solved, level, loading),
        levels=int(np.count_nonzero(sizes > 1)),
        replicated_rows=int(sizes[sizes > 1].sum()),
        prediction_half_width=float(
            prediction_half_width(solved, {name: column[[at]] for name, column in columns.items()})[0]
        ),
        check_reference=None if check is None else check.column(load_result.setting.name),
        check_percent_fs=None
        if load_result.check_residuals is None
        else 100 * load_result.check_residuals / full,
        tolerance_percent_fs=100 * load_result.setting.tolerance / full,
        reversals=reversal,
        reversibility_percent_fs=max((r.percent_fs for r in reversal), key=abs, default=None),
        noise_free=noise_free,
    )


def _sums(fit: TermFit, load: Array, *, weighted: bool) -> tuple[float, float, float]:
    """Return the squares of the load about its mean, of the residuals, and of those left out."""
    w = fit.weights if weighted and fit.weights is not None else np.ones(len(load))
    # Without a constant the origin is the model's own zero.
    middle = float(np.average(load, weights=w)) if fit.terms[-1] == "intercept" else 0.0
    left_out = fit.residuals / (1 - np.minimum(fit.leverage, 1 - 1e-12))
    return (
        float(np.sum(w * (load - middle) ** 2)),
        float(np.sum(w * fit.residuals**2)),
        float(np.sum(w * left_out**2)),
    )


def _normality(internal: Array) -> tuple[float, float] | None:
    if not 8 <= len(internal) <= _SHAPIRO_ROWS:
        return None
    from scipy.stats import shapiro

    result = shapiro(internal)
    return float(result.statistic), float(result.pvalue)
