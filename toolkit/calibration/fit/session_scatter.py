"""The scatter of a session's rows about a load's equation, whatever the method of its fit.

Fit and refit come here, so that what a record stores is held against what its own rows tell.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.fit.row_noise import RowNoise, scatter_of_one
from toolkit.calibration.fit.run_scatter import estimate, is_lowest, stated_scatter, untold_scatter
from toolkit.calibration.fit.session_rows import SessionRows, are_untold, groups_of
from toolkit.calibration.records.scatter import MODEL, SHOWN, RunScatter

if TYPE_CHECKING:
    from toolkit.calibration.session.statements import BetweenRuns
    from toolkit.calibration.session.table import Table

# Of figures that fit and refit compute from coefficients of two algorithms.
_SAME = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FittedRows:
    """The rows of a load, and what its equation leaves of them.

    ``design`` (rows, terms), ``load`` and ``residuals`` (rows,); ``between`` is what the session states of
    runs, which counts where its rows cannot tell them.
    """

    design: Array
    load: Array
    table: Table
    zero: str
    noise: RowNoise | None
    residuals: Array
    residual_sd: float
    dof: int
    between: BetweenRuns | None

    def session_rows(self, *, every: bool = False) -> SessionRows:
        """Return the rows as their scatter is judged; ``every`` run counts, of however few rows."""
        profile = None if self.noise is None else self.noise.profile
        return SessionRows.of(self.design, self.load, self.table, self.zero, noise=profile, every=every)


def scatter_of_rows(rows: FittedRows) -> RunScatter | None:
    """Return the scatter that the coefficients' covariance is made of; None where they have their own."""
    factor, group = groups_of(rows.table, rows.zero)
    if group.any():
        return estimate(rows.session_rows())
    noise, residuals, dof = rows.noise, rows.residuals, rows.dof
    shown = rows.residual_sd if noise is None else noise.shown(residuals, dof)
    if rows.between is not None:
        return stated_scatter(factor, rows.between, residual_sd=shown, dof=dof)
    if are_untold(rows.table, rows.zero) and shown:
        fitted = rows.load - residuals
        relative = fitted / (float(np.abs(rows.load).max()) or 1.0)
        return untold_scatter(factor, relative, residuals, within=shown, dof=dof)
    return None if noise is None else scatter_of_one(noise, residuals, factor, dof)


def scatter_as_shown(scatter: RunScatter | None, rows: FittedRows) -> RunScatter | None:
    """Return the scatter of rows whose residuals show a profile; None where a model of its own holds them.

    ``scatter`` is that of rows alike (`scatter_of_rows`).
    """
    if scatter is not None:
        return replace(scatter, model=SHOWN) if scatter.model == MODEL else None
    return RunScatter(
        factor=groups_of(rows.table, rows.zero)[0], groups=1, within=rows.residual_sd, zero=0.0, gain=0.0,
        correlation=0.0, dof=rows.dof, model=SHOWN,
    )  # fmt: skip


def is_of_rows(scatter: RunScatter, rows: FittedRows) -> bool:
    """Tell whether a stored scatter is the one that the rows have (see `scatter_of_rows`)."""
    if scatter.groups > 1:  # of runs of few rows, too, in records made before these counted as one
        return is_lowest(rows.session_rows(every=True), scatter)
    expected = scatter_of_rows(rows)
    if scatter.model == SHOWN:
        expected = scatter_as_shown(expected, rows)
    if expected is None or expected.groups > 1:
        return False
    if (scatter.factor, scatter.dof, scatter.model) != (expected.factor, expected.dof, expected.model):
        return False
    sizes = np.array([[s.within, s.zero, s.gain, s.correlation] for s in (scatter, expected)])
    return bool((np.abs(sizes[0] - sizes[1]) <= _SAME * np.abs(sizes[1]).max()).all())
