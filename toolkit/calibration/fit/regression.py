"""Least squares as `metrology` demands it: statsmodels with QR on centred, scaled columns.

statsmodels' default pseudo-inverse gives six correct digits on the NIST load-cell set (Pontius); QR on
scaled columns gives twelve. One step of iterative refinement, with residuals in extended precision, takes
out what rounding of the solve is left.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.fit.basis import build_basis

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TermFit:
    """A solved load. Coefficients and covariance in the raw terms, in the order of ``terms``.

    ``residual_sd`` = sqrt(sum of squared residuals / dof) in the load's unit; ``residuals`` and
    ``leverage`` (rows,); ``weights`` 1/u^2 or None; ``singular_values`` of the scaled term matrix.
    """

    terms: tuple[str, ...]
    coefficients: tuple[float, ...]
    covariance: NDArray[np.float64]
    residual_sd: float
    dof: int
    residuals: NDArray[np.float64]
    leverage: NDArray[np.float64]
    weights: NDArray[np.float64] | None
    singular_values: NDArray[np.float64]

    @property
    def standard_errors(self) -> NDArray[np.float64]:
        """Standard errors of the coefficients (terms,)."""
        return np.sqrt(np.diag(self.covariance))


def fit_terms(
    *,
    terms: Sequence[str],
    columns: Mapping[str, NDArray[np.float64]],
    load: NDArray[np.float64],
    u: NDArray[np.float64] | None = None,
) -> TermFit:
    """Fit load = sum of c_i term_i by ordinary least squares, or weighted by known uncertainties.

    Parameters
    ----------
    terms : names as in `terms`, the intercept last where there is one
    columns : indications by name (rows,)
    load : reference load (rows,)
    u : standard uncertainties of the loads (rows,); the covariance then follows from them alone
        (``cov_type="fixed scale"``), and is not rescaled by the residuals

    Reference: NIST Statistical Reference Datasets, linear least squares.
    """
    from statsmodels.regression.linear_model import OLS, WLS

    basis = build_basis(terms, columns)
    design = basis.design
    n, p = design.shape
    weights = None if u is None else 1.0 / u**2
    model = OLS(load, design) if weights is None else WLS(load, design, weights=weights)
    kind = {} if weights is None else {"cov_type": "fixed scale"}
    first = model.fit(method="qr", **kind)
    solution = np.asarray(first.params, dtype=np.longdouble)
    exact = design.astype(np.longdouble)
    rest = np.asarray(load - exact @ solution, dtype=np.float64)
    w = np.ones(n) if weights is None else np.sqrt(weights)
    inverse = np.asarray(model.pinv_wexog)
    solution = solution + inverse @ (rest * w)
    residuals = np.asarray(load - exact @ solution, dtype=np.float64)
    dof = n - p
    sd = float(np.sqrt(residuals @ residuals / dof))
    # statsmodels inverts R'R, which squares the condition number; the pseudo-inverse does not.
    normalized = inverse @ inverse.T
    scale = sd**2 if weights is None else 1.0
    raw = [
        float(sum((a * _fraction(b) for a, b in zip(row, solution, strict=True)), Fraction(0)))
        for row in basis.back_exact
    ]
    covariance = basis.back @ normalized @ basis.back.T * scale
    return TermFit(
        terms=tuple(terms),
        coefficients=tuple(raw),
        covariance=(covariance + covariance.T) / 2,
        residual_sd=sd,
        dof=dof,
        residuals=residuals,
        leverage=np.einsum("ij,ji->i", np.asarray(model.wexog), inverse),
        weights=weights,
        singular_values=np.asarray(np.linalg.svd(design, compute_uv=False), dtype=np.float64),
    )


def _fraction(value: np.longdouble) -> Fraction:
    # An extended double is the sum of two doubles, exactly.
    high = float(value)
    return Fraction(high) + Fraction(float(value - np.longdouble(high)))
