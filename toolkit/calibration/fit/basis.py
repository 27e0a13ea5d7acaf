"""The columns in which a fit is solved: centred, scaled, and powers built from the centred variable.

Powers of a raw indication are nearly parallel; powers of z = (x - mean) / half-range are not. The solved
coefficients are carried back to the raw terms by a linear map, and their covariance by the same map.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from toolkit.arrays import Array
from toolkit.calibration.terms import INTERCEPT, Term, parse_term, term_matrix


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Basis:
    """``design`` (rows, terms): columns near unit length, the constant last; raw = ``back`` @ solution.

    ``back_exact`` is the same map in rationals: back-substitution of a polynomial cancels, and the last
    digits of its low coefficients depend on it. ``centre`` and ``half`` are those of the indications where
    powers are built from z = (x - centre) / half, else None; ``middle`` and ``length`` (terms,) those of
    the columns.
    """

    terms: tuple[str, ...]
    design: Array
    back: Array
    back_exact: tuple[tuple[Fraction, ...], ...]
    centre: Mapping[str, float] | None
    half: Mapping[str, float] | None
    middle: Array
    length: Array

    def at(self, columns: Mapping[str, Array]) -> Array:
        """Return the design's columns at other indications (rows, terms)."""
        if self.centre is not None and self.half is not None:
            columns = {n: (x - self.centre[n]) / self.half[n] for n, x in columns.items()}
        return (term_matrix(self.terms, columns) - self.middle) / self.length

    def moved_back(self, zero: Mapping[str, float]) -> Basis:
        """Return the basis of indications less ``zero`` with its map to the raw indications (`free_zero`)."""
        if not any(zero.values()):
            return self
        parsed = [parse_term(name) for name in self.terms]
        expand = _expansion(parsed, zero, dict.fromkeys(zero, 1.0))
        exact = tuple(
            tuple(sum((a * self.back_exact[m][j] for m, a in enumerate(row) if a), Fraction(0))
                  for j in range(len(self.terms)))
            for row in expand
        )  # fmt: skip
        back = np.array([[float(value) for value in row] for row in exact])
        return replace(self, back=back, back_exact=exact)


def free_zero(
    terms: Sequence[str], columns: Mapping[str, Array]
) -> tuple[dict[str, float], dict[str, Array]]:
    """Return a zero of every indication, and the indications less it (rows,), without rounding.

    Where the terms are the same model about any zero, that is one near the mean, so that what is added to an
    indication is not lost beside a large one; else 0.
    """
    hierarchical = _hierarchical([parse_term(name) for name in terms])
    zero = {name: _anchor(x) if hierarchical else 0.0 for name, x in columns.items()}
    return zero, {name: x - zero[name] for name, x in columns.items()}


def build_basis(terms: Sequence[str], columns: Mapping[str, Array]) -> Basis:
    """Return the solving basis of a list of terms (the intercept, where there is one, last).

    Centres lie on a grid of a power of two and scales are powers of two, so that neither rounds: a
    rounding of the columns is seen by the coefficients as soon as the residuals are large (Wampler5).
    """
    parsed = [parse_term(name) for name in terms]
    centre, half = None, None
    if not _linear(parsed) and _hierarchical(parsed):
        centre = {name: _anchor(x) for name, x in columns.items()}
        half = {name: _power_of_two(np.max(np.abs(x - centre[name]))) for name, x in columns.items()}
        raw = term_matrix(terms, {name: (x - centre[name]) / half[name] for name, x in columns.items()})
        expand = _expansion(parsed, centre, half)
    else:
        raw = term_matrix(terms, columns)
        expand = [[Fraction(int(i == j)) for j in range(len(terms))] for i in range(len(terms))]
    n, p = raw.shape
    constant = terms[-1] == INTERCEPT
    k = p - 1 if constant else p
    middle, length = np.zeros(p), np.ones(p)
    if constant:
        middle[:k] = [_anchor(column) for column in raw[:, :k].T]
        length[k] = _power_of_two(math.sqrt(n))
    design = raw
    design[:, :k] -= middle[:k]
    length[:k] = [_power_of_two(math.sqrt(inner(column, column))) for column in design[:, :k].T]
    design /= length
    # design column j = (raw_j - middle_j) / length_j: a coefficient goes into a raw term by its own column,
    # and into the constant by the middle as well.
    scale = [1 / Fraction(float(number)) for number in length]
    shift = [Fraction(float(number)) for number in middle]
    exact = tuple(_mapped(row, row[k] if constant else Fraction(0), shift, scale) for row in expand)
    return Basis(
        terms=tuple(terms),
        design=design,
        back=np.array([[float(value) for value in row] for row in exact]),
        back_exact=exact,
        centre=centre,
        half=half,
        middle=middle,
        length=length,
    )


