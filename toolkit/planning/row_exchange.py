"""Exact optimal designs by point exchange over the rows that are feasible.

A row of a response is, in units of its repeatability,

    y = f . b + g . r + e,   e ~ N(0, 1)

with coefficients b common to the session and r drawn anew by every run. A coefficient with a precision above
zero is known beforehand to that precision (0 a priori, as a run's zero or a possible misfit); what is sought
are the first ``wanted`` of b. Their covariance is a block of the inverse of the information: linear Bayes, as
DuMouchel and Jones (Technometrics 36 (1994) 37) have it for terms that may be missing, and generalised least
squares for random run effects (Goos and Vandebroek, Technometrics 43 (2001) 436). Rows are the parts of such
a design (`exchange`); they are a list of loads that fixtures can make, not factors that can be set freely.

A design is judged by D, I or G. D is the log-determinant of the covariance of the coefficients, I the mean
and G the largest variance of what they predict at the targets. A row z adds to the information M, and by
Sherman and Morrison

    (M + z z')^-1 = C - (C z)(C z)' / (1 + z' C z),   C = M^-1

so that each criterion of every candidate row costs products with C, and no matrix is inverted for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.planning.exchange import Alternatives, best_of, exchanged

Criterion = Literal["D", "I", "G"]
CRITERIA: tuple[Criterion, ...] = ("D", "I", "G")


def criterion(covariance: Array, targets: Array, by: Criterion) -> float:
    """Return what a criterion asks to be small, of the covariance (wanted, wanted) of one response.

    ``targets`` (points, wanted) are rows at which the response is to be predicted.
    """
    if by == "D":
        sign, size = np.linalg.slogdet(covariance)
        return float(size) if sign > 0 else float("inf")
    variances = np.einsum("ij,jk,ik->i", targets, covariance, targets)
    return float(variances.mean() if by == "I" else variances.max())


def with_each_row(covariance: Array, rows: Array, targets: Array, by: Criterion) -> Array:
    """Return the criterion (rows,) of a design with each of some rows added.

    ``covariance`` (columns, columns) is that of all coefficients, of which the first are wanted, as many as
    ``targets`` (points, wanted) has columns; ``rows`` (rows, columns) are in the same columns.
    """
    wanted = targets.shape[1]
    moved = rows @ covariance
    scale = 1.0 + np.einsum("ij,ij->i", moved, rows)
    inner, gained = covariance[:wanted, :wanted], moved[:, :wanted]
    if by == "D":
        share = np.einsum("ij,ij->i", gained, np.linalg.solve(inner, gained.T).T) / scale
        return np.asarray(np.linalg.slogdet(inner)[1] + np.log(np.maximum(1.0 - share, 1e-300)))
    before = np.einsum("ij,jk,ik->i", targets, inner, targets)
    after = before - (gained @ targets.T) ** 2 / scale[:, None]
    return np.asarray(after.mean(axis=1) if by == "I" else after.max(axis=1))


def together(values: list[Array], by: Criterion) -> Array:
    """Return the criterion of several responses: their sum, for G the largest."""
    return np.asarray(np.max(values, axis=0) if by == "G" else np.sum(values, axis=0))


_LACKING = 1e6  # of a run in which a span is lacking: more than any criterion gains
_RIDGE = 1e-9  # a first draw may not determine what an exchange will


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Response:
    """One response over the feasible rows.

    ``common`` (candidates, columns) and ``of_run`` (candidates, effects) are f and g of every candidate;
    ``precision`` (columns,) and ``run_precision`` (effects,) those of b and r; ``targets`` (points, wanted)
    are rows f at which the response is to be predicted: all ``common`` columns but the wanted are absent
    from them.
    """

    common: Array
    of_run: Array
    precision: Array
    run_precision: Array
    targets: Array

    @property
    def wanted(self) -> int:
        """Number of coefficients that are sought."""
        return int(self.targets.shape[1])

    def rows(self, runs: int) -> Array:
        """Return the rows of every candidate in every run: (runs, candidates, columns + runs * effects)."""
        (candidates, columns), effects = self.common.shape, self.of_run.shape[1]
        rows = np.zeros((runs, candidates, columns + runs * effects))
        rows[:, :, :columns] = self.common
        for run in range(runs):
            start = columns + run * effects
            rows[run, :, start : start + effects] = self.of_run
        return rows

    def before(self, runs: int) -> Array:
        """Return the information that is there before any row."""
        return np.diag(np.concatenate([self.precision, np.tile(self.run_precision, runs)]))

    def information(self, points: NDArray[np.intp], run: NDArray[np.intp], runs: int) -> Array:
        """Return the information of rows, with what is known beforehand."""
        return _information(self.rows(runs), self.before(runs), points, run)


def _information(rows: Array, before: Array, points: NDArray[np.intp], run: NDArray[np.intp]) -> Array:
    order = np.argsort(run, kind="stable")
    chosen = rows[run[order], points[order]]
    return np.asarray(chosen.T @ chosen + before)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Price:
    """What a row takes beside what it tells: ``minutes`` of every candidate, and ``setup`` of its mount.

    A mount (numbers from 0, of every candidate) is set up once in each run that has a row of it; below 0 it
    is none. ``weight`` is what the criterion pays for a minute.
    """

    mount: NDArray[np.intp]
    minutes: Array
    setup: Array
    weight: float

    def added(self, rows: NDArray[np.intp]) -> Array:
        """Return what each candidate costs in a run that has these rows."""
        absent = ~np.isin(self.mount, self.mount[rows]) & (self.mount >= 0)
        return self.weight * (self.minutes + self.setup * absent)

    def total(self, points: NDArray[np.intp], run: NDArray[np.intp]) -> float:
        """Return the minutes of a design."""
        pairs = {
            (r, self.mount[at]): self.setup[at] for r, at in zip(run.tolist(), points.tolist(), strict=True)
        }
        mounted = sum(float(setup) for (_, mount), setup in pairs.items() if mount >= 0)
        return float(self.minutes[points].sum()) + mounted


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Span:
    """In so many ``runs`` at least one of some candidates (``among``, one mark a candidate) has to stand."""

    among: NDArray[np.bool_]
    runs: int

    def lacking(self, points: NDArray[np.intp], run: NDArray[np.intp]) -> int:
        """Return in how many runs too few they stand in a design."""
        return max(self.runs - len(np.unique(run[self.among[points]])), 0)


def loss(
    responses: Sequence[Response],
    points: NDArray[np.intp],
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
        information = response.information(points, run, runs)
        information = information + ridge * np.eye(len(information))
        if np.linalg.matrix_rank(information, hermitian=True) < len(information):
            return float("inf")
        covariance = np.asarray(np.linalg.inv(information)[: response.wanted, : response.wanted], np.float64)
        values.append(np.array(criterion(covariance, response.targets, by)))
    return float(together(values, by))


def exchange(
    responses: Sequence[Response],
    run: NDArray[np.intp],
    by: Criterion,
    rng: np.random.Generator,
    *,
    starts: int = 4,
    price: Price | None = None,
    once: bool = False,
    spans: Sequence[Span] = (),
) -> NDArray[np.intp]:
    """Return the candidates (rows,) of the best design found for rows in given runs (numbered from 0).

    With a ``price`` the criterion pays for what the rows take; ``once``: no run has a candidate twice.
    ``spans`` are kept before anything else counts, as far as the rows allow.
    """
    runs = int(run.max()) + 1
    rows = _Rows(
        responses=responses, run=run, by=by, price=price, once=once, spans=spans,
        of_candidates=[response.rows(runs) for response in responses],
        before=[response.before(runs) for response in responses],
    )  # fmt: skip
    return best_of(
        (rows.drawn(rng) for _ in range(starts)),
        lambda start: exchanged(start, rows.alternatives, lambda: rng.permutation(len(run)).tolist()),
        rows.loss,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Rows:
    """The rows of a session as parts of a design: each may be any candidate, in its own run.

    ``of_candidates`` and ``before`` are `Response.rows` and `Response.before` of each response: thousands of
    exchanges ask for them.
    """

    responses: Sequence[Response]
    run: NDArray[np.intp]
    by: Criterion
    price: Price | None
    once: bool
    spans: Sequence[Span]
    of_candidates: Sequence[Array]
    before: Sequence[Array]

    def drawn(self, rng: np.random.Generator) -> NDArray[np.intp]:
        """Return a design (rows,) drawn at random."""
        count = len(self.responses[0].common)
        first = np.concatenate(
            [rng.choice(count, size=size, replace=not self.once) for size in np.bincount(self.run).tolist()]
        )
        return np.asarray(first[np.argsort(np.argsort(self.run, kind="stable"))])

    def loss(self, points: NDArray[np.intp]) -> float:
        value = loss(self.responses, points, self.run, self.by, _RIDGE)
        value += sum(_LACKING * span.lacking(points, self.run) for span in self.spans)
        return value + (0.0 if self.price is None else self.price.weight * self.price.total(points, self.run))

    def alternatives(self, points: NDArray[np.intp], at: int) -> Alternatives[NDArray[np.intp]]:
        remaining, run_of_rest = np.delete(points, at), np.delete(self.run, at)
        losses = self._losses(remaining, run_of_rest, int(self.run[at]))
        beside = remaining[run_of_rest == self.run[at]]
        if self.price is not None:
            losses = losses + self.price.added(beside)
        for span in self.spans:
            runs = set(run_of_rest[span.among[remaining]].tolist())
            if (lacking := span.runs - len(runs)) > 0:
                adds = span.among & (int(self.run[at]) not in runs)
                losses = losses + _LACKING * np.maximum(lacking - adds, 0)
        if self.once:
            losses[beside] = np.inf

        def exchanged_for(candidate: int) -> NDArray[np.intp]:
            design = points.copy()
            design[at] = candidate
            return design

        return Alternatives(losses=losses, present=int(points[at]), design=exchanged_for)

    def _losses(self, remaining: NDArray[np.intp], run_of_rest: NDArray[np.intp], run: int) -> Array:
        """Return the criterion (candidates,) of what remains with each candidate added to a run."""
        values = []
        for response, rows, before in zip(self.responses, self.of_candidates, self.before, strict=True):
            information = _information(rows, before, remaining, run_of_rest)
            covariance = np.asarray(np.linalg.inv(information + _RIDGE * np.eye(len(information))))
            values.append(with_each_row(covariance, rows[run], response.targets, self.by))
        return together(values, self.by)
