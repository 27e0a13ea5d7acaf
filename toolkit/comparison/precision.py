"""Precision of repeats by ISO 5725: repeatability, intermediate precision by factor, Mandel's h and k.

Repeatability (5725-2) and intermediate precision (5725-3) come of a one-way random-effects analysis of
variance with unequal cells: with n_i tests in level i of p levels and N in all,

    s_w^2 = sum_i sum_j (y_ij - y_i)^2 / (N - p)
    n_0   = (N - sum n_i^2 / N) / (p - 1)
    s_b^2 = max(0, (MS_between - s_w^2) / n_0)

and the intermediate precision with that factor different is sqrt(s_w^2 + s_b^2). The interval of the spread
of all tests counts what tests of one level share (`total_spread`). A factor is told apart from another only
where they did not change together; repeatability needs two tests of the same day, operator, mounting,
calibration, machine and laboratory. Reproducibility needs another laboratory.

Mandel's statistics tell which laboratory lies apart, and which scatters more than the others (5725-2, 7.3.1):

    h = (y - m) / s       m, s: mean and standard deviation of the p laboratories' means y
    k = s_i / s_r         s_r: the repeatability, pooled over all laboratories

At level a, two-sided for h and one-sided for k, with F of n_i - 1 and N - n_i degrees of freedom of N in all:

    |h| > (p - 1) t / sqrt(p (p - 2 + t^2))         t of p - 2 degrees of freedom, a / 2 above it
    k > sqrt(N F / (N - n_i + n_i F)), where n_i and N count degrees of freedom

For equal numbers of results that is the standard's table of critical values; for different ones each
laboratory has a limit of its own. 5 % tells a straggler, 1 % an outlier.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from toolkit.arrays import Array
from toolkit.comparison.differences import (
    Series,
    at_load,
    deviations,
    grubbs_p,
    holm,
    printed_step,
    series_of,
)
from toolkit.comparison.model import Entry, Factor, FactorSpread, Precision, Repeats, Spread

FACTORS = ("day", "operator", "mounting", "calibration", "machine", "laboratory")
Departure = Literal["straggler", "outlier"]
STRAGGLER, OUTLIER = 0.05, 0.01
FEWEST = 3
"""Laboratories below which h says nothing: of two it is 0.71, whatever they report."""


def repeats_of(entries: Sequence[Entry], *, level: float) -> Repeats:
    """Return the precision of tests of one tire, in every characteristic at the first test's loads."""
    factors = factors_of(entries)
    varied = [factor for factor in factors if factor.varied]
    cells = list(zip(*(factor.levels for factor in factors if None not in factor.levels), strict=True)) or [
        () for _ in entries
    ]
    precisions = []
    labels = [entry.label for entry in entries]
    everywhere = [series_of(entry.rows) for entry in entries]
    for series, rows in everywhere[0].items():
        if series[2] is not None or any(series not in other for other in everywhere):
            continue
        for row in sorted(rows, key=lambda row: row.load_N):
            numbers = [
                at_load(series_there[series], row.load_N, owner=entry.identity)
                for series_there, entry in zip(everywhere, entries, strict=True)
            ]
            values = [number.value for number in numbers if number is not None]
            if len(values) == len(entries):
                precisions.append(_precision(series, row.load_N, np.array(values), cells, varied, labels))
    laboratory = next(factor for factor in factors if factor.name == "laboratory")
    reproducible = laboratory.varied and None not in laboratory.levels
    return Repeats(
        precisions=_decided(precisions, level),
        factors=factors,
        reproducibility="laboratory" if reproducible else None,
        reproducibility_note="the spread with factor laboratory different is the reproducibility"
        if reproducible
        else "not stated: reproducibility needs tests of another laboratory (ISO 5725-1)",
    )


def factors_of(entries: Sequence[Entry]) -> tuple[Factor, ...]:
    """Return the factors of the tests and which of them changed together."""
    levels = {name: tuple(entry.condition(name) for entry in entries) for name in FACTORS}
    split = {name: _partition(listed) for name, listed in levels.items() if None not in listed}
    factors = []
    for name, listed in levels.items():
        stated = None not in listed
        varied = stated and len(set(listed)) > 1
        aliases = tuple(
            other for other, parts in split.items() if varied and other != name and parts == split[name]
        )
        if not stated:
            note = f"not stated by {sum(level is None for level in listed)} of {len(listed)} tests"
        elif not varied:
            note = "the same in all tests"
        elif aliases:
            note = f"changed together with {', '.join(aliases)}: what they add cannot be told apart"
        else:
            note = None
        factors.append(Factor(name=name, levels=listed, varied=varied, same_as=aliases, note=note))
    return tuple(factors)


