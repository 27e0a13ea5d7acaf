"""Screening: how much each candidate would improve the fit, linearised, noise estimated anew for each.

Ranks candidates; it never decides. The improvement of a candidate is the gain of the log-likelihood when its
responses are fitted beside the nominal parameters, by generalised least squares with the noise of what then
remains: a noise that was estimated with the effect in it would hide the effect.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.fit import Fit, jacobian, log_prior
from toolkit.diagnosis.fit.noise import Autoregression, Layout, fit_noise, log_likelihood, whiten
from toolkit.diagnosis.policy import SCREENING
from toolkit.diagnosis.search.candidates import CandidateEffect, Start
from toolkit.diagnosis.simulators.simulator import TermPattern
from toolkit.effects.applied import AppliedEffect
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.problem import Problem

    Stacked = dict[str, Array]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scored:
    """One candidate from one start: the gain of twice the log-likelihood and where a fit should begin.

    ``directions`` are its responses over all rows of each output, one column for each amplitude; ``block``
    the same whitened, off the nominal parameters, orthonormal. A gain is first a quick one, at the noise of
    the fit or at white noise, whichever is larger; `LinearisedFit.sharpened` makes the best ones exact.
    ``p`` are free parameters with which it was seen, where those are not the fit's.
    """

    candidate: CandidateEffect
    start: Start
    active: AppliedEffect
    gain: float
    directions: Stacked
    block: Array
    trust: float
    p: tuple[float, ...] | None = None

    @property
    def dof(self) -> int:
        """Number of parameters that were searched."""
        return max(len(self.candidate.active.searched), 1)

    @property
    def _off(self) -> dict[str, float]:
        """Of every amplitude the value at which the effect is not there."""
        parameters = {parameter.name: parameter for parameter in self.active.effect.parameters}
        off = {name: parameters[name].off or 0.0 for name in self.start.amplitudes}
        return {name: value for name, value in off.items() if math.isfinite(value)}

    def reached(self, coefficients: Sequence[float]) -> AppliedEffect:
        """Return the effect with the values that coefficients of its directions stand for."""
        values = self.start.reached(coefficients, self._off) if coefficients else dict(self.start.values)
        return replace(self.active, values=values)

    def valued(self, coefficients: Sequence[float]) -> AppliedEffect | None:
        """Return the same; None where the other sign would fit, and the effect has one only."""
        reached, off = self.reached(coefficients), self._off
        lowest = {parameter.name: parameter.bounds[0] for parameter in self.active.effect.parameters}
        if len(off) == 1 and any(reached.values[name] < lowest[name] for name in off):
            return None
        return reached


def trust_of(worth: float) -> float:
    """Return the share of a gain that coloured series of so many independent values leave."""
    return max(SCREENING.least_trust, 1 - SCREENING.short / max(worth, 1.0))


@dataclass(frozen=True, slots=True, eq=False)
class Weighed:
    """Rows of all outputs under one noise, with the priors beneath; what the nominal parameters span."""

    noise: dict[str, Autoregression]
    span: Array
    left: Array

    @property
    def rest(self) -> float:
        """Sum of squares that the nominal parameters leave."""
        return float(self.left @ self.left)


@dataclass(frozen=True, slots=True, eq=False)
class LinearisedFit:
    """What every candidate is held against: a fit, its Jacobian, and its residual under two noises."""

    problem: Problem
    base: Fit
    columns: Stacked
    sizes: Array
    layouts: dict[str, Layout]
    log_likelihood: float
    coloured: Weighed
    white: Weighed

    @staticmethod
    def of(problem: Problem, base: Fit) -> LinearisedFit:
        """Return the screen about a fit."""
        columns, sizes = jacobian(problem, base)
        layouts = {name: problem.layout(name) for name in problem.names}
        plain = {
            name: Autoregression(reflection=(), sd=autoregression.marginal_sd, memory=autoregression.memory)
            for name, autoregression in base.noise.items()
        }
        coloured, white = (
            _weighed(problem, base, columns, sizes, layouts, noise) for noise in (base.noise, plain)
        )
        bare = LinearisedFit(problem, base, columns, sizes, layouts, 0.0, coloured, white)
        # What the nominal parameters reach by the same steps without a response: gains count from there.
        none = {name: np.zeros((problem.rows, 0)) for name in problem.names}
        reached = max(0.5 * bare.gain(none)[0], base.log_posterior)
        return replace(bare, log_likelihood=reached)

    @property
    def n(self) -> float:
        """Number of values that count, of what is no noise the independent ones."""
        return self.problem.values

    def prepare(self, candidates: Sequence[CandidateEffect]) -> None:
        """Have the simulations made at once that scoring the candidates asks for."""
        base = self.base
        listed = [
            replace(candidate.active, values=values)
            for candidate in candidates
            if not candidate.has_pattern and not self._is_pushed(candidate)
            for start in candidate.starts
            for values in start.directions
        ]
        self.problem.prepare(
            [(base.p, base.active), *((base.p, (*base.active, applied)) for applied in listed)]
        )

    def score(self, candidate: CandidateEffect) -> list[Scored]:
        """Return a candidate with its quick gains, one for each start that the simulation can run."""
        trials = []
        for start, directions in zip(candidate.starts, self._directions(candidate), strict=True):
            # Rows that do not count (a cell was lost there) may be without a response.
            counted = [columns[self.layouts[name].index] for name, columns in directions.items()]
            if not any(
                np.isfinite(response).all() and np.abs(response).max(initial=0.0) > 0 for response in counted
            ):
                continue
            directions = {name: np.nan_to_num(columns) for name, columns in directions.items()}
            gain, block = self.quick(directions, fixed=candidate.discrete, beside=self._zero(candidate))
            active = replace(candidate.active, values=start.values)
            trials.append(
                Scored(
                    candidate=candidate,
                    start=start,
                    active=active,
                    gain=gain,
                    directions=directions,
                    block=block,
                    trust=self.trust(self.base.noise),
                )
            )
        return trials

    def _directions(self, candidate: CandidateEffect) -> Iterator[Stacked]:
        """Give the responses of every start, nothing for one that the simulation cannot run."""
        if candidate.has_pattern:
            try:
                starts = [start.values for start in candidate.starts]
                yield from self.problem.patterned(self.base.p, self.base.active, candidate.active, starts)
            except FitError:
                yield from ({} for _ in candidate.starts)
            return
        if self._is_pushed(candidate):
            try:
                yield from self._pushed(candidate)
            except FitError:
                yield from ({} for _ in candidate.starts)
            return
        for start in candidate.starts:
            responses = []
            try:
                for values in start.directions:
                    applied = replace(candidate.active, values=values)
                    moved = self.problem.simulate(self.base.p, (*self.base.active, applied))
                    responses.append({name: moved[name] - self.base.simulated[name] for name in moved})
            except FitError:
                yield {}
                continue
            yield {
                name: np.stack([response[name] for response in responses], axis=1)
                for name in self.problem.names
            }

    def _is_pushed(self, candidate: CandidateEffect) -> bool:
        """Tell whether a candidate's response is taken along the motion, and not simulated.

        Friction that turns takes many times a smooth term's time, for a response that is linear while it is
        small; what it does where it is large, the equation along the recording tells.
        """
        term, moving = candidate.active.effect.term, self.problem.model.capability.motion
        return term is not None and term.bristle is not None and moving is not None and moving.integrates

    def _pushed(self, candidate: CandidateEffect) -> Iterator[Stacked]:
        """Give the linear responses of every start to small forces."""
        values = [values for start in candidate.starts for values in start.directions]
        pattern = TermPattern(((candidate.active.effect, tuple(values)),))
        base = self.base
        moved = self.problem.pushed(base.p, base.active, candidate.active, pattern, len(values))
        at = 0
        for start in candidate.starts:
            columns = slice(at, at + len(start.directions))
            at = columns.stop
            yield {name: -response[:, columns] for name, response in moved.items()}

    def _zero(self, candidate: CandidateEffect) -> Stacked | None:
        """Return an output's response to the constant beside which a candidate is seen, if there is one."""
        channel = candidate.active.channel
        if channel not in self.problem.names or not candidate.zero_beside(self.base.active):
            return None
        return {name: np.full((self.problem.rows, 1), float(name == channel)) for name in self.problem.names}

    def quick(
        self, directions: Stacked, *, fixed: bool = False, beside: Stacked | None = None
    ) -> tuple[float, Array]:
        """Return twice the gain at a fixed noise, the better of two, and the responses' orthonormal block.

        ``beside`` is a response that is free with and without them.
        """
        gains, blocks = [], []
        for under in (self.coloured, self.white):
            raw, left = self._rows(directions, under.noise), under.left
            raw = raw - under.span @ (under.span.T @ raw)
            if beside is not None:
                free = self._rows(beside, under.noise)
                free = _orthonormal(free - under.span @ (under.span.T @ free))
                raw, left = raw - free @ (free.T @ raw), left - free @ (free.T @ left)
            block = _orthonormal(raw)
            rest = float(left @ left)
            if fixed:
                remaining = float(np.sum((left - raw.sum(axis=1)) ** 2))
            else:
                remaining = rest - float(np.sum((block.T @ left) ** 2))
            gains.append(self.n * math.log(rest / max(remaining, 1e-12 * rest)))
            blocks.append(block)
        # White noise overrates what is smooth; as a first look that is what is wanted.
        return (max(gains) if self._is_coloured else gains[0]), blocks[0]

    def trust(self, noise: dict[str, Autoregression]) -> float:
        """Return the share of a gain that short coloured series leave: their noise is known from few rows.

        In the manner of Bartlett's correction, with rows counted by what they are worth; found on clean
        series of AR(1) noise. Of rows without an order no colour is known or asked for: nothing is lost.
        """
        if not self.problem.case.has_order:
            return 1.0
        return trust_of(sum(where.n / noise[name].correlation_rows for name, where in self.layouts.items()))

    @property
    def _is_coloured(self) -> bool:
        return any(autoregression.is_coloured for autoregression in self.base.noise.values())

    def rows(self, directions: Stacked) -> Array:
        """Return responses whitened by the fit's noise, (values and priors, columns)."""
        return self._rows(directions, self.coloured.noise)

    def _rows(self, directions: Stacked, noise: dict[str, Autoregression]) -> Array:
        parts = [
            whiten(directions[name][where.index], where, noise[name]) for name, where in self.layouts.items()
        ]
        none = np.zeros((len(self.problem.free), parts[0].shape[1]))
        return np.vstack([*parts, none])

    def sharpened(self, scored: Sequence[Scored], most: int) -> list[Scored]:
        """Return all of them, the ``most`` best with their exact gain and the values that reach it."""
        first: list[Scored] = []
        later: list[Scored] = []
        starts_of = Counter[object]()
        for trial in sorted(scored, key=lambda trial: -trial.gain):
            starts_of[trial.candidate.key] += 1
            chosen = len(first) < most and starts_of[trial.candidate.key] <= SCREENING.starts
            (first if chosen else later).append(trial)
        sharp = [self._exact(scored) for scored in first]
        least = min((scored.gain for scored in sharp), default=0.0)
        # What was not sharpened keeps its quick gain, but never ranks before what was.
        return [*sharp, *(replace(scored, gain=min(scored.gain, least)) for scored in later)]

    def _exact(self, trial: Scored) -> Scored:
        beside = self._zero(trial.candidate)
        if beside is None:
            gain, coefficients, trust = self.gain(trial.directions, fixed=trial.candidate.discrete)
        else:
            both = {name: np.hstack([trial.directions[name], column]) for name, column in beside.items()}
            gain, coefficients, trust = self.gain(both)
            gain, coefficients = gain - max(self.gain(beside)[0], 0.0), coefficients[:-1]
        if trial.candidate.discrete:
            return replace(trial, gain=gain, trust=trust)
        reached = trial.valued(coefficients)
        if reached is None:
            return replace(trial, gain=0.0, trust=trust, active=trial.reached(coefficients))
        return replace(trial, gain=gain, trust=trust, active=reached)

    def whitened(self) -> LinearisedFit:
        """Return the screen under white noise alone."""
        return replace(self, base=replace(self.base, noise=self.white.noise), coloured=self.white)

    def plain_gain(self, directions: Stacked) -> tuple[float, list[float]]:
        """Return twice the gain under white noise, and the responses' coefficients by least squares."""
        under = self.white
        raw = self._rows(directions, under.noise)
        raw = raw - under.span @ (under.span.T @ raw)
        coefficients = np.linalg.lstsq(raw, under.left, rcond=1e-9)[0]
        remaining = float(np.sum((under.left - raw @ coefficients) ** 2))
        return self.n * math.log(under.rest / max(remaining, 1e-12 * under.rest)), coefficients.tolist()

    def gain(self, directions: Stacked, *, fixed: bool = False) -> tuple[float, tuple[float, ...], float]:
        """Return twice the gain of the log-likelihood, the responses' coefficients, and its trust.

        ``fixed`` takes the responses as they are (coefficients one) and fits the nominal parameters alone.
        """
        width = next(iter(directions.values())).shape[1]
        best, chosen, noise_there = -math.inf, tuple([1.0] * width), self.base.noise
        for first in (self.base.noise, None) if self._is_coloured else (self.base.noise,):
            noise = first
            for _ in range(SCREENING.turns):
                linear_fit = self._once(directions, noise, fixed=fixed)
                if linear_fit is None:
                    break
                value, coefficients, noise = linear_fit
                if value > best:
                    best, chosen, noise_there = value, coefficients, noise
        return 2 * (best - self.log_likelihood), chosen, self.trust(noise_there)

    def _once(
        self, directions: Stacked, noise: dict[str, Autoregression] | None, *, fixed: bool
    ) -> tuple[float, tuple[float, ...], dict[str, Autoregression]] | None:
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
            spectrum = noise[name] if noise is not None else Autoregression(reflection=(), sd=_rms(r) or 1.0)
            white = whiten(np.hstack([matrix, r[:, None]]), where, spectrum)
            blocks.append(white[:, :-1])
            targets.append(white[:, -1])
        free = problem.free
        prior = problem.prior_rows(self.sizes, n_p + width)
        solution = _solved([*blocks, prior], [*targets, -problem.off_priors(base.p)])
        if not np.isfinite(solution).all():
            return None
        total, noise_there = 0.0, {}
        p = np.array(base.p) + solution[: len(free)] * self.sizes[: len(free)]
        total += log_prior(problem, p.tolist())
        for name, where in self.layouts.items():
            at = where.index
            remaining = base.residual[name][at] - self.columns[name][at] @ solution[:n_p]
            remaining = remaining - (
                directions[name][at].sum(axis=1) if fixed else directions[name][at] @ solution[n_p:]
            )
            noise_there[name] = fit_noise(
                remaining,
                where,
                floor=problem.floor[name],
                sd=problem.sd_of(name),
                used=len(solution) // len(self.layouts),
                memory=problem.memory.get(name),
            )
            total += log_likelihood(remaining, where, noise_there[name])
        coefficients = (
            tuple([1.0] * next(iter(directions.values())).shape[1])
            if fixed
            else tuple(solution[n_p:].tolist())
        )
        return total, coefficients, noise_there


