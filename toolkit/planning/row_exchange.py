"""Exact optimal designs by point exchange over the rows that are feasible.

A row of a response is, in units of its repeatability,

    y = f . b + g . r + e,   e ~ N(0, 1)

with coefficients b common to the session and r drawn anew by every run. A coefficient with a precision above
zero is known beforehand to that precision (0 a priori, as a run's zero or a possible misfit); what is sought
are the first ``wanted`` of b. Their covariance is a block of the inverse of the information: linear Bayes, as
DuMouchel and Jones (Technometrics 36 (1994) 37) have it for terms that may be missing, and generalised least
squares for random run effects (Goos and Vandebroek, Technometrics 43 (2001) 436). Rows are exchanged by
themselves (Fedorov 1972) until no exchange is better, from several starts; they are a list of loads that
fixtures can make, not factors that can be set freely.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

Criterion = Literal["D", "I", "G"]
CRITERIA: tuple[Criterion, ...] = ("D", "I", "G")
_RIDGE = 1e-9  # a first draw may not determine what an exchange will
_SWEEPS = 30
_BETTER = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Response:
    """One response over the feasible rows.

    ``common`` (candidates, columns) and ``of_run`` (candidates, effects) are f and g of every candidate;
    ``precision`` (columns,) and ``run_precision`` (effects,) those of b and r; ``targets`` (points, wanted)
    are rows f at which the response is to be predicted: all ``common`` columns but the wanted are absent
    from them.
    """

    common: NDArray[np.float64]
    of_run: NDArray[np.float64]
    precision: NDArray[np.float64]
    run_precision: NDArray[np.float64]
    targets: NDArray[np.float64]

    @property
    def wanted(self) -> int:
        """Number of coefficients that are sought."""
        return int(self.targets.shape[1])

    def row(self, candidate: NDArray[np.intp] | int, run: int, runs: int) -> NDArray[np.float64]:
        """Return the rows of candidates in a run: (candidates, columns + runs * effects)."""
        common, of_run = self.common[candidate], self.of_run[candidate]
        effects = of_run.shape[-1]
        rows = np.zeros((*common.shape[:-1], common.shape[-1] + runs * effects))
        rows[..., : common.shape[-1]] = common
        start = common.shape[-1] + run * effects
        rows[..., start : start + effects] = of_run
        return rows

    def information(self, chosen: NDArray[np.intp], run: NDArray[np.intp], runs: int) -> NDArray[np.float64]:
        """Return the information of rows, with what is known beforehand."""
        rows = np.concatenate([self.row(chosen[run == r], r, runs) for r in range(runs)])
        precision = np.concatenate([self.precision, np.tile(self.run_precision, runs)])
        return np.asarray(rows.T @ rows + np.diag(precision))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Price:
    """What a row takes beside what it tells: ``minutes`` of every candidate, and ``setup`` of its mount.

    A mount (numbers from 0, of every candidate) is set up once in each run that has a row of it; below 0 it
    is none. ``weight`` is what the criterion pays for a minute.
    """

    mount: NDArray[np.intp]
    minutes: NDArray[np.float64]
    setup: NDArray[np.float64]
    weight: float

    def added(self, rows: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return what each candidate costs in a run that has these rows."""
        absent = ~np.isin(self.mount, self.mount[rows]) & (self.mount >= 0)
        return self.weight * (self.minutes + self.setup * absent)

    def total(self, chosen: NDArray[np.intp], run: NDArray[np.intp]) -> float:
        """Return the minutes of a design."""
        pairs = {
            (r, self.mount[at]): self.setup[at] for r, at in zip(run.tolist(), chosen.tolist(), strict=True)
        }
        mounted = sum(float(setup) for (_, mount), setup in pairs.items() if mount >= 0)
        return float(self.minutes[chosen].sum()) + mounted


def response_loss(covariance: NDArray[np.float64], targets: NDArray[np.float64], by: Criterion) -> float:
    """Return what a criterion asks to be small, of the covariance (wanted, wanted) of one response."""
    if by == "D":
        sign, size = np.linalg.slogdet(covariance)
        return float(size) if sign > 0 else float("inf")
    variances = np.einsum("ij,jk,ik->i", targets, covariance, targets)
    return float(variances.mean() if by == "I" else variances.max())


