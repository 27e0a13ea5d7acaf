"""Laws as the rivals of effects: simpler, and no worse on rows that no fit has seen.

The other way round, effects that only imitate a law are dropped: beside it nothing is left for them to
explain.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.fit import fit, sizes_off
from toolkit.diagnosis.fit.folds import hold_out, unseen_error
from toolkit.diagnosis.fit.sensor_noise import noise_parts
from toolkit.diagnosis.law.foretelling import before_nothing
from toolkit.diagnosis.law.learn import Law, Laws, learned
from toolkit.diagnosis.policy import LAWS, STEP, VERDICT
from toolkit.diagnosis.search.superfluous import without
from toolkit.diagnosis.search.time_budget import BudgetSpentError, TimeBudget
from toolkit.errors import FitError

if TYPE_CHECKING:
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.folds import HeldOut
    from toolkit.diagnosis.fit.problem import Problem
    from toolkit.diagnosis.search.forward_step import Step
    from toolkit.diagnosis.search.search import Search
    from toolkit.effects.applied import AppliedEffect


def judged_by_laws(search: Search, laws: Laws, *, seed: int, budget: TimeBudget) -> tuple[Search, Laws]:
    """Return a search and its laws, or laws alone where these have fewer parameters and foretell as well.

    Effects imitate much that they are not, and a law beside one then mends what is left. Asked where laws
    stand beside effects, where these leave what is known to be no noise, and in an equation where they leave
    more than the sensor's noise: what is missing there rings, coloured noise takes it up, and no structure
    shows. In an equation a name that leaves more than the sensor's noise where laws that foretell no worse do
    not is lost: it imitates them. Else what takes nearly all that the laws take, or most of it with fewer
    parameters, keeps its name, and any other loses it where all that is named has another size beside them.
    """
    predicting = any(law.predicts for law in laws.listed)
    is_asked = predicting or _leaves_process_noise(search)
    beside = any(step.active.key == applied.key for step in search.steps for applied in laws.fit.active)
    if not beside or not is_asked or not laws.complete:
        return search, laws
    leaves_noise = _leaves_process_noise(search)
    least = LAWS.same if leaves_noise else VERDICT.nearly
    # Laws take at most all there is: where one effect takes nearly that, it keeps its name whatever they are.
    settled = len(_effects(search)) < 2 and take_as_much(
        search.problem, search.held_refitted, search.held_augmented, None, least=least
    )
    if settled and not leaves_noise:
        return search, laws
    try:
        bare = before_nothing(_bare(search), seed=seed, budget=budget)
    except BudgetSpentError:
        return search, replace(laws, complete=False)
    if settled and not bare.problem.shown_sd:
        return search, laws
    alone = learned(bare, withdrawn=False, budget=budget)
    if not any(law.predicts for law in alone.listed):
        return search, laws if alone.complete else replace(laws, complete=False)
    if (
        bare.problem.shown_sd
        and leaves_noise
        and not _process_noise(search, alone.fit)
        and _foretell_no_worse(search, alone)
    ):
        return bare, alone
    alike = take_as_much(
        search.problem, search.held_refitted, search.held_augmented, alone.held_out,
        least=least_share(search.augmented, alone.fit, least),
    )  # fmt: skip
    fewer = _does_with_fewer(search, alone)
    if alike and not fewer:
        return search, laws
    if fewer and (formula := _own_formula(search, alone)) is not None:
        return formula, learned(formula, withdrawn=False, budget=budget)
    if not fewer and any(_holds_beside(laws, step) for step in search.steps):
        more = parameters_of(alone.fit) - parameters_of(laws.fit)
        beside_laws = laws.held_out if predicting else search.held_augmented
        # Of as many parameters it has to be better, by its score and in some output, of fewer no worse.
        least = STEP.least_gain if more == 0 else -STEP.least_gain
        worse = more > 0 or alone.held_out.total - beside_laws.total < least
        if worse or (
            more == 0
            and take_as_much(
                search.problem, search.held_refitted, beside_laws, alone.held_out, least=LAWS.same
            )
        ):
            return search, laws
    elif alone.held_out.total - search.held_augmented.total < STEP.least_gain:
        return search, laws
    return bare, alone


def least_share(named: Fit, laws: Fit, least: float = LAWS.same) -> float:
    """Return the share of what laws in their place take that effects have to take to keep their names.

    A shape with more in it takes more of whatever is left, and has to earn it: beside laws with more
    parameters most is enough.

    Parameters
    ----------
    least : of laws with no more parameters
    """
    return min(least, VERDICT.taken) if parameters_of(named) < parameters_of(laws) else least


def _does_with_fewer(search: Search, alone: Laws) -> bool:
    """Tell whether the first laws do better with fewer terms and fewer parameters than all effects together.

    A law may be one effect's own formula, with a size more or less. It is not that of two: these imitate it
    together, however much of it they take. Better is a higher held-out score, and less error on unseen rows
    over all outputs. What laws further mend is no matter of the effects.
    """
    problem, most = search.problem, len(_effects(search)) - 1
    first: list[AppliedEffect] = []
    for law in _whole(alone.listed)[:most]:
        added = [*first, *(each.applied for each in law.together)]
        if _searched(added) >= parameters_of(search.augmented):
            break
        first = added
    if not first:
        return False
    held_out = alone.held_out
    if len(first) < len(alone.fit.active):
        try:
            made = fit(problem, first, start=alone.fit.p)
            held_out = hold_out(problem, search.folds, made.active, made)
        except FitError:
            return False
    gain = held_out.total - search.held_augmented.total
    return gain >= STEP.least_gain and unseen_error(problem, held_out) < unseen_error(
        problem, search.held_augmented
    )


def _own_formula(search: Search, alone: Laws) -> Search | None:
    """Return a search with the one effect whose own formula the first law is; None where it is that of none.

    What several effects did together the law does better. One of them may do what it does alone: then that is
    what is missing, and the others mended its form.
    """
    problem, first = search.problem, _whole(alone.listed)[:1]
    added = [each.applied for law in first for each in law.together]
    try:
        of_law = fit(problem, added, start=alone.fit.p)
        unseen_of_law = hold_out(problem, search.folds, of_law.active, of_law)
        for step in _effects(search):
            of_effect = fit(problem, (step.active,), start=search.augmented.p)
            unseen = hold_out(problem, search.folds, of_effect.active, of_effect)
            least = least_share(of_effect, of_law)
            if take_as_much(problem, search.held_refitted, unseen, unseen_of_law, least=least):
                gained = unseen.total - search.held_refitted.total
                alone_step = replace(step, active=of_effect.active[0], held_out_gain=gained, rivals=())
                return replace(
                    search, steps=(alone_step,), augmented=of_effect, held_augmented=unseen,
                    structure=search.structure_before,
                )  # fmt: skip
    except FitError:
        pass
    return None


def _whole(listed: Sequence[Law]) -> list[Law]:
    """Return the laws of which others are the counterparts, and those without any."""
    counterparts = {id(each) for law in listed for each in law.together[1:]}
    return [law for law in listed if id(law) not in counterparts and law.predicts]


def _foretell_no_worse(search: Search, alone: Laws) -> bool:
    """Tell whether laws leave no output with more error on unseen rows than all effects do.

    What happened once, in one run, leaves little of it there and foretells nothing of another.
    """
    problem = search.problem
    return all(
        _error(problem, alone.held_out, name) <= _error(problem, search.held_augmented, name)
        for name in problem.names
        if problem.kept[name].any()
    )


def _effects(search: Search) -> list[Step]:
    """Return the steps that are no lattice of the recorded digits."""
    return [step for step in search.steps if not step.active.effect.from_digits]


def _holds_beside(laws: Laws, step: Step) -> bool:
    """Tell whether some size of an effect stays, by and large, what it was before laws stood beside it.

    What is there keeps its size when more of the rest is explained. One that only imitates gives way to what
    it imitates: it is another effect then, or has the other sign.
    """
    beside = next((applied for applied in laws.fit.active if applied.key == step.active.key), None)
    if beside is None:
        return False
    sizes = [parameter for parameter in step.active.searched if parameter.off is not None]
    before, after = (
        [applied.values[each.name] - (each.off or 0.0) for each in sizes] for applied in (step.active, beside)
    )
    return not sizes or any(
        before[i] * after[i] > 0 and LAWS.kept < abs(after[i] / before[i]) < 1 / LAWS.kept
        for i in range(len(sizes))
    )


def _turns_beside(laws: Laws, step: Step) -> bool:
    """Tell whether all sizes of an effect have the other sign where laws stand beside it."""
    beside = next((applied for applied in laws.fit.active if applied.key == step.active.key), None)
    sizes = [parameter for parameter in step.active.searched if parameter.off is not None]
    if beside is None or not sizes:
        return False
    before, after = (
        np.array([applied.values[each.name] - (each.off or 0.0) for each in sizes])
        for applied in (step.active, beside)
    )
    return bool((before * after < 0).all())


def _leaves_process_noise(search: Search) -> bool:
    """Tell whether the effects found leave what is no noise, or in an equation more than its sensors'."""
    if search.problem.memory:
        return True
    motion = search.problem.model.capability.motion
    if motion is None or not motion.integrates:
        return False
    return _process_noise(search, search.augmented)