def _weighed(
    problem: Problem,
    base: Fit,
    columns: Stacked,
    sizes: Array,
    layouts: dict[str, Layout],
    noise: dict[str, Autoregression],
) -> Weighed:
    blocks, targets = [], []
    for name, where in layouts.items():
        blocks.append(whiten(columns[name][where.index], where, noise[name]))
        targets.append(whiten(base.residual[name][where.index], where, noise[name]))
    span = _orthonormal(np.vstack([*blocks, problem.prior_rows(sizes, len(sizes))]))
    target = np.concatenate([*targets, -problem.off_priors(base.p)])
    return Weighed(noise, span, target - span @ (span.T @ target))


def _orthonormal(columns: Array) -> Array:
    """Return an orthonormal basis of columns, (rows, rank), by their Gram matrix."""
    if not columns.shape[1]:
        return columns
    size = np.sqrt((columns**2).sum(axis=0))
    scaled = columns / np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(scaled.T @ scaled)
    keep = values > 1e-10 * max(float(values.max()), 1e-300)
    basis = (scaled @ vectors[:, keep]) / np.sqrt(values[keep])
    # Once more, against what rounding left.
    q, _ = np.linalg.qr(basis)
    return np.asarray(q)


def best_of(scored: Sequence[Scored]) -> list[Scored]:
    """Return the best start of every candidate, best first."""
    best: dict[object, Scored] = {}
    for trial in scored:
        key = trial.candidate.key
        if key not in best or trial.gain > best[key].gain:
            best[key] = trial
    return sorted(best.values(), key=lambda scored: -scored.gain)


def _solved(blocks: list[Array], targets: list[Array]) -> Array:
    """Return least squares by normal equations on scaled columns: quick, and enough to rank."""
    gram = sum(block.T @ block for block in blocks)
    right = sum(block.T @ target for block, target in zip(blocks, targets, strict=True))
    gram, right = np.asarray(gram), np.asarray(right)
    if not gram.size:
        return np.zeros(0)
    size = np.sqrt(np.diag(gram))
    size[size == 0] = 1.0
    values, vectors = np.linalg.eigh(gram / np.outer(size, size))
    keep = values > SCREENING.collinear * values.max()
    return np.asarray(((vectors[:, keep] / values[keep]) @ (vectors[:, keep].T @ (right / size))) / size)


def _rms(values: Array) -> float:
    return math.sqrt(float(np.mean(values**2))) if len(values) else 0.0
