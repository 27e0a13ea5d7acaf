"""Numbers that know what makes them uncertain, so that what two of them share cancels in their difference.

A value y of independent standardised variables e_k is, to first order, y + sum_k u_k e_k. Each part u_k is
signed and named by its variable's ``key``; parts of one key are one variable, fully correlated, and add with
their signs in every weighted sum (JCGM 100:2008, 5.2.2 and F.1.2.3). Nothing has to be said about
correlations afterwards.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from toolkit.estimate import Estimate, effective_dof


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """One variable's signed share ``u`` of a standard uncertainty, in the unit of the value.

    ``source`` is the line of the budget that it belongs to; ``dof`` its degrees of freedom. Parts of one
    ``pool`` are independent variables whose sizes rest on one estimate of variance: what makes the estimate
    too small makes all of them too small, and their degrees of freedom do not add up.
    """

    source: str
    key: str
    u: float
    dof: float = math.inf
    pool: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Uncertain:
    """A value with the parts of its uncertainty.

    Examples
    --------
    >>> scale = Part(source="load", key="FZ", u=3.0)
    >>> one = Uncertain(value=10.0, unit="N", parts=(scale, Part(source="fit", key="a", u=4.0)))
    >>> other = Uncertain(value=9.0, unit="N", parts=(scale,))
    >>> one.estimate().u, weighted([(1.0, one), (-1.0, other)]).estimate().u
    (5.0, 4.0)
    """

    value: float
    unit: str
    parts: tuple[Part, ...] = ()

    def estimate(self) -> Estimate:
        """Return value, standard uncertainty and effective degrees of freedom (GUM G.4.1)."""
        u = math.sqrt(sum(part.u * part.u for part in self.parts))
        dof = float(effective_dof(_estimates(self.parts))) if u else math.inf
        return Estimate(value=self.value, u=u, unit=self.unit, dof=dof)

    def scaled(self, factor: float, unit: str) -> Uncertain:
        """Return the number times an exact factor, in another unit."""
        return Uncertain(
            value=self.value * factor,
            unit=unit,
            parts=tuple(replace(part, u=part.u * factor) for part in self.parts),
        )

    def with_parts(self, *more: Part) -> Uncertain:
        """Return the number with further parts; those that are zero are left out."""
        return replace(self, parts=merged((*self.parts, *more)))

    def by_source(self) -> tuple[tuple[str, float], ...]:
        """Return the budget: (source, standard uncertainty), in the order of the parts."""
        squares: dict[str, float] = {}
        for part in self.parts:
            squares[part.source] = squares.get(part.source, 0.0) + part.u * part.u
        return tuple((source, math.sqrt(square)) for source, square in squares.items())


def _estimates(parts: Iterable[Part]) -> list[tuple[float, float]]:
    """Return u and degrees of freedom of every estimate of variance.

    Variances of one estimate are fully correlated: the standard deviation of their sum, u^2 sqrt(2/dof) of
    each, is the sum of theirs.
    """
    pools: dict[str, list[Part]] = {}
    for part in parts:
        pools.setdefault(part.pool or part.key, []).append(part)
    estimates = []
    for pool in pools.values():
        variance = sum(part.u**2 for part in pool)
        spread = sum(part.u**2 / math.sqrt(part.dof) for part in pool)
        estimates.append((math.sqrt(variance), (variance / spread) ** 2 if spread else math.inf))
    return estimates


def merged(parts: Iterable[Part]) -> tuple[Part, ...]:
    """Return parts with one entry a key, their signed shares added; those that vanish are left out."""
    return _merged((1.0, part) for part in parts)


def _merged(weighted_parts: Iterable[tuple[float, Part]]) -> tuple[Part, ...]:
    # A comparison adds up a million parts: each variable becomes a part once, when its sum is known.
    first: dict[str, Part] = {}
    shares: dict[str, float] = {}
    for weight, part in weighted_parts:
        key, share = part.key, part.u * weight
        if key in shares:
            shares[key] += share
        else:
            first[key], shares[key] = part, share
    return tuple(
        Part(source=first[key].source, key=key, u=share, dof=first[key].dof, pool=first[key].pool)
        for key, share in shares.items()
        if share
    )


def weighted(terms: Sequence[tuple[float, Uncertain]]) -> Uncertain:
    """Return the weighted sum of numbers of one unit; what they share is added with its sign."""
    first = terms[0][1]
    return Uncertain(
        value=sum(weight * number.value for weight, number in terms),
        unit=first.unit,
        parts=_merged((weight, part) for weight, number in terms for part in number.parts),
    )
