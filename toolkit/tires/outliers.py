"""Gross outliers that a least squares fit has followed: told, never removed.

A tenth of the rows a few times too large bends a least squares curve so far that its own residuals no longer
show them. Where a fit looks suspicious the curve is fitted again with bounded influence (Tukey's biweight,
Maronna, Martin, Yohai, Robust Statistics (2006), ch. 4), and its residuals are judged instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from toolkit.findings import Finding
from toolkit.tires.evaluate import value_at
from toolkit.tires.fit import Curve, fit_curves
from toolkit.tires.model import CHANNEL_UNIT, CurveFit
from toolkit.tires.places import median, shares
from toolkit.units import in_both

if TYPE_CHECKING:
    from numpy.typing import NDArray

_SUSPECT_PERCENT = 5.0  # fit error above which the curve is looked at again, whatever its residuals
_SUSPECT_SD = 4.0
_SURE_SD = 10.0  # robust standard deviations: misfit of a model and heavy tails of noise stay below
_SURE_SHARE = 0.05  # of the curve's largest value: what matters to the fit
_SD_OF_MEDIAN = 1.4826  # sd of a normal over the median of its absolute values


def gross_outliers(curves: Sequence[Curve], fits: Sequence[CurveFit]) -> tuple[Finding, ...]:
    """Return a finding for every Magic Formula fit by least squares whose rows hold gross outliers."""
    suspects = [
        curve
        for curve, fit in zip(curves, fits, strict=True)
        if fit.loss == "linear"
        and (fit.error_percent > _SUSPECT_PERCENT or _largest(_residual(fit, curve), curve) > _SUSPECT_SD)
    ]
    if not suspects:
        return ()
    found = []
    for curve, fit in zip(suspects, fit_curves(suspects, loss="robust"), strict=True):
        residual = _residual(fit, curve)
        size = np.abs(residual)
        away = size > np.maximum(
            _SURE_SD * _SD_OF_MEDIAN * _typical(size, curve), _SURE_SHARE * np.abs(curve.y - residual).max()
        )
        if away.any():
            worst, unit = int(np.argmax(size)), CHANNEL_UNIT[curve.channel]
            load = "all loads" if curve.load_N is None else in_both(curve.load_N, "N", ".0f")
            text = (
                f"{int(away.sum())} of {len(size)} rows lie far from the curve of the others, the farthest "
                f"{in_both(curve.y[worst], unit, '.5g')} at {np.degrees(curve.SA[worst]):.2f} deg, by "
                f"{in_both(size[worst], unit)}: least squares follows them"
            )
            found.append(Finding(rule="gross-outliers", where=f"{curve.channel} at {load}", message=text))
    return tuple(found)


def _residual(fit: CurveFit, curve: Curve) -> NDArray[np.float64]:
    return np.asarray(curve.y - value_at(fit, curve.SA))


def _largest(residual: NDArray[np.float64], curve: Curve) -> float:
    # In robust standard deviations; an exact fit has none.
    size = np.abs(residual)
    middle = _typical(size, curve)
    return float(size.max()) / (_SD_OF_MEDIAN * middle) if middle > 0 else 0.0


def _typical(size: NDArray[np.float64], curve: Curve) -> float:
    low, high = curve.SA.min(), curve.SA.max()
    u = (2 * curve.SA - low - high) / (high - low)
    return float(median(size[None], shares(u[None], np.ones((1, len(u)), dtype=np.bool_)))[0])
