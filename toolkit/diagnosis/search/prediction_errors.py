"""Prediction errors of an equation led along its recording, and how they answer to terms in it.

Where the plant was, a term has the size that it had there, whatever the simulation lacks besides: the errors
from row to row answer to every term, and to every parameter with its prior, in proportion.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.along_recording import followed_along
from toolkit.diagnosis.search.candidates import CandidateEffect, Start, candidates
from toolkit.diagnosis.search.case_view import CaseView
from toolkit.diagnosis.search.screen import Scored
from toolkit.diagnosis.simulators.simulator import TermPattern
from toolkit.diagnosis.simulators.states import usual_step, way_of
from toolkit.effects.law import ITSELF, POSITION, TIME

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.diagnosis.simulators.following import Followed
    from toolkit.effects.facts import Values
    from toolkit.effects.surroundings import MotionSizes


def errors_along(problem: Problem, base: Fit, steadier: float) -> PredictionErrors | None:
    """Return the prediction errors of a fit's equation; None where it cannot be followed."""
    made = followed_along(problem, base, steadier)
    return None if made is None else PredictionErrors(problem, base, *made)


class FollowedView(CaseView):
    """A case whose motion has the sizes of the followed states: a simulation may never come so far."""

    def __init__(self, followed: Followed, problem: Problem, channel: str | None, source: str | None) -> None:
        super().__init__(problem, channel, source)
        self._followed = followed

    @cached_property
    def motion(self) -> MotionSizes:
        """Sizes of the followed motion."""
        sizes, moving = super().motion, self._problem.model.capability.motion
        names = [state.name for state in moving.states] if moving is not None else []
        if moving is None or self.channel not in names:
            return sizes
        x = self._followed.states
        own = x[names.index(self.channel)]
        position = moving.position(self.channel)
        place = own if position is None else x[names.index(position)]
        spread = float(np.std(place))
        if position is None:
            runs = [own[rows] for rows in self._problem.slices]
            spread = way_of(runs, [run.t for run in self._problem.runs])
        return replace(
            sizes, fastest=float(np.abs(own).max()), farthest=float(np.abs(place).max()),
            speed=float(np.std(own)) or sizes.speed, place=spread or sizes.place,
            level=float(own.max()) or sizes.level,
        )  # fmt: skip

    @property
    def way(self) -> tuple[float, float]:
        """Longest way of a run over the followed position and the usual one from row to row.

        A simulation that lacks what stops it goes farther: what the plant saw once would look periodic.
        """
        moving = self._problem.model.capability.motion
        if moving is None or self.channel is None:
            return super().way
        names = [state.name for state in moving.states]
        position = moving.position(self.channel)
        if position not in names:
            return super().way
        place = self._followed.states[names.index(position)]
        runs = [place[rows] for rows in self._problem.slices if rows.stop > rows.start]
        return max(float(np.ptp(run)) for run in runs), usual_step(runs)


