"""Terms that an equation lacks, proposed along the recording itself.

The screen of free simulations asks what a candidate would change where the simulation is. Where something
large is missing, the simulation is elsewhere than the plant, its refit has driven the parameters off, and the
true term may look small from there, or not show at all. Led along the recording (`simulators.following`) the
equation is where the plant was: the prediction errors answer to every term, and to every parameter with its
prior, in proportion. What takes most of them is fitted first, from the values that it has there.

A proposal names nothing: joint fits of free simulations and unseen runs decide, as of every candidate.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.along_recording import followed_along
from toolkit.diagnosis.policy import FOLLOWING, SCREENING
from toolkit.diagnosis.search.candidates import CandidateEffect, Start, candidates
from toolkit.diagnosis.search.case_view import CaseView
from toolkit.diagnosis.search.screen import Scored
from toolkit.diagnosis.search.unexplained import StructureFound
from toolkit.diagnosis.simulators.simulator import TermPattern
from toolkit.diagnosis.simulators.states import usual_step, way_of
from toolkit.effects.law import ITSELF, POSITION, TIME

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.diagnosis.simulators.following import Followed
    from toolkit.effects.applied import EffectKey
    from toolkit.effects.facts import Values
    from toolkit.effects.surroundings import MotionSizes

    Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Proposals:
    """Terms that take a good part of the prediction errors, the best first, and those that take next to none.

    ``together`` are terms of which each takes a good part of what those before it leave, with their sizes
    beside each other; one alone is none. ``p_of`` has the p-value of every term, by its identity.
    ``hopeless`` take next to nothing beside the best, or no more than chance where none takes a good part.
    """

    scored: tuple[Scored, ...]
    together: tuple[Scored, ...]
    p_of: dict[int, float]
    hopeless: frozenset[EffectKey]

    def is_worth(self, candidate: CandidateEffect) -> bool:
        """Tell whether a candidate is worth a free simulation.

        One that turns or runs against a limit costs many times another: a hopeless one is left out.
        """
        term = candidate.active.effect.term
        abrupt = term is not None and (term.limit is not None or term.bristle is not None)
        return candidate.key not in self.hopeless or not abrupt

    def unconfirmed(self, problem: Problem) -> tuple[StructureFound, ...]:
        """Return what prediction errors show and no free simulation confirms: no name, and not nothing."""
        if not self.scored:
            return ()
        best = self.scored[0]
        place = (str(best.candidate.active.channel),)
        return tuple(
            StructureFound(
                output=name,
                variables=place,
                reason="from row to row",
                gain=best.gain,
                p_value=self.p_of[id(best)],
                rest=True,
            )
            for name in problem.names
            if problem.kept[name].any()
        )


NONE = Proposals((), (), {}, frozenset())


def proposals(problem: Problem, base: Fit) -> Proposals:
    """Return what the prediction errors of a fit propose; nothing where its equation cannot be followed."""
    if not problem.names:
        return NONE

    def errors_along(steadier: float) -> _PredictionErrors | None:
        return _errors_along(problem, base, steadier)

    usual = errors_along(1.0)
    if usual is None:
        return NONE
    found = _shown(usual)
    if found.scored:
        return found
    likeliest, plain = -np.inf, usual.likelihood
    steadiest = found
    for steadier in FOLLOWING.steadier:
        errors = errors_along(steadier)
        if errors is None:
            break
        plain = max(plain, errors.likelihood)
        made = _shown(errors)
        if made.scored:
            likelihood = errors.beside(made.together or made.scored[:1]).likelihood
            if likelihood > likeliest:
                steadiest, likeliest = made, likelihood
    return steadiest if likeliest > plain else found


def likelihood_along(problem: Problem, base: Fit) -> float | None:
    """Return how likely a recording is to a fit's equation that wanders as is likeliest, but for a constant.

    The logarithm, with the priors in it and the parameters at their best; None where no equation can be led
    along its recording.
    """
    errors = _errors_along(problem, base, 1.0)
    return None if errors is None else errors.likelihood


def _errors_along(problem: Problem, base: Fit, steadier: float) -> _PredictionErrors | None:
    """Return the prediction errors of a fit's equation; None where it cannot be followed."""
    made = followed_along(problem, base, steadier)
    return None if made is None else _PredictionErrors(problem, base, *made)


