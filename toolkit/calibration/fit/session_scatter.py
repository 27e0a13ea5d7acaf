"""The scatter of a session's rows about a load's equation, whatever the method of its fit.

Fit and refit come here, so that what a record stores is held against what its own rows tell.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.fit.row_noise import scatter_of_one
from toolkit.calibration.fit.run_scatter import estimate, is_lowest, stated_scatter, untold_scatter
from toolkit.calibration.fit.session_rows import SessionRows, are_untold, groups_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.fit.row_noise import RowNoise
    from toolkit.calibration.records.scatter import RunScatter
    from toolkit.calibration.session.statements import BetweenRuns
    from toolkit.calibration.session.table import Table

# Of figures that fit and refit compute from coefficients of two algorithms.
_SAME = 1e-6


def scatter_of_rows(
    design: NDArray[np.float64],
    load: NDArray[np.float64],
    table: Table,
    *,
    zero: str,
    noise: RowNoise | None,
    residuals: NDArray[np.float64],
    residual_sd: float,
    dof: int,
    between: BetweenRuns | None,
) -> RunScatter | None:
    """Return the scatter that the coefficients' covariance is made of; None where they have their own.

    ``design`` (rows, terms), ``load`` and ``residuals`` (rows,); ``between`` is what the session states of
    runs, which counts where its rows cannot tell them.
    """
    factor, group = groups_of(table, zero)
    if group.any():
        profile = None if noise is None else noise.profile
        return estimate(SessionRows.of(design, load, table, zero, noise=profile))
    shown = residual_sd if noise is None else noise.shown(residuals, dof)
    if between is not None:
        return stated_scatter(factor, between, residual_sd=shown, dof=dof)
    if are_untold(table, zero) and shown:
        fitted = load - residuals
        relative = fitted / (float(np.abs(load).max()) or 1.0)
        return untold_scatter(factor, relative, residuals, within=shown, dof=dof)
    return None if noise is None else scatter_of_one(noise, residuals, factor, dof)


def is_of_rows(
    scatter: RunScatter,
    design: NDArray[np.float64],
    load: NDArray[np.float64],
    table: Table,
    *,
    zero: str,
    noise: RowNoise | None,
    residuals: NDArray[np.float64],
    residual_sd: float,
    dof: int,
    between: BetweenRuns | None,
) -> bool:
    """Tell whether a stored scatter is the one that the rows have (see `scatter_of_rows`)."""
    if scatter.groups > 1:  # of runs of few rows, too, in records made before these counted as one
        profile = None if noise is None else noise.profile
        return is_lowest(SessionRows.of(design, load, table, zero, noise=profile, every=True), scatter)
    expected = scatter_of_rows(
        design, load, table, zero=zero, noise=noise, residuals=residuals, residual_sd=residual_sd, dof=dof,
        between=between,
    )  # fmt: skip
    if expected is None or expected.groups > 1:
        return False
    if (scatter.factor, scatter.dof, scatter.model) != (expected.factor, expected.dof, expected.model):
        return False
    sizes = np.array([[s.within, s.zero, s.gain, s.correlation] for s in (scatter, expected)])
    return bool((np.abs(sizes[0] - sizes[1]) <= _SAME * np.abs(sizes[1]).max()).all())
