"""The balance form of AIAA R-091: responses as functions of loads, and loads from responses by iteration.

    R = a + C1 F + C2 G(F),    G = |F|, F^2, F|F|, F_i F_k

A balance answers to loads, so this is the physical direction; its regression has the loads, which are known
best, as regressors. Loads follow by F(k+1) = C1^-1 (R - a - C2 G(F(k))), from C1^-1 (R - a).

Reference: AIAA R-091A-2020, Calibration and Use of Internal Strain-Gage Balances, sections 3.1 and 4.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.fit.regression import TermFit, fit_terms
from toolkit.calibration.terms import INTERCEPT, model_terms, parse_term, term_matrix
from toolkit.errors import SessionError

if TYPE_CHECKING:
    from numpy.typing import NDArray

TOLERANCE = 1e-10
MAX_STEPS = 100
_INDEPENDENT = 1e-5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BalanceForm:
    """Response equations. ``coefficients`` (responses, terms) by ``terms``; ``full_scale`` (loads,).

    ``not_excited`` are terms of the form that the loads applied cannot tell from the others, and that the
    form is therefore fitted without: products of loads never applied together, |F| of a load of one sign.
    """

    responses: tuple[str, ...]
    loads: tuple[str, ...]
    terms: tuple[str, ...]
    coefficients: NDArray[np.float64]
    fits: tuple[TermFit, ...]
    full_scale: NDArray[np.float64]
    not_excited: tuple[str, ...]

    @property
    def linear(self) -> NDArray[np.float64]:
        """C1 (responses, loads)."""
        return self.coefficients[:, : len(self.loads)]

    def predict(self, loads: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the responses (rows, responses) to loads (rows, loads)."""
        responses: NDArray[np.float64] = (
            term_matrix(self.terms, dict(zip(self.loads, loads.T, strict=True))) @ self.coefficients.T
        )
        return responses

    def slopes(self, loads: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return dR/dF (rows, responses, loads) at loads (rows, loads)."""
        by_term = np.stack([_derivatives(name, self.loads, loads) for name in self.terms], axis=1)
        slopes: NDArray[np.float64] = np.einsum("jt,rtl->rjl", self.coefficients, by_term)
        return slopes


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solved:
    """Loads (rows, loads) found from responses, and the steps that it took."""

    loads: NDArray[np.float64]
    steps: int


def fit_balance(
    *,
    loads: Mapping[str, NDArray[np.float64]],
    responses: Mapping[str, NDArray[np.float64]],
    zero: Mapping[str, float] | None = None,
) -> BalanceForm:
    """Fit the response equations on the loads (rows,) applied, through the natural zeros where given.

    Raises
    ------
    SessionError
        ``balance``: fewer responses than loads, too few rows, or linear parts that the loads do not span
    """
    names = tuple(loads)
    if len(responses) < len(names):
        raise _failed(
            "the balance form needs as many indications as loads",
            f"{len(responses)} indications, {len(names)} loads", "an indication for each load",
            "leave loads out, or use the direct form alone",
        )  # fmt: skip
    wanted = model_terms("balance", names)
    terms = _excited(wanted, loads, constant=zero is None)
    rows = len(next(iter(loads.values())))
    if not set(names) <= set(terms) or rows - len(terms) < 1:
        raise _failed(
            "the loads do not determine the balance form",
            f"{rows} rows, terms {', '.join(terms)}", f"more rows than terms, and {', '.join(names)} apart",
            "apply more loads, each also by itself",
        )  # fmt: skip
    fitted = terms if zero is None else terms[:-1]
    fits = tuple(
        fit_terms(terms=fitted, columns=loads, load=response if zero is None else response - zero[name])
        for name, response in responses.items()
    )
    rest = [() if zero is None else (zero[name],) for name in responses]
    return BalanceForm(
        responses=tuple(responses),
        loads=names,
        terms=terms,
        coefficients=np.array([(*one.coefficients, *more) for one, more in zip(fits, rest, strict=True)]),
        fits=fits,
        full_scale=np.array([float(np.abs(values).max()) for values in loads.values()]),
        not_excited=tuple(name for name in wanted if name not in terms),
    )


def loads_by_iteration(
    form: BalanceForm, responses: NDArray[np.float64], *, tolerance: float = TOLERANCE, steps: int = MAX_STEPS
) -> Solved:
    """Return the loads of responses (rows, responses) by the load iteration of R-091.

    It ends where no load changes by more than ``tolerance`` of its full scale. With more responses than
    loads, C1^-1 is the least-squares inverse.

    Raises
    ------
    SessionError
        ``not-converged``: the steps are spent, or the loads leave ten times full scale
    """
    inverse = np.linalg.pinv(form.linear)
    found = start = (responses - form.coefficients[:, -1]) @ inverse.T
    for step in range(1, steps + 1):
        # predict = a + C1 F + C2 G(F), so that F - C1^-1 (predict - R) is the iteration.
        with np.errstate(over="ignore", invalid="ignore"):
            new = found - (form.predict(found) - responses) @ inverse.T
        change = np.abs(new - found) / form.full_scale
        found = new
        if not np.isfinite(found).all() or (np.abs(found) > 10 * (form.full_scale + np.abs(start))).any():
            break
        if float(change.max()) <= tolerance:
            return Solved(loads=found, steps=step)
    row, load = np.unravel_index(int(np.argmax(np.nan_to_num(change, nan=np.inf))), change.shape)
    raise _failed(
        "the load iteration of the balance form does not converge",
        f"row {row + 1}, {form.loads[load]}: still changing by {100 * float(change[row, load]):.3g} % of "
        f"full scale in step {step}", f"changes under {tolerance:g} of full scale within {steps} steps",
        "check the indications of that row; a form whose higher terms outweigh the linear ones is no balance",
        rule="not-converged",
    )  # fmt: skip


def loads_by_newton(
    form: BalanceForm, responses: NDArray[np.float64], *, tolerance: float = TOLERANCE, steps: int = MAX_STEPS
) -> Solved:
    """Return the same loads by Newton's method (Gauss-Newton with more responses than loads).

    The two agree to ``tolerance`` where there are as many responses as loads. Raises as the iteration does.
    """
    found = (responses - form.coefficients[:, -1]) @ np.linalg.pinv(form.linear).T
    size = np.full(len(form.loads), np.inf)
    for step in range(1, steps + 1):
        slope = form.slopes(found)
        move = np.einsum("rlj,rj->rl", np.linalg.pinv(slope), responses - form.predict(found))
        found = found + move
        size = np.abs(move).max(axis=0) / form.full_scale
        if float(size.max()) <= tolerance:
            return Solved(loads=found, steps=step)
    raise _failed(
        "Newton's method does not find the loads of the balance form",
        f"still changing by {100 * float(size.max()):.3g} % of full scale",
        f"changes under {tolerance:g} of full scale within {steps} steps",
        "check the indications", rule="not-converged",
    )  # fmt: skip


def _excited(
    terms: Sequence[str], columns: Mapping[str, NDArray[np.float64]], *, constant: bool
) -> tuple[str, ...]:
    """Return the terms that the data tell apart, the first of dependent ones kept."""
    matrix = term_matrix(terms, columns)
    basis = [np.full(len(matrix), 1 / np.sqrt(len(matrix)))] if constant else []
    kept = []
    for name, column in zip(terms, matrix.T, strict=True):
        if name == INTERCEPT:
            kept.append(name)
            continue
        length = float(np.linalg.norm(column))
        rest = column / length if length > 0 else column
        for _ in range(2):  # twice is enough: Gram-Schmidt loses orthogonality once
            for one in basis:
                rest = rest - (one @ rest) * one
        size = float(np.linalg.norm(rest))
        if size > _INDEPENDENT:
            kept.append(name)
            basis.append(rest / size)
    return tuple(kept)


def _derivatives(name: str, loads: Sequence[str], at: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the term's slope to each load (rows, loads)."""
    term = parse_term(name)
    columns = dict(zip(loads, at.T, strict=True))
    slopes = np.zeros_like(at)
    factors = [(n, columns[n] ** k, k * columns[n] ** (k - 1)) for n, k in term.powers]
    factors += [(n, np.abs(columns[n]), np.sign(columns[n])) for n in term.absolutes]
    for i, (n, _, slope) in enumerate(factors):
        product = slope.copy()
        for k, (_, value, _) in enumerate(factors):
            if k != i:
                product = product * value
        slopes[:, loads.index(n)] += product
    return slopes


def _failed(
    what: str, got: object, expected: object, next_step: str, *, rule: str = "balance"
) -> SessionError:
    return SessionError(
        what, where="balance form", got=got, expected=expected, next_step=next_step, rule=rule
    )
