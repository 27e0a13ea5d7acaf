"""The members of a diagnosis' class, each fitted in the others' place, and what each predicts of a run.

A prediction is Gaussian: the simulation at the fitted values, the recording's noise, and what the fit leaves
open of the values, carried along by derivatives. How far two members are apart in a run is then the expected
log-evidence of one over the other when it is true: the divergence of Kullback and Leibler of their
predictions, in which each may still move its parameters as far as the recordings allow (the T-criterion of
Atkinson and Fedorov, Biometrika 62 (1975) 57, with the recordings as prior).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.arrays import Array
from toolkit.diagnosis.answer.answer import DiagnosedEffect, Diagnosis
from toolkit.diagnosis.case.case import Run
from toolkit.diagnosis.fit.fit import Fit, fit
from toolkit.diagnosis.fit.noise import layout, whiten
from toolkit.diagnosis.fit.problem import Problem
from toolkit.diagnosis.policy import VERDICT
from toolkit.diagnosis.search.candidates import CandidateEffect, candidates
from toolkit.effects.applied import AppliedEffect
from toolkit.errors import ConfigError, FitError

_STARTS = 3  # of each place, from the first to the last
_STEP = 1e-4
_BETWEEN = 3.0  # sd of what rows leave open, in what a row between each two changes: the next ones add to it
_WIDEST = 3.0  # sd of a parameter that the recordings leave open, in its own size


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Member:
    """One explanation: its name and place, and the fit with it in the recordings.

    ``step_s`` is the time from row to row [s] of the recordings, whose noise is that of the fit.
    """

    label: str
    fit: Fit
    step_s: float = math.inf

    def white(self, run: Run, values: Mapping[str, Array]) -> Array:
        """Return columns of every output (n,) or (n, k), one below the other, in the noise's deviations.

        Of rows that are denser than the recordings' each has as much more noise: its density over time
        stays, so that they tell of what lies between the rows, and no more than before of all else.
        """
        where = layout([run.t], [np.ones(run.rows, dtype=bool)])
        denser_by = max(self.step_s / row_step(run), 1.0) if math.isfinite(self.step_s) else 1.0
        columns = [
            whiten(column[where.index], where, self.fit.noise[name]) for name, column in values.items()
        ]
        return np.asarray(np.concatenate(columns) / math.sqrt(denser_by))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Predicted:
    """What a member says of a run: ``outputs`` by name (n,), and what is open of them.

    ``spread`` by name (n, parameters): the change by one standard deviation of each independent parameter;
    ``between`` by name (n, k): by what inputs may do between rows, whichever member is true; first where they
    go straight. ``lost`` is the log-likelihood that a fit may miss where derivatives do not say what
    parameters change.
    """

    outputs: dict[str, Array]
    spread: dict[str, Array]
    between: dict[str, Array]
    lost: float = 0.0


def class_of(diagnosis: Diagnosis, where: object) -> DiagnosedEffect:
    """Return the first effect of an answer that others explain as well.

    Raises
    ------
    ConfigError
        ``plan-next``: every effect of the answer stands alone
    """
    effect = next((effect for effect in diagnosis.effects if effect.equivalent_to), None)
    if effect is None:
        raise ConfigError(
            "the answer has no class to part", where=where, got=f"verdict {diagnosis.verdict}",
            expected="an effect with others that explain it as well (equivalent_to)",
            next_step="'next_measurements' of the answer says what would help", rule="plan-next",
        )  # fmt: skip
    return effect


def members_of(
    problem: Problem, effects: Sequence[DiagnosedEffect], effect: DiagnosedEffect
) -> tuple[Member, ...]:
    """Return the members of an effect's class that can be fitted, the likeliest first.

    The other ``effects`` of the answer stay beside each.

    Raises
    ------
    ConfigError
        ``plan-next``: fewer than two can be
    """
    listed = [candidate for candidate in candidates(problem) if candidate.active.runs is None]
    others = tuple(
        _at_answer(candidate, found)
        for found in effects
        if found is not effect
        for candidate in listed
        if candidate.key[:3] == found.key[:3]
    )
    members = []
    for name in (effect.name, *effect.equivalent_to):
        places = [
            c for c in listed if c.name == name and (name != effect.name or c.key[:3] == effect.key[:3])
        ]
        fits = [fitted for place in places for fitted in _fits(problem, place, others)]
        if fits:
            best = max(fits, key=lambda fitted: fitted.log_posterior)
            step_s = min(row_step(run) for run in problem.runs)
            members.append(Member(label=best.active[-1].key.label, fit=best, step_s=step_s))
    if len(members) < 2:
        raise ConfigError(
            "fewer than two members of the class can be fitted", where=problem.case.path,
            got=", ".join(member.label for member in members) or "none",
            expected=", ".join((effect.name, *effect.equivalent_to)),
            next_step="diagnose the case again with this version", rule="plan-next",
        )  # fmt: skip
    return tuple(sorted(members, key=lambda member: -member.fit.log_posterior))


def _at_answer(candidate: CandidateEffect, found: DiagnosedEffect) -> AppliedEffect:
    values = {p.name: p.value for p in found.parameters if isinstance(p.value, float)}
    return dataclasses.replace(candidate.active, values=candidate.starts[0].values | values)


def _fits(problem: Problem, place: CandidateEffect, others: Sequence[AppliedEffect]) -> Iterator[Fit]:
    at = np.unique(np.linspace(0, len(place.starts) - 1, min(_STARTS, len(place.starts))).astype(int))
    for start in (place.starts[i] for i in at):
        active = dataclasses.replace(place.active, values=start.values)
        try:
            yield fit(problem, (*others, active))
        except FitError:  # beyond what the simulation runs with: another start, or another place
            continue


def row_step(run: Run) -> float:
    """Return the usual time from row to row [s]."""
    return float(np.median(np.diff(run.t))) if run.rows > 1 else math.inf


def refined(run: Run, times: int) -> Run:
    """Return a run with so many rows for each that it has, all straight between those."""
    if times == 1:
        return run
    places = np.arange((run.rows - 1) * times + 1) / times
    t = np.interp(places, np.arange(run.rows), run.t)
    columns = {name: np.interp(t, run.t, column) for name, column in run.columns.items()}
    return dataclasses.replace(run, t=t, columns=columns)


def denser(run: Run, drivers: Sequence[str]) -> tuple[Run, Run]:
    """Return a run with a row between each two, twice: its drivers straight between rows, and smooth."""
    from scipy.interpolate import Akima1DInterpolator

    straight = refined(run, 2)
    smooth = {
        name: np.asarray(Akima1DInterpolator(run.t, run.columns[name])(straight.t))
        for name in drivers
        if name in run.columns
    }
    return straight, dataclasses.replace(straight, columns={**straight.columns, **smooth})


def predict(problem: Problem, member: Member, run: Run) -> Predicted | None:
    """Return what a member says of a run, all that it leaves open between rows aside (`completed`).

    None where its simulation gives no number.
    """
    fitted = member.fit
    values, covariance = _tamed(fitted)
    steps = np.sqrt(np.diag(covariance))
    steps = np.minimum(steps, _STEP * np.maximum(np.abs(values), steps))
    steps[steps == 0] = _STEP
    centre, *moved = _simulated(problem, run, fitted, [0 * steps, *np.diag(steps)])
    if centre is None:
        return None
    slopes = {
        name: np.stack(
            [
                np.zeros(run.rows) if outputs is None else (outputs[name] - column) / step
                for outputs, step in zip(moved, steps.tolist(), strict=True)
            ],
            axis=1,
        )
        if moved
        else np.zeros((run.rows, 0))
        for name, column in centre.items()
    }
    root = _root(covariance)
    spread = {name: columns @ root for name, columns in slopes.items()}
    none = {name: np.zeros((run.rows, 0)) for name in centre}
    return Predicted(outputs=centre, spread=spread, between=none)


def completed(
    problem: Problem, member: Member, run: Run, predicted: Predicted, dense: Sequence[Run]
) -> Predicted | None:
    """Return what a member says of a run (`predict`) with what rows leave open and what a fit may miss.

    None where a simulation gives no number.

    Parameters
    ----------
    dense : the run with twice the rows (`denser`): what each changes is what rows leave open. Of effects that
        are shorter than a row, predictions differ by what inputs do between rows, which no recording shows.
    """
    fitted = member.fit
    values, covariance = _tamed(fitted)
    known = [_simulated(problem, other, fitted, [0 * values])[0] for other in dense]
    if any(outputs is None for outputs in known):
        return None
    between = {
        name: np.array([_BETWEEN * (outputs[name][::2] - column) for outputs in known if outputs is not None])
        .reshape(-1, run.rows)
        .T
        for name, column in predicted.outputs.items()
    }
    root = _root(covariance)
    # Away from zero: a time constant that is hardly known stays one.
    away = [step * (1.0 if step @ np.sign(values) >= 0 else -1.0) for step in root.T]
    begin = np.zeros(len(values))
    begin[: len(fitted.p)] = [parameter.value for parameter in problem.free] - np.asarray(fitted.p)
    steps = [*away, begin]
    moved = _simulated(problem, run, fitted, steps)
    ways = [
        _lost(run, member, predicted, outputs, np.linalg.pinv(root) @ step)
        for step, outputs in zip(steps, moved, strict=True)
        if outputs is not None  # beyond what the simulation runs with no fit goes
    ]
    lost = max(ways, default=0.0)
    return dataclasses.replace(predicted, between=between, lost=lost)


def _lost(run: Run, member: Member, predicted: Predicted, moved: dict[str, Array], by: Array) -> float:
    """Return what a fit misses that goes by derivatives, where half of a change is not as they say.

    Such a fit may end anywhere: of a pendulum that goes over the top, of waves that are late by more than
    half of one. ``by`` (n,) is what parameters are moved by, in standard deviations.
    """
    change = member.white(run, {name: moved[name] - column for name, column in predicted.outputs.items()})
    slope = member.white(run, {name: columns @ by for name, columns in predicted.spread.items()})
    size = float(change @ change)
    along = float(change @ slope) ** 2 / max(float(slope @ slope), 1e-300)
    return 0.0 if along >= size / 2 else 0.5 * (size - along)


def _tamed(fitted: Fit) -> tuple[Array, Array]:
    """Return the values (n,) of a fit, and their covariance (n, n).

    What the recordings leave open altogether is as wide as its size.
    """
    values = np.array(
        [*fitted.p, *(applied.values[p.name] for applied in fitted.active for p in applied.searched)]
    )
    sd = np.sqrt(np.maximum(np.diag(fitted.covariance), 0.0))
    limit = _WIDEST * np.maximum(np.abs(values), 1e-9)
    shrink = np.where(sd > limit, limit / np.where(sd > 0, sd, 1.0), 1.0)
    return values, np.asarray(fitted.covariance * np.outer(shrink, shrink))


def _root(covariance: Array) -> Array:
    """Return independent standard deviations (n, n), a column each."""
    sizes, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(sizes, 0.0)))


def _simulated(
    problem: Problem, run: Run, fitted: Fit, steps: Sequence[Array]
) -> list[dict[str, Array] | None]:
    """Return the outputs of a run with a fit's values moved by steps (n,), each; None where there are none.

    Together where the simulation can: it is sooner, and what its own steps leave is no part of a difference.
    """
    points = [_moved(problem, fitted, step) for step in steps]
    if problem.model.capability.together is not None:
        problem.model.capability.together([run], points)
    simulated: list[dict[str, Array] | None] = []
    for values, active in points:
        try:
            outputs = problem.model.simulate(run, values, active)
        except FitError:
            simulated.append(None)
            continue
        numbers = {name: outputs[name] for name in problem.names}
        finite = all(np.isfinite(column).all() for column in numbers.values())
        simulated.append(numbers if finite else None)
    return simulated


def _moved(problem: Problem, fitted: Fit, step: Array) -> tuple[dict[str, float], tuple[AppliedEffect, ...]]:
    """Return the parameters and effects of a fit, its values moved by a step (n,)."""
    steps = iter(step.tolist())
    values = dict(problem.known)
    values |= {
        parameter.name: float(value) + next(steps)
        for parameter, value in zip(problem.free, fitted.p, strict=True)
    }
    active = tuple(
        dataclasses.replace(
            applied,
            values={
                **applied.values,
                **{p.name: applied.values[p.name] + next(steps) for p in applied.searched},
            },
        )
        for applied in fitted.active
    )
    return values, active


def evidence_a_second(run: Run, members: Sequence[Member], true: Predicted, rival: Predicted) -> float:
    """Return the log-evidence a second that the row tells in which two members are furthest apart.

    Nothing has to be fitted beside, and no row tells more: no run whose rows are no further apart than this
    one gathers more in its time.
    """
    gap = {name: true.outputs[name] - column for name, column in rival.outputs.items()}
    rows = (np.sum(member.white(run, gap).reshape(len(gap), -1) ** 2, axis=0) for member in members)
    return min(float(0.5 * row.max()) for row in rows) / row_step(run)


def expected_log_evidence(
    run: Run, members: Sequence[Member], true: Predicted, rival: Predicted, *, times: float = 1.0
) -> float:
    """Return the mean log-evidence of a true member over another one, in a run that is yet to be made.

    The divergence of two Gaussians with covariances I + W W^T in the noise's standard deviations (Woodbury's
    identity). Each fit has taken what it does not explain for noise: the noise counts under which the two
    are less apart. What rows leave open by either is open to both. But a fit of the run takes simulations at
    their rows for the truth: by what inputs that go straight between rows make of it, it is misled. And what
    the true member's own fit may miss is not to be expected, nor what the other one's may find: where
    derivatives do not say what its parameters change, it may come nearer than they say. Where that is as much
    as a verdict asks for, which one is ahead is chance, however far apart they are: nothing is expected.

    Parameters
    ----------
    members : those of the two predictions
    times : how often the run is made, one after the other: rows with the same expectation stand one below
        the other
    """
    expected = min(_divergence(run, member, true, rival, times) for member in members)
    lost = times * (true.lost + rival.lost)
    return min(expected, 0.0 if lost > VERDICT.close else max(expected - lost, 0.0))


def _divergence(run: Run, member: Member, true: Predicted, rival: Predicted, times: float) -> float:
    def white(columns: Mapping[str, Array]) -> Array:
        return member.white(run, columns) * math.sqrt(times)

    gap = white({name: true.outputs[name] - column for name, column in rival.outputs.items()})
    open_to_both = [white(predicted.between) for predicted in (true, rival)]
    own, rivals = (np.hstack([white(predicted.spread), *open_to_both]) for predicted in (true, rival))
    inner, of_own = (np.eye(w.shape[1]) + w.T @ w for w in (rivals, own))
    through, crossed = rivals.T @ gap, rivals.T @ own
    squares = float(gap @ gap - through @ np.linalg.solve(inner, through))
    trace = float(np.sum(own**2) - np.sum(rivals * (rivals @ np.linalg.inv(inner))))
    trace -= float(np.sum(crossed * np.linalg.solve(inner, crossed)))
    logs = float(np.linalg.slogdet(inner)[1] - np.linalg.slogdet(of_own)[1])
    expected = 0.5 * (squares + trace + logs)
    spread = white(rival.spread)
    apart = gap - spread @ np.linalg.solve(np.eye(spread.shape[1]) + spread.T @ spread, spread.T @ gap)
    misled = max((abs(float(apart @ w[:, 0])) for w in open_to_both if w.shape[1]), default=0.0) / _BETWEEN
    return min(expected, 0.5 * float(gap @ apart) - misled) if misled else expected