def _partition(levels: Sequence[Hashable]) -> tuple[int, ...]:
    """Return the levels as numbers in the order in which they first come."""
    numbers: dict[Hashable, int] = {}
    return tuple(numbers.setdefault(level, len(numbers)) for level in levels)


def _precision(
    series: Series,
    load_N: float,
    values: Array,
    cells: Sequence[Hashable],
    varied: Sequence[Factor],
    labels: Sequence[str],
) -> Precision:
    name, rotation, _ = series
    variance, dof = _within(values, cells)
    repeatability = spread(math.sqrt(variance), dof) if dof else None
    farthest = int(np.argmax(np.abs(values - values.mean())))
    return Precision(
        farthest=labels[farthest],
        outlier_p=grubbs_p(values),
        name=name,
        rotation=rotation,
        load_N=load_N,
        n=len(values),
        mean=float(values.mean()),
        total=total_spread(values, [factor.levels for factor in varied]),
        repeatability=repeatability,
        limit_r=1.96 * math.sqrt(2.0) * repeatability.value if repeatability else None,
        factors=tuple(factor_spread(values, factor.levels, factor=factor.name) for factor in varied),
    )


def _within(values: Array, levels: Sequence[Hashable]) -> tuple[float, int]:
    """Return the pooled variance inside levels and its degrees of freedom."""
    squares, dof = 0.0, 0
    for level in dict.fromkeys(levels):
        members = values[[entry == level for entry in levels]]
        squares += float(np.sum(deviations(members) ** 2))
        dof += len(members) - 1
    return (squares / dof if dof else 0.0), dof


def factor_spread(values: Array, levels: Sequence[Hashable], *, factor: str) -> FactorSpread:
    """Return what a factor with at least two levels adds to the spread of values (tests,)."""
    from scipy.special import fdtrc

    N = len(values)
    sizes = np.array(
        [sum(entry == level for entry in levels) for level in dict.fromkeys(levels)], dtype=float
    )
    p = len(sizes)
    if p == N:
        # Every test has a level of its own: the spread of all is the intermediate precision itself.
        s = math.sqrt(float(np.sum(deviations(values) ** 2)) / (N - 1))
        return FactorSpread(factor=factor, levels=p, s=s, s_between=None, F=None, p=None)
    within, dof = _within(values, levels)
    off = deviations(values)
    means = np.array([off[[entry == level for entry in levels]].mean() for level in dict.fromkeys(levels)])
    between = float(np.sum(sizes * means**2)) / (p - 1)
    n0 = (N - float(np.sum(sizes**2)) / N) / (p - 1)
    s_between = math.sqrt(max(0.0, (between - within) / n0))
    F = between / within if within > 0 else None
    return FactorSpread(
        factor=factor,
        levels=p,
        s=math.hypot(math.sqrt(within), s_between),
        s_between=s_between,
        F=F,
        p=None if F is None else float(fdtrc(p - 1, dof, F)),
    )


def spread(s: float, dof: int) -> Spread:
    """Return a standard deviation with its 95 % interval from the chi-squared distribution.

    >>> s = spread(1.0, 4)
    >>> round(s.low, 3), round(s.high, 3)  # sqrt(4/11.143), sqrt(4/0.4844)
    (0.599, 2.874)
    """
    from scipy.special import chdtri

    high = math.sqrt(dof / float(chdtri(dof, 0.975)))
    return Spread(value=s, dof=dof, low=s * math.sqrt(dof / float(chdtri(dof, 0.025))), high=s * high)


def _decided(precisions: Sequence[Precision], level: float) -> tuple[Precision, ...]:
    """Adjust each factor's F tests, and the tests for outliers, over their tables."""
    names = dict.fromkeys(factor.factor for row in precisions for factor in row.factors)
    adjusted: dict[tuple[int, str], float | None] = {}
    for name in names:
        tests = [
            (i, factor) for i, row in enumerate(precisions) for factor in row.factors if factor.factor == name
        ]
        for (i, _), p in zip(tests, holm([factor.p for _, factor in tests]), strict=True):
            adjusted[i, name] = p
    apart = holm([row.outlier_p for row in precisions])
    return tuple(
        replace(
            row,
            outlier_p_holm=apart[i],
            outlier=(p_apart := apart[i]) is not None and p_apart < level,
            factors=tuple(
                replace(factor, p_holm=p, significant=p is not None and p < level)
                for factor in row.factors
                for p in (adjusted[i, factor.factor],)
            ),
        )
        for i, row in enumerate(precisions)
    )