def _mapped(
    row: Sequence[Fraction], constant: Fraction, shift: Sequence[Fraction], scale: Sequence[Fraction]
) -> tuple[Fraction, ...]:
    # Most places are zero, and a product of rationals costs more than to look.
    shifted = (a - constant * m if constant and m else a for a, m in zip(row, shift, strict=True))
    return tuple(a * factor if a else a for a, factor in zip(shifted, scale, strict=True))


def _anchor(values: Array) -> float:
    # Near the mean, to 2^-12 of the spread: few digits, so that the difference to a value is exact.
    middle, spread = float(values.mean()), float(np.ptp(values))
    if not (spread > 0 and math.isfinite(spread)):
        return middle
    step = math.ldexp(1.0, math.frexp(spread)[1] - 13)
    return round(middle / step) * step if abs(middle / step) < 2**53 else middle


def _power_of_two(value: float) -> float:
    # Division by a power of two is exact: the centred variable takes no rounding from its scale.
    return math.ldexp(1.0, math.frexp(value)[1]) if value > 0 else 1.0


def _linear(terms: Sequence[Term]) -> bool:
    # The columns themselves are centred: nothing is gained by a centred variable.
    return not any(sum(power for _, power in term.powers) > 1 for term in terms)


def _hierarchical(terms: Sequence[Term]) -> bool:
    # (x - m)^2 spills into x and 1: centring keeps the model only where the lower terms are in it.
    if any(term.absolutes for term in terms):
        return False
    present = {_key(dict(term.powers)) for term in terms}
    for term in terms:
        powers = dict(term.powers)
        for lower in itertools.product(*(range(power + 1) for power in powers.values())):
            if _key(dict(zip(powers, lower, strict=True))) not in present:
                return False
    return True


def _key(powers: Mapping[str, int]) -> tuple[tuple[str, int], ...]:
    return tuple(sorted((name, power) for name, power in powers.items() if power))


def _expansion(
    terms: Sequence[Term], centre: Mapping[str, float], half: Mapping[str, float]
) -> list[list[Fraction]]:
    """Return E with raw coefficient i = sum over j of E[i][j] times z coefficient j (binomial theorem)."""
    index = {_key(dict(term.powers)): i for i, term in enumerate(terms)}
    expansion = [[Fraction(0)] * len(terms) for _ in terms]
    for j, term in enumerate(terms):
        powers = dict(term.powers)
        for lower in itertools.product(*(range(power + 1) for power in powers.values())):
            factor = Fraction(1)
            for (name, power), low in zip(powers.items(), lower, strict=True):
                factor *= math.comb(power, low) * Fraction(-centre[name]) ** (power - low)
                factor /= Fraction(half[name]) ** power
            expansion[index[_key(dict(zip(powers, lower, strict=True)))]][j] += factor
    return expansion


def inner(a: NDArray[Any], b: NDArray[Any]) -> float:
    """Return the sum of products of two long columns (rows,), in one thread.

    The threads of a BLAS gain nothing on some thousand numbers, wait for each other where cores are shared,
    and add in an order that depends on their number: a record's last digit should not.

    >>> inner(np.array([1.0, 2.0]), np.array([3.0, 4.0]))
    11.0
    """
    return float(np.einsum("i,i->", a, b))
