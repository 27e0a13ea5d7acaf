"""The balance form of AIAA R-091: responses as functions of loads, and loads from responses by iteration.

    R = a + C1 F + C2 G(F),    G = |F|, F^2, F|F|, F_i F_k

A balance answers to loads, so this is the physical direction; its regression has the loads, which are known
best, as regressors. Loads follow by F(k+1) = C1^-1 (R - a - C2 G(F(k))), from C1^-1 (R - a).

Reference: AIAA R-091A-2020, Calibration and Use of Internal Strain-Gage Balances, sections 3.1 and 4.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.arrays import Array
from toolkit.calibration.fit.regression import TermFit, fit_terms
from toolkit.calibration.terms import INTERCEPT, model_terms, term_matrix, term_slopes
from toolkit.errors import SessionError

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
    coefficients: Array
    fits: tuple[TermFit, ...]
    full_scale: Array
    not_excited: tuple[str, ...]

    @property
    def linear(self) -> Array:
        """C1 (responses, loads)."""
        return self.coefficients[:, : len(self.loads)]

    def predict(self, loads: Array) -> Array:
        """Return the responses (rows, responses) to loads (rows, loads)."""
        responses: Array = (
            term_matrix(self.terms, dict(zip(self.loads, loads.T, strict=True))) @ self.coefficients.T
        )
        return responses

    def slopes(self, loads: Array) -> Array:
        """Return dR/dF (rows, responses, loads) at loads (rows, loads)."""
        columns, zero = dict(zip(self.loads, loads.T, strict=True)), np.zeros(len(loads))
        slopes = [term_slopes([name], [1.0], columns, zero).values() for name in self.terms]
        by_term = np.stack([np.stack(list(by_load), axis=1) for by_load in slopes], axis=1)
        responses: Array = np.einsum("jt,rtl->rjl", self.coefficients, by_term)
        return responses


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Solved:
    """Loads (rows, loads) found from responses, and the steps that it took."""

    loads: Array
    steps: int


def fit_balance(
    *, loads: Mapping[str, Array], responses: Mapping[str, Array], zero: Mapping[str, float] | None = None
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
    balance_terms = model_terms("balance", names)
    terms = _excited(balance_terms, loads, constant=zero is None)
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
    fixed = [() if zero is None else (zero[name],) for name in responses]
    return BalanceForm(
        responses=tuple(responses),
        loads=names,
        terms=terms,
        coefficients=np.array(
            [(*fit.coefficients, *constants) for fit, constants in zip(fits, fixed, strict=True)]
        ),
        fits=fits,
        full_scale=np.array([float(np.abs(values).max()) for values in loads.values()]),
        not_excited=tuple(name for name in balance_terms if name not in terms),
    )


def loads_by_iteration(form: BalanceForm, responses: Array) -> Solved:
    """Return the loads of responses (rows, responses) by the load iteration of R-091.

    It ends where no load changes by more than `TOLERANCE` of its full scale. With more responses than
    loads, C1^-1 is the least-squares inverse.

    Raises
    ------
    SessionError
        ``not-converged``: the steps are spent, or the loads leave ten times full scale
    """
    inverse = np.linalg.pinv(form.linear)
    loads = start = (responses - form.coefficients[:, -1]) @ inverse.T
    for step in range(1, MAX_STEPS + 1):
        # predict = a + C1 F + C2 G(F), so that F - C1^-1 (predict - R) is the iteration.
        with np.errstate(over="ignore", invalid="ignore"):
            new = loads - (form.predict(loads) - responses) @ inverse.T
        change = np.abs(new - loads) / form.full_scale
        loads = new
        if not np.isfinite(loads).all() or (np.abs(loads) > 10 * (form.full_scale + np.abs(start))).any():
            break
        if float(change.max()) <= TOLERANCE:
            return Solved(loads=loads, steps=step)
    row, load = np.unravel_index(int(np.argmax(np.nan_to_num(change, nan=np.inf))), change.shape)
    raise _failed(
        "the load iteration of the balance form does not converge",
        f"row {row + 1}, {form.loads[load]}: still changing by {100 * float(change[row, load]):.3g} % of "
        f"full scale in step {step}", f"changes under {TOLERANCE:g} of full scale within {MAX_STEPS} steps",
        "check the indications of that row; a form whose higher terms outweigh the linear ones is no balance",
        rule="not-converged",
    )  # fmt: skip


def loads_by_newton(form: BalanceForm, responses: Array) -> Solved:
    """Return the same loads by Newton's method (Gauss-Newton with more responses than loads).

    The two agree to `TOLERANCE` where there are as many responses as loads. Raises as the iteration does.
    """
    loads = (responses - form.coefficients[:, -1]) @ np.linalg.pinv(form.linear).T
    size = np.full(len(form.loads), np.inf)
    for step in range(1, MAX_STEPS + 1):
        slope = form.slopes(loads)
        move = np.einsum("rlj,rj->rl", np.linalg.pinv(slope), responses - form.predict(loads))
        loads = loads + move
        size = np.abs(move).max(axis=0) / form.full_scale
        if float(size.max()) <= TOLERANCE:
            return Solved(loads=loads, steps=step)
    raise _failed(
        "Newton's method does not find the loads of the balance form",
        f"still changing by {100 * float(size.max()):.3g} % of full scale",
        f"changes under {TOLERANCE:g} of full scale within {MAX_STEPS} steps",
        "check the indications", rule="not-converged",
    )  # fmt: skip


def _excited(terms: Sequence[str], columns: Mapping[str, Array], *, constant: bool) -> tuple[str, ...]:
    """Return the terms that the data tell apart, the first of dependent ones kept."""
    matrix = term_matrix(terms, columns)
    basis = [np.full(len(matrix), 1 / np.sqrt(len(matrix)))] if constant else []
    orthogonal = []
    for name, column in zip(terms, matrix.T, strict=True):
        if name == INTERCEPT:
            orthogonal.append(name)
            continue
        length = float(np.linalg.norm(column))
        remainder = column / length if length > 0 else column
        for _ in range(2):  # twice is enough: Gram-Schmidt loses orthogonality once
            for direction in basis:
                remainder = remainder - (direction @ remainder) * direction
        size = float(np.linalg.norm(remainder))
        if size > _INDEPENDENT:
            orthogonal.append(name)
            basis.append(remainder / size)
    return tuple(orthogonal)


def _failed(
    problem: str, actual: object, expected: object, next_step: str, *, rule: str = "balance"
) -> SessionError:
    return SessionError(
        problem, where="balance form", got=actual, expected=expected, next_step=next_step, rule=rule
    )


# Tare loads of a balance calibration: what hangs on the balance in each run, besides the applied loads.


CHANGE = 1e-6
MAX_TARE_STEPS = 50


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tares:
    """``values`` (runs, loads) in the loads' units, by ``runs``; ``form`` is fitted on the sums.

    ``relative``: no natural zero was given, so that the constant of the form takes up what all runs share,
    and the tares are counted from their mean. ``standard_errors`` (runs, loads) for given coefficients.
    """

    runs: tuple[int, ...]
    values: Array
    standard_errors: Array
    form: BalanceForm
    steps: int
    relative: bool


def estimate_tares(
    *,
    loads: Mapping[str, Array],
    responses: Mapping[str, Array],
    run: Array,
    natural_zero: Mapping[str, float] | None = None,
) -> Tares:
    """Return tares and coefficients that belong together.

    Parameters
    ----------
    loads, responses : applied loads and indications (rows,) by name, in their units
    run : run of each row (rows,)
    natural_zero : indications with no load at all, measured apart; without them only differences of tares
        between runs are determined

    It ends where no tare changes by more than 1e-6 of full scale.

    Raises
    ------
    SessionError
        ``not-converged``: the tares still change after 50 steps; ``balance``: the runs do not determine them
    """
    numbers, index = np.unique(run, return_inverse=True)
    index = index.ravel()
    applied = np.column_stack(list(loads.values()))
    names, full = tuple(loads), np.abs(applied).max(axis=0)
    measured = np.column_stack(list(responses.values()))
    member = (index[:, None] == np.arange(len(numbers))).astype(np.float64)
    if natural_zero is None:
        # Differences from the mean: the last run's is minus the sum of the others'.
        member = member[:, :-1] - member[:, -1:]
    shape = (member.shape[1], len(names))
    to_runs = np.eye(shape[0])
    if natural_zero is None:
        to_runs = np.vstack([to_runs, -np.ones(shape[0])])
    tares = np.zeros(shape)
    for step in range(1, MAX_TARE_STEPS + 1):
        total = applied + member @ tares
        form = fit_balance(
            loads=dict(zip(names, total.T, strict=True)), responses=responses, zero=natural_zero
        )
        if not shape[0]:
            return _tares(numbers, to_runs, tares, np.zeros((0, 0)), form, step, natural_zero)
        move, covariance = _move(form, total, measured, member, natural_zero is not None)
        tares = tares + move
        if float((np.abs(to_runs @ move) / full).max()) <= CHANGE:
            return _tares(numbers, to_runs, tares, covariance, form, step, natural_zero)
    raise SessionError(
        "the tare iteration does not converge",
        where="balance form",
        got=f"a tare still changes by {float((np.abs(move) / full).max()):.2g} of full scale",
        expected=f"changes under {CHANGE:g} of full scale within {MAX_TARE_STEPS} steps",
        next_step="check the column run: each run has one set of fixtures",
        rule="not-converged",
    )


def _move(
    form: BalanceForm, total: Array, measured: Array, member: Array, absolute: bool
) -> tuple[Array, Array]:
    """Return the tares' step (free runs, loads), and its covariance."""
    terms = [t for t in form.terms if not (absolute and t == INTERCEPT)]
    design = term_matrix(terms, dict(zip(form.loads, total.T, strict=True)))
    q, _ = np.linalg.qr(design / np.linalg.norm(design, axis=0))
    slopes, residual = form.slopes(total), measured - form.predict(total)
    scale = np.maximum(np.array([fit.residual_sd for fit in form.fits]), 1e-12 * np.abs(measured).max(axis=0))
    rows, right = [], []
    for j, sd in enumerate(scale):
        column = (member[:, :, None] * slopes[:, j, None, :]).reshape(len(total), -1)
        rows.append((column - q @ (q.T @ column)) / sd)
        right.append(residual[:, j] / sd)
    matrix, target = np.vstack(rows), np.concatenate(right)
    length = np.linalg.norm(matrix, axis=0)
    scaled = matrix / np.where(length > 0, length, 1.0)
    values = np.linalg.svd(scaled, compute_uv=False)
    if values[-1] < 1e-8 * values[0] or (length == 0).any():
        raise SessionError(
            "the runs do not determine the tares",
            where="balance form", got=f"{member.shape[1]} free runs, {len(total)} rows",
            expected="runs in which the loads vary independently of the run",
            next_step="apply several loads in every run",
            rule="balance",
        )  # fmt: skip
    solution = np.linalg.lstsq(scaled, target, rcond=None)[0] / length
    covariance = np.linalg.inv(scaled.T @ scaled) / np.outer(length, length)
    return solution.reshape(member.shape[1], -1), covariance


def _tares(
    numbers: Array,
    to_runs: Array,
    moves: Array,
    covariance: Array,
    form: BalanceForm,
    steps: int,
    zero: Mapping[str, float] | None,
) -> Tares:
    free, loads = moves.shape
    spread = covariance.reshape(free, loads, free, loads)
    variance = np.zeros((len(numbers), loads))
    if free:
        variance = np.einsum("ra,albl,rb->rl", to_runs, spread, to_runs)
    return Tares(
        runs=tuple(int(n) for n in numbers),
        values=to_runs @ moves,
        standard_errors=np.sqrt(variance),
        form=form,
        steps=steps,
        relative=zero is None,
    )
