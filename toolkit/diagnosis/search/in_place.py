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

from toolkit.diagnosis.fit.fit import Fit, jacobian
from toolkit.diagnosis.fit.noise import Layout, whiten
from toolkit.diagnosis.policy import FOLLOWING
from toolkit.diagnosis.search.forward_step import Rival, at_bound, joint_fit, score_in_place
from toolkit.diagnosis.search.screen import LinearisedFit
from toolkit.effects.applied import AppliedEffect

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.diagnosis.search.candidates import CandidateEffect

    Array = NDArray[np.float64]


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
    for candidate in _alike(problem, joint, applied, listed)[: FOLLOWING.in_place]:
        instead = joint_fit(problem, replace(joint, active=others), (candidate,))
        if instead is not None and not any(at_bound(each) for each in instead.active):
            fits[candidate.key] = (instead, instead.active[-1])
    scores = {key: score_in_place(problem, *there) for key, there in fits.items()}
    best = max(scores, key=lambda key: scores[key])
    rivals = tuple(
        Rival(active=active, difference=scores[key] - scores[best])
        for key, (_, active) in fits.items()
        if key != best and not active.effect.nuisance
    )
    return *fits[best], rivals


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
    amount = np.array(
        [
            0.0 if each.off is None else applied.values[each.name] - each.off
            for each in applied.searched
        ]
    ) / sizes[own]  # fmt: skip
    beside = np.delete(np.arange(at), np.arange(own.start, own.stop))
    span = np.linalg.qr(
        np.vstack([_white(columns, beside, screen), problem.prior_rows(sizes, at)[:, beside]])
    )[0]

    def off(rows: Array) -> Array:
        return np.asarray(rows - span @ (span.T @ rows))

    none = np.zeros((len(problem.free), len(amount)))
    target = off(np.vstack([_white(columns, np.arange(own.start, own.stop), screen), none]) @ amount)
    size = float(target @ target)
    present = {each.key for each in joint.active}
    sought = [candidate for candidate in listed if candidate.key not in present and not candidate.discrete]
    screen.prepare(sought)
    ranked: list[tuple[float, AppliedEffect]] = []
    for candidate in sought:
        seen = []
        for scored in screen.score(candidate):
            rows = off(screen.rows(scored.directions))
            coefficients = np.linalg.lstsq(rows, target, rcond=1e-9)[0]
            taken = float(target @ (rows @ coefficients)) / max(size, 1e-300)
            reached = scored.valued(coefficients.tolist())
            if reached is not None and taken > FOLLOWING.alike:
                seen.append((taken, reached))
        ranked += sorted(seen, key=lambda entry: -entry[0])[:1]
    return [reached for _, reached in sorted(ranked, key=lambda entry: -entry[0])]


def _white(columns: dict[str, Array], chosen: NDArray[np.intp], screen: LinearisedFit) -> Array:
    layouts: dict[str, Layout] = screen.layouts
    return np.vstack(
        [
            whiten(columns[name][where.index][:, chosen], where, screen.base.noise[name])
            for name, where in layouts.items()
        ]
    )
