"""Power: the smallest size of every effect that was not found which this recording would have shown."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.answer.answer import AbsentEffect, cut_short
from toolkit.diagnosis.policy import VERDICT
from toolkit.diagnosis.search.candidates import is_refuted
from toolkit.diagnosis.search.noise_floor import is_beyond_noise
from toolkit.effects.catalogue import effects

if TYPE_CHECKING:
    from toolkit.diagnosis.search.screen import LinearisedFit, Scored
    from toolkit.diagnosis.search.search import Search
    from toolkit.effects.effect import EffectParameter


NO_PLACE = "no place for it in this case"
NO_TIME = "it takes time, and the recording has none"
NO_SIZE = "it is there or not: it has no size"
NO_ORDER = "it remembers its way, and the rows have no order"
NO_STEPS = "the values stand on no steps coarser than their last digits that matter beside what is left"
REFUTED = "the recording has values that it cannot show"
NOT_TRIED = "it has a place in this case, and the last step of the search left it out"
OUTWEIGHED = "found, but what stays without a name outweighs it"
GIVEN_UP = "found, and given up for what explains as much"
UNDECIDED = "not decided: it shows, but not that it matters on rows that no fit has seen"
CUT_SHORT = "not decided: the search ended before all was tried"
HIDDEN = "no size is promised: what is left is larger than any noise, and may hide it"
VANISHES = "its response vanishes here, or the free parameters take it all"
TOO_LARGE = "it would not have been seen at any usual size that leaves the outputs in their own range"


def not_found(
    search: Search, names: set[str], *, alpha: float, units: dict[int, str]
) -> tuple[AbsentEffect, ...]:
    """Return every effect that is not named, with its minimum detectable size.

    A size is the power of a whole search: none is promised by one that was cut short, nor beside a rest that
    is too large to be noise and was weighed as if it were, nor of an effect that the recording seems to have,
    at whatever size, and that was not confirmed.

    Parameters
    ----------
    names : of the effects that are named
    alpha : of one test, so that the whole search keeps its own
    units : of the first parameter, by the identity of each scored
    """
    screen, scored = search.screen, search.scored
    open_for = dict.fromkeys(search.undecided, UNDECIDED)
    if cut_short(search.skipped):
        open_for = dict.fromkeys(effects(), CUT_SHORT) | open_for
    elif is_beyond_noise(search.problem, search.augmented):
        open_for = dict.fromkeys(effects(), HIDDEN) | open_for
    best: dict[str, tuple[float | None, str, bool]] = {}
    beyond: set[str] = set()
    for trial in scored:
        name = trial.candidate.name
        if name in names:
            continue
        length, share, amplitude = _distance(screen, trial)
        visible = share > VERDICT.observable and length > 0
        needed = _noncentrality(alpha, trial.dof)
        size = abs(amplitude) * needed / length if visible and amplitude else None
        times = needed / length if size is not None else 0.0
        if times > VERDICT.far or _is_beyond(screen, trial, size or 0.0, times):
            # No such size is met here, or nothing is known of the response to it.
            visible, beyond = False, beyond | {name}
        smallest = best.get(name)
        if (
            smallest is None
            or (visible and not smallest[2])
            or (visible and size is not None and (smallest[0] is None or size < smallest[0]))
        ):
            best[name] = (size if visible else None, units.get(id(trial), "1"), visible)
    entries = []
    for name in effects():
        if name in names:
            continue
        size, unit, visible = best.get(name, (None, "", False))
        if name not in best:
            why = _unscored(search, name)
            visible = why in (OUTWEIGHED, GIVEN_UP, NO_STEPS)
        elif not visible:
            why = TOO_LARGE if name in beyond else VANISHES
        else:
            why = open_for.get(name, NO_SIZE if size is None else "")
            size, unit = (None, "") if name in open_for else (size, unit)
        entries.append(
            AbsentEffect(name=name, minimum_detectable=size, unit=unit, observable=visible, why=why)
        )
    return tuple(entries)


def _unscored(search: Search, name: str) -> str:
    """Return why an effect has no response about the last fit."""
    effect = effects()[name]
    if any(step.active.effect.name == name for step in search.steps):
        return OUTWEIGHED
    if any(applied.effect.name == name for applied in search.screen.base.active):
        return GIVEN_UP
    places = search.problem.model.places(effect)
    if not places:
        return NO_PLACE
    if all(is_refuted(search.problem, effect, channel) for channel, _ in places):
        return REFUTED
    if effect.in_time and not search.problem.case.has_time:
        return NO_TIME
    if effect.remembers and not search.problem.case.has_order:
        return NO_ORDER
    return NO_STEPS if effect.from_digits and not cut_short(search.skipped) else NOT_TRIED


def _is_beyond(screen: LinearisedFit, trial: Scored, size: float, times: float) -> bool:
    """Tell whether a size is more than the case allows: its output's range, its runs, the effect's bounds.

    Parameters
    ----------
    size : of the first parameter, off its neutral value
    times : the size over that of the response
    """
    if times * _moved(screen, trial) > VERDICT.moved:
        return True
    first = _first(trial)
    if first is None or first.off is None or not math.isfinite(first.off):
        return False
    low, high = first.bounds
    longest = max(float(run.t[-1] - run.t[0]) for run in screen.problem.runs)
    late = first.unit == "s" and size > VERDICT.of_a_run * longest
    return late or not (first.off + size <= high or first.off - size >= low)


def _moved(screen: LinearisedFit, trial: Scored) -> float:
    """Return by how much of an output's recorded range a response moves it, the output it moves most."""
    shares = []
    for name, kept in screen.problem.kept.items():
        span = float(np.ptp(screen.problem.observed[name][kept])) if kept.any() else 0.0
        if span > 0:
            shares.append(float(np.abs(trial.directions[name][kept, 0]).max(initial=0.0)) / span)
    return max(shares, default=0.0)


def _distance(screen: LinearisedFit, trial: Scored) -> tuple[float, float, float]:
    """Return the whitened response off the nominal parameters, its share of the whole, and the amplitude."""
    raw = screen.rows(trial.directions)[:, 0]
    length = float(np.linalg.norm(raw))
    off_nominal = raw - screen.coloured.span @ (screen.coloured.span.T @ raw)
    amplitude = 0.0
    first = _first(trial)
    if first is not None:
        off = first.off if first.off is not None and math.isfinite(first.off) else 0.0
        amplitude = trial.start.directions[0][first.name] - off
    return (
        float(np.linalg.norm(off_nominal)),
        float(np.linalg.norm(off_nominal)) / max(length, 1e-300),
        amplitude,
    )


def _first(trial: Scored) -> EffectParameter | None:
    """Return the parameter of the first direction: what was switched on, off its own neutral value."""
    return next((size for size in trial.candidate.active.searched if size.off is not None), None)


def _noncentrality(alpha: float, dof: int) -> float:
    """Return the distance at which a chi-squared test of a level has 80 % power."""
    from scipy.special import chdtri, chndtrinc

    return math.sqrt(chndtrinc(chdtri(dof, alpha), dof, 1 - VERDICT.power))
