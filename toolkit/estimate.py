"""Estimate: a value with its standard uncertainty, the result type of the GUM (JCGM 100:2008), and its print.

An uncertainty is printed in two significant digits, a value to the last place of its uncertainty (GUM 7.2.6,
ILAC-P14:09/2020): wherever people read both, they are made by the functions here. JSON keeps all digits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_HALF_EVEN, Decimal
from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from toolkit.arrays import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A measured or fitted value.

    Attributes
    ----------
    value : the best estimate, in ``unit``
    u : standard uncertainty (coverage factor 1), in ``unit``
    dof : effective degrees of freedom; infinite where a type B statement is taken as certain
    unit : unit of value and u
    """

    value: float
    u: float
    unit: str
    dof: float = math.inf

    def expanded(self, probability: float = 0.95) -> tuple[float, float]:
        """Return (U, k): expanded uncertainty and coverage factor from Student's t (GUM G.6.4).

        >>> U, k = Estimate(value=1.0, u=0.5, unit="N", dof=10).expanded()
        >>> round(k, 3), round(U, 3)
        (2.228, 1.114)
        """
        k = coverage_factor(self.dof, probability)
        return k * self.u, k

    def as_dict(self) -> dict[str, float | str]:
        """Return it as the answers have it, with its expanded uncertainty."""
        U, k = self.expanded()
        return {
            "value": self.value, "standard_uncertainty": self.u, "dof": self.dof, "expanded_uncertainty": U,
            "k": k, "unit": self.unit,
        }  # fmt: skip

    def scaled(self, factor: float, unit: str) -> Estimate:
        """Return the estimate times an exact factor, in another unit."""
        return Estimate(value=self.value * factor, u=self.u * abs(factor), unit=unit, dof=self.dof)


@lru_cache(maxsize=256)
def coverage_factor(dof: float, probability: float = 0.95) -> float:
    """Return Student's t for a two-sided coverage probability.

    Degrees of freedom are truncated to a whole number as in GUM G.4.1; one that is whole but for
    rounding counts as whole. Below one there is no interval.

    >>> round(coverage_factor(math.inf), 4)
    1.96
    """
    return float(coverage_factors(dof, probability))


def coverage_factors(dof: Array | float, probability: float = 0.95) -> Array:
    """Return `coverage_factor` of every number of degrees of freedom (any shape)."""
    import numpy as np
    from scipy.special import ndtri, stdtrit

    tail = 0.5 + probability / 2
    # Of rows of a file most have the same few.
    whole = np.where(np.less(dof, 1 - 1e-9), np.nan, np.floor(np.multiply(dof, 1 + 1e-9)))
    distinct, place = np.unique(whole, return_inverse=True)
    factors = np.where(np.isinf(distinct), ndtri(tail), stdtrit(distinct, tail))
    return np.asarray(factors[place].reshape(np.shape(dof)))


def effective_dof(contributions: Sequence[tuple[Array | float, Array | float]]) -> Array:
    """Return the Welch-Satterthwaite degrees of freedom of (u_i, dof_i), at many points (GUM G.4.1).

    >>> float(effective_dof([(3.0, 10.0), (4.0, math.inf)]))
    77.16049382716...
    """
    import numpy as np

    total = np.asarray(sum(u * u for u, _ in contributions))
    bottom = np.asarray(sum(u**4 / dof for u, dof in contributions))  # of what is certain, nothing
    return np.where(bottom == 0, math.inf, total * total / np.where(bottom == 0, 1.0, bottom))


_MANY = 1e6  # degrees of freedom from which Student's t is the normal quantile to six digits


def dof_text(dof: float) -> str:
    """Return degrees of freedom for people: more than a million are infinite.

    >>> [dof_text(dof) for dof in (7.5, 28461.3, 7.5e19, math.inf)]
    ['7.5', '28461', 'inf', 'inf']
    """
    if dof > _MANY:
        return "inf"
    return f"{dof:.3g}" if dof < 1000 else f"{dof:.0f}"


_MOST_LOWERED = Decimal("0.05")