def total_spread(values: Array, factors: Sequence[Sequence[Hashable]]) -> Spread:
    """Return the standard deviation of tests (tests,) with the interval of what a test of any level scatters.

    Tests of one level of a factor share what the level adds: they are fewer than they look. The interval is
    that of s_w^2 + s_b^2 for unequal cells by the modified large-sample method (Burdick and Graybill,
    Confidence Intervals on Variance Components, 1992), with the variance of the levels' means and their
    harmonic mean size; of several factors, the widest to either side.

    Parameters
    ----------
    factors : levels of each factor (tests,)
    """
    from scipy.special import chdtri

    N = len(values)
    alone = spread(float(values.std(ddof=1)), N - 1)
    off = deviations(values)
    ends = []
    for levels in factors:
        cells = [off[[entry == level for entry in levels]] for level in dict.fromkeys(levels)]
        p = len(cells)
        if not 1 < p < N:
            continue
        within, inside = _within(values, levels)
        harmonic = p / sum(1 / len(cell) for cell in cells)
        parts = np.array([np.var([cell.mean() for cell in cells], ddof=1), (1 - 1 / harmonic) * within])
        dofs = np.array([p - 1, inside])
        below, above = 1 - dofs / chdtri(dofs, 0.025), dofs / chdtri(dofs, 0.975) - 1
        low = float(parts.sum() - np.linalg.norm(below * parts))
        ends.append((math.sqrt(max(low, 0.0)), math.sqrt(float(parts.sum() + np.linalg.norm(above * parts)))))
    if not ends:
        return alone
    return replace(alone, low=min(low for low, _ in ends), high=max(high for _, high in ends))


@dataclass(frozen=True, slots=True, kw_only=True)
class Consistency:
    """A laboratory's h and k, None where there are too few laboratories or repeats, and what they tell."""

    h: float | None
    k: float | None
    h_departure: Departure | None
    k_departure: Departure | None


def consistencies(results: Sequence[Sequence[float]]) -> tuple[Consistency, ...]:
    """Return h and k of every laboratory from its results, their numbers equal or not.

    An h departs where it would beside the variance of the results' last digit too, as for `grubbs_p`.

    >>> [round(laboratory.h, 3) for laboratory in consistencies([[1.0], [2.0], [6.0]])]
    [-0.756, -0.378, 1.134]
    """
    p = len(results)
    off = deviations([values[0] + float(np.mean(np.subtract(values, values[0]))) for values in results])
    scatter = math.sqrt(float(off @ off) / (p - 1)) if p > 1 else 0.0
    step = printed_step(np.concatenate([np.asarray(values, dtype=np.float64) for values in results]))
    sure = scatter / math.hypot(scatter, step / math.sqrt(12.0))
    dofs = [len(values) - 1 for values in results]
    squares = [float(np.sum(deviations(values) ** 2)) for values in results]
    repeated = sum(dof > 0 for dof in dofs) > 1 and sum(squares) > 0
    s_r = math.sqrt(sum(squares) / sum(dofs)) if repeated else math.nan
    laboratories = []
    for apart, dof, square in zip(off.tolist(), dofs, squares, strict=True):
        h = apart / scatter if p >= FEWEST and scatter > 0 else None
        k = math.sqrt(square / dof) / s_r if repeated and dof else None
        h_limits = [h_limit(p, level) / sure for level in (STRAGGLER, OUTLIER)] if h is not None else []
        k_limits = [k_limit(dof, sum(dofs), level) for level in (STRAGGLER, OUTLIER)] if k is not None else []
        laboratories.append(
            Consistency(h=h, k=k, h_departure=_departure(h, h_limits), k_departure=_departure(k, k_limits))
        )
    return tuple(laboratories)


def _departure(statistic: float | None, limits: Sequence[float]) -> Departure | None:
    if statistic is None:
        return None
    straggler, outlier = limits
    if abs(statistic) > outlier:
        return "outlier"
    return "straggler" if abs(statistic) > straggler else None


def h_limit(laboratories: int, level: float) -> float:
    """Return the critical value of |h| of three laboratories or more.

    >>> round(h_limit(10, 0.01), 2), round(h_limit(10, 0.05), 2)
    (2.18, 1.8)
    """
    from scipy.special import stdtrit

    p = laboratories
    t = float(stdtrit(p - 2, 1 - level / 2))
    return (p - 1) * t / math.sqrt(p * (p - 2 + t * t))


def k_limit(dof: int, total: int, level: float) -> float:
    """Return the critical value of k: ``dof`` of the laboratory and ``total`` of all, it among them.

    >>> round(k_limit(1, 10, 0.01), 2), round(k_limit(2, 20, 0.05), 2)  # ten of two, of three results
    (2.32, 1.68)
    """
    from scipy.special import fdtri

    F = float(fdtri(dof, total - dof, 1 - level))
    return math.sqrt(total * F / (total - dof + dof * F))