def _shown(errors: _PredictionErrors) -> Proposals:
    """Return the terms that take a good part of prediction errors."""
    listed = errors.listed()
    tests = sum(len(candidate.starts) for candidate in listed)
    seen = errors.ranked(listed)
    p_of = {id(scored): errors.p_value(scored, tests) for scored in seen}
    shown = [
        scored
        for scored in seen
        if errors.share(scored) > FOLLOWING.least
        and p_of[id(scored)] < SCREENING.alpha
        and scored.gain > FOLLOWING.near * seen[0].gain
    ]
    best = {scored.candidate.key: scored for scored in seen}
    if not shown:
        idle = (key for key, scored in best.items() if errors.p_value(scored, 1) > FOLLOWING.idle)
        unseen = (candidate.key for candidate in listed if candidate.key not in best)
        return replace(NONE, hopeless=frozenset((*idle, *unseen)))
    hopeless = frozenset(
        candidate.key
        for candidate in listed
        if candidate.key not in best or best[candidate.key].gain < FOLLOWING.hopeless * seen[0].gain
    )
    together = _pursued(errors, shown[0], listed, tests)
    p_of |= {id(scored): p_value for scored, p_value in together}
    return Proposals(tuple(shown), tuple(scored for scored, _ in together), p_of, hopeless)


def _pursued(
    errors: _PredictionErrors, first: Scored, listed: Sequence[CandidateEffect], tests: int
) -> list[tuple[Scored, float]]:
    """Return terms with their p-values, each the best beside those before it (orthogonal matching pursuit).

    An offset beside dry friction moves a body as far as the friction does: no simulation comes near without
    both.
    """
    chosen, p_values = [first], [errors.p_value(first, tests)]
    while len(chosen) < FOLLOWING.together:
        beside = errors.beside(chosen)
        keys = {scored.candidate.key for scored in chosen}
        ranked = beside.ranked([candidate for candidate in listed if candidate.key not in keys])
        if not ranked or beside.share(ranked[0]) < FOLLOWING.later:
            break
        p_value = beside.p_value(ranked[0], tests)
        if p_value >= SCREENING.alpha:
            break
        chosen, p_values = [*chosen, ranked[0]], [*p_values, p_value]
    if len(chosen) < 2:
        return []
    sized = errors.sized(chosen)
    return [] if sized is None else list(zip(sized, p_values, strict=True))


class _FollowedView(CaseView):
    """A case whose motion has the sizes of the followed states: a simulation may never come so far."""

    def __init__(self, followed: Followed, problem: Problem, channel: str | None, source: str | None) -> None:
        super().__init__(problem, channel, source)
        self._followed = followed

    @cached_property
    def motion(self) -> MotionSizes:
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


class _PredictionErrors:
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
                self._problem, view=lambda *place: _FollowedView(self._followed, *place)
            )
            if candidate.active.effect.term is not None and candidate.key not in present
        ]

    def share(self, scored: Scored) -> float:
        """Return the share of the prediction errors' square that a candidate takes."""
        return float(-np.expm1(-scored.gain / max(self.n, 1)))

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

    def beside(self, chosen: Sequence[Scored]) -> _PredictionErrors:
        """Return what is left beside some candidates, whatever their sizes."""
        taken = np.hstack([self._response(scored.candidate, scored.start) for scored in chosen])
        return _PredictionErrors(self._problem, self._base, self._followed, self._answered, taken)

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
        p, at = self._parameters(solved), len(self._problem.free)
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
        limited, columns = _limits(candidate), self._off(raw)
        coefficients: Array = np.ones(columns.shape[1])
        if not limited:
            coefficients = np.asarray(np.linalg.lstsq(columns, self._left, rcond=1e-9)[0])
        left = self._left - columns @ coefficients
        gain = self.n * float(np.log(self._rest / max(float(left @ left), 1e-300)))
        if not gain > 0:
            return None
        beside = np.linalg.lstsq(self._columns, self._target - raw @ coefficients, rcond=1e-9)[0]
        scored = Scored(
            candidate=candidate, start=start, active=replace(candidate.active, values=start.values),
            gain=gain, directions={}, block=np.zeros((0, 0)), trust=1.0, p=self._parameters(beside),
        )  # fmt: skip
        if limited:
            return scored
        reached = scored.valued(coefficients.tolist())
        return None if reached is None else replace(scored, active=reached)

    def _parameters(self, moved: NDArray[np.floating]) -> tuple[float, ...]:
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
        force[self._ends] = 0.0
        added = -self._followed.entry[:, :, at].T[:, None, :] * force.T[None]
        spilt = self._spilt(candidate, start.values)
        if spilt is not None:
            to, share = spilt
            added += share * self._followed.entry[:, :, to].T[:, None, :] * force.T[None]
        answers = self._followed.answers(added)[self._read]
        return np.vstack([answers, np.zeros((len(self._problem.free), answers.shape[1]))])

    def _forces(self, candidate: CandidateEffect, start: Start, at: int) -> Array:
        """Return the mean of a term over every interval, (rows - 1, directions)."""
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
        # A pattern has its directions in blocks of its own; any other term one for each set of values.
        values = (start.values,) if candidate.has_pattern else start.directions
        force = TermPattern(((candidate.active.effect, tuple(values)),))(signals)
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
