"""Differences from the reference at its loads, with what is left of U when the shared cancels, and their
significance.

Two tests never have quite the same loads. Inside the measured loads the value is that of the parabola
through the three nearest (of the line through two); it is a weighted sum, so its parts are too. What the
choice of the curve leaves is the difference of parabola and line, taken as the half-width of a rectangle
(JCGM 100:2008, 4.3.7). Beyond the outermost load nothing is read, but for 5 % of that load.

Holm's step-down procedure (Scand. J. Statist. 6, 1979, 65-70): of m hypotheses, ordered by p, the i-th
smallest is multiplied by m - i + 1; the largest so far stands. The chance of even one false decision in the
table is then at most the level, whatever the dependence.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal

import numpy as np
from numpy.typing import ArrayLike

from toolkit.arrays import Array
from toolkit.characteristics.catalogue import compared
from toolkit.characteristics.model import Row
from toolkit.characteristics.uncertain import Part, Uncertain, weighted
from toolkit.comparison.model import SECTIONS, Difference, Entry, PatternEffect, Section
from toolkit.units import in_both

REACH = 0.05  # of the outermost load
Series = tuple[str, str, float | None]
_SAME_ANGLE = 1e-6  # rad


def holm(p: Sequence[float | None]) -> tuple[float | None, ...]:
    """Return adjusted p values; those that are None were not decided and do not count.

    >>> [round(x, 10) for x in holm([0.01, 0.04, 0.03])]
    [0.03, 0.06, 0.06]
    """
    places = [place for place, value in enumerate(p) if value is not None]
    adjusted: list[float | None] = [None] * len(p)
    values = np.array([p[place] for place in places], dtype=np.float64)
    order = np.argsort(values, kind="stable")
    largest = np.maximum.accumulate(values[order] * (len(values) - np.arange(len(values))))
    for rank, index in enumerate(order):
        adjusted[places[index]] = float(min(largest[rank], 1.0))
    return tuple(adjusted)


def two_sided_p(value: float, u: float, dof: float) -> float | None:
    """Return the two-sided p of a value that has standard uncertainty ``u`` being zero; None without one.

    Student's t; normal for infinite degrees of freedom.
    """
    from scipy.special import ndtr, stdtr

    if not u > 0 or math.isnan(dof):
        return None
    t = -abs(value) / u
    return float(2 * (ndtr(t) if math.isinf(dof) else stdtr(dof, t)))


ROUNDED = 16 * float(np.finfo(np.float64).eps)


def deviations(values: ArrayLike) -> Array:
    """Return how far values (n,) lie from their mean; zeros where they differ by no more than rounding.

    >>> deviations([5.4, 5.4, 5.4 + 1e-15]).tolist(), deviations([1.0, 3.0]).tolist()
    ([0.0, 0.0, 0.0], [-1.0, 1.0])
    """
    array = np.asarray(values, dtype=np.float64)
    apart = array - array[0]  # of equal values nothing is left, whatever their size
    if np.ptp(apart) <= ROUNDED * np.abs(array).max():
        return np.zeros_like(array)
    return np.asarray(apart - apart.mean())


def printed_step(values: Array) -> float:
    """Return the step of the last digit that values are stated to.

    >>> printed_step(np.array([100.0, 101.0])), printed_step(np.array([1.0, 1.25]))
    (1.0, 0.01)
    """
    exponents = (Decimal(repr(value)).normalize().as_tuple().exponent for value in values.tolist())
    return 10.0 ** min(0, *(int(exponent) for exponent in exponents))


def grubbs_p(values: Array, step: float = 0.0) -> float | None:
    """Return the two-sided p of the value farthest from the mean (Grubbs, Technometrics 11, 1969, 1-21).

    None for fewer than three values, or values that are all the same. Values that are stated to a ``step``
    have its variance beside their own (GUM F.2.2.1): of 100, 101 and 101 the two need not be equal, and
    without it the third lies apart for certain.

    >>> round(grubbs_p(np.array([0.0, 0.1, -0.1, 0.05, 5.0])), 4) < 0.01
    True
    """
    from scipy.special import stdtr

    n = len(values)
    if n < 3:
        return None
    off = deviations(values)
    s = math.sqrt(float(off @ off) / (n - 1))
    if s <= 0:
        return None
    s = math.hypot(s, step / math.sqrt(12.0))
    G = float(np.max(np.abs(off))) / s
    remainder = (n - 1) ** 2 - n * G * G
    if remainder <= 0:
        return 0.0
    t = math.sqrt(n * (n - 2) * G * G / remainder)
    return min(1.0, 2 * n * float(stdtr(n - 2, -t)))


def at_load(rows: Sequence[Row], load_N: float, *, owner: str) -> Uncertain | None:
    """Return a series' value at a load [N]; None where its loads do not reach there.

    Parameters
    ----------
    rows : one series, any order, each load once
    owner : what the series belongs to; the way between its loads is its own
    """
    ordered = sorted(rows, key=lambda row: row.load_N)
    first, last = ordered[0].load_N, ordered[-1].load_N
    if not first * (1 - REACH) <= load_N <= last * (1 + REACH):
        return None
    near = sorted(ordered, key=lambda row: abs(row.load_N - load_N))
    if near[0].load_N == load_N:
        return near[0].number
    key = f"load interpolation/{owner}/{ordered[0].series}/{load_N:.6g}"
    if len(ordered) == 1:
        # One load tells no slope: the value stands, and proportion to the load is its uncertainty.
        only = near[0]
        bend = only.number.value * (load_N / only.load_N - 1)
        return _with(only.number, bend, key)
    # The two around it, or the outermost two; the third is the nearer neighbour of these.
    below = [row for row in ordered if row.load_N <= load_N]
    start = min(max(len(below) - 1, 0), len(ordered) - 2)
    pair = ordered[start : start + 2]
    if len(ordered) == 2:
        line = weighted(_through(pair, load_N))
        steep = (pair[1].number.value - pair[0].number.value) / (pair[1].load_N - pair[0].load_N)
        return _with(line, steep * (load_N - near[0].load_N) / 2, key)
    third = min((row for row in ordered if row not in pair), key=lambda row: abs(row.load_N - load_N))
    parabola = weighted(_through(sorted([*pair, third], key=lambda row: row.load_N), load_N))
    straight = sum(weight * number.value for weight, number in _through(pair, load_N))
    return _with(parabola, parabola.value - straight, key)


def _through(rows: Sequence[Row], load_N: float) -> list[tuple[float, Uncertain]]:
    """Return the terms of Lagrange's polynomial through the rows at a load."""
    terms = []
    for row in rows:
        weight = math.prod(
            (load_N - node.load_N) / (row.load_N - node.load_N) for node in rows if node is not row
        )
        terms.append((weight, row.number))
    return terms


