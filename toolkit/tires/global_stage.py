"""One stage of a global fit: the free parameters of one channel (or two) searched, then judged.

The search starts from the model's own starts and deterministic variations of them. Few steps show which
starts lose; the rest go on to the end. A parameter that the data do not determine is set to its neutral
default where the fit is as good with it: all defaults together lie in the 95 % region of the whole model, and
raise its cost by no more than a thousandth, for a model's own misfit is no noise. Else it stays where the
search ended, named, and free in the covariance, so that the errors of what moves with it stay true.

An interval is linear first, with what is held at a default anywhere within its bounds. Each of its ends is
held and all else fitted again: where the cost rises less than it should, the end moves out, and an end that
fits better begins the search anew. Every end of the search whose cost the noise cannot tell from the lowest
lies within the intervals: parameters in which such ends differ are not determined, however well each fits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolkit.arrays import Array
from toolkit.estimate import coverage_factor
from toolkit.tires.global_data import Measured
from toolkit.tires.global_misfit import Misfit, Task
from toolkit.tires.global_noise import Covariance, Noise, noise_of
from toolkit.tires.global_solver import Box, Descent, descend, descend_each, spread_starts

_SAME = 1e-3  # the files contract: starts that agree in cost to this are at one minimum
_EXACT = 1e-18  # a cost below this share of the data's square is rounding
_PLAN = (12, 6, 5, 60)  # starts, first steps, how many go on, steps to the end
_PATIENT = (36, 8, 10, 90)
_AGAIN = (25, 12, 8, 90)
_REFITS = 15  # steps by which all else is fitted again where one parameter is held
_PARABOLA, _LEAST_RISE = 0.7, 1e-2  # of the expected rise: below, an interval's end moves out, and so far
_WIDE = (0.3, 2.5)  # an interval of more than 30 % of the value and 2.5 sizes to either side says little
_LEVEL = 0.95
_BIWEIGHT = 4.685  # 95 % efficiency on normal noise
_POLISH = 4_000_000  # rows x inner points x copies that a polish on the rows may cost a step


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StageFit:
    """What a stage found: ``values`` of all parameters, ``covariance`` of those that stayed ``free``.

    ``held`` were set to their defaults, and ``spread`` that of ``free`` and ``held`` with the held
    ones moving within their bounds: what follows from the curve, a stiffness, is uncertain by theirs too, and
    so is every parameter: ``covariance`` is the part of the free ones.
    ``fixed`` (place, reason); ``bound`` places at a bound; ``undetermined`` places without a standard error;
    ``time`` autocorrelation time of the residuals; ``dof`` degrees of freedom;
    ``bin_width`` [rad] of the means that were fitted, zero where the rows were; ``kept`` names what was not
    physical between the rows in a first search, in which it was free to.
    """

    values: Array
    free: tuple[int, ...]
    covariance: Array
    held: tuple[int, ...]
    spread: Array
    fixed: tuple[tuple[int, str], ...]
    bound: tuple[int, ...]
    undetermined: tuple[int, ...]
    starts: int
    agreeing: int
    time: float
    dof: float
    bin_width: float
    kept: tuple[str, ...] = ()


def run(task: Task, coarse: Measured, count: Array, width: float, *, again: int = 2) -> StageFit:
    """Return what a stage finds; ``coarse`` are the means of bins of ``width`` [rad], ``count`` rows each.

    ``again``: how often the search begins anew from a better end that an interval's ends have come upon.
    """
    scale = {name: float(np.sqrt(np.mean(task.data[name] ** 2))) or 1.0 for name in task.channels}
    weight = np.ones(len(task.data)) if task.sigma is None else 1.0 / task.sigma
    weight = weight / np.sqrt(np.mean(weight**2))
    coarse_weight = np.sqrt(count)
    if task.sigma is not None:
        coarse_weight = coarse_weight * _coarse(task.data, coarse, weight)
    search = Misfit(task, coarse, coarse_weight, scale, count)
    rows = Misfit(task, task.data, weight, scale)
    start = task.starts[:, list(task.free)]
    descent, starts = _search(search, start)
    searched = task.values, task.free
    floor = _EXACT * float(np.sum((search.y * search.weight) ** 2))
    agreeing = descent.agreeing(_SAME, floor)
    x = descend(search, descent.x[:1].copy(), search.box(), steps=30, tolerance=1e-10).x
    cheap = len(task.data) * task.model.grid * (len(task.free) + 1) <= _POLISH
    # Bin medians where outliers are many rows: their residuals are the noise then.
    judged = search if task.robust and not cheap else rows
    work = search
    if task.robust:
        work = judged
        x, work.weight = _reweight(work, x)
    fixed: list[tuple[int, str]] = []
    x = _prune(work, x, noise_of(judged, x, alike=task.robust), fixed)
    for misfit_of in (judged, rows):
        misfit_of.base, misfit_of.free = work.base.copy(), list(work.free)
    misfit = rows if cheap else search
    if cheap:
        x = descend(rows, x, rows.box(), steps=10, tolerance=1e-10).x
    noise = noise_of(judged, x, alike=task.robust)
    on_rows = cheap or len(coarse) == len(task.data)
    box = misfit.box()
    bound = _at_bound(x[0], box)
    values = misfit.base.copy()
    values[misfit.free] = x[0]
    free, held = tuple(misfit.free), tuple(place for place, _ in fixed)
    bounded = tuple(p for p, at in zip(free, bound, strict=True) if at)
    # What is held at a default may be anywhere within its bounds: the others move with it.
    every = Covariance(misfit, misfit.release(held, x), noise)
    spread, dof = every.covariance, every.dof
    factor = coverage_factor(dof)
    half = factor * every.errors[: len(free)]
    excess = factor**2 * noise.variance * every.largest
    rivals = _rivals(descent, searched, excess)[:, list(free)] - values[list(free)]
    sides = np.stack([half, half])
    if cheap and task.model.grid == 1 and not task.robust:
        sides, better = _profile(misfit, every.alike / noise.variance, half, excess)
        if better is not None and again:
            starts_of = np.concatenate([better[None], task.starts])
            return run(replace(task, starts=starts_of), coarse, count, width, again=again - 1)
    sides[0] = np.maximum(sides[0], -rivals.min(axis=0, initial=0.0))
    sides[1] = np.maximum(sides[1], rivals.max(axis=0, initial=0.0))
    half = sides.max(axis=0)
    wide = half > np.maximum(_WIDE[0] * np.abs(x[0]), _WIDE[1] * box.size)
    undetermined = [p for p, at, too in zip(free, bound, wide, strict=True) if at or too]
    linear = factor * every.errors[: len(free)]
    # Of each parameter by itself: what follows from all of them together, a stiffness, keeps their spread.
    stretch = np.where(linear > 1e-9 * half, half / np.maximum(linear, 1e-300), 1.0)
    covariance = spread[: len(free), : len(free)] * np.outer(stretch, stretch)
    return StageFit(
        values=values,
        free=free,
        covariance=covariance,
        held=held,
        spread=spread,
        fixed=tuple(fixed),
        bound=bounded,
        undetermined=tuple(undetermined),
        starts=starts,
        agreeing=agreeing,
        time=noise.time,
        dof=dof,
        bin_width=0.0 if on_rows else width,
    )


def _profile(misfit: Misfit, inverse: Array, half: Array, excess: float) -> tuple[Array, Array | None]:
    """Return how far the intervals reach below and above (2, reported), and all values of a better end.

    Each parameter is held at either end of its linear interval and all else is fitted again: where the cost
    rises by less than its parabola does, that end moves out. An end is better where the cost is lower by
    ``excess``. ``inverse`` (free, free) is that of the normal matrix.
    """
    box, count = misfit.box(), len(half)
    x = descend(misfit, misfit.base[misfit.free][None], box, steps=_REFITS, tolerance=1e-6)
    own = np.maximum(np.diag(inverse)[:count], 1e-300)
    step = inverse[:count] * (half / own)[:, None]
    ends = np.clip(np.concatenate([x.x - step, x.x + step]), box.low, box.high)
    held = np.tile(np.eye(count, len(inverse), dtype=np.bool_), (2, 1))
    moved = np.abs((ends - x.x)[held]).reshape(2, count)
    away = descend_each(misfit, ends, box, steps=_REFITS, tolerance=1e-4, held=held)
    lowest = int(np.argmin(away.cost))
    if away.cost[lowest] < x.cost[0] - excess:
        better = misfit.base.copy()
        better[misfit.free] = away.x[lowest]
        return np.stack([half, half]), better
    risen = (away.cost.reshape(2, count) - x.cost[0]) / np.maximum(moved**2 / own, 1e-300)
    # At a bound there is no way out, and where rounding leaves no interval nothing to be held against.
    risen = np.where(moved > 1e-9 * box.size[:count], risen, 1.0)
    return half * np.sqrt(np.maximum(_PARABOLA / np.maximum(risen, _LEAST_RISE), 1.0)), None


def _rivals(descent: Descent, searched: tuple[Array, tuple[int, ...]], excess: float) -> Array:
    # All values (rivals, parameters) at the ends whose cost the noise cannot tell from the lowest.
    base, free = searched
    ends = descent.x[descent.cost <= descent.cost[0] + excess]
    rivals = np.repeat(base[None], len(ends), axis=0)
    rivals[:, list(free)] = ends
    return rivals


def _coarse(data: Measured, coarse: Measured, weight: Array) -> Array:
    # Weights go by load block: each bin takes the mean weight of its block.
    total = np.bincount(data.block, weight**2, len(data.loads))
    rows = np.bincount(data.block, minlength=len(data.loads))
    return np.sqrt(total / np.maximum(rows, 1))[coarse.block]


def _search(misfit: Misfit, start: Array) -> tuple[Descent, int]:
    box = misfit.box()
    floor = _EXACT * float(np.sum(misfit.weight**2))
    best: Descent | None = None
    evaluations = 0
    for (many, first, keep, last), reach in ((_PLAN, 3.0), (_PATIENT, 8.0)):
        x = np.concatenate([start, spread_starts(start, box, max(many - len(start), 0), reach=reach)])
        best, count = _round(misfit, x, box, (first, keep, last), best)
        evaluations += count
        if best.agreeing(_SAME, floor) >= 2:
            return best, evaluations
    # A deep and narrow valley is found again from about its end, or it is not confirmed.
    many, first, keep, last = _AGAIN
    x = spread_starts(best.x[:1], box, many, reach=5.0) if best is not None else start
    best, count = _round(misfit, x, box, (first, keep, last), best)
    return best, evaluations + count


def _round(
    misfit: Misfit, x: Array, box: Box, plan: tuple[int, int, int], best: Descent | None
) -> tuple[Descent, int]:
    # A round of starts, joined with where the best of earlier rounds ended.
    first, keep, last = plan
    early = descend(misfit, x, box, steps=first, tolerance=1e-4)
    descent = descend(misfit, early.x[:keep].copy(), box, steps=last, tolerance=1e-6)
    if best is not None:
        cost = np.concatenate([best.cost, descent.cost])
        order = np.argsort(cost, kind="stable")
        descent = Descent(x=np.concatenate([best.x, descent.x])[order], cost=cost[order])
    return descent, len(x)


def _reweight(misfit: Misfit, x: Array) -> tuple[Array, Array]:
    # From least absolute values to Tukey's biweight: gross outliers would mislead a start by squares.
    base = misfit.weight.copy()
    box = misfit.box()
    for width in (0.3, 0.1, 0.05, 0.05):
        r = misfit.raw(x)[0] * base
        middle = max(float(np.median(np.abs(r))), 1e-12)
        misfit.weight = base / np.sqrt(np.sqrt(r**2 + (width * middle) ** 2) / middle)
        x = descend(misfit, x, box, steps=6, tolerance=1e-6).x
    sd = max(float(np.median(np.abs(misfit.raw(x)[0] * base))) / 0.6745, 1e-12)
    for _ in range(20):
        r = misfit.raw(x)[0] * base
        share = np.clip(1.0 - (r / (_BIWEIGHT * sd)) ** 2, 0.0, None)
        misfit.weight = base * np.maximum(share, 1e-9)
        before = x.copy()
        x = descend(misfit, x, box, steps=6, tolerance=1e-9).x
        if np.all(np.abs(x - before) <= 1e-4 * box.size):
            break
    return x, misfit.weight


def _at_bound(x: Array, box: Box) -> Sequence[bool]:
    margin = 1e-4 * box.size
    return [bool(is_at_bound) for is_at_bound in (x <= box.low + margin) | (x >= box.high - margin)]


def _prune(misfit: Misfit, x: Array, noise: Noise, fixed: list[tuple[int, str]]) -> Array:
    # One at a time, the worst first: parameters that are not determined move together. Every trial is held
    # against the whole model, not against the last trial: many small rises would add up to a large one.
    from scipy.special import fdtri

    survivors: set[int] = set()
    r = misfit(x)[0]
    total, rounding = float(r @ r), _EXACT * float(np.sum((misfit.y * misfit.weight) ** 2))
    while misfit.free:
        box = misfit.box()
        every = Covariance(misfit, x, noise)
        allowed = np.maximum(_WIDE[0] * np.abs(x[0]), _WIDE[1] * box.size)
        bound = np.array(_at_bound(x[0], box))
        excess = np.where(bound, 10.0, coverage_factor(every.dof) * every.errors / allowed)
        excess[[place in survivors for place in misfit.free]] = 0.0
        worst = int(np.argmax(excess))
        if excess[worst] <= 1.0:
            break
        place = misfit.free[worst]
        spec = misfit.model.parameters[place]
        value = float(x[0, worst])
        remaining_starts = np.delete(x, worst, axis=1)
        misfit.hold(place, spec.default)
        trial = descend(misfit, remaining_starts.copy(), misfit.box(), steps=12, tolerance=1e-7)
        count = len(fixed) + 1
        allowed_rise = min(count * float(fdtri(count, noise.dof, _LEVEL)) * noise.variance, _SAME * total)
        if trial.cost[0] <= total + allowed_rise + rounding:
            x = trial.x
            fixed.append((place, f"not determined by these data, fixed at its default {spec.default:g}"))
        else:
            # It matters, though its value is not known: it stays free, so that the errors of what moves
            # with it stay true, and is named.
            misfit.base[place] = value
            misfit.free.insert(worst, place)
            survivors.add(place)
    return x


def refit(task: Task, coarse: Measured, count: Array) -> Array:
    """Return all values after a descent from the first start on other rows; nothing is judged."""
    scale = {name: float(np.sqrt(np.mean(task.data[name] ** 2))) or 1.0 for name in task.channels}
    weight = np.sqrt(count)
    if task.sigma is not None:
        weight = weight * _coarse(task.data, coarse, 1.0 / task.sigma)
    misfit = Misfit(task, coarse, weight, scale)
    x = task.starts[:1, list(task.free)].copy()
    if task.robust:
        x, _ = _reweight(misfit, x)
    else:
        x = descend(misfit, x, misfit.box(), steps=40, tolerance=1e-8).x
    values = task.values.copy()
    values[list(task.free)] = x[0]
    return values
