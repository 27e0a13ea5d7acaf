"""Precision of repeats: ISO 5725-2 repeatability, ISO 5725-3 intermediate precision by factor.

A one-way random-effects analysis of variance with unequal cells: with n_i tests in level i of p levels
and N in all,

    s_w^2 = sum_i sum_j (y_ij - y_i)^2 / (N - p)
    n_0   = (N - sum n_i^2 / N) / (p - 1)
    s_b^2 = max(0, (MS_between - s_w^2) / n_0)

and the intermediate precision with that factor different is sqrt(s_w^2 + s_b^2). A factor is told apart from
another only where they did not change together; repeatability needs two tests of the same day, operator,
mounting, calibration, machine and laboratory. Reproducibility needs another laboratory.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from toolkit.comparison.at_load import at_load
from toolkit.comparison.differences import Series, series_of
from toolkit.comparison.model import Entry, Factor, FactorSpread, Precision, Repeats, Spread
from toolkit.comparison.significance import grubbs_p, holm

FACTORS = ("day", "operator", "mounting", "calibration", "machine", "laboratory")


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
    values: NDArray[np.float64],
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
        total=spread(float(values.std(ddof=1)), len(values) - 1),
        repeatability=repeatability,
        limit_r=1.96 * math.sqrt(2.0) * repeatability.value if repeatability else None,
        factors=tuple(factor_spread(values, factor.levels, factor=factor.name) for factor in varied),
    )


def _within(values: NDArray[np.float64], levels: Sequence[Hashable]) -> tuple[float, int]:
    """Return the pooled variance inside levels and its degrees of freedom."""
    squares, dof = 0.0, 0
    for level in set(levels):
        members = values[[entry == level for entry in levels]]
        squares += float(np.sum((members - members.mean()) ** 2))
        dof += len(members) - 1
    return (squares / dof if dof else 0.0), dof


def factor_spread(values: NDArray[np.float64], levels: Sequence[Hashable], *, factor: str) -> FactorSpread:
    """Return what a factor with at least two levels adds to the spread of values (tests,)."""
    from scipy.special import fdtrc

    N = len(values)
    sizes = np.array(
        [sum(entry == level for entry in levels) for level in dict.fromkeys(levels)], dtype=float
    )
    p = len(sizes)
    if p == N:
        # Every test has a level of its own: the spread of all is the intermediate precision itself.
        s = float(values.std(ddof=1))
        return FactorSpread(factor=factor, levels=p, s=s, s_between=None, F=None, p=None)
    within, dof = _within(values, levels)
    means = np.array([values[[entry == level for entry in levels]].mean() for level in dict.fromkeys(levels)])
    between = float(np.sum(sizes * (means - values.mean()) ** 2)) / (p - 1)
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