class PredictionErrors:
    """Prediction errors with the priors beneath, off what the nominal parameters take of them."""

    def __init__(
        self, problem: Problem, base: Fit, followed: Followed, answers: Array, taken: Array | None = None
    ) -> None:
        self._problem, self._base, self._followed, self._answered = problem, base, followed, answers
        moving = problem.model.capability.motion
        self._names = [state.name for state in moving.states] if moving is not None else []
        self._position = {name: moving.position(name) or name for name in self._names} if moving else {}
        self._read = np.isfinite(followed.errors)
        self._columns = np.vstack([answers[self._read], np.eye(len(problem.free))])
        off = -problem.off_priors(base.p)
        self._target = np.concatenate([followed.errors[self._read], off])
        spanned = self._columns if taken is None else np.hstack([self._columns, taken])
        self._span = np.linalg.qr(spanned)[0] if spanned.shape[1] else np.zeros((len(self._target), 0))
        self._left = self._off(self._target[:, None])[:, 0]
        self._rest = float(self._left @ self._left)
        self._ends = np.array([rows.stop - 1 for rows in problem.slices[:-1]], dtype=np.intp)
        interval = np.diff(np.concatenate([run.t for run in problem.runs]))
        interval[self._ends] = 1.0
        self._rates = followed.rates / interval

    @property
    def n(self) -> int:
        """Number of prediction errors."""
        return int(self._read.sum())

    @property
    def likelihood(self) -> float:
        """Log-likelihood of the recording with the process noise of this following, but for a constant."""
        return self._followed.log_scale - 0.5 * self._rest

    def listed(self) -> list[CandidateEffect]:
        """Return the terms of an equation that are not in it."""
        present = {applied.key for applied in self._base.active}
        return [
            candidate
            for candidate in candidates(
                self._problem, view=lambda *place: FollowedView(self._followed, *place)
            )
            if candidate.active.effect.term is not None and candidate.key not in present
        ]

    def share(self, gain: float) -> float:
        """Return the share of the prediction errors' square that a term of such a gain takes."""
        return float(-np.expm1(-gain / max(self.n, 1)))

    def p_value(self, scored: Scored, tests: int) -> float:
        """Return the chance that the best of so many tests has such a gain where nothing is missing."""
        from scipy.stats import chi2

        return min(1.0, float(chi2.sf(max(scored.gain, 0.0), scored.dof)) * tests)

    def ranked(self, listed: Sequence[CandidateEffect]) -> list[Scored]:
        """Return candidates from the start that takes most, at the size that does, the best first."""
        best = []
        for candidate in listed:
            made = [self._scored(candidate, start) for start in candidate.starts]
            best += sorted((scored for scored in made if scored), key=lambda scored: -scored.gain)[:1]
        return sorted(best, key=lambda scored: -scored.gain)

    def beside(self, chosen: Sequence[Scored]) -> PredictionErrors:
        """Return what is left beside some candidates, whatever their sizes."""
        taken = np.hstack([self._response(scored.candidate, scored.start) for scored in chosen])
        return PredictionErrors(self._problem, self._base, self._followed, self._answered, taken)

    def sized(self, chosen: Sequence[Scored]) -> list[Scored] | None:
        """Return candidates at their sizes beside each other; None where one would have an impossible one."""
        parts = [self._response(scored.candidate, scored.start) for scored in chosen]
        limited = [_limits(scored.candidate) for scored in chosen]
        target = self._target - sum(
            (part.sum(axis=1) for part, limit in zip(parts, limited, strict=True) if limit),
            start=np.zeros(len(self._target)),
        )
        free = [part for part, limit in zip(parts, limited, strict=True) if not limit]
        solved = np.linalg.lstsq(np.hstack([self._columns, *free]), target, rcond=1e-9)[0]
        p, at = self._moved(solved), len(self._problem.free)
        sized = []
        for scored, part, limit in zip(chosen, parts, limited, strict=True):
            if limit:
                sized.append(replace(scored, p=p))
                continue
            reached = scored.valued(solved[at : at + part.shape[1]].tolist())
            at += part.shape[1]
            if reached is None:
                return None
            sized.append(replace(scored, active=reached, p=p))
        return sized

    def _response(self, candidate: CandidateEffect, start: Start) -> Array:
        answers = self._answers(candidate, start)
        return np.zeros((len(self._target), 0)) if answers is None else answers

    def _scored(self, candidate: CandidateEffect, start: Start) -> Scored | None:
        raw = self._response(candidate, start)
        if not raw.shape[1]:
            return None
        limited = _limits(candidate)
        gain, coefficients = self.gain(raw, sizes=np.ones(raw.shape[1]) if limited else None)
        if not gain > 0:
            return None
        scored = Scored(
            candidate=candidate, start=start, active=replace(candidate.active, values=start.values),
            gain=gain, directions={}, block=np.zeros((0, 0)), trust=1.0,
            p=self.parameters(raw @ coefficients),
        )  # fmt: skip
        if limited:
            return scored
        reached = scored.valued(coefficients.tolist())
        return None if reached is None else replace(scored, active=reached)

    def gain(self, answers: Array, sizes: Array | None = None) -> tuple[float, Array]:
        """Return twice what terms gain of the log-likelihood, and their sizes: the best where none are given.

        Parameters
        ----------
        answers : of the errors to terms of size one, (errors, terms)
        """
        columns = self._off(answers)
        if sizes is None:
            sizes = np.asarray(np.linalg.lstsq(columns, self._left, rcond=1e-9)[0])
        left = self._left - columns @ sizes
        return self.n * float(np.log(self._rest / max(float(left @ left), 1e-300))), sizes

    def parameters(self, answered: Array) -> tuple[float, ...]:
        """Return the free parameters at their best beside terms to which the errors answer so."""
        return self._moved(np.asarray(np.linalg.lstsq(self._columns, self._target - answered, rcond=1e-9)[0]))

    def _moved(self, moved: Array) -> tuple[float, ...]:
        """Return the free parameters moved by so many prior sd, within their bounds."""
        return tuple(
            float(np.clip(value + by * (parameter.sd or 1.0), *(parameter.bounds or (-np.inf, np.inf))))
            for value, by, parameter in zip(self._base.p, moved, self._problem.free, strict=False)
        )

    def _off(self, columns: Array) -> Array:
        return np.asarray(columns - self._span @ (self._span.T @ columns))

    def _answers(self, candidate: CandidateEffect, start: Start) -> Array | None:
        """Return how the prediction errors answer to a start's directions, with zeros for the priors."""
        channel = str(candidate.active.channel)
        if channel not in self._names:
            return None
        at = self._names.index(channel)
        with np.errstate(all="ignore"):
            if _limits(candidate):
                force = self._held_up(candidate, start.values, at)[:, None]
            else:
                force = self._forces(candidate, start, at)
        if not np.isfinite(force).all() or not np.abs(force).max(initial=0.0) > 0:
            return None
        for run, rows in zip(self._problem.runs, self._problem.slices, strict=True):
            if not candidate.active.acts_in(run):
                force[rows.start : rows.stop - 1] = 0.0
        spilt = self._spilt(candidate, start.values)
        return self._answered_to(force, {at: -1.0} | ({} if spilt is None else {spilt[0]: spilt[1]}))

    def answers_to(self, channel: str, terms: TermPattern) -> Array:
        """Return how the prediction errors answer to terms in the equation of a state, (errors, terms).

        The priors are beneath; a term is none where it is no number.
        """
        at = self._names.index(channel)
        with np.errstate(all="ignore"):
            return self._answered_to(np.nan_to_num(self._of_intervals(terms, at)), {at: -1.0})

    def _answered_to(self, force: Array, entering: Mapping[int, float]) -> Array:
        """Return the answers to forces over every interval, (rows - 1, forces), and the zeros of the priors.

        Parameters
        ----------
        entering : states whose rates they change, and by how many times themselves
        """
        force[self._ends] = 0.0
        added = np.sum(
            [
                times * self._followed.entry[:, :, at].T[:, None] * force.T[None]
                for at, times in entering.items()
            ],
            axis=0,
        )
        answers = self._followed.answers(added)[self._read]
        return np.vstack([answers, np.zeros((len(self._problem.free), answers.shape[1]))])

    def _forces(self, candidate: CandidateEffect, start: Start, at: int) -> Array:
        """Return the mean of a candidate's term over every interval, (rows - 1, directions)."""
        # A pattern has its directions in blocks of its own; any other term one for each set of values.
        values = (start.values,) if candidate.has_pattern else start.directions
        return self._of_intervals(TermPattern(((candidate.active.effect, tuple(values)),)), at)

    def _of_intervals(self, terms: TermPattern, at: int) -> Array:
        """Return the means of terms in the equation of a state over every interval, (rows - 1, terms)."""
        x = self._followed.states
        inputs = {
            driver.name: np.concatenate([run.columns[driver.name] for run in self._problem.runs])
            for driver in self._problem.case.drivers
            if all(driver.name in run.columns for run in self._problem.runs)
        }
        signals = {
            **inputs, **dict(zip(self._names, x, strict=False)),
            TIME: np.concatenate([run.t for run in self._problem.runs]),
            ITSELF: x[at], POSITION: x[self._names.index(self._position[self._names[at]])],
        }  # fmt: skip
        force = terms(signals)
        return np.asarray(0.5 * (force[1:] + force[:-1]))

    def _spilt(self, candidate: CandidateEffect, values: Values) -> tuple[int, float] | None:
        """Return the state to which a part of what is held back comes, and which part."""
        term = candidate.active.effect.term
        to = CaseView(self._problem, candidate.active.channel).motion.feeds
        if term is None or term.spill is None or to not in self._names:
            return None
        return self._names.index(to), values.get(term.spill, 0.0)

    def _held_up(self, candidate: CandidateEffect, values: Values, at: int) -> Array:
        """Return by how much a limit lowers the mean rate of a state that rises, (rows - 1,)."""
        term = candidate.active.effect.term
        if term is None or term.limit is None:
            return np.zeros(self._rates.shape[1])
        left = term.limit(self._followed.states[at], float(self._followed.spread[at]), values)
        free = 0.5 * (left[1:] + left[:-1])
        return np.asarray(np.maximum(self._rates[at], 0.0) * (1 - free))


def _limits(candidate: CandidateEffect) -> bool:
    term = candidate.active.effect.term
    return term is not None and term.limit is not None