def round_uncertainty(U: float, *, digits: int = 2) -> str:
    """Return U in at most two significant digits, as decimal text without an exponent.

    ILAC-P14:09/2020 asks for at most two significant digits. Rounding is to nearest, and up where that would
    lower U by more than 5 % (EA-4/02 M, 6.3).

    >>> [round_uncertainty(U) for U in (0.17984, 1234.0, 0.996, 0.01)]
    ['0.18', '1200', '1.0', '0.010']
    >>> round_uncertainty(1.45, digits=1)
    '2'
    """
    if U == 0:
        return "0"
    if not (math.isfinite(U) and U > 0):
        return "not determined"
    rounded, place = _rounded(U, digits)
    # As an integer, so that a last zero counts: 0.010 and not 0.01.
    return format(Decimal(int(rounded)).scaleb(place), "f")


def round_to_uncertainty(value: float, U: float) -> str:
    """Return a value to the last place of its rounded expanded uncertainty (GUM 7.2.6).

    >>> round_to_uncertainty(1184.6932, 0.17984), round_to_uncertainty(1184.6932, 1234.0)
    ('1184.69', '1200')
    """
    if not has_interval(value, U):
        return repr(float(value))
    place = last_place(U)
    # int drops the exponent of a zero, which would print as 0 where its neighbours print 0.00.
    rounded = int(Decimal(repr(float(value))).scaleb(-place).to_integral_value(rounding=ROUND_HALF_EVEN))
    return format(Decimal(rounded).scaleb(place) + 0, "f")


def plus_minus(value: float, U: float, *, spec: str = ".4g", decimal_comma: bool = False) -> str:
    """Return ``-119 ± 97``: the uncertainty in two significant digits, the value to its last place.

    Where there is no uncertainty, or the value is none, the value stands alone, by ``spec``.

    >>> plus_minus(-118.7, 97.2), plus_minus(1301.2, 112.8), plus_minus(0.0, 0.0996)
    ('-119 ± 97', '1300 ± 110', '0.00 ± 0.10')
    >>> plus_minus(3.25, math.nan), plus_minus(8.983e-9, 8.7e-10), plus_minus(1.5, 0.25, decimal_comma=True)
    ('3.25', '8.98e-9 ± 8.7e-10', '1,50 ± 0,25')
    """
    if has_interval(value, U):
        text = f"{round_to_uncertainty(value, U)} ± {round_uncertainty(U)}"
        if last_place(U) < _SMALL:
            text = " ± ".join(
                format(Decimal(number), "e") if float(number) else "0" for number in text.split(" ± ")
            )
    else:
        text = format(value, spec)
    return text.replace(".", ",") if decimal_comma else text


def has_interval(value: float, U: float) -> bool:
    """Tell whether a value can be printed to the last place of an uncertainty: both finite, U above zero."""
    return math.isfinite(value) and math.isfinite(U) and U > 0


_SMALL = -7  # power of ten below which zeros behind the point are written as an exponent


def last_place(U: float, *, digits: int = 2) -> int:
    """Return the power of ten of a rounded uncertainty's last digit (l of JCGM 101, 7.9.2).

    >>> last_place(0.17984), last_place(0.996), last_place(1234.0)
    (-2, -1, 2)
    """
    return _rounded(U, digits)[1]


def _rounded(U: float, digits: int) -> tuple[Decimal, int]:
    """Return the whole number of ``digits`` digits and the power of ten that it is multiplied by."""
    if digits not in (1, 2):
        raise ValueError("an uncertainty is stated in one or two significant digits")
    exact = Decimal(repr(float(U)))
    place = exact.adjusted() - digits + 1
    scaled = exact.scaleb(-place)
    rounded = scaled.to_integral_value(rounding=ROUND_HALF_EVEN)
    if scaled - rounded > _MOST_LOWERED * scaled:
        rounded = scaled.to_integral_value(rounding=ROUND_CEILING)
    if rounded == 10**digits:
        return rounded / 10, place + 1
    return rounded, place
