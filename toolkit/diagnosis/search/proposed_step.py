"""A forward step from what the recording itself proposes, and what free simulations put beside it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from toolkit.diagnosis.fit.fit import Fit
from toolkit.diagnosis.fit.folds import Folds, HeldOut, hold_out, matters
from toolkit.diagnosis.fit.problem import Problem
from toolkit.diagnosis.policy import FOLLOWING, PAIRS, STEP
from toolkit.diagnosis.search.bends import only_bends
from toolkit.diagnosis.search.forward_step import (
    Joint,
    Step,
    best_step,
    cost,
    drifts_faster,
    is_of_runs_alone,
    joint_fit,
    joint_fits,
    ranked,
)
from toolkit.diagnosis.search.in_place import best_in_place
from toolkit.diagnosis.search.proposals import Proposals
from toolkit.diagnosis.search.screen import Scored
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.diagnosis.search.candidates import CandidateEffect
    from toolkit.diagnosis.search.screen_step import Look

    Outcome = tuple[Fit, HeldOut, tuple[Step, ...]]


@dataclass(frozen=True, slots=True, eq=False)
class ProposedStep:
    """What stands on unseen rows (None: nothing), the joint fits that it was chosen of, and the proposals."""

    outcome: Outcome | None
    joint: tuple[Joint, ...]
    proposed: Proposals


def proposed_step(
    problem: Problem,
    folds: Folds,
    base: Fit,
    held_base: HeldOut,
    proposed: Proposals,
    *,
    least: float,
    refitted: HeldOut,
    listed: Sequence[CandidateEffect],
    tell: Callable[[Sequence[Scored]], None],
) -> ProposedStep | None:
    """Return the step that the recording proposes, None where it proposes none.

    Parameters
    ----------
    proposed : what the prediction errors of the base propose
    listed : candidates that may stand in the place of one of several
    least : share of an output's held-out mean square that it must take away
    refitted : the held-out rows without any effect
    tell : is told what is fitted
    """
    if not proposed.scored:
        return None
    for count in range(len(proposed.together), 1, -1):
        tell(proposed.together[:count])
        outcome = _joined(problem, folds, base, held_base, proposed, listed, count, least)
        if outcome is not None:
            return ProposedStep(outcome, (), proposed)
    promising = proposed.scored[: STEP.refined]
    tell(promising)
    joint = joint_fits(problem, base, promising)
    single = best_step(problem, folds, base, held_base, joint, proposed.p_of, least, refitted)
    return ProposedStep(None if single is None else (*single[:2], (single[2],)), joint, proposed)


def _joined(
    problem: Problem,
    folds: Folds,
    base: Fit,
    held_base: HeldOut,
    proposed: Proposals,
    listed: Sequence[CandidateEffect],
    count: int,
    least: float,
) -> Outcome | None:
    """Return several terms fitted at once, None where they do not stand; the steps end on the largest.

    Whether each of them is needed beside the others is asked of every step at the end of the search. What
    does better in the place of one of them takes it, where unseen rows allow it.
    """
    members = proposed.together[:count]
    joint = joint_fit(problem, base, [scored.active for scored in members], begin=members[0].p)
    if joint is None or only_bends(problem, joint):
        return None
    if drifts_faster(problem, base, joint) or is_of_runs_alone(problem, base, joint):
        return None
    try:
        held_out = hold_out(problem, folds, joint.active, joint)
    except FitError:
        return None
    gained = held_out.total - held_base.total
    if gained < count * STEP.least_gain or not matters(problem, held_base, held_out, max(least, PAIRS.least)):
        return None
    steps = []
    for scored, member in zip(members, joint.active[-count:], strict=True):
        instead, active, rivals = best_in_place(problem, joint, member, listed)
        if instead is not joint:
            try:
                scores = hold_out(problem, folds, instead.active, instead)
            except FitError:
                scores = None
            worse = scores is None or scores.total < held_out.total - STEP.least_gain
            if scores is None or worse or drifts_faster(problem, joint, instead):
                active = member
            else:
                joint, held_out = instead, scores
        steps.append(
            Step(
                active=active, p_value=proposed.p_of[id(scored)], held_out_gain=gained,
                gain=joint.log_posterior - base.log_posterior, rivals=rivals,
            )
        )  # fmt: skip
    return joint, held_out, tuple(reversed(steps))


def beside_rivals(
    problem: Problem,
    folds: Folds,
    base: Fit,
    held_base: HeldOut,
    led: ProposedStep,
    outcome: Outcome,
    view: Look,
    *,
    least: float,
    refitted: HeldOut,
    tell: Callable[[Sequence[Scored]], None],
) -> Outcome:
    """Return an ``outcome`` as proposed, or a better one, with what free simulations promise in its place."""
    made, _, steps = outcome
    fitted = {joint.scored.candidate.key for joint in led.joint}
    promising = [
        scored
        for scored in view.significant
        if scored.candidate.key not in fitted and scored.gain > 2 * FOLLOWING.rival * steps[-1].gain
    ][: STEP.refined]
    if not promising:
        return outcome
    tell(promising)
    # What one effect could stand for several with has to explain as much as they do.
    needed = made.log_posterior - cost(problem, made.active[-len(steps) :]) if len(steps) > 1 else -math.inf
    joint = ranked(problem, (*led.joint, *joint_fits(problem, base, promising, least=needed)))
    p_of = led.proposed.p_of | view.p_of
    single = best_step(problem, folds, base, held_base, joint, p_of, least, refitted)
    return outcome if single is None else (*single[:2], (single[2],))