def _with(number: Uncertain, half_width: float, key: str) -> Uncertain:
    return number.with_parts(Part(source="load interpolation", key=key, u=half_width / math.sqrt(3.0)))


def series_of(rows: Sequence[Row]) -> dict[Series, list[Row]]:
    """Return the rows that are compared, by (name, rotation, slip angle)."""
    series: dict[Series, list[Row]] = {}
    for row in rows:
        if row.characteristic.compared:
            angle = None if row.SA_rad is None else round(row.SA_rad / _SAME_ANGLE) * _SAME_ANGLE
            series.setdefault((row.name, row.rotation, angle), []).append(row)
    return series


def differences(entries: Sequence[Entry], *, level: float) -> tuple[tuple[Difference, ...], tuple[str, ...]]:
    """Return every difference of the others from the first entry, and what could not be compared.

    Significance is decided over each table as a whole: characteristics, and forces at slip angles.
    """
    reference = entries[0]
    base = series_of(reference.rows)
    compared_rows: list[Difference] = []
    left_out: list[str] = []
    for other in entries[1:]:
        other_series = series_of(other.rows)
        lacking: dict[str, None] = {}
        beyond: dict[float, None] = {}
        for series, rows in base.items():
            if series not in other_series:
                lacking[_said(series)] = None
                continue
            for row in sorted(rows, key=lambda row: row.load_N):
                number = at_load(other_series[series], row.load_N, owner=other.identity)
                if number is None:
                    beyond[round(row.load_N)] = None
                else:
                    compared_rows.append(_difference(series, row, number, other.label))
        left_out += _left_out(other.label, lacking, beyond)
    return tuple(row for part in SECTIONS for row in _decided(compared_rows, part, level)), tuple(left_out)


