"""What would explain the same in the place of an effect that was fitted beside others.

A step of one effect has its rivals from the screen before it. Of effects that were fitted at once none was
seen alone, and what would do in the place of one shows only beside the others: candidates whose response is
nearly that of the effect, off the nominal parameters and off the others (the cosine of the angle between
them), are fitted in its place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.fit import Fit, fit, jacobian
from toolkit.diagnosis.fit.folds import HeldOut, hold_out
from toolkit.diagnosis.fit.noise import whiten
from toolkit.diagnosis.policy import FOLLOWING, STEP
from toolkit.diagnosis.search.bends import only_bends
from toolkit.diagnosis.search.forward_step import (
    Rival,
    Step,
    drifts_faster,
    joint_fit,
    least_in_place,
    leaves_more_than_noise,
    score_in_place,
)
from toolkit.diagnosis.search.screen import LinearisedFit
from toolkit.diagnosis.search.wandering import may_wander
from toolkit.effects.applied import AppliedEffect
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.folds import Folds
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.diagnosis.search.candidates import CandidateEffect


def best_in_place(
    problem: Problem, joint: Fit, applied: AppliedEffect, listed: Sequence[CandidateEffect]
) -> tuple[Fit, AppliedEffect, tuple[Rival, ...]]:
    """Return the best joint fit with an effect or another in its place, which one, and its rivals.

    Parameters
    ----------
    joint : with the effect and those beside it
    listed : candidates that may stand in its place
    """
    others = tuple(each for each in joint.active if each.key != applied.key)
    fits = {applied.key: (joint, applied)}
    scores = {applied.key: score_in_place(problem, joint, applied)}
    for candidate in _alike(problem, joint, applied, listed)[: FOLLOWING.in_place]:
        least = least_in_place(problem, max(scores.values()), candidate)
        instead = joint_fit(problem, replace(joint, active=others), (candidate,), least=least)
        if instead is not None and not only_bends(problem, instead):
            fits[candidate.key] = (instead, instead.active[-1])
            scores[candidate.key] = score_in_place(problem, *fits[candidate.key])
    best = max(scores, key=lambda key: scores[key])
    rivals = tuple(
        Rival(active=active, difference=scores[key] - scores[best])
        for key, (_, active) in fits.items()
        if key != best and not active.effect.nuisance
    )
    return *fits[best], rivals


def foretold_best(
    problem: Problem, folds: Folds, base: Fit, held_base: HeldOut, steps: Sequence[Step]
) -> tuple[Fit, HeldOut, list[Step]]:
    """Put in an effect's place what foretells unseen rows better; the better fit then stays in its class.

    Of effects that were fitted at once, or that stand for one that was dropped, the fit alone has chosen.
    Where more than noise is left, that is also what the fit made of the rest (as in `best_step`).
    """
    chosen = list(steps)
    for i, step in enumerate(steps if leaves_more_than_noise(problem, base) else ()):
        better = _foretells_better(problem, folds, base, held_base, step)
        if better is not None:
            rival, instead, scores = better
            gained = scores.total - held_base.total
            chosen[i] = _replaced(step, rival, instead.active[-1], gained=gained)
            base, held_base = instead, scores
    return base, held_base, chosen


def _foretells_better(
    problem: Problem, folds: Folds, base: Fit, held_base: HeldOut, step: Step
) -> tuple[Rival, Fit, HeldOut] | None:
    """Return the rival that foretells unseen rows best in an effect's place, None where the effect does."""
    others = tuple(each for each in base.active if each.key != step.active.key)
    present = {each.key for each in others}
    near = [
        each
        for each in step.rivals
        if each.difference > (STEP.rival - 1) * step.gain
        and each.active.key not in present
        and not may_wander(problem, each.active)
    ]
    better, best = None, held_base.total + STEP.least_gain
    for rival in sorted(near, key=lambda each: -each.difference)[: STEP.judged - 1]:
        try:
            instead = fit(problem, (*others, rival.active), start=base.p)
            if only_bends(problem, instead) or drifts_faster(problem, base, instead):
                continue
            scores = hold_out(problem, folds, instead.active, instead)
        except FitError:  # the simulation does not run with it
            continue
        if scores.total > best:
            better, best = (rival, instead, scores), scores.total
    return better


