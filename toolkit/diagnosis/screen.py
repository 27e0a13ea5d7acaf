"""Screening: how much each candidate would improve the fit, linearised, noise estimated anew for each.

Ranks candidates; it never decides. The improvement of a candidate is the gain of the log-likelihood when its
responses are fitted beside the nominal parameters, by generalised least squares with the noise of what then
remains: a noise that was estimated with the effect in it would hide the effect.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.candidates import Candidate
from toolkit.diagnosis.fit import Fit, jacobian, log_prior
from toolkit.diagnosis.model import Active
from toolkit.diagnosis.noise import Layout, Noise, fit_noise, log_likelihood, whiten
from toolkit.errors import FitError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.diagnosis.problem import Problem

    Stacked = dict[str, NDArray[np.float64]]

_TURNS = 2
_COLLINEAR = 1e-11  # of the largest eigenvalue: what lies below adds nothing that could be told apart


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scored:
    """One candidate from one start: the gain of twice the log-likelihood and where a fit should begin.

    ``directions`` are its responses over all rows of each output, one column for each amplitude.
    """

    candidate: Candidate
    active: Active
    gain: float
    directions: Stacked
    coefficients: tuple[float, ...]

    @property
    def dof(self) -> int:
        """Number of parameters that were searched."""
        return max(len(self.candidate.active.searched), 1)


@dataclass(frozen=True, slots=True, eq=False)
class Screen:
    """What every candidate is held against: a fit, its Jacobian and its noise."""

    problem: Problem
    base: Fit
    columns: Stacked
    sizes: NDArray[np.float64]
    layouts: dict[str, Layout]
    log_likelihood: float

    @staticmethod
    def of(problem: Problem, base: Fit) -> Screen:
        """Return the screen about a fit."""
        columns, sizes = jacobian(problem, base)
        layouts = {name: problem.layout(name) for name in problem.names}
        return Screen(problem, base, columns, sizes, layouts, base.log_posterior)

    def score(self, candidate: Candidate) -> list[Scored]:
        """Return the gains of a candidate, one for each start that the simulation can run."""
        made = []
        for start in candidate.starts:
            responses = []
            try:
                for values in start.directions:
                    one = replace(candidate.active, values=values)
                    moved = self.problem.simulate(self.base.p, (*self.base.active, one))
                    responses.append({name: moved[name] - self.base.simulated[name] for name in moved})
            except FitError:
                continue
            directions = {
                name: np.stack([one[name] for one in responses], axis=1) for name in self.problem.names
            }
            if not any(np.isfinite(one).all() and np.abs(one).max() > 0 for one in directions.values()):
                continue
            directions = {name: np.nan_to_num(one) for name, one in directions.items()}
            gain, coefficients = self.gain(directions, fixed=candidate.discrete)
            values = dict(start.values)
            for name, c in zip(start.amplitudes, coefficients, strict=False):
                off = next(one.off for one in candidate.active.effect.parameters if one.name == name) or 0.0
                if math.isfinite(off) and not candidate.discrete:
                    values[name] = off + c * (start.values[name] - off)
            made.append(
                Scored(
                    candidate=candidate, active=replace(candidate.active, values=values), gain=gain,
                    directions=directions, coefficients=coefficients,
                )
            )  # fmt: skip
        return made

    def gain(self, directions: Stacked, *, fixed: bool = False) -> tuple[float, tuple[float, ...]]:
        """Return twice the gain of the log-likelihood, and the responses' coefficients.

        ``fixed`` takes the responses as they are (coefficients one) and fits the nominal parameters alone.
        """
        width = next(iter(directions.values())).shape[1]
        best, chosen = -math.inf, tuple([1.0] * width)
        for first in (self.base.noise, None):
            known = first
            for _ in range(_TURNS):
                made = self._once(directions, known, fixed=fixed)
                if made is None:
                    break
                value, coefficients, known = made
                if value > best:
                    best, chosen = value, coefficients
        return 2 * (best - self.log_likelihood), chosen

    def _once(
        self, directions: Stacked, noise: dict[str, Noise] | None, *, fixed: bool
    ) -> tuple[float, tuple[float, ...], dict[str, Noise]] | None:
        problem, base = self.problem, self.base
        n_p = len(self.sizes)
        width = 0 if fixed else next(iter(directions.values())).shape[1]
        blocks, targets = [], []
        for name, where in self.layouts.items():
            at = where.index
            r = base.residual[name][at]
            if fixed:
                r = r - directions[name][at].sum(axis=1)
            matrix = self.columns[name][at]
            if not fixed:
                matrix = np.hstack([matrix, directions[name][at]])
            used = noise[name] if noise is not None else Noise(reflection=(), sd=_rms(r) or 1.0)
            white = whiten(np.hstack([matrix, r[:, None]]), where, used)
            blocks.append(white[:, :-1])
            targets.append(white[:, -1])
        free = problem.free
        prior = np.zeros((len(free), n_p + width))
        for i, one in enumerate(free):
            prior[i, i] = self.sizes[i] / (one.sd or 1.0)
        at_prior = [-(v - one.value) / (one.sd or 1.0) for v, one in zip(base.p, free, strict=True)]
        found = _solved([*blocks, prior], [*targets, np.array(at_prior)])
        if not np.isfinite(found).all():
            return None
        total, made = 0.0, {}
        p = np.array(base.p) + found[: len(free)] * self.sizes[: len(free)]
        total += log_prior(problem, p.tolist())
        for name, where in self.layouts.items():
            at = where.index
            left = base.residual[name][at] - self.columns[name][at] @ found[:n_p]
            left = left - (directions[name][at].sum(axis=1) if fixed else directions[name][at] @ found[n_p:])
            made[name] = fit_noise(
                left,
                where,
                floor=problem.floor[name],
                sd=problem.sd_of(name),
                used=len(found) // len(self.layouts),
            )
            total += log_likelihood(left, where, made[name])
        coefficients = (
            tuple([1.0] * next(iter(directions.values())).shape[1]) if fixed else tuple(found[n_p:].tolist())
        )
        return total, coefficients, made


def best_of(scored: Sequence[Scored]) -> list[Scored]:
    """Return the best start of every candidate, best first."""
    best: dict[object, Scored] = {}
    for one in scored:
        key = one.candidate.key
        if key not in best or one.gain > best[key].gain:
            best[key] = one
    return sorted(best.values(), key=lambda one: -one.gain)


def _solved(blocks: list[NDArray[np.float64]], targets: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return least squares by normal equations on scaled columns: quick, and enough to rank."""
    gram = sum(one.T @ one for one in blocks)
    right = sum(one.T @ target for one, target in zip(blocks, targets, strict=True))
    gram, right = np.asarray(gram), np.asarray(right)
    if not gram.size:
        return np.zeros(0)
    size = np.sqrt(np.diag(gram))
    size[size == 0] = 1.0
    values, vectors = np.linalg.eigh(gram / np.outer(size, size))
    keep = values > _COLLINEAR * values.max()
    return np.asarray(((vectors[:, keep] / values[keep]) @ (vectors[:, keep].T @ (right / size))) / size)


def _rms(values: NDArray[np.float64]) -> float:
    return math.sqrt(float(np.mean(values**2))) if len(values) else 0.0
