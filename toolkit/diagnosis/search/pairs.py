"""Two effects at once, where no single one passes: each alone explains nothing, both together do.

Dry friction and quadratic drag beside a free viscous term are the classic pair: what the term cannot take of
one has nearly the shape of the other with its sign turned round, and either alone is hidden by the other.
Pairs are ranked on the linearised residual, by what both responses together take of it off the nominal
parameters (orthogonal matching); joint fits decide, held-out rows judge, and each of the two has to be needed
beside the other.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from toolkit.diagnosis.fit.fit import Fit, fit
from toolkit.diagnosis.fit.folds import Folds, HeldOut, hold_out, matters
from toolkit.diagnosis.fit.problem import Problem
from toolkit.diagnosis.fit.unknown_past import past_gain
from toolkit.diagnosis.policy import PAIRS, SCREENING, STEP
from toolkit.diagnosis.search.bends import only_bends
from toolkit.diagnosis.search.forward_step import Rival, Step, drifts_faster, is_of_runs_alone, joint_fit
from toolkit.diagnosis.search.screen import LinearisedFit, Scored
from toolkit.effects.applied import AppliedEffect
from toolkit.errors import FitError


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pair:
    """Two candidates from one start each, and the gain of both together among so many ``tests``."""

    members: tuple[Scored, Scored]
    gain: float
    tests: int

    def p_value(self, gain: float) -> float:
        """Return the chance that noise gives some pair such a gain of twice the log-likelihood."""
        from scipy.stats import chi2

        trust, dof = self.members[0].trust, sum(member.dof for member in self.members)
        return min(1.0, float(chi2.sf(max(gain, 0.0) * trust, dof)) * self.tests)


def ranked_pairs(screen: LinearisedFit, scored: Sequence[Scored]) -> list[Pair]:
    """Return the pairs of candidates that are significant together, the best first."""
    listed = _starts(scored)
    if len(listed) < 2 or screen.coloured.rest <= 0:
        return []
    ends = np.cumsum([0, *(trial.block.shape[1] for trial in listed)])
    columns = [np.arange(ends[i], ends[i + 1]) for i in range(len(listed))]
    stacked = np.hstack([trial.block for trial in listed])
    gram, seen = stacked.T @ stacked, stacked.T @ screen.coloured.left
    couples = [
        (i, j)
        for i, j in itertools.combinations(range(len(listed)), 2)
        # One effect in two groups of runs is one effect: single steps try its groups.
        if listed[i].candidate.active.effect.name != listed[j].candidate.active.effect.name
    ]
    # The likeliest starts were chosen among all: as many pairs were looked at as all of them make.
    tests = math.comb(len(scored), 2)
    pairs = []
    for i, j in couples:
        both = np.concatenate([columns[i], columns[j]])
        within = gram[np.ix_(both, both)]
        if np.linalg.eigvalsh(within)[0] < PAIRS.apart:
            continue
        taken = float(seen[both] @ np.linalg.solve(within, seen[both]))
        share = min(max(taken / screen.coloured.rest, 0.0), 1 - 1e-12)
        gain = -screen.n * float(np.log1p(-share))
        pair = Pair(members=(listed[i], listed[j]), gain=gain, tests=tests)
        alone = max(listed[i].gain, listed[j].gain, 0.0)
        if pair.p_value(gain) < SCREENING.alpha and gain > PAIRS.better * alone:
            pairs.append(pair)
    return sorted(pairs, key=lambda pair: -pair.gain)


def _starts(scored: Sequence[Scored]) -> list[Scored]:
    """Return the starts that pairs are made of: some of each candidate, the likeliest candidates."""
    listed: list[Scored] = []
    taken: dict[object, int] = {}
    for trial in sorted(scored, key=lambda trial: -trial.gain):
        fits = not trial.candidate.discrete and not trial.candidate.active.effect.nuisance
        if fits and trial.block.shape[1] and taken.get(trial.candidate.key, 0) < PAIRS.starts:
            taken[trial.candidate.key] = taken.get(trial.candidate.key, 0) + 1
            listed.append(trial)
    return listed[: PAIRS.most]


def best_pair(
    problem: Problem,
    folds: Folds,
    base: Fit,
    held_base: HeldOut,
    screen: LinearisedFit,
    scored: Sequence[Scored],
    least: float,
    check: Callable[[], None],
) -> tuple[Fit, HeldOut, tuple[Step, Step]] | None:
    """Return the first pair that stands on what it has not seen, None where none does.

    Parameters
    ----------
    least : share of an output's held-out mean square that the two must take away
    check : called before every pair is fitted, and before one is held out
    """
    fitted: list[tuple[Pair, Fit]] = []
    for pair in _of_different_effects(ranked_pairs(screen, scored))[: PAIRS.fitted]:
        check()
        members = _reached(screen, pair)
        joint = None if members is None else joint_fit(problem, base, members)
        if joint is None or only_bends(problem, joint) or is_of_runs_alone(problem, base, joint):
            continue
        if not drifts_faster(problem, base, joint):
            fitted.append((pair, joint))
    fitted.sort(key=lambda entry: -entry[1].log_posterior)
    for pair, joint in fitted[: PAIRS.judged]:
        # What the linear fit promises, the joint fit has to keep.
        p_value = pair.p_value(2 * (joint.log_posterior - base.log_posterior))
        if p_value >= SCREENING.alpha:
            continue
        check()
        try:
            held_out = hold_out(problem, folds, joint.active, joint)
        except FitError:
            continue
        if held_out.total - held_base.total < 2 * STEP.least_gain:
            continue
        if not matters(problem, held_base, held_out, max(least, PAIRS.least)):
            continue
        steps = tuple(
            _needed(problem, folds, joint, held_out, position, p_value, fitted) for position in (-2, -1)
        )
        if steps[0] is not None and steps[1] is not None:
            return joint, held_out, (steps[0], steps[1])
    return None


def _of_different_effects(pairs: Sequence[Pair]) -> list[Pair]:
    """Return the best starts of every two candidates."""
    best: dict[object, Pair] = {}
    for pair in pairs:
        best.setdefault(tuple(member.candidate.key for member in pair.members), pair)
    return list(best.values())


def _reached(screen: LinearisedFit, pair: Pair) -> tuple[AppliedEffect, AppliedEffect] | None:
    """Return both effects with the values that the linear fit reaches; None where a sign is impossible."""
    first, second = pair.members
    together = {
        name: np.hstack([first.directions[name], second.directions[name]]) for name in screen.problem.names
    }
    _, coefficients, _ = screen.gain(together)
    width = next(iter(first.directions.values())).shape[1]
    parts = (coefficients[:width], coefficients[width:])
    members = [member.valued(part) for member, part in zip(pair.members, parts, strict=True)]
    if members[0] is None or members[1] is None:
        return None
    return members[0], members[1]


def _needed(
    problem: Problem,
    folds: Folds,
    joint: Fit,
    held_out: HeldOut,
    position: int,
    p_value: float,
    fitted: Sequence[tuple[Pair, Fit]],
) -> Step | None:
    """Return the step of one of a pair, None where the other does as well without it."""
    effect, other = joint.active[position], joint.active[-3 - position]
    try:
        alone = fit(problem, (*joint.active[:-2], other), start=joint.p)
        without = hold_out(problem, folds, alone.active, alone)
    except FitError:  # the simulation runs with both only
        return None
    gain = held_out.total - without.total
    if gain < STEP.least_gain:
        return None
    rivals, own = [], joint.log_posterior + past_gain(problem, joint)
    for _, rival in fitted:
        keys = [each.key for each in rival.active[-2:]]
        if rival is not joint and other.key in keys:
            instead = rival.active[-2] if keys[1] == other.key else rival.active[-1]
            difference = rival.log_posterior + past_gain(problem, rival) - own
            rivals.append(Rival(active=instead, difference=difference))
    return Step(
        active=effect,
        p_value=p_value,
        held_out_gain=gain,
        gain=joint.log_posterior - alone.log_posterior,
        rivals=tuple(rivals),
    )