def _difference(series: Series, row: Row, number: Uncertain, label: str) -> Difference:
    name, rotation, angle = series
    difference = weighted([(1.0, number), (-1.0, row.number)]).estimate()
    reference, other = row.number.estimate(), number.estimate()
    return Difference(
        part="curves" if angle is not None else "characteristics",
        name=name,
        rotation=rotation,
        SA_rad=angle,
        load_N=row.load_N,
        label=label,
        reference=reference,
        other=other,
        difference=difference,
        u_apart=math.hypot(reference.u, other.u),
        p=two_sided_p(difference.value, difference.u, difference.dof),
        p_holm=None,
        significant=False,
    )


def _decided(differences: Sequence[Difference], part: Section, level: float) -> list[Difference]:
    table = [difference for difference in differences if difference.part == part]
    adjusted = holm([difference.p for difference in table])
    return [
        replace(difference, p_holm=p, significant=p is not None and p < level)
        for difference, p in zip(table, adjusted, strict=True)
    ]


def _said(series: Series) -> str:
    name, rotation, angle = series
    return name + ("" if rotation == "both" else f" {rotation}") if angle is None else f"{name} {rotation}"


def _left_out(label: str, lacking: dict[str, None], beyond: dict[float, None]) -> list[str]:
    sentences = []
    if lacking:
        sentences.append(f"{label} has no {', '.join(lacking)}")
    if beyond:
        sentences.append(f"{label} does not reach the load {in_both(list(beyond), 'N', '.0f')}")
    return sentences


def pattern_effects(entries: Sequence[Entry]) -> tuple[PatternEffect, ...]:
    """Return the pattern effects of two prototypes whose belt cords mirror each other.

        pattern effect = (PRAT_regular + PRAT_reversed)/2,   body effect = (PRAT_regular - PRAT_reversed)/2

    The belt's part of PRAT changes its sign with the cords, the tread's does not (source document, 6.1.1). By
    either definition of PRAT, at 0 deg and at FY = 0; empty without one regular and one reversed belt.
    """
    regular = [entry for entry in entries if entry.condition("belt") == "regular"]
    turned = [entry for entry in entries if entry.condition("belt") == "reversed"]
    if len(regular) != 1 or len(turned) != 1:
        return ()
    regular_series, turned_series = series_of(regular[0].rows), series_of(turned[0].rows)
    effects = []
    for declared in compared():
        series = (declared.name, "both", None)
        if not declared.belt_sign or series not in turned_series:
            continue
        for row in sorted(regular_series.get(series, ()), key=lambda row: row.load_N):
            other = at_load(turned_series[series], row.load_N, owner=turned[0].identity)
            if other is not None:
                effects.append(
                    PatternEffect(
                        name=declared.name,
                        load_N=row.load_N,
                        regular=row.number.estimate(),
                        reversed=other.estimate(),
                        pattern=weighted([(0.5, row.number), (0.5, other)]).estimate(),
                        body=weighted([(0.5, row.number), (-0.5, other)]).estimate(),
                    )
                )
    return tuple(effects)
