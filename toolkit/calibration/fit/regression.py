"""Least squares as `metrology` demands it: statsmodels with QR on exactly centred, scaled columns, refined.

A pseudo-inverse on raw columns gives six correct digits on the NIST load-cell set (Pontius); QR on scaled
columns gives twelve. Refinement with the gradient A'(y - A x) in extended precision (corrected seminormal
equations: Bjorck, Numerical Methods for Least Squares Problems, 1996, section 6.6.5) takes out what
rounding of the solve is left, also where the residuals are large against the solution.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.calibration.fit.basis import Basis, build_basis

if TYPE_CHECKING:
    from numpy.typing import NDArray

_REFINEMENTS = 3
_SETTLED = 1e-15


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TermFit:
    """A solved load. Coefficients and covariance in the raw terms, in the order of ``terms``.

    ``residual_sd`` = sqrt(sum of squared residuals / dof) in the load's unit; ``residuals`` and
    ``leverage`` (rows,); ``weights`` the diagonal of the inverse covariance of the rows (1/u^2 for
    independent ones) or None; ``singular_values`` of the scaled term matrix. ``scaled`` (rows,) are the
    residuals that `diagnostics` judges: e for least squares, e/u for weighted, see `gls` and `odr` for the
    others. ``chi2`` is the weighted sum of squares at the minimum, None where no uncertainty is known.
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
    scaled: NDArray[np.float64]
    chi2: float | None = None

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
    u : standard uncertainties of the loads (rows,); the covariance then follows from them alone, and is
        not rescaled by the residuals

    Reference: NIST Statistical Reference Datasets, linear least squares.
    """
    return fit_loads(terms=terms, columns=columns, loads=(load,), u=u)[0]


def fit_loads(
    *,
    terms: Sequence[str],
    columns: Mapping[str, NDArray[np.float64]],
    loads: Sequence[NDArray[np.float64]],
    u: NDArray[np.float64] | None = None,
) -> tuple[TermFit, ...]:
    """Fit several loads on the same rows and weights: one decomposition serves them all (see `fit_terms`)."""
    basis = build_basis(terms, columns)
    weights = None if u is None else 1.0 / u**2
    factor = Factor.of(basis.design, None if u is None else 1.0 / u)
    fits = []
    for load in loads:
        solution, residuals = factor.solve(load)
        dof = len(load) - len(factor.inverse)
        sd = float(np.sqrt(residuals @ residuals / dof))
        scaled = residuals if u is None else residuals / u
        covariance = covariance_of(basis, factor.inverse, sd**2 if u is None else 1.0)
        fits.append(
            TermFit(
                terms=tuple(terms),
                coefficients=raw_coefficients(basis, solution),
                covariance=covariance,
                residual_sd=sd,
                dof=dof,
                residuals=residuals,
                leverage=factor.leverage,
                weights=weights,
                singular_values=factor.singular_values,
                scaled=scaled,
                chi2=None if u is None else float(scaled @ scaled),
            )
        )
    return tuple(fits)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Factor:
    """One QR decomposition of a design (rows, terms), weighted row by row where ``root`` = 1/u is given.

    ``inverse`` (terms, terms) is the inverse of the normal matrix, ``leverage`` (rows,), ``singular_values``
    those of the design without weights.
    """

    design: NDArray[np.float64]
    exact: NDArray[np.longdouble]
    root: NDArray[np.float64] | None
    r_inverse: NDArray[np.float64]
    inverse: NDArray[np.float64]
    leverage: NDArray[np.float64]
    singular_values: NDArray[np.float64]

    @classmethod
    def of(cls, design: NDArray[np.float64], root: NDArray[np.float64] | None) -> Factor:
        """Decompose; LinAlgError where the columns are dependent."""
        from scipy.linalg import qr, solve_triangular

        q, r = qr(design if root is None else design * root[:, None], mode="economic")
        if not np.abs(np.diag(r)).all():
            raise np.linalg.LinAlgError("the terms are exactly dependent")
        r_inverse = np.asarray(solve_triangular(r, np.eye(len(r))), dtype=np.float64)
        of_design = r if root is None else np.linalg.qr(design, mode="r")
        return cls(
            design=design,
            exact=design.T.astype(np.longdouble),
            root=root,
            r_inverse=r_inverse,
            inverse=r_inverse @ r_inverse.T,
            leverage=np.einsum("ij,ij->i", q, q),
            singular_values=np.asarray(np.linalg.svd(of_design, compute_uv=False), dtype=np.float64),
        )

    def solve(self, load: NDArray[np.float64]) -> tuple[NDArray[np.longdouble], NDArray[np.float64]]:
        """Return the solution (terms,) in extended precision, and the residuals (rows,)."""
        from statsmodels.regression.linear_model import OLS

        weighted = load if self.root is None else load * self.root
        weighted_design = self.design if self.root is None else self.design * self.root[:, None]
        first = np.asarray(OLS(weighted, weighted_design).fit(method="qr").params, dtype=np.float64)
        solution = first.astype(np.longdouble)
        squared = None if self.root is None else self.root.astype(np.longdouble) ** 2
        rest = load - solution.dot(self.exact)
        for _ in range(_REFINEMENTS):
            gradient = [column.dot(rest if squared is None else rest * squared) for column in self.exact]
            step = self.inverse @ np.asarray(gradient, dtype=np.float64)
            solution = solution + step
            # A step is small: its product in doubles is exact enough for the extended residuals.
            rest -= self.design @ step
            if not (np.abs(step) > _SETTLED * np.abs(first)).any():
                break
        return solution, np.asarray(rest, dtype=np.float64)


def raw_coefficients(basis: Basis, solution: NDArray[Any]) -> tuple[float, ...]:
    """Return the coefficients of the raw terms, carried back in rationals and rounded once."""
    values = [_fraction(value) for value in solution]
    return tuple(
        float(sum((a * b for a, b in zip(row, values, strict=True) if a), Fraction(0)))
        for row in basis.back_exact
    )


def covariance_of(basis: Basis, inverse: NDArray[np.float64], scale: float = 1.0) -> NDArray[np.float64]:
    """Return the covariance in the raw terms, symmetric to the last bit."""
    covariance = basis.back @ inverse @ basis.back.T * scale
    return np.asarray((covariance + covariance.T) / 2, dtype=np.float64)


def _fraction(value: np.longdouble) -> Fraction:
    # An extended double is the sum of two doubles, exactly.
    high = float(value)
    return Fraction(high) + Fraction(float(value - np.longdouble(high)))
