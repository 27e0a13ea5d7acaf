"""Tire models, one a file, and their fits."""

from __future__ import annotations

from toolkit.tires.evaluate import estimate_at, slope_at, slope_estimate_at, value_at, zero_crossing
from toolkit.tires.fit import MIN_POINTS, fit_curves, why_not
from toolkit.tires.model import Curve, CurveFit, Parameter

__all__ = [
    "MIN_POINTS",
    "Curve",
    "CurveFit",
    "Parameter",
    "estimate_at",
    "fit_curves",
    "slope_at",
    "slope_estimate_at",
    "value_at",
    "why_not",
    "zero_crossing",
]
