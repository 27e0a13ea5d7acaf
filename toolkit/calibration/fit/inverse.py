"""A straight calibration line y = a + b x read backwards: x from an observed y.

It carries the uncertainty of the line, with the covariance of its coefficients, and that of the value put in,
to first order: the line's own values and the value put in are taken as independent. It needs a slope that is
known well, u(b) small beside |b|.

Reference: ISO/TS 28037:2010, use of the calibration function (prediction); GUM 5.2.2.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from toolkit.calibration.fit.regression import TermFit


@dataclass(frozen=True, slots=True, kw_only=True)
class StraightLine:
    """y = a + b x. ``a``, ``u_a`` in the unit of y, ``b``, ``u_b`` in y per x, ``cov_ab`` their product.

    Raises
    ------
    ValueError
        a value is no finite number, an uncertainty is negative, or |cov_ab| exceeds u_a u_b
    """

    a: float
    b: float
    u_a: float
    u_b: float
    cov_ab: float

    def __post_init__(self) -> None:
        """Refuse what is no line with a covariance."""
        _finite(a=self.a, b=self.b, u_a=self.u_a, u_b=self.u_b, cov_ab=self.cov_ab)
        _not_negative(u_a=self.u_a, u_b=self.u_b)
        # A computed covariance may pass the product by its rounding, not by more.
        if abs(self.cov_ab) > self.u_a * self.u_b * (1 + 1e-12):
            raise ValueError(f"cov_ab = {self.cov_ab!r} exceeds u_a u_b = {self.u_a * self.u_b!r} in size")

    @classmethod
    def of(cls, fit: TermFit) -> StraightLine:
        """Return the line of a fit in one indication and the intercept; ValueError for other terms."""
        if len(fit.terms) != 2 or fit.terms[1] != "intercept":
            raise ValueError(f"terms {', '.join(fit.terms)} are no straight line")
        b, a = fit.coefficients
        u_b, u_a = fit.standard_errors.tolist()
        return cls(a=a, b=b, u_a=u_a, u_b=u_b, cov_ab=float(fit.covariance[0, 1]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluated:
    """A value from a line and its standard uncertainty ``u``, in the unit of x or of y."""

    value: float
    u: float


def x_from_y(line: StraightLine, y0: float, *, u_y0: float) -> Evaluated:
    """Return x0 = (y0 - a) / b for an observed y0 with standard uncertainty u_y0, in the unit of x.

    u^2(x0) = (u^2(y0) + u^2(a) + x0^2 u^2(b) + 2 x0 cov(a, b)) / b^2

    Raises
    ------
    ValueError
        y0 or u_y0 is no finite number, u_y0 is negative, or the slope is 0 or too small to divide by
    """
    _finite(y0=y0, u_y0=u_y0)
    _not_negative(u_y0=u_y0)
    if line.b == 0:
        raise ValueError("the slope is 0: no x belongs to a y")
    x0 = (y0 - line.a) / line.b
    # The quadratic form as a sum of squares, so that a strong correlation cannot leave a negative variance:
    # (u_a + r x0 u_b)^2 + (1 - r^2) x0^2 u_b^2, with r the correlation of a and b.
    spread, tilt = line.u_a * line.u_b, x0 * line.u_b
    r = max(-1.0, min(1.0, line.cov_ab / spread)) if spread else 0.0
    u = math.hypot(u_y0, line.u_a + r * tilt, math.sqrt((1 - r) * (1 + r)) * tilt) / abs(line.b)
    if not math.isfinite(x0) or not math.isfinite(u):
        raise ValueError(f"the slope {line.b!r} is too small to find x at y = {y0!r}")
    return Evaluated(value=x0, u=u)


def _finite(**values: float) -> None:
    for name, value in values.items():
        if not math.isfinite(value):
            raise ValueError(f"{name} = {value!r} is no finite number")


def _not_negative(**values: float) -> None:
    for name, value in values.items():
        if value < 0:
            raise ValueError(f"{name} = {value!r}: a standard uncertainty is not negative")