def loss(
    responses: Sequence[Response],
    chosen: NDArray[np.intp],
    run: NDArray[np.intp],
    by: Criterion,
    ridge: float = 0.0,
) -> float:
    """Return the criterion of a design, summed over the responses (G: the largest); infinite if singular.

    D is the log-determinant of the covariance, I the mean and G the largest variance over the targets, each
    in units of the repeatability.
    """
    runs = int(run.max()) + 1
    values = []
    for response in responses:
        information = response.information(chosen, run, runs)
        information = information + ridge * np.eye(len(information))
        if np.linalg.matrix_rank(information, hermitian=True) < len(information):
            return float("inf")
        covariance = np.asarray(np.linalg.inv(information)[: response.wanted, : response.wanted], np.float64)
        values.append(response_loss(covariance, response.targets, by))
    return max(values) if by == "G" else sum(values)


def exchange(
    responses: Sequence[Response],
    run: NDArray[np.intp],
    by: Criterion,
    rng: np.random.Generator,
    *,
    starts: int = 4,
    price: Price | None = None,
    once: bool = False,
) -> NDArray[np.intp]:
    """Return the candidates (rows,) of the best design found for rows in given runs (numbered from 0).

    With a ``price`` the criterion pays for what the rows take; ``once``: no run has a candidate twice.
    """
    count = len(responses[0].common)
    designs = []
    for _ in range(starts):
        first = np.concatenate(
            [rng.choice(count, size=size, replace=not once) for size in np.bincount(run).tolist()]
        )
        chosen = _descend(
            responses, first[np.argsort(np.argsort(run, kind="stable"))], run, by, rng, price, once
        )
        value = loss(responses, chosen, run, by, _RIDGE)
        value += 0.0 if price is None else price.weight * price.total(chosen, run)
        designs.append((value, chosen))
    return min(designs, key=lambda design: design[0])[1]


def _descend(
    responses: Sequence[Response],
    chosen: NDArray[np.intp],
    run: NDArray[np.intp],
    by: Criterion,
    rng: np.random.Generator,
    price: Price | None,
    once: bool,
) -> NDArray[np.intp]:
    """Exchange row after row for the best candidate until a sweep changes none."""
    chosen = chosen.copy()
    for _ in range(_SWEEPS):
        changed = False
        for at in rng.permutation(len(chosen)).tolist():
            rest, run_of_rest = np.delete(chosen, at), np.delete(run, at)
            losses = _losses(responses, rest, run_of_rest, int(run[at]), run, by)
            beside = rest[run_of_rest == run[at]]
            if price is not None:
                losses = losses + price.added(beside)
            if once:
                losses[beside] = np.inf
            best = int(np.argmin(losses))
            if losses[best] < losses[chosen[at]] - _BETTER * max(abs(losses[best]), 1.0):
                chosen[at], changed = best, True
        if not changed:
            break
    return chosen


def _losses(
    responses: Sequence[Response],
    rest: NDArray[np.intp],
    run_of_rest: NDArray[np.intp],
    run: int,
    all_runs: NDArray[np.intp],
    by: Criterion,
) -> NDArray[np.float64]:
    """Return the criterion (candidates,) of the rest of a design with each candidate added to a run."""
    runs = int(all_runs.max()) + 1
    values = []
    for response in responses:
        information = response.information(rest, run_of_rest, runs)
        covariance = np.linalg.inv(information + _RIDGE * np.eye(len(information)))
        rows = response.row(np.arange(len(response.common)), run, runs)
        # (M + z z')^-1 = C - (C z)(C z)' / (1 + z' C z)
        moved = rows @ covariance
        scale = 1.0 + np.einsum("ij,ij->i", moved, rows)
        p = response.wanted
        inner, gained = covariance[:p, :p], moved[:, :p]
        if by == "D":
            share = np.einsum("ij,ij->i", gained, np.linalg.solve(inner, gained.T).T) / scale
            value = np.linalg.slogdet(inner)[1] + np.log(np.maximum(1.0 - share, 1e-300))
        else:
            before = np.einsum("ij,jk,ik->i", response.targets, inner, response.targets)
            after = before - (gained @ response.targets.T) ** 2 / scale[:, None]
            value = after.mean(axis=1) if by == "I" else after.max(axis=1)
        values.append(value)
    return np.asarray(np.max(values, axis=0) if by == "G" else np.sum(values, axis=0))
