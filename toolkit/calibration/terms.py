"""Terms of a calibration equation: names such as ``D51``, ``D51^2``, ``D51*E5``, ``abs(D51)``.

A term is a product of powers and absolute values of indications. The same text names it in sessions,
records, tables and JSON, and the same function evaluates it on arrays and on exact rationals.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from toolkit.arrays import Array
from toolkit.errors import SessionError

INTERCEPT = "intercept"
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*\Z")
NAME_FORM = (
    "names of letters A to Z, digits and '_', a letter first, as in D51 and S_x: they stand in equations"
)
_FACTOR = re.compile(r"(?:(?P<name>[A-Za-z]\w*)(?:\^(?P<power>[1-9]))?|abs\((?P<abs>[A-Za-z]\w*)\))\Z")


@dataclass(frozen=True, slots=True, kw_only=True)
class Term:
    """A product: each indication to a power, times absolute values of indications."""

    name: str
    powers: tuple[tuple[str, int], ...]
    absolutes: tuple[str, ...]

    @property
    def indications(self) -> tuple[str, ...]:
        """The indications that it takes."""
        return (*(name for name, _ in self.powers), *self.absolutes)

    @property
    def degree(self) -> int:
        """The power of a factor that all indications share."""
        return sum(power for _, power in self.powers) + len(self.absolutes)


@lru_cache(maxsize=4096)
def parse_term(name: str) -> Term:
    """Read a term's name; ``intercept`` is the empty product.

    >>> parse_term("D51^2*E5").powers
    (('D51', 2), ('E5', 1))
    """
    if name == INTERCEPT:
        return Term(name=name, powers=(), absolutes=())
    powers: list[tuple[str, int]] = []
    absolutes: list[str] = []
    for factor in name.split("*"):
        match = _FACTOR.match(factor.strip())
        if match is None:
            raise SessionError(
                f"a term cannot be read: {name!r}",
                where=f"term {name!r}",
                got=name,
                expected="products of NAME, NAME^2 to NAME^9 and abs(NAME)",
                next_step="write it as in D51, D51^2, D51*E5 or abs(D51)",
                rule="term",
            )
        if match["abs"]:
            absolutes.append(match["abs"])
        else:
            powers.append((match["name"], int(match["power"] or 1)))
    return Term(name=name, powers=tuple(powers), absolutes=tuple(absolutes))


def evaluate(term: Term, columns: Mapping[str, Any], one: Any) -> Any:
    """Return the term's value on columns of any arithmetic type; ``one`` is the empty product's value."""
    value = one
    for name, power in term.powers:
        value = value * columns[name] ** power
    for name in term.absolutes:
        value = value * abs(columns[name])
    return value


def term_matrix(terms: Sequence[str], columns: Mapping[str, Array]) -> Array:
    """Return the terms' values (rows, terms), each in the raw indications."""
    rows = len(next(iter(columns.values())))
    # Column by column in memory, as it is filled and read.
    matrix = np.empty((rows, len(terms)), order="F")
    for j, name in enumerate(terms):
        matrix[:, j] = 1.0 if name == INTERCEPT else evaluate(parse_term(name), columns, 1.0)
    return matrix


def model_terms(
    model: str, indications: Sequence[str], *, degree: int = 2, drop: Sequence[str] = ()
) -> tuple[str, ...]:
    """Return a model's term names, the intercept last.

    ``linear`` has the indications, ``polynomial`` their powers up to ``degree``, ``balance`` the form of
    AIAA R-091 on indications: linear, absolute, square, x|x| and all cross products. ``drop`` leaves out
    terms that the session names; nothing else ever does.

    >>> model_terms("linear", ["D51", "E5"])
    ('D51', 'E5', 'intercept')
    >>> model_terms("polynomial", ["S"], degree=3)
    ('S', 'S^2', 'S^3', 'intercept')
    """
    names = list(indications)
    if model == "polynomial":
        names += [f"{name}^{power}" for power in range(2, degree + 1) for name in indications]
    elif model == "balance":
        names += [f"abs({name})" for name in indications]
        names += [f"{name}^2" for name in indications]
        names += [f"{name}*abs({name})" for name in indications]
        names += [f"{a}*{b}" for a, b in itertools.combinations(indications, 2)]
    names.append(INTERCEPT)
    for name in drop:
        if name not in names:
            raise SessionError(
                f"a term to drop is not in the model: {name!r}",
                where="drop",
                got=name,
                expected=", ".join(names),
                next_step="name one of the model's terms, or remove it from drop",
                rule="term",
            )
    remaining = tuple(name for name in names if name not in drop)
    if set(remaining) <= {INTERCEPT}:
        raise SessionError(
            "no term of an indication is left in the model",
            where="drop",
            got=", ".join(drop),
            expected="at least one term of an indication",
            next_step="drop fewer terms; nothing was written",
            rule="term",
        )
    return remaining


def term_slopes(terms: Sequence[str], coefficients: Any, columns: Mapping[str, Any], zero: Any = 0.0) -> Any:
    """Return the slope of sum of c_i term_i by each column, by name; any arithmetic type.

    >>> term_slopes(["A^2", "A*B", "intercept"], [1.0, 2.0, 3.0], {"A": 5.0, "B": 7.0})
    {'A': 24.0, 'B': 10.0}
    """
    slopes = dict.fromkeys(columns, zero)
    for term, coefficient in zip(map(parse_term, terms), coefficients, strict=True):
        factors: list[tuple[str, Any, Any]] = []
        for name, power in term.powers:
            x = columns[name]
            factors.append((name, x**power, power if power == 1 else power * x ** (power - 1)))
        for name in term.absolutes:
            x = columns[name]
            # |x| has no slope at 0; either side's mean is 0 there.
            factors.append((name, abs(x), (x > zero) * 1 - (x < zero) * 1))
        for i, (name, _, slope) in enumerate(factors):
            product = coefficient * slope
            for k, (_, value, _) in enumerate(factors):
                product = product if k == i else product * value
            slopes[name] = slopes[name] + product
    return slopes


def term_reach(terms: Array, has_constant: bool) -> Array:
    """Return the range of each term over the rows; 1 for the constant."""
    reach: Array = np.ptp(terms, axis=0)
    if has_constant:
        reach[-1] = 1.0
    return reach
