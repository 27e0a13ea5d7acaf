"""Generalised least squares: reference loads that share errors, with a known covariance.

The model of the covariance is that of `session.known_errors`. Each group's V = D (I + a a') D, with
D = diag(u) and a = v/u, is whitened by the inverse of its symmetric square root, which is a rank-one change,
(I + a a')^(-1/2) = I - (1 - 1/sqrt(1 + a'a)) a a' / (a'a): any number of rows, no matrix of rows by rows.
The whitened problem is solved as any other (`regression`); the covariance of the coefficients follows from V
alone and is not rescaled, chi2 = r' V^-1 r is told.

Reference: Aitken, Proc. Royal Society of Edinburgh 55 (1936); GUM F.1.2.3; Cook and Weisberg, Residuals and
Influence in Regression (1982), for deletion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.fit.basis import build_basis
from toolkit.calibration.fit.regression import Factor, TermFit, covariance_of, fit_terms, raw_coefficients

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.calibration.session.known_errors import KnownErrors


def fit_gls(
    *,
    terms: Sequence[str],
    columns: Mapping[str, NDArray[np.float64]],
    load: NDArray[np.float64],
    errors: KnownErrors,
) -> TermFit:
    """Fit load = sum of c_i term_i where rows of one group share an error.

    ``weights`` of the result is the diagonal of V^-1. ``scaled`` is V^-1 r over its root and ``leverage`` 1
    minus the share that P = V^-1 - V^-1 X (X' V^-1 X)^-1 X' V^-1 has of that diagonal, so that a row's
    deletion residual is scaled / sqrt(weights) / (1 - leverage), as for independent rows.

    Raises
    ------
    ValueError
        no uncertainty of single rows is stated, and the residuals tell none
    """
    ordinary = fit_terms(terms=terms, columns=columns, load=load)
    largest = float(np.abs(load).max())
    u = errors.u
    if u is None:
        if ordinary.residual_sd <= 1e-12 * largest:
            raise ValueError("the residuals tell no uncertainty of single rows")
        u = np.full(len(load), ordinary.residual_sd)
    v = np.full(len(load), errors.u_shared)
    if errors.proportional:
        v *= (load - ordinary.residuals) / largest
    a, group = v / u, errors.group
    total = np.bincount(group, weights=a * a)[group]
    basis = build_basis(terms, columns)
    # The limit of the factor for a'a -> 0 is 1/2; written so that nothing cancels.
    root = np.sqrt(1 + total)
    shrink = 1 / (root * (1 + root))

    def shared(x: NDArray[np.float64], by: NDArray[np.float64]) -> NDArray[np.float64]:
        # (I - by a a') x within each group
        return np.asarray(x - by * a * np.bincount(group, weights=a * x)[group], dtype=np.float64)

    design = np.column_stack([shared(column / u, shrink) for column in basis.design.T])
    factor = Factor.of(np.asfortranarray(design), None)
    (solution,), (white,) = factor.solve(shared(load / u, shrink)[None, :])
    residuals = np.asarray(load - solution.dot(basis.design.T.astype(np.longdouble)), dtype=np.float64)
    diagonal = (1 - a * a / (1 + total)) / u**2
    pull = shared(residuals / u, 1 / (1 + total)) / u
    rows = np.column_stack([shared(column / u, 1 / (1 + total)) / u for column in basis.design.T])
    dof = len(load) - len(terms)
    return TermFit(
        terms=tuple(terms),
        coefficients=raw_coefficients(basis, solution),
        covariance=covariance_of(basis, factor.inverse),
        residual_sd=float(np.sqrt(residuals @ residuals / dof)),
        dof=dof,
        residuals=residuals,
        leverage=np.einsum("ij,jk,ik->i", rows, factor.inverse, rows) / diagonal,
        weights=diagonal,
        singular_values=np.asarray(np.linalg.svd(basis.design, compute_uv=False), dtype=np.float64),
        scaled=pull / np.sqrt(diagonal),
        chi2=float(white @ white),
    )