def _replaced(step: Step, rival: Rival, active: AppliedEffect, *, gained: float) -> Step:
    """Return a step with a rival in the effect's place, as fitted there; ``gained`` on unseen rows."""
    behind = [
        replace(each, difference=each.difference - rival.difference)
        for each in step.rivals
        if each.active.key != rival.active.key
    ]
    return replace(
        step,
        active=active,
        held_out_gain=step.held_out_gain + gained,
        gain=step.gain + rival.difference,
        rivals=(Rival(active=step.active, difference=-rival.difference), *behind),
    )


def _alike(
    problem: Problem, joint: Fit, applied: AppliedEffect, listed: Sequence[CandidateEffect]
) -> list[AppliedEffect]:
    """Return candidates that respond nearly as an effect does, with the sizes that they have in its place."""
    screen = LinearisedFit.of(problem, joint)
    columns, sizes = jacobian(problem, joint)
    at, places = len(problem.free), {}
    for each in joint.active:
        places[each.key] = slice(at, at + len(each.searched))
        at += len(each.searched)
    own = places[applied.key]
    beside = np.delete(np.arange(at), np.arange(own.start, own.stop))
    others = {name: column[:, beside] for name, column in columns.items()}
    own_response = _response(
        problem, joint, applied, {name: column[:, own] / sizes[own] for name, column in columns.items()}
    )
    if own_response is None:
        return []
    span = np.linalg.qr(np.vstack([_white(others, screen), problem.prior_rows(sizes, at)[:, beside]]))[0]

    def off(rows: Array) -> Array:
        return np.asarray(rows - span @ (span.T @ rows))

    target = off(screen.rows(own_response))[:, 0]
    size = float(target @ target)
    if not (np.isfinite(span).all() and 0 < size < np.inf):
        return []
    present = {each.key for each in joint.active}
    sought = [candidate for candidate in listed if candidate.key not in present and not candidate.discrete]
    screen.prepare(sought)
    ranked: list[tuple[float, AppliedEffect]] = []
    for candidate in sought:
        seen = []
        for scored in screen.score(candidate):
            rows = off(screen.rows(scored.directions))
            if not np.isfinite(rows).all():
                continue
            coefficients = np.linalg.lstsq(rows, target, rcond=1e-9)[0]
            taken = float(target @ (rows @ coefficients)) / size
            reached = scored.valued(coefficients.tolist())
            if reached is not None and taken > FOLLOWING.alike:
                seen.append((taken, reached))
        ranked += sorted(seen, key=lambda entry: -entry[0])[:1]
    return [reached for _, reached in sorted(ranked, key=lambda entry: -entry[0])]


def _response(
    problem: Problem, joint: Fit, applied: AppliedEffect, derivatives: dict[str, Array]
) -> dict[str, Array] | None:
    """Return what an effect does, (rows, 1) of every output; None where the simulation does not run without.

    By its derivatives times its sizes: without it a motion may be another one. A limit has no size.
    """
    sizes = [0.0 if each.off is None else applied.values[each.name] - each.off for each in applied.searched]
    if np.isfinite(sizes).all():
        return {name: columns @ np.array(sizes)[:, None] for name, columns in derivatives.items()}
    others = tuple(each for each in joint.active if each.key != applied.key)
    try:
        bare = problem.simulate(joint.p, others)
    except FitError:
        return None
    return {name: (joint.simulated[name] - bare[name])[:, None] for name in problem.names}


def _white(columns: dict[str, Array], screen: LinearisedFit) -> Array:
    return np.vstack(
        [
            whiten(columns[name][where.index], where, screen.base.noise[name])
            for name, where in screen.layouts.items()
        ]
    )
