"""The columns in which a fit is solved: centred, scaled, and powers built from the centred variable.

Powers of a raw indication are nearly parallel; powers of z = (x - mean) / half-range are not. The solved
coefficients are carried back to the raw terms by a linear map, and their covariance by the same map.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from toolkit.calibration.terms import INTERCEPT, Term, parse_term, term_matrix

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Basis:
    """``design`` (rows, terms): unit-length columns, the constant last; raw = ``back`` @ solution.

    ``back_exact`` is the same map in rationals: back-substitution of a polynomial cancels, and the last
    digits of its low coefficients depend on it.
    """

    design: NDArray[np.float64]
    back: NDArray[np.float64]
    back_exact: tuple[tuple[Fraction, ...], ...]


def build_basis(terms: Sequence[str], columns: Mapping[str, NDArray[np.float64]]) -> Basis:
    """Return the solving basis of a list of terms (the intercept, where there is one, last)."""
    parsed = [parse_term(name) for name in terms]
    if _closed(parsed):
        centre = {name: float(np.mean(x)) for name, x in columns.items()}
        half = {name: _power_of_two(np.max(np.abs(x - centre[name]))) for name, x in columns.items()}
        z = {name: (x - centre[name]) / half[name] for name, x in columns.items()}
        raw = term_matrix(terms, z)
        expand = _expansion(parsed, centre, half)
    else:
        raw = term_matrix(terms, columns)
        expand = [[Fraction(int(i == j)) for j in range(len(terms))] for i in range(len(terms))]
    n, p = raw.shape
    constant = terms[-1] == INTERCEPT
    k = p - 1 if constant else p
    middle = raw[:, :k].mean(axis=0) if constant else np.zeros(k)
    design = np.empty((n, p), order="F")
    design[:, :k] = raw[:, :k] - middle
    length = np.sqrt(np.einsum("ij,ij->j", design[:, :k], design[:, :k]))
    length[length == 0] = 1.0
    design[:, :k] /= length
    # design column j = (raw_j - middle_j) / length_j, and the constant column = 1 / sqrt(n)
    unscale = [[Fraction(0)] * p for _ in range(p)]
    for j in range(k):
        unscale[j][j] = 1 / Fraction(float(length[j]))
        if constant:
            unscale[k][j] = -Fraction(float(middle[j])) / Fraction(float(length[j]))
    if constant:
        design[:, k] = 1 / math.sqrt(n)
        unscale[k][k] = Fraction(1 / math.sqrt(n))
    exact = tuple(
        tuple(sum((a * unscale[m][j] for m, a in enumerate(row) if a), Fraction(0)) for j in range(p))
        for row in expand
    )
    return Basis(
        design=design,
        back=np.array([[float(value) for value in row] for row in exact]),
        back_exact=exact,
    )


def _power_of_two(value: float) -> float:
    # Division by a power of two is exact: the centred variable takes no rounding from its scale.
    return math.ldexp(1.0, math.frexp(value)[1]) if value > 0 else 1.0


def _closed(terms: Sequence[Term]) -> bool:
    # (x - m)^2 spills into x and 1: centring keeps the model only where the lower terms are in it.
    if any(term.absolutes for term in terms) or all(
        len(term.powers) == 1 and term.powers[0][1] == 1 for term in terms
    ):
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