def _process_noise(search: Search, fit: Fit) -> bool:
    parts = [noise_parts(search.problem, fit, name) for name in search.problem.names]
    return any(part.process_sd > part.sensor_sd for part in parts)


def without_untested(search: Search, laws: Laws) -> Search:
    """Return a search without the names that laws beside them outdo, where their last test was not made.

    It may have taken them away; the laws stand whether they are there or not.
    """
    if laws.complete or search.skipped or not outdone(search, laws):
        return search
    return _bare(search)


def outdone(search: Search, laws: Laws) -> bool:
    """Tell whether laws take several times what all effects take of unseen rows, in every output they are in.

    The effects then are at best the smaller part of what was left out.
    """
    if not search.steps or not any(law.predicts for law in laws.listed):
        return False
    problem, shown = search.problem, []
    for name in problem.names:
        if problem.kept[name].any():
            without, named, beside = (
                _error(problem, held_out, name)
                for held_out in (search.held_refitted, search.held_augmented, laws.held_out)
            )
            if max(without, named) > beside:
                shown.append(named - beside > LAWS.outdoes * (without - named))
    return bool(shown) and all(shown)


def _is_idle(made: Fit, step: Step) -> bool:
    """Tell whether the sizes of an effect, all together, are none within their interval."""
    from scipy.stats import chi2

    for applied in made.active:
        if applied.key == step.active.key:
            away, sizes = sizes_off(made, applied)
            return bool(sizes) and away < float(chi2.ppf(VERDICT.interval, len(sizes)))
    return False


