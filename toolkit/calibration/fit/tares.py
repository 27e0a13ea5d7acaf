"""Tare loads of a balance calibration: what hangs on the balance in each run, besides the applied loads.

Fixtures and hangers load the balance all through a run. In a nonlinear form that is no mere offset, so the
tares are estimated together with the coefficients: R = R(F_applied + tare_run). Each step solves the tares by
least squares on the slopes at the loads of the step before, with the coefficients eliminated (variable
projection; Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973), and fits the coefficients again.

Reference: AIAA R-091A-2020, section 3.3 (tare iteration).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.fit.balance import BalanceForm, fit_balance
from toolkit.calibration.terms import INTERCEPT, term_matrix
from toolkit.errors import SessionError

if TYPE_CHECKING:
    from numpy.typing import NDArray

CHANGE = 1e-6
MAX_STEPS = 50


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tares:
    """``values`` (runs, loads) in the loads' units, by ``runs``; ``form`` is fitted on the sums.

    ``relative``: no natural zero was given, so that the constant of the form takes up what all runs share,
    and the tares are counted from their mean. ``standard_errors`` (runs, loads) for given coefficients.
    """

    runs: tuple[int, ...]
    values: NDArray[np.float64]
    standard_errors: NDArray[np.float64]
    form: BalanceForm
    steps: int
    relative: bool


def estimate_tares(
    *,
    loads: Mapping[str, NDArray[np.float64]],
    responses: Mapping[str, NDArray[np.float64]],
    run: NDArray[np.float64],
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
    found = np.zeros(shape)
    for step in range(1, MAX_STEPS + 1):
        total = applied + member @ found
        form = fit_balance(
            loads=dict(zip(names, total.T, strict=True)), responses=responses, zero=natural_zero
        )
        if not shape[0]:
            return _tares(numbers, to_runs, found, np.zeros((0, 0)), form, step, natural_zero)
        move, covariance = _move(form, total, measured, member, natural_zero is not None)
        found = found + move
        if float((np.abs(to_runs @ move) / full).max()) <= CHANGE:
            return _tares(numbers, to_runs, found, covariance, form, step, natural_zero)
    raise SessionError(
        "the tare iteration does not converge",
        where="balance form",
        got=f"a tare still changes by {float((np.abs(move) / full).max()):.2g} of full scale",
        expected=f"changes under {CHANGE:g} of full scale within {MAX_STEPS} steps",
        next_step="check the column run: each run has one set of fixtures",
        rule="not-converged",
    )


def _move(
    form: BalanceForm,
    total: NDArray[np.float64],
    measured: NDArray[np.float64],
    member: NDArray[np.float64],
    absolute: bool,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the tares' step (free runs, loads), and its covariance."""
    terms = [t for t in form.terms if not (absolute and t == INTERCEPT)]
    design = term_matrix(terms, dict(zip(form.loads, total.T, strict=True)))
    q, _ = np.linalg.qr(design / np.linalg.norm(design, axis=0))
    slopes, rest = form.slopes(total), measured - form.predict(total)
    scale = np.maximum(np.array([one.residual_sd for one in form.fits]), 1e-12 * np.abs(measured).max(axis=0))
    left, right = [], []
    for j, sd in enumerate(scale):
        column = (member[:, :, None] * slopes[:, j, None, :]).reshape(len(total), -1)
        left.append((column - q @ (q.T @ column)) / sd)
        right.append(rest[:, j] / sd)
    matrix, target = np.vstack(left), np.concatenate(right)
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
    numbers: NDArray[np.float64],
    to_runs: NDArray[np.float64],
    found: NDArray[np.float64],
    covariance: NDArray[np.float64],
    form: BalanceForm,
    steps: int,
    zero: Mapping[str, float] | None,
) -> Tares:
    free, loads = found.shape
    spread = covariance.reshape(free, loads, free, loads)
    variance = np.zeros((len(numbers), loads))
    if free:
        variance = np.einsum("ra,albl,rb->rl", to_runs, spread, to_runs)
    return Tares(
        runs=tuple(int(n) for n in numbers),
        values=to_runs @ found,
        standard_errors=np.sqrt(variance),
        form=form,
        steps=steps,
        relative=zero is None,
    )
