"""The same least squares once more, in exact rational arithmetic: the golden vectors of a record.

Data are doubles, hence exact binary fractions; sums of their products are exact integers over a power of
two, and the normal equations are solved in rationals. Nothing here is shared with the fit.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from operator import mul

from toolkit.calibration.terms import evaluate, parse_term


def solve_exactly(
    *,
    terms: Sequence[str],
    columns: Mapping[str, Sequence[float]],
    load: Sequence[float],
    weights: Sequence[float] | None = None,
) -> tuple[Fraction, ...]:
    """Return the least-squares coefficients of the raw terms as exact rationals.

    Raises
    ------
    ZeroDivisionError
        the terms are exactly dependent
    """
    names = sorted({name for t in terms for name in _names(t)})
    integers = {name: _integers(columns[name]) for name in names}
    matrix = [_term_integers(term, integers, len(load)) for term in terms]
    y, y_denominator = _integers(load)
    w, w_denominator = ([1] * len(y), 1) if weights is None else _integers(weights)
    weighted = [list(map(mul, column, w)) for column, _ in matrix]
    size = len(terms)
    normal = [[Fraction(0)] * (size + 1) for _ in range(size)]
    for i in range(size):
        for j in range(i, size):
            value = Fraction(_dot(weighted[i], matrix[j][0]), matrix[i][1] * matrix[j][1] * w_denominator)
            normal[i][j] = normal[j][i] = value
        normal[i][size] = Fraction(_dot(weighted[i], y), matrix[i][1] * y_denominator * w_denominator)
    return _eliminate(normal)


def golden_inputs(ranges: Sequence[tuple[float, float]]) -> tuple[tuple[float, ...], ...]:
    """Return points that excite every indication: the centre, the ends of each, each pair at its top."""
    middle = [(low + high) / 2 for low, high in ranges]
    points = [tuple(middle)]
    for i, (low, high) in enumerate(ranges):
        points += [(*middle[:i], end, *middle[i + 1 :]) for end in (low, high)]
    for i, j in itertools.combinations(range(len(ranges)), 2):
        point = list(middle)
        point[i], point[j] = ranges[i][1], ranges[j][1]
        points.append(tuple(point))
    return tuple(points)


def predict_exactly(
    *, terms: Sequence[str], coefficients: Sequence[Fraction], names: Sequence[str], point: Sequence[float]
) -> float:
    """Return the load at a point, computed in rationals and rounded once."""
    columns = {name: Fraction(value) for name, value in zip(names, point, strict=True)}
    total = Fraction(0)
    for term, coefficient in zip(terms, coefficients, strict=True):
        total += coefficient * evaluate(parse_term(term), columns, Fraction(1))
    return float(total)


def _names(term: str) -> Iterable[str]:
    parsed = parse_term(term)
    return [name for name, _ in parsed.powers] + list(parsed.absolutes)


def _integers(values: Sequence[float]) -> tuple[list[int], int]:
    ratios = [float(value).as_integer_ratio() for value in values]
    common = max(denominator for _, denominator in ratios)
    return [number * (common // denominator) for number, denominator in ratios], common


def _term_integers(
    term: str, integers: Mapping[str, tuple[list[int], int]], rows: int
) -> tuple[list[int], int]:
    parsed = parse_term(term)
    column, denominator = [1] * rows, 1
    for name, power in parsed.powers:
        column = [a * b**power for a, b in zip(column, integers[name][0], strict=True)]
        denominator *= integers[name][1] ** power
    for name in parsed.absolutes:
        column = [a * abs(b) for a, b in zip(column, integers[name][0], strict=True)]
        denominator *= integers[name][1]
    return column, denominator


def _dot(a: Sequence[int], b: Sequence[int]) -> int:
    return sum(map(mul, a, b))


def _eliminate(rows: list[list[Fraction]]) -> tuple[Fraction, ...]:
    size = len(rows)
    for i in range(size):
        pivot = next((r for r in range(i, size) if rows[r][i] != 0), None)
        if pivot is None:
            raise ZeroDivisionError("the terms are exactly dependent")
        rows[i], rows[pivot] = rows[pivot], rows[i]
        rows[i] = [value / rows[i][i] for value in rows[i]]
        for r in range(size):
            if r != i and rows[r][i] != 0:
                factor = rows[r][i]
                rows[r] = [a - factor * b for a, b in zip(rows[r], rows[i], strict=True)]
    return tuple(row[size] for row in rows)