def _bare(search: Search) -> Search:
    """Return a search without the effects that it found."""
    return replace(
        search, steps=(), augmented=search.refitted, held_augmented=search.held_refitted,
        structure=search.structure_before,
    )  # fmt: skip


def _error(problem: Problem, held_out: HeldOut, name: str) -> float:
    """Return the mean square of an output's error on unseen rows."""
    away = problem.judged(name, problem.observed[name] - held_out.simulated[name])
    return float(np.mean(away**2))


def take_as_much(
    problem: Problem, without: HeldOut, named: HeldOut, laws: HeldOut | None, *, least: float = LAWS.same
) -> bool:
    """Tell whether effects take nearly all that laws in their place take: these are then their own formulas.

    Parameters
    ----------
    without, named, laws : unseen rows with neither, with the effects, and with the laws in their place, None
        of laws that leave nothing
    least : share of what the laws take
    """
    for name in (name for name in problem.names if problem.kept[name].any()):
        before = _error(problem, without, name)
        by_laws = before - (0.0 if laws is None else _error(problem, laws, name))
        if before - _error(problem, named, name) < least * by_laws:
            return False
    return True


def parameters_of(fit: Fit) -> int:
    """Return how many parameters of effects and laws a fit has searched."""
    return _searched(fit.active)


