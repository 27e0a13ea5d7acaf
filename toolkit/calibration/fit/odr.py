"""Errors in both variables: orthogonal distance regression by odrpack, refined.

Minimised: sum over rows of (load - f(x + delta))^2 / u_load^2 + sum of delta_j^2 / u_j^2. odrpack stops
where the sum of squares does not move any more; a few Gauss-Newton steps then settle the last digits of the
coefficients. Indications are taken from a zero near their mean, as the other fits take them: beside an
indication of 50 with a span of 1 an adjustment of its last digits would be rounded away. The covariance
follows from the stated uncertainties alone, as for `regression` with weights and in ISO/TS 28037 clause 7: at
the solution it is odrpack's ``cov_beta``, which is unscaled, to more digits. ``sd_beta``, rescaled by the
residuals, is not used.

Reference: Boggs, Byrd, Schnabel, SIAM J. Sci. Stat. Comput. 8 (1987) 1052; ODRPACK95, ACM TOMS algorithm 869.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.fit.basis import build_basis, free_zero
from toolkit.calibration.fit.regression import Factor, TermFit, covariance_of, fit_terms, raw_coefficients
from toolkit.calibration.terms import term_slopes

_STEPS = 100
_SETTLED = 4e-15
_ITERATIONS = 500


def fit_odr(
    *, terms: Sequence[str], columns: Mapping[str, Array], load: Array, u: Array, u_cells: Array
) -> TermFit:
    """Fit load = sum of c_i term_i with standard uncertainties of the loads (rows,) and indications.

    ``weights`` of the result are 1 / (u^2 + sum of (slope_j u_j)^2), the effective ones at the solution;
    ``scaled`` the residuals in them, ``leverage`` that of the weighted fit; ``residuals`` are load minus
    equation at the indications as observed.

    Raises
    ------
    ValueError
        no solution was found
    """
    from odrpack import odr_fit

    zero, columns = free_zero(terms, columns)
    basis = build_basis(terms, columns)
    names = list(columns)
    x = np.array([columns[name] for name in names])
    start = fit_terms(terms=terms, columns=columns, load=load, u=u)
    beta = np.linalg.solve(basis.back, np.asarray(start.coefficients))

    def slopes(at: Array, beta: Array) -> Array:
        gradients = term_slopes(terms, basis.back @ beta, dict(zip(names, at, strict=True)))
        return np.array([np.broadcast_to(gradients[name], load.shape) for name in names])

    def design(at: Array) -> Array:
        return basis.at(dict(zip(names, at, strict=True)))

    single = len(names) == 1
    eps = float(np.finfo(float).eps)
    optimum = odr_fit(
        lambda at, b: design(np.atleast_2d(at)) @ b,
        x[0] if single else x,
        load,
        beta,
        weight_x=float(u_cells[0] ** -2) if single else u_cells**-2.0,
        weight_y=u**-2.0,
        jac_beta=lambda at, _b: design(np.atleast_2d(at)).T,
        jac_x=lambda at, b: slopes(np.atleast_2d(at), b)[0] if single else slopes(np.atleast_2d(at), b),
        sstol=eps,
        partol=eps,
        maxit=_ITERATIONS,
    )
    beta, delta = np.asarray(optimum.beta), np.atleast_2d(optimum.delta)
    # The last digit of its code tells why it stopped; the others doubt derivatives, which the steps below
    # prove: they end only where the objective is stationary.
    if optimum.info % 10 not in (1, 2, 3) or not np.isfinite(beta).all():
        raise ValueError(f"odrpack found no solution: {optimum.stopreason}")
    best, still = np.inf, 0
    for _ in range(_STEPS):
        slope = slopes(x + delta, beta)
        spread = np.sqrt(u**2 + (slope**2 * u_cells[:, None] ** 2).sum(axis=0))
        at = design(x + delta)
        # At fixed slopes the problem is linear: its load is carried back to the observed indications.
        carried = load + (slope * delta).sum(axis=0)
        factor = Factor.of(at, 1 / spread)
        (solution,), (residual,) = factor.solve(carried[None, :])
        moved = np.abs(at @ (np.asarray(solution, dtype=np.float64) - beta)).max()
        beta = np.asarray(solution, dtype=np.float64)
        adjusted = slope * u_cells[:, None] ** 2 * residual / spread**2
        moved = max(moved, np.abs((slope * (adjusted - delta)).sum(axis=0)).max())
        delta = adjusted
        # Steps stop shrinking where they round at the size of what the indications make of the load.
        still = 0 if moved < best else still + 1
        best = min(best, moved)
        rounds = _SETTLED * np.abs(slope * (x + delta)).sum(axis=0).max()
        if moved <= _SETTLED * np.abs(load).max() or (still > 20 and moved <= 10 * rounds):
            break
    else:
        raise ValueError("the solution does not settle")
    fitted = design(x).astype(np.longdouble) @ solution
    residuals = np.asarray(load - fitted, dtype=np.float64)
    dof = len(load) - len(terms)
    scaled = residual / spread
    raw = basis.moved_back(zero)
    return TermFit(
        terms=tuple(terms),
        coefficients=raw_coefficients(raw, solution),
        covariance=covariance_of(raw, factor.inverse),
        residual_sd=float(np.sqrt(residuals @ residuals / dof)),
        dof=dof,
        residuals=residuals,
        leverage=factor.leverage,
        weights=spread**-2.0,
        scaled=scaled,
        chi2=float(scaled @ scaled),
    )
