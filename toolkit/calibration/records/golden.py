"""Golden vectors of a record: its least squares once more, in exact rationals or in 60 digits and more.

Data are doubles, hence exact binary fractions. Ordinary and weighted least squares sum their products as
integers over a power of two and solve the normal equations in rationals. Fits with shared errors, or errors
in both variables, have decimal arithmetic on the raw terms: shared errors are further unknowns with a prior
of unit spread (Henderson's mixed-model equations), which has the same solution as generalised least squares
without its covariance ever being built. Nothing is centred, scaled or whitened, and nothing is shared with
the fit.

References: Henderson, Biometrics 31 (1975) 423; Britt and Luecke, Technometrics 15 (1973) 233.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from decimal import Decimal, localcontext
from fractions import Fraction
from operator import mul
from typing import Any

from toolkit.calibration.terms import Term, evaluate, parse_term, term_slopes

_DIGITS = 60
_SETTLED = Decimal("1e-24")
_ITERATIONS = 400
_Rows = list[list[Decimal]]


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
    names = sorted({name for term in terms for name in parse_term(term).indications})
    integers = {name: _integers(columns[name]) for name in names}
    matrix = [_term_integers(term, integers, len(load)) for term in terms]
    y, y_denominator = _integers(load)
    w, w_denominator = ([1] * len(y), 1) if weights is None else _integers(weights)
    weighted = [list(map(mul, column, w)) for column, _ in matrix]
    size = len(terms)
    normal = [[Fraction(0)] * size for _ in range(size)]
    right = []
    for i in range(size):
        for j in range(i, size):
            product = sum(map(mul, weighted[i], matrix[j][0]))
            normal[i][j] = normal[j][i] = Fraction(product, matrix[i][1] * matrix[j][1] * w_denominator)
        product = sum(map(mul, weighted[i], y))
        right.append(Fraction(product, matrix[i][1] * y_denominator * w_denominator))
    return tuple(_solve(normal, right))


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


def solve_gls_precisely(
    *,
    terms: Sequence[str],
    columns: Mapping[str, Sequence[float]],
    load: Sequence[float],
    u: Sequence[float] | None,
    group: Sequence[int],
    u_shared: float,
    proportional: bool,
) -> tuple[Fraction, ...]:
    """Return the coefficients by the covariance of `session.known_errors`.

    Raises
    ------
    ArithmeticError
        the terms are dependent
    """
    with localcontext() as context:
        context.prec = _digits(terms, columns)
        x, y = _rows(terms, columns), [Decimal(value) for value in load]
        unit = Decimal(1)
        ordinary = _least_squares(x, y, [unit] * len(y))
        fitted = [_dot(row, ordinary) for row in x]
        if u is None:
            square = sum(((a - b) ** 2 for a, b in zip(y, fitted, strict=True)), Decimal(0))
            weights = [(len(y) - len(ordinary)) / square] * len(y)
        else:
            weights = [1 / Decimal(value) ** 2 for value in u]
        largest = max(abs(value) for value in y)
        shared = Decimal(u_shared)
        v = [shared * value / largest if proportional else shared for value in fitted]
        size, groups = len(ordinary), max(group) + 1
        normal, right = _normal(x, y, weights)
        cross = [[Decimal(0)] * size for _ in range(groups)]
        variances, against = [unit] * groups, [Decimal(0)] * groups
        for row, value, w, s, g in zip(x, y, weights, v, group, strict=True):
            variances[g] += w * s * s
            against[g] += w * s * value
            for i in range(size):
                cross[g][i] += w * s * row[i]
        for g in range(groups):
            for i in range(size):
                right[i] -= cross[g][i] * against[g] / variances[g]
                for j in range(size):
                    normal[i][j] -= cross[g][i] * cross[g][j] / variances[g]
        return tuple(Fraction(value) for value in _solve(normal, right))


def solve_odr_precisely(
    *,
    terms: Sequence[str],
    columns: Mapping[str, Sequence[float]],
    load: Sequence[float],
    u: Sequence[float],
    u_cells: Sequence[float],
) -> tuple[Fraction, ...]:
    """Return the coefficients with errors in both variables; ``u_cells`` in the order of ``columns``.

    Raises
    ------
    ArithmeticError
        the terms are dependent, or the iteration does not settle
    """
    with localcontext() as context:
        context.prec = _digits(terms, columns)
        names = list(columns)
        y = [Decimal(value) for value in load]
        observed = [[Decimal(value) for value in row] for row in zip(*columns.values(), strict=True)]
        u2, cells2 = [Decimal(v) ** 2 for v in u], [Decimal(v) ** 2 for v in u_cells]
        parsed = [parse_term(name) for name in terms]
        coefficients = _least_squares(
            [_terms(parsed, dict(zip(names, row, strict=True))) for row in observed], y, [1 / v for v in u2]
        )
        delta = [[Decimal(0)] * len(names) for _ in y]
        largest = max(abs(value) for value in y)
        for _ in range(_ITERATIONS):
            rows, slopes, carried, weights = [], [], [], []
            for row, off, value, square in zip(observed, delta, y, u2, strict=True):
                at = {n: a + b for n, a, b in zip(names, row, off, strict=True)}
                slope = list(term_slopes(terms, coefficients, at, Decimal(0)).values())
                rows.append(_terms(parsed, at))
                slopes.append(slope)
                carried.append(value + _dot(slope, off))
                weights.append(1 / (square + sum(s * s * c for s, c in zip(slope, cells2, strict=True))))
            solution = _least_squares(rows, carried, weights)
            moved = max(
                abs(_dot(row, [a - b for a, b in zip(solution, coefficients, strict=True)])) for row in rows
            )
            coefficients, before = solution, delta
            delta = [
                [s * c * (value - _dot(row, solution)) * w for s, c in zip(slope, cells2, strict=True)]
                for row, slope, value, w in zip(rows, slopes, carried, weights, strict=True)
            ]
            # The first step moves no coefficient where all weights are equal: the adjustments must rest too.
            for slope, now, then in zip(slopes, delta, before, strict=True):
                moved = max(moved, abs(_dot(slope, [a - b for a, b in zip(now, then, strict=True)])))
            if moved <= _SETTLED * largest:
                return tuple(Fraction(value) for value in coefficients)
        raise ArithmeticError("the iteration does not settle")


def _digits(terms: Sequence[str], columns: Mapping[str, Sequence[float]]) -> int:
    # Nothing is centred here: a large zero costs the normal equations its digits twice, by every power.
    ratio = max(
        (max(map(abs, x)) / ((max(x) - min(x)) or 1.0) for x in columns.values() if any(x)), default=1.0
    )
    degree = max(parse_term(name).degree for name in terms)
    return _DIGITS + 4 * degree * max(0, math.ceil(math.log10(max(ratio, 1.0))))


def _terms(parsed: Sequence[Term], at: Mapping[str, Decimal]) -> list[Decimal]:
    return [evaluate(term, at, Decimal(1)) for term in parsed]


def _rows(terms: Sequence[str], columns: Mapping[str, Sequence[float]]) -> _Rows:
    names, parsed = list(columns), [parse_term(name) for name in terms]
    points = zip(*columns.values(), strict=True)
    return [_terms(parsed, {n: Decimal(v) for n, v in zip(names, row, strict=True)}) for row in points]


def _dot(left_row: Sequence[Decimal], right_row: Sequence[Decimal]) -> Decimal:
    return sum((a * b for a, b in zip(left_row, right_row, strict=True)), Decimal(0))


def _normal(x: _Rows, y: Sequence[Decimal], weights: Sequence[Decimal]) -> tuple[_Rows, list[Decimal]]:
    size = len(x[0])
    normal = [[Decimal(0)] * size for _ in range(size)]
    right = [Decimal(0)] * size
    for row, value, w in zip(x, y, weights, strict=True):
        for i in range(size):
            weighted = w * row[i]
            right[i] += weighted * value
            for j in range(i, size):
                normal[i][j] += weighted * row[j]
    for i in range(size):
        for j in range(i):
            normal[i][j] = normal[j][i]
    return normal, right


def _least_squares(x: _Rows, y: Sequence[Decimal], weights: Sequence[Decimal]) -> list[Decimal]:
    return _solve(*_normal(x, y, weights))


def _solve(normal: Sequence[Sequence[Any]], right: Sequence[Any]) -> list[Any]:
    rows = [[*row, value] for row, value in zip(normal, right, strict=True)]
    size = len(rows)
    for i in range(size):
        pivot = max(range(i, size), key=lambda r: abs(rows[r][i]))
        rows[i], rows[pivot] = rows[pivot], rows[i]
        if rows[i][i] == 0:
            raise ZeroDivisionError("the terms are dependent")
        rows[i] = [value / rows[i][i] for value in rows[i]]
        for r in range(size):
            if r != i:
                factor = rows[r][i]
                rows[r] = [a - factor * b for a, b in zip(rows[r], rows[i], strict=True)]
    return [row[size] for row in rows]