def _searched(active: Sequence[AppliedEffect]) -> int:
    return sum(len(applied.searched) for applied in active)


def without_imitations(search: Search, laws: Laws, budget: TimeBudget) -> tuple[Search, Laws]:
    """Return a search and its laws without the effects that the laws made superfluous.

    Part of a law's answer looks like this effect or that one, and the search has only effects to name. One is
    dropped where the held-out score of the laws beside refitted parameters is as good without it, where laws
    as simple are better in its place and it is the small part of both, or where it has the other sign beside
    them. One that takes nearly all that the laws take in its place, or most of it with fewer parameters,
    keeps its name: they mend its form (a leak of the load into a force, before or after the filter).
    """
    if not any(law.predicts for law in laws.listed):
        return search, laws
    try:
        for dropped in _choices(search.steps):
            budget.check(f"laws without {', '.join(step.active.effect.name for step in dropped)}")
            refit = _dropped(search, laws, dropped)
            if refit is not None:
                return without_imitations(*refit, budget)
    except BudgetSpentError:
        laws = replace(laws, complete=False)
    return search, laws


def _choices(steps: tuple[Step, ...]) -> Iterator[tuple[Step, ...]]:
    """Give all effects together, then every one alone: two may hold each other up."""
    for count in sorted({len(steps), 1} - {0}, reverse=True):
        yield from itertools.combinations(steps, count)


def _is_minor(search: Search, laws: Laws, bare: Fit, alone: HeldOut) -> bool:
    """Tell whether laws with no more parameters than all effects foretell better in their place, and are the
    larger part of both: any bend is nearly a polynomial, and what that leaves is much.

    Parameters
    ----------
    bare, alone : the laws without the effects, and their held-out rows
    """
    both, named = laws.held_out.total, search.held_augmented.total
    return (
        2 * parameters_of(bare) <= parameters_of(laws.fit)
        and alone.total - named >= STEP.least_gain
        and both - named > LAWS.outdoes * (both - alone.total)
    )


def _dropped(search: Search, laws: Laws, dropped: tuple[Step, ...]) -> tuple[Search, Laws] | None:
    """Return both without some effects, None where they are needed."""
    problem = search.problem

    def remaining(active: tuple[AppliedEffect, ...]) -> tuple[AppliedEffect, ...]:
        for step in dropped:
            active = without(active, step.active)
        return active

    listed = remaining(laws.fit.active)
    if len(listed) == len(laws.fit.active):  # the laws began without them
        return None
    try:
        bare = fit(problem, listed, start=laws.fit.p)
        scores = hold_out(problem, search.folds, bare.active, bare)
        idle = outdone(search, laws) and all(_is_idle(laws.fit, step) for step in dropped)
        astray = all(_turns_beside(laws, step) for step in dropped)
        needed = laws.held_out.total - scores.total >= STEP.least_gain
        if (
            needed
            and not idle
            and not astray
            and not (dropped == search.steps and _is_minor(search, laws, bare, scores))
        ):
            return None
        steps = tuple(step for step in search.steps if step not in dropped)
        if steps:
            augmented = fit(problem, remaining(search.augmented.active), start=search.augmented.p)
            held_out = hold_out(problem, search.folds, augmented.active, augmented)
        else:
            augmented, held_out = search.refitted, search.held_refitted
    except FitError:
        return None
    least = least_share(search.augmented, bare)
    if take_as_much(problem, held_out, search.held_augmented, scores, least=least):
        return None
    values = {applied.key: applied for applied in (*bare.active, *augmented.active)}
    searched = replace(
        search,
        steps=tuple(replace(step, active=values[step.active.key]) for step in steps),
        augmented=augmented,
        held_augmented=held_out,
        structure=search.structure if steps else search.structure_before,
    )
    updated = tuple(replace(law, applied=values.get(law.applied.key, law.applied)) for law in laws.listed)
    return searched, replace(laws, listed=updated, fit=bare, held_out=scores)
