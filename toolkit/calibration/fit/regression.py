"""Least squares as `metrology` demands it: statsmodels with QR on exactly centred, scaled columns, refined.

A pseudo-inverse on raw columns gives six correct digits on the NIST load-cell set (Pontius); QR on scaled
columns gives twelve. Refinement with a gradient A'(y - A x) that does not round (`exact_products`; corrected
seminormal equations: Bjorck, Numerical Methods for Least Squares Problems, 1996, section 6.6.5) takes out
what rounding of the solve is left, also where the residuals are large against the solution.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.calibration.fit.basis import Basis, build_basis, inner

# Products of tall matrices without their rounding: matrices cut into parts whose products are exact.


_MANTISSA = 53


def exact_bits(rows: int) -> int:
    """Return how many bits two factors may each keep so that a sum of ``rows`` products is exact.

    >>> exact_bits(1024)
    21
    """
    return (_MANTISSA - max(rows - 1, 1).bit_length()) // 2


def leading(values: Array, bits: int) -> Array:
    """Return the leading bits of each line of (lines, rows), on a grid of 2^-bits of its largest value.

    What is left, ``values`` minus the result, is exact.
    """
    _, exponent = np.frexp(_largest(values))
    # Added to a number of this size, a value is rounded to the grid; taken away again, it stands there.
    size = np.ldexp(1.5, exponent + (_MANTISSA - 1 - bits))[:, None]
    moved: Array = values + size
    moved -= size
    return moved


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Residuals:
    """``high`` + ``low`` (loads, rows), the first cut to the bits that exact products allow."""

    high: Array
    low: Array

    @classmethod
    def of(cls, values: Array, bits: int) -> Residuals:
        """Cut residuals (loads, rows)."""
        high = leading(values, bits)
        return cls(high=high, low=values - high)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CutDesign:
    """A design in two parts (terms, rows), ``high`` + ``low``, exactly."""

    high: Array
    low: Array
    bits: int

    @classmethod
    def of(cls, design: Array) -> CutDesign:
        """Cut a design (terms, rows)."""
        bits = exact_bits(design.shape[1])
        high = leading(design, bits)
        return cls(high=high, low=design - high, bits=bits)

    def residuals(self, loads: Array, solution: NDArray[np.longdouble]) -> Residuals:
        """Return loads (loads, rows) minus solution (loads, terms) times design, to 70 bits or so."""
        x = np.asarray(solution, dtype=np.float64)
        _, of_terms = np.frexp(_largest(self.high))
        _, of_sums = np.frexp(np.abs(x) @ np.ldexp(1.0, of_terms))
        # One grid for the products of all terms: a small term's coefficient keeps fewer bits.
        grid = np.ldexp(1.0, of_sums[:, None] - _MANTISSA + 1 - of_terms[None, :] + self.bits)
        head = np.rint(x / grid) * grid
        fitted = head @ self.high
        high_part = loads - fitted
        # What that difference rounds away (Knuth, The Art of Computer Programming 2, 4.2.2, theorem B).
        back = loads - high_part
        lost = (loads - (high_part + back)) + (back - fitted)
        correction = np.asarray(solution - head, dtype=np.float64) @ self.high
        correction += x @ self.low
        high = leading(high_part - correction, self.bits)
        high_part -= high
        high_part -= correction
        high_part += lost
        return Residuals(high=high, low=high_part)

    def gradient(self, residuals: Residuals) -> NDArray[np.longdouble]:
        """Return the products of residuals and design (loads, terms)."""
        exact = residuals.high @ self.high.T
        projected = residuals.low @ self.high.T + (residuals.high + residuals.low) @ self.low.T
        return np.asarray(exact, dtype=np.longdouble) + projected


def _largest(values: Array) -> Array:
    return np.asarray(np.maximum(values.max(axis=1), -values.min(axis=1)), dtype=np.float64)


_REFINEMENTS = 3
_SETTLED = 1e-15


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TermFit:
    """A solved load. Coefficients and covariance in the raw terms, in the order of ``terms``.

    ``residual_sd`` = sqrt(sum of squared residuals / dof) in the load's unit; ``residuals`` and
    ``leverage`` (rows,); ``weights`` the diagonal of the inverse covariance of the rows (1/u^2 for
    independent ones) or None. ``scaled`` (rows,) are the residuals that `diagnostics` judges: e for least
    squares, e/u for weighted, see `gls` and `odr` for the others. ``chi2`` is the weighted sum of squares
    at the minimum, None where no uncertainty is known.
    """

    terms: tuple[str, ...]
    coefficients: tuple[float, ...]
    covariance: Array
    residual_sd: float
    dof: int
    residuals: Array
    leverage: Array
    weights: Array | None
    scaled: Array
    chi2: float | None = None

    @property
    def standard_errors(self) -> Array:
        """Standard errors of the coefficients (terms,)."""
        return np.sqrt(np.diag(self.covariance))


def fit_terms(
    *, terms: Sequence[str], columns: Mapping[str, Array], load: Array, u: Array | None = None
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
    *, terms: Sequence[str], columns: Mapping[str, Array], loads: Sequence[Array], u: Array | None = None
) -> tuple[TermFit, ...]:
    """Fit several loads on the same rows and weights: one decomposition serves them all (see `fit_terms`)."""
    basis = build_basis(terms, columns)
    weights = None if u is None else 1.0 / u**2
    factor = Factor.of(basis.design, None if u is None else 1.0 / u)
    fits = []
    for solution, residuals in zip(*factor.solve(np.array(loads)), strict=True):
        dof = len(residuals) - len(factor.inverse)
        sd = math.sqrt(inner(residuals, residuals) / dof)
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
                scaled=scaled,
                chi2=None if u is None else inner(scaled, scaled),
            )
        )
    return tuple(fits)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Factor:
    """One QR decomposition of a design (rows, terms), weighted row by row where ``root`` = 1/u is given.

    ``q`` (rows, terms) and ``r`` (terms, terms) are its factors, ``inverse`` (terms, terms) that of the
    normal matrix, ``leverage`` (rows,).
    """

    design: Array
    root: Array | None
    q: Array
    r: Array
    inverse: Array
    leverage: Array

    @classmethod
    def of(cls, design: Array, root: Array | None) -> Factor:
        """Decompose; LinAlgError where the columns are dependent, or not finite."""
        from scipy.linalg import qr

        if not np.isfinite(design).all():
            raise np.linalg.LinAlgError("a term is not finite")
        weighted = design if root is None else design * root[:, None]
        factors = qr(weighted, mode="economic", check_finite=False)
        q, r = (np.asarray(factor, dtype=np.float64) for factor in factors)
        if not np.abs(np.diag(r)).all():
            raise np.linalg.LinAlgError("the terms are exactly dependent")
        # Elimination has nothing to do in a triangle: this is back-substitution.
        r_inverse = np.linalg.solve(r, np.eye(len(r)))
        return cls(
            design=design,
            root=root,
            q=q,
            r=r,
            inverse=r_inverse @ r_inverse.T,
            leverage=np.einsum("ij,ij->i", q, q),
        )

    def solve(self, loads: Array) -> tuple[NDArray[np.longdouble], Array]:
        """Return the solutions (loads, terms) in extended precision and the residuals, of (loads, rows)."""
        cut = CutDesign.of(np.ascontiguousarray(self.design.T))
        square = None if self.root is None else self.root**2
        first = self._first(loads)
        solution = first.astype(np.longdouble)
        residuals = cut.residuals(loads, solution)
        for _ in range(_REFINEMENTS):
            # A weight rounds once a row, as if its uncertainty were stated to 53 bits.
            weighed = (
                residuals
                if square is None
                else Residuals.of(square * (residuals.high + residuals.low), cut.bits)
            )
            step = np.asarray(cut.gradient(weighed), dtype=np.float64) @ self.inverse
            solution = solution + step
            # A step is small: its product in doubles is exact enough for the residuals' low part.
            residuals = Residuals(high=residuals.high, low=residuals.low - step @ self.design.T)
            if not (np.abs(step) > _SETTLED * np.abs(first)).any():
                break
        return solution, residuals.high + residuals.low

    def _first(self, loads: Array) -> Array:
        """Return statsmodels' solution by QR (loads, terms).

        It is given the triangle R and Q'y with the length of what is left over, in place of all rows: an
        orthogonal change of the same problem, with the same solution and the same sum of squares.
        """
        from statsmodels.regression.linear_model import OLS

        y = loads if self.root is None else loads * self.root
        head = y @ self.q
        residual = y - head @ self.q.T
        length = np.sqrt(np.einsum("ij,ij->i", residual, residual))
        rows = np.vstack([self.r, np.zeros(len(self.r))])
        solutions = [OLS(column, rows).fit(method="qr").params for column in np.column_stack([head, length])]
        return np.asarray(solutions, dtype=np.float64)


def raw_coefficients(basis: Basis, solution: NDArray[Any]) -> tuple[float, ...]:
    """Return the coefficients of the raw terms, carried back in rationals and rounded once."""
    values = [_fraction(value) for value in solution]
    return tuple(
        float(sum((a * b for a, b in zip(row, values, strict=True) if a), Fraction(0)))
        for row in basis.back_exact
    )


def covariance_of(basis: Basis, inverse: Array, scale: float = 1.0) -> Array:
    """Return the covariance in the raw terms, symmetric to the last bit."""
    covariance = basis.back @ inverse @ basis.back.T * scale
    return np.asarray((covariance + covariance.T) / 2, dtype=np.float64)


def _fraction(value: np.longdouble) -> Fraction:
    # An extended double is the sum of two doubles, exactly.
    high = float(value)
    return Fraction(high) + Fraction(float(value - np.longdouble(high)))
