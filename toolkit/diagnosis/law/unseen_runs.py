"""Laws that whole unseen runs show, where the rest is beyond all noise.

Coloured noise foretells a large smooth rest from its own past, and what is right is then punished for a
corner and not rewarded for what it takes: a tape that relaxes for half a minute leaves a tenth of its force,
of which each value foretells the next to a hundredth. As effects are there (`search.unseen_runs`), laws are
fitted by ordinary least squares and judged by the runs that no fit has seen, simulated freely. Two runs and
half of what each leaves are enough: a law describes, and gives no name.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from toolkit.diagnosis.fit.folds import hold_out
from toolkit.diagnosis.law.ranking import all_responses, at_coefficients, likely
from toolkit.diagnosis.policy import UNSEEN
from toolkit.diagnosis.search.bends import at_bound
from toolkit.diagnosis.search.forward_step import joint_fit
from toolkit.diagnosis.search.unseen_runs import asked_of_unseen_runs, gains_of, takes_most
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.folds import Folds, HeldOut
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.diagnosis.law.trial import Trial
    from toolkit.diagnosis.search.screen import LinearisedFit


@dataclass(frozen=True, slots=True, eq=False)
class ShownLaw:
    """A law that stands: its fit, its unseen rows, and its gain of independent values there."""

    trial: Trial
    fit: Fit
    held_out: HeldOut
    gain: float


def laws_on_unseen_runs(
    problem: Problem,
    folds: Folds,
    base: Fit,
    held_base: HeldOut,
    screen: LinearisedFit,
    trials: Sequence[Trial],
    weight: float,
) -> list[ShownLaw]:
    """Return laws that take most of the rest of whole unseen runs; none where noise may have left it.

    Not asked of equations: there each of these fits takes many integrations, and prediction errors along the
    recording, which have no long memory, have proposed what they show.

    Parameters
    ----------
    trials : what was looked at; what was met once foretells nothing and is passed over
    weight : what a parameter costs of the log-likelihood
    """
    motion = problem.model.capability.motion
    integrates = motion is not None and motion.integrates
    if integrates or not asked_of_unseen_runs(problem, folds, base, screen, UNSEEN.runs_of_laws):
        return []
    shown = []
    for trial in _ranked(problem, base, screen, trials, weight)[: UNSEEN.fitted]:
        made = joint_fit(problem, base, (trial.applied,), plain=True)
        # What does not take most of the rows that it was fitted to takes less of others.
        if made is None or at_bound(made.active[-1]) or not takes_most(problem, base, made, UNSEEN.every):
            continue
        try:
            held_out = hold_out(problem, folds, made.active, made)
        except FitError:
            continue
        if takes_most(problem, held_base, held_out, UNSEEN.every):
            shown.append((trial, made, held_out))
    if not shown:
        return []
    gains = gains_of(problem, held_base, [(made, held_out) for _, made, held_out in shown])
    return [ShownLaw(*each, gain) for each, gain in zip(shown, gains, strict=True)]


def _ranked(
    problem: Problem, base: Fit, screen: LinearisedFit, trials: Sequence[Trial], weight: float
) -> list[Trial]:
    """Return laws with the amplitudes of ordinary least squares, those first that leave the least.

    None that leaves more in proportion than it may of any run.
    """
    least = -screen.n * math.log(1 - UNSEEN.every)
    predicting = [trial for trial in trials if trial.form != "event"]
    best = likely(problem, base, screen.whitened(), predicting, weight)
    sized = []
    for trial, directions in zip(best, all_responses(problem, base, best), strict=True):
        if directions is not None:
            gain, coefficients = screen.plain_gain(directions)
            if gain > least:
                sized.append(replace(at_coefficients(trial, coefficients), gain=gain))
    return sorted(sized, key=lambda trial: -(trial.gain - 2 * weight * trial.cost))
