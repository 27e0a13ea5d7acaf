"""What a session's rows tell of one load: scatter within and between runs, misfit of the curve, reversal.

The scatter is that of the record (`records.scatter`); of records made before it was kept there, it is
estimated from their rows here. Misfit and reversal are the parts
of the mean beside the equation's terms (`fit.session_rows`): what the columns explain, less what the scatter
alone would give them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.fit.profile import Profile
from toolkit.calibration.fit.rounding import rounding_of
from toolkit.calibration.fit.row_noise import RowNoise, noise_of, shown_rows, weighed_rows
from toolkit.calibration.fit.run_scatter import estimate, spread
from toolkit.calibration.fit.session_rows import SessionRows, groups_of
from toolkit.calibration.records.record import CalibrationRecord, LoadFit
from toolkit.calibration.records.scatter import SHOWN, UNTOLD, UNTOLD_DOF, Rows, RunScatter, quadratic
from toolkit.calibration.session.statements import statements_of
from toolkit.calibration.session.table import Table
from toolkit.calibration.terms import term_matrix


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scatter:
    """Standard deviations in the load's unit, each with its degrees of freedom (0: not determined).

    ``runs`` are the components within and between runs, with one group where one run tells nothing of the
    next; ``profile`` is the variance of a reading by that of ``runs.within`` at any point, where rows weigh
    unlike or their residuals show that they scatter unlike, else None; ``spread`` (4, 4) the covariance of
    their estimates; ``rows`` how they reach the coefficients.
    ``reversal`` is half the root mean square difference of the directions, ``misfit`` the root mean square
    distance from the curve of what a smooth one through the rows would be.
    """

    runs: RunScatter
    spread: Array
    rows: Rows
    profile: Profile | None
    reversal: float
    reversal_dof: int
    misfit: float
    misfit_dof: int

    def reading(self, columns: Mapping[str, Array]) -> Array:
        """Return the variance of a reading at indications (points,), in units of ``runs.within``^2."""
        if self.profile is None:
            return np.ones(len(next(iter(columns.values()))))
        return self.profile.at(columns)

    def dof(self, gradient: Array, variance: Array) -> Array:
        """Return Satterthwaite's degrees of freedom of variances (points,), 2 u^4 / Var(u^2), one at least.

        ``gradient`` (points, 4) is d u^2 by within^2, zero^2, gain^2 and the correlation. Two runs differ
        in one number; less than that the formula gives where it takes a variance for about none.
        """
        uncertain = quadratic(gradient, self.spread)
        dof = np.divide(
            2 * variance**2, uncertain, out=np.full(uncertain.shape, np.inf), where=~(uncertain <= 0)
        )
        return np.asarray(np.maximum(dof, 1.0))


def scatter_of(record: CalibrationRecord, loads: Table, fitted: LoadFit) -> Scatter:
    """Return the scatter of a record's load from its reference loads."""
    design = term_matrix(fitted.terms, loads.columns(record.indications))
    load = loads.column(fitted.load)
    every = fitted.scatter is not None and fitted.scatter.groups > 1
    noise = noise_of(
        fitted.method, statements_of(record), loads, fitted.load, terms=fitted.terms,
        coefficients=fitted.coefficients, indications=record.indications, where=record.id,
    )  # fmt: skip
    rows = SessionRows.of(
        design, load, loads, record.zero, noise=None if noise is None else noise.profile, every=every
    )
    runs = fitted.scatter or estimate(rows) or _one_run(rows)
    if runs.model == SHOWN and runs.groups < 2 and not (runs.zero or runs.gain):
        runs = replace(_one_run(rows), model=SHOWN)  # what a smooth curve leaves, as of rows alike
    if runs.groups > 1:
        covariance = spread(rows, runs)
    else:
        between = UNTOLD_DOF if runs.model == UNTOLD else math.inf
        covariance = np.diag([*(2 * runs.variances**2 / [runs.dof, between, between]), 0.0])
    misfit = _explained(rows, runs, rows.mean.misfit)
    reversal = _explained(rows, runs, rows.mean.direction)
    weighed = weighed_rows(
        design,
        load,
        groups_of(loads, record.zero, every=every)[1],
        noise,
        rounding=rounding_of(record, fitted, loads),
    )
    residuals = load - design @ np.asarray(fitted.coefficients)
    unlike, profile = (
        shown_rows(
            weighed, design, loads.columns(record.indications), residuals - weighed.of_runs(runs, residuals)
        )
        if noise is None
        else (weighed, _profile(record, loads, noise))
    )
    return Scatter(
        runs=runs,
        spread=covariance,
        # Coefficients have the covariance that the record names; a reading to come has what the rows show.
        rows=unlike if runs.model == SHOWN else weighed,
        profile=profile,
        misfit=misfit[0],
        misfit_dof=misfit[1],
        reversal=reversal[0],
        reversal_dof=reversal[1],
    )


def _profile(record: CalibrationRecord, loads: Table, noise: RowNoise) -> Profile:
    squares = noise.profile**2
    return Profile.of(loads.columns(record.indications), squares, float(squares.min()))


def _one_run(rows: SessionRows) -> RunScatter:
    """Return what rows tell whose runs cannot be told apart: scatter about the mean alone."""
    columns = rows.mean.columns
    residual = rows.load - columns @ (columns.T @ rows.load)
    n, p = columns.shape
    if n - p < 1:  # the smooth curve took up every row: the residuals of the equation's own terms are left
        columns = columns[:, : rows.mean.misfit.start]
        residual, p = rows.load - columns @ (columns.T @ rows.load), columns.shape[1]
    within = float(np.sqrt(residual @ residual / (n - p)))
    return RunScatter(
        factor=rows.factor, groups=1, within=within, zero=0.0, gain=0.0, correlation=0.0, dof=n - p
    )


def _explained(rows: SessionRows, runs: RunScatter, part: slice) -> tuple[float, int]:
    """Return the root mean square that columns of the mean explain beyond the scatter, and their number."""
    columns = rows.mean.columns[:, part]
    count = columns.shape[1]
    if not count:
        return 0.0, 0
    squares = float(np.sum((columns.T @ rows.load) ** 2))
    alone = Rows(operator=columns.T, relative=rows.relative, group=rows.group, noise=rows.noise)
    noise = np.einsum("k,kii->", runs.variances, alone.parts(runs.correlation))
    return float(np.sqrt(max(squares - noise, 0.0) / len(rows.load))), count
