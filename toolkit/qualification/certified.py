"""NIST's certified linear regressions through the toolkit's own solver, in correct digits.

A polynomial of degree 10 (Filip) is beyond what a term can name: its powers of the centred variable are given
as columns, as the solver builds them for lower degrees, and its results are carried back by the binomial
theorem.

Reference: NIST Statistical Reference Datasets, linear least squares.
"""

from __future__ import annotations

import math
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.fit.regression import fit_terms
from toolkit.errors import ToolkitError
from toolkit.qualification.model import Check, correct_digits, digits_check, not_run
from toolkit.qualification.numbers import QUANTITIES, SETS, CertifiedSet, read_set

if TYPE_CHECKING:
    from numpy.typing import NDArray

GROUP = "NIST StRD linear"
_NAMED_POWERS = 9


def check_certified(folder: Path) -> list[Check]:
    """Solve every certified set; one check a quantity."""
    checks: list[Check] = []
    for name in SETS:
        try:
            checks += _checks(read_set(name, folder))
        except (ToolkitError, np.linalg.LinAlgError, ValueError, KeyError) as error:
            checks.append(not_run(GROUP, name, str(error)))
    return checks


def solve(certified: CertifiedSet) -> tuple[tuple[float, ...], tuple[float, ...], float]:
    """Return estimates, their standard errors and the residual standard deviation of a certified set."""
    power = len(certified.terms) - 1
    if certified.terms[-2:] == (f"x^{power}", "intercept") and power > _NAMED_POWERS:
        return _high_polynomial(certified.columns["x"], certified.y, power)
    fit = fit_terms(terms=certified.terms, columns=certified.columns, load=certified.y)
    return fit.coefficients, tuple(fit.standard_errors.tolist()), fit.residual_sd


def _checks(certified: CertifiedSet) -> list[Check]:
    estimates, errors, sd = solve(certified)
    reached = (
        min(correct_digits(a, b) for a, b in zip(estimates, certified.estimates, strict=True)),
        min(correct_digits(a, b) for a, b in zip(errors, certified.errors, strict=True)),
        correct_digits(sd, certified.residual_sd),
    )
    return [
        digits_check(
            GROUP, certified.name, quantity.replace("_", " "), required, got, _note(public, required)
        )
        for quantity, required, public, got in zip(
            QUANTITIES, certified.required, certified.public, reached, strict=True
        )
    ]


def _note(public: float, required: float) -> str:
    short = ", more than is asked for here" if required < math.floor(min(public, 14.0)) else ""
    return f"public QR solvers reach {public:g}{short}"


def _high_polynomial(
    x: NDArray[np.float64], y: NDArray[np.float64], degree: int
) -> tuple[tuple[float, ...], tuple[float, ...], float]:
    centre = float(np.mean(x))
    half = math.ldexp(1.0, math.frexp(float(np.abs(x - centre).max()))[1])
    z = (x - centre) / half
    names = tuple(f"z{power}" for power in range(1, degree + 1))
    columns = {name: z**power for power, name in enumerate(names, start=1)}
    fit = fit_terms(terms=(*names, "intercept"), columns=columns, load=y)
    powers = (*range(1, degree + 1), 0)
    back = [
        [
            math.comb(j, i) * Fraction(-centre) ** (j - i) / Fraction(half) ** j if j >= i else Fraction(0)
            for j in powers
        ]
        for i in powers
    ]
    solved = [Fraction(value) for value in fit.coefficients]
    estimates = tuple(float(sum(a * b for a, b in zip(row, solved, strict=True))) for row in back)
    matrix = np.array([[float(value) for value in row] for row in back])
    errors = np.sqrt(np.einsum("ij,jk,ik->i", matrix, fit.covariance, matrix))
    return estimates, tuple(errors.tolist()), fit.residual_sd
